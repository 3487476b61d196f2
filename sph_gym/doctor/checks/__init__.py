"""The checks, imported in the order in which they are done."""

from sph_gym.doctor.checks import setup  # isort: skip
from sph_gym.doctor.checks import density, pressure, force, pair_force  # isort: skip

__all__ = ["density", "force", "pressure", "setup"]
