"""The debugging playbook as a program, for this solver and for anybody's; see docs/playbook.md."""

from sph_gym.doctor.case import Case
from sph_gym.doctor.checkup import check_solver
from sph_gym.doctor.diagnosis import Diagnosis, Result

__all__ = ["Case", "Diagnosis", "Result", "check_solver"]
