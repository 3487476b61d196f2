"""The doctor finds the first broken link of any SPH solver; see docs/playbook.md."""

from sph_gym.doctor.case import Case
from sph_gym.doctor.checkup import check_solver
from sph_gym.doctor.comparison import compare
from sph_gym.doctor.diagnosis import Diagnosis, Result
from sph_gym.doctor.recordings import check_recording
from sph_gym.doctor.testing import parametrize_with_checks
from sph_gym.doctor.watch import Limits, Tripped, watch

__all__ = [
    "Case",
    "Diagnosis",
    "Limits",
    "Result",
    "Tripped",
    "check_recording",
    "check_solver",
    "compare",
    "parametrize_with_checks",
    "watch",
]
