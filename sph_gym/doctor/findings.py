"""Results of checks: findings, made by one of the functions below."""

from typing import Any, NamedTuple


class Finding(NamedTuple):
    """The outcome of a check, before it knows its name; see `Result` for the fields.

    link: where the evidence points, "" for the check's own link.
    """

    status: str
    measured: float | str = ""
    expected: float | str = ""
    unit: str = ""
    message: str = ""
    remedy: str = ""
    tolerance: str = ""
    link: str = ""


def passed(message: str, measured: Any = "", expected: Any = "", **others: str) -> Finding:
    """Return that the link is sound; others: unit, tolerance."""
    return Finding("pass", measured, expected, message=message, **others)


def failed(
    message: str, remedy: str, measured: Any = "", expected: Any = "", **others: str
) -> Finding:
    """Return that the link is broken; others: unit, tolerance, link."""
    return Finding("fail", measured, expected, message=message, remedy=remedy, **others)


def inconclusive(message: str, measured: Any = "", expected: Any = "", **others: str) -> Finding:
    """Return that the outcome decides nothing."""
    return Finding("inconclusive", measured, expected, message=message, **others)


def skipped(message: str) -> Finding:
    """Return that the solver does not show what the check needs."""
    return Finding("skip", message=message)
