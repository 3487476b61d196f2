"""Checks of recordings: all that can be told from particles at some times, without the solver."""
