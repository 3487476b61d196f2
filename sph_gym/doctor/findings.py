"""Results of checks: findings, made by one of the functions below."""

from typing import Any, NamedTuple


class Measured(NamedTuple):
    """The numbers that a verdict rests on; see `Result` for the fields."""

    measured: Any = ""
    expected: Any = ""
    unit: str = ""
    tolerance: str = ""


NOTHING = Measured()


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


def passed(message: str, numbers: Measured = NOTHING) -> Finding:
    """Return that the link is sound."""
    return Finding("pass", message=message, **numbers._asdict())


def failed(message: str, remedy: str, numbers: Measured = NOTHING, link: str = "") -> Finding:
    """Return that the link is broken; link: where the evidence points, if not to the check's."""
    return Finding("fail", message=message, remedy=remedy, link=link, **numbers._asdict())


def inconclusive(message: str, numbers: Measured = NOTHING) -> Finding:
    """Return that the outcome decides nothing."""
    return Finding("inconclusive", message=message, **numbers._asdict())


def skipped(message: str) -> Finding:
    """Return that the solver does not show what the check needs."""
    return Finding("skip", message=message)
