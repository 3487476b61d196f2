"""The checks, imported in the order in which they are done."""

from sph_gym.doctor.checks import setup  # isort: skip
from sph_gym.doctor.checks import density, pressure, force, pair_force, black_box  # isort: skip

__all__ = ["black_box", "density", "force", "pair_force", "pressure", "setup"]
