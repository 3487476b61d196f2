"""Accuracy against time: work-precision diagrams of every scene with a reference."""

from sph_gym.scenes.shared.refinement import names
from sph_gym.studies.accuracy.points import rerun
from sph_gym.studies.accuracy.study import measure

__all__ = ["measure", "names", "rerun"]
