"""Warnings of a running simulation: what is odd about it without being a blow-up."""

from typing import NamedTuple

KINDS = ("energy", "clumping", "volume", "mach", "walls", "start")


class Warning(NamedTuple):
    """One thing that is odd about a simulation.

    kind: one of `KINDS`; value: the measure at its worst; limit: the value above which it is odd;
    since: time [s] at which it was first seen; message: one plain sentence that says what was seen
    and what helps.
    """

    kind: str
    value: float
    limit: float
    since: float
    message: str


def short(warning: Warning) -> str:
    """Return a warning in a few words, for pictures and tables."""
    return f"{warning.kind} {warning.value:.3g} (limit {warning.limit:.3g})"
