"""The checks, imported in the order in which they are done."""

from sph_gym.doctor.checks import setup  # isort: skip
from sph_gym.doctor.checks import neighbours, places, sums, meetings  # isort: skip

__all__ = ["meetings", "neighbours", "places", "setup", "sums"]
