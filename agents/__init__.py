"""Agents that tune the solver, one readable file each, and an honest way to compare them."""
