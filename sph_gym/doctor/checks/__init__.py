"""The checks, imported in the order in which they are done."""

from sph_gym.doctor.checks import setup, density  # isort: skip
from sph_gym.doctor.checks import neighbours, places, sums, meetings  # isort: skip
from sph_gym.doctor.checks import pressure, force, pair_force, black_box  # isort: skip
from sph_gym.doctor.checks import integration, scheme  # isort: skip

__all__ = [
    "black_box",
    "density",
    "force",
    "integration",
    "meetings",
    "neighbours",
    "pair_force",
    "places",
    "pressure",
    "scheme",
    "setup",
    "sums",
]
