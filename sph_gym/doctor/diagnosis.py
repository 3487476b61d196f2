"""The diagnosis of a solver: the result of each check, and the first broken link."""

import json
import math
from dataclasses import asdict, dataclass, field
from textwrap import shorten
from typing import Any

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
STATUSES = ("pass", "fail", "blocked", "skip", "inconclusive", "xfail", "error")
BROKEN = ("fail", "error")
# Longest message in a row of the table [characters].
WIDTH = 110


@dataclass(frozen=True)
class Result:
    """The outcome of one check.

    check: its name; link: the link of the chain that it speaks of, see `LINKS`.

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


@dataclass(frozen=True)
class Diagnosis:
    """All results, in the order of the chain. `print(diagnosis)` shows them."""

    results: tuple[Result, ...]
    name: str = ""
    notes: tuple[str, ...] = field(default=())

    @property
    def ok(self) -> bool:
        """Return whether no check failed."""
        return self.first is None

    @property
    def first(self) -> Result | None:
        """Return the result that shows the first broken link, None if no check failed."""
        broken = [each for each in self.results if each.broken]
        return min(broken, key=lambda each: LINKS.index(each.link)) if broken else None

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
