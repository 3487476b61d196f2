"""The diagnosis of a solver: the result of each check, and the first broken link."""

import json
import math
import time
from dataclasses import asdict, dataclass, replace
from textwrap import shorten
from typing import Any, NamedTuple

# The chain, in the order in which a fault travels through a solver.
LINKS = (
    "setup",
    "neighbours",
    "density",
    "pressure",
    "force",
    "viscosity",
    "xsph",
    "integration",
    "walls",
)
# What a solver may show of the chain, and the link that makes it.
COLUMNS = {"rho": "density", "p": "pressure", "a": "force"}
STATUSES = ("pass", "fail", "blocked", "skip", "inconclusive", "xfail", "error")
BROKEN = ("fail", "error")
# Longest message in a row of the table [characters].
WIDTH = 110


@dataclass(frozen=True)
class Result:
    """The outcome of one check.

    check: its name; link: the link of the chain that it speaks of, see `LINKS`. A check leaves its
    name out, and the link unless the evidence points to another one than its own: see `of`.

    status: "pass"; "fail": the link is broken; "error": the solver crashed, hung or broke the
    protocol; "blocked": a check that this one builds on failed, so it was not done; "skip": the
    solver does not show what it needs; "inconclusive": done, but the outcome decides nothing;
    "xfail": failed as was announced.

    measured, expected: numbers or short texts, in `unit`; tolerance: how far apart they may be,
    in words; message: what was done and what came out; remedy: the likely causes in their order,
    and what to do; step: the step of the playbook, 0 for none; seconds: time taken.
    """

    check: str
    link: str
    status: str
    measured: float | str = ""
    expected: float | str = ""
    unit: str = ""
    message: str = ""
    remedy: str = ""
    tolerance: str = ""
    step: int = 0
    seconds: float = 0.0

    @property
    def broken(self) -> bool:
        """Return whether the result speaks against the solver."""
        return self.status in BROKEN

    def of(self, check: Any, started: float) -> "Result":
        """Return the result with the name, link and step of its check, begun at `started` [s]."""
        return replace(
            self,
            check=check.name,
            link=self.link or check.link,
            step=check.step,
            seconds=round(time.monotonic() - started, 3),
        )


class Measured(NamedTuple):
    """The numbers that a result rests on; see `Result` for the fields."""

    measured: Any = ""
    expected: Any = ""
    unit: str = ""
    tolerance: str = ""

    @property
    def bare(self) -> "Measured":
        """Return the two numbers alone, for an outcome that no tolerance decides."""
        return Measured(self.measured, self.expected)


NOTHING = Measured()


def passed(message: str, numbers: Measured = NOTHING) -> Result:
    """Return that the link is sound."""
    return Result("", "", "pass", message=message, **numbers._asdict())


def failed(message: str, remedy: str, numbers: Measured = NOTHING, link: str = "") -> Result:
    """Return that the link is broken; link: where the evidence points, if not to the check's."""
    return Result("", link, "fail", message=message, remedy=remedy, **numbers._asdict())


def error(message: str, remedy: str, link: str = "") -> Result:
    """Return that the solver crashed, hung or broke the protocol."""
    return Result("", link, "error", message=message, remedy=remedy)


def inconclusive(message: str, numbers: Measured = NOTHING) -> Result:
    """Return that the outcome decides nothing."""
    return Result("", "", "inconclusive", message=message, **numbers._asdict())


def skipped(message: str) -> Result:
    """Return that the solver does not show what the check needs."""
    return Result("", "", "skip", message=message)


def blocked(message: str) -> Result:
    """Return that the check was not done, as one that it builds on failed."""
    return Result("", "", "blocked", message=message)


class Ends(Exception):
    """A check ends before its last line, with the result that is given."""


def need(condition: Any, message: str, numbers: Measured = NOTHING) -> None:
    """End the check as inconclusive unless the condition holds."""
    if not condition:
        raise Ends(inconclusive(message, numbers))


@dataclass(frozen=True)
class Diagnosis:
    """All results, put into the order of the chain. `print(diagnosis)` shows them."""

    results: tuple[Result, ...]
    name: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        ordered = sorted(self.results, key=lambda each: LINKS.index(each.link))
        object.__setattr__(self, "results", tuple(ordered))

    @property
    def ok(self) -> bool:
        """Return whether no check failed."""
        return self.first is None

    @property
    def first(self) -> Result | None:
        """Return the result that shows the first broken link, None if no check failed."""
        return next((each for each in self.results if each.broken), None)

    @property
    def link(self) -> str:
        """Return the first broken link, "" if no check failed."""
        return self.first.link if self.first else ""

    @property
    def verdict(self) -> str:
        """Return the last line: the link and the remedy, or that all is well."""
        if self.first is None:
            done = sum(each.status == "pass" for each in self.results)
            return f"healthy: {done} checks passed"
        what = f" {self.first.message}." if self.first.status == "error" else ""
        text = f"broken: {self.link} ({self.first.check}).{what} {self.first.remedy}"
        return " ".join(text.split())

    @property
    def counts(self) -> str:
        """Return how many results have each status, as text."""
        numbers = {s: sum(each.status == s for each in self.results) for s in STATUSES}
        return ", ".join(f"{n} {status}" for status, n in numbers.items() if n)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, for JSON."""
        results = [
            asdict(each) | {"measured": _plain(each.measured), "expected": _plain(each.expected)}
            for each in self.results
        ]
        return {
            "name": self.name,
            "ok": self.ok,
            "link": self.link,
            "verdict": self.verdict,
            "notes": list(self.notes),
            "results": results,
        }

    def to_json(self) -> str:
        """Return the diagnosis as JSON text."""
        return json.dumps(self.to_dict(), indent=1, allow_nan=False)

    def __str__(self) -> str:
        lines = [row(each) for each in self.results]
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join([*lines, self.counts, self.verdict])


def shown(value: float | str) -> str:
    """Return a number or text in few characters."""
    return value if isinstance(value, str) else f"{value:.4g}"


def _plain(value: float | str) -> float | str:
    """Return a value that JSON has: infinity and NaN are text."""
    if isinstance(value, str):
        return value
    return float(value) if math.isfinite(value) else str(float(value))


def row(result: Result) -> str:
    """Return a result as one line of a table."""
    head = f"{result.status:<12} {result.link:<11} {result.check:<28}"
    if result.status in ("pass", "blocked", "skip") and result.message:
        return f"{head} {shorten(result.message, WIDTH)}"
    if result.measured == "" and result.expected == "":
        return f"{head} {result.message}".rstrip()
    unit = f" {result.unit}" if result.unit else ""
    numbers = f"{shown(result.measured)} (expected {shown(result.expected)}){unit}"
    return f"{head} {numbers}: {shorten(result.message, WIDTH)}".rstrip()
