"""Passive checks of a recording, whatever solver it comes from and in whatever language."""

import os
import time
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.diagnosis import Diagnosis, Result, inconclusive, skipped
from sph_gym.doctor.passive.clumping import clumping, suction
from sph_gym.doctor.passive.density import interior_density
from sph_gym.doctor.passive.energy import energy, momentum
from sph_gym.doctor.passive.escape import escape
from sph_gym.doctor.passive.identity import finite, layout, particles
from sph_gym.doctor.passive.motion import frozen, motion, speeds
from sph_gym.doctor.passive.pressure import equation_of_state
from sph_gym.doctor.passive.survey import RecordingSurvey
from sph_gym.doctor.reading import open_recording


class Passive(NamedTuple):
    """One check: the link that it speaks of, the step of the playbook (0 for none), what it does.

    whole: whether it needs a frame in which all numbers are finite.
    """

    link: str
    step: int
    function: Callable[[RecordingSurvey], Result]
    whole: bool = True

    @property
    def name(self) -> str:
        """Return the name of the check, that of its function."""
        return self.function.__name__


# In the order in which they are done: later ones use what earlier ones found.
CHECKS = (
    Passive("setup", 0, layout, whole=False),
    Passive("integration", 4, finite, whole=False),
    Passive("setup", 0, particles),
    Passive("density", 4, interior_density),
    Passive("pressure", 6, equation_of_state),
    Passive("pressure", 5, suction),
    Passive("force", 8, clumping),
    Passive("force", 3, momentum),
    Passive("integration", 0, motion),
    Passive("integration", 0, frozen),
    Passive("integration", 4, speeds),
    Passive("integration", 3, energy),
    Passive("walls", 0, escape),
)


def check_recording(path: str | os.PathLike[str]) -> Diagnosis:
    """Examine a recording and return what was found.

    path: of a .npz, .h5, .hdf5, .pvd, .vtk, .vtu or .csv, or of a folder; see `open_recording`.
    Numbered files are taken as one recording, of which any one may be named.

    A recording shows less than a solver that can be asked: what walls and gravity do isn't known,
    frames may be far apart. So many a check is inconclusive, and "healthy" means that nothing
    speaks against the solver.

    Raises ValueError for what isn't known, with the names that were found and expected,
    FileNotFoundError if there is nothing, ImportError that names the extra to install.
    """
    recording = open_recording(path)
    survey = RecordingSurvey(recording)
    results = []
    for check in CHECKS:
        started = time.monotonic()
        results.append(_result(check, survey).of(check, started))
    return Diagnosis(tuple(results), recording.path, tuple(survey.notes))


def _result(check: Passive, survey: RecordingSurvey) -> Result:
    if check.whole and not survey.n_frames:
        return skipped("no frame is finite in all its numbers")
    if check.whole and not survey.looks[0].n:
        return skipped("there are no fluid particles")
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return check.function(survey)
    except (ArithmeticError, ValueError, IndexError) as error:
        # what numbers lead astray must not end in a traceback
        return inconclusive(f"the recorded numbers could not be used: {error}")
