"""The checks, imported in the order in which they are done."""

from sph_gym.doctor.checks import setup

__all__ = ["setup"]
