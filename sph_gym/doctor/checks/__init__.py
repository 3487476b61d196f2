"""The checks, imported in the order in which they are done.

The motion of lone particles comes first, since accelerations are measured by tiny steps. What
shows only that something is wrong, not where, comes last.
"""

from sph_gym.doctor.checks import setup, integration, density, flows  # isort: skip
from sph_gym.doctor.checks import neighbours, places, sums, meetings  # isort: skip
from sph_gym.doctor.checks import pressure, lags, force, crowds  # isort: skip
from sph_gym.doctor.checks import pair_force, black_box, scheme  # isort: skip
from sph_gym.doctor.checks import viscosity, xsph, whole, walls, tank  # isort: skip

__all__ = [
    "black_box",
    "crowds",
    "density",
    "flows",
    "force",
    "integration",
    "lags",
    "meetings",
    "neighbours",
    "pair_force",
    "places",
    "pressure",
    "scheme",
    "setup",
    "sums",
    "tank",
    "viscosity",
    "walls",
    "whole",
    "xsph",
]
