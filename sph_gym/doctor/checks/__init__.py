"""The checks, imported in the order in which they are done.

The motion of lone particles comes first, since accelerations are measured by tiny steps. What
shows only that something is wrong, not where, comes last.
"""

# ruff: noqa: F401  (importing them fills the registry)
from sph_gym.doctor.checks import setup, integration, density  # isort: skip
from sph_gym.doctor.checks import neighbours, places, sums, meetings  # isort: skip
from sph_gym.doctor.checks import pressure, force, pair_force, black_box  # isort: skip
from sph_gym.doctor.checks import scheme, viscosity, xsph, whole, walls  # isort: skip
