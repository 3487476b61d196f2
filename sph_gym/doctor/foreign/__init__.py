"""Solvers from the package index through the doctor's door: worked examples of its protocol.

    python -m sph_gym doctor --solver sph_gym.doctor.foreign.pysph:make

A module a package; each has `make(case)` and asks for its package when it is imported.
"""
