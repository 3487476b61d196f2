"""What accuracy costs in time: work-precision diagrams of every scene with a reference."""

from sph_gym.studies.accuracy.problems import names
from sph_gym.studies.accuracy.study import measure

__all__ = ["measure", "names"]
