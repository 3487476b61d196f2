"""Checks of states before an episode takes them back: all that is wrong is named, nothing moves."""

from collections.abc import Iterable, Mapping
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import failure
from sph_gym.solver.checks import finite_array, in_range, known, number, positive, whole
from sph_gym.solver.simulation import Report

NAMES = (
    "simulation", "past", "coordinates", "before", "numbers", "step", "over", "setbacks",
    "control_work", "report", "info", "rules",
)  # fmt: skip
CAUSES = ("", *failure.CAUSES)
LINKS = ("", "neighbours", "density", "pressure", "force", "integration", "walls")
# How far the solver's clock may be off the number of steps, in frames.
CLOCK = 1e-3


class Bounds(NamedTuple):
    """What a state must fit to.

    rules: of the environment, as plain values; instance_id: of the episode; n_steps: of it;
    rollbacks: blow-ups in a row that are taken back; frame: of the scene [s]; numbers, info: names
    of the entries, those of info with whether they are text.
    """

    rules: dict[str, Any]
    instance_id: str
    n_steps: int
    rollbacks: int
    frame: float
    numbers: Iterable[str]
    info: dict[str, bool]


class Kept(NamedTuple):
    """What a state holds besides the simulation, in the types that an episode works with."""

    past: list[Any]
    coordinates: NDArray[np.float64]
    before: dict[str, float]
    numbers: dict[str, float]
    step: int
    over: bool
    setbacks: int
    control_work: float
    report: Report
    info: dict[str, Any]


def check(state: Any, bounds: Bounds) -> Kept:
    """The parts of a state that fit to an episode. Raises ValueError that names what doesn't.

    The simulation is for `Simulation.restore` to check, but for its clock.
    """
    _named("state", state, NAMES)
    _same_rules(state["rules"], bounds.rules)
    step = int(in_range("state: step", whole("state: step", state["step"]), 0, bounds.n_steps))
    setbacks = whole("state: setbacks", state["setbacks"])
    in_range("state: setbacks", setbacks, 0, bounds.rollbacks)
    kept = Kept(
        _past(state["past"], step),
        _coordinates(state["coordinates"]),
        _numbers("state: before", state["before"], bounds.numbers),
        _numbers("state: numbers", state["numbers"], bounds.numbers),
        step,
        _flag("state: over", state["over"]),
        setbacks,
        number("state: control_work", state["control_work"]),
        _report(state["report"]),
        _info(state["info"], bounds),
    )
    _consistent(kept, state["simulation"], bounds)
    return kept


def _named(name: str, value: Any, names: Iterable[str]) -> None:
    """ValueError for what is no dictionary with just these entries."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}: expected a dictionary, got {type(value).__name__}")
    wrong = sorted(map(str, set(value) ^ set(names)))
    if wrong:
        raise ValueError(f"{name}: expected {', '.join(names)}; missing or unknown: {wrong}")


def _same_rules(given: Any, rules: dict[str, Any]) -> None:
    _named("state: rules", given, rules)
    for name, here in rules.items():
        if given[name] != here:
            raise ValueError(
                f"state: of an environment with {name} = {given[name]!r}, but here it is {here!r}"
            )


def _past(given: Any, step: int) -> list[Any]:
    array = finite_array("state: past", given, ("n", 5))
    if len(array) != step + 1:
        raise ValueError(f"state: past: expected {step + 1} rows at step {step}, got {len(array)}")
    return [tuple(row) for row in array.tolist()]


def _coordinates(given: Any) -> NDArray[np.float64]:
    array = finite_array("state: coordinates", given, (3,))
    if np.abs(array).max() > 1:
        raise ValueError(f"state: coordinates: expected numbers in [-1, 1], got {array.tolist()}")
    return array


def _numbers(name: str, given: Any, names: Iterable[str]) -> dict[str, float]:
    _named(name, given, names)
    for key, value in given.items():
        # some are infinite where there is nothing to measure
        if isinstance(value, bool) or not isinstance(value, Real) or value != value:
            raise ValueError(f"{name}: expected a number for {key}, got {value!r}")
    return dict(given)


def _flag(name: str, given: Any) -> bool:
    if not isinstance(given, bool):
        raise ValueError(f"{name}: expected True or False, got {given!r}")
    return given


def _report(given: Any) -> Report:
    if not isinstance(given, (tuple, list)) or len(given) != 6:
        raise ValueError(f"state: report: expected the 6 entries of a report, got {given!r}")
    n_substeps, dt, diverged, cause, link, bad_particle = given
    return Report(
        whole("state: report: n_substeps", n_substeps),
        positive("state: report: dt", dt),
        _flag("state: report: diverged", diverged),
        known("state: report: cause", cause, CAUSES),
        known("state: report: link", link, LINKS),
        whole("state: report: bad_particle", bad_particle, at_least=-1),
    )


def _info(given: Any, bounds: Bounds) -> dict[str, Any]:
    _named("state: info", given, bounds.info)
    for key, is_text in bounds.info.items():
        if is_text and not isinstance(given[key], str):
            raise ValueError(f"state: info: expected a text for {key}, got {given[key]!r}")
        if not is_text:
            number(f"state: info: {key}", given[key])
    if given["instance_id"] != bounds.instance_id:
        raise ValueError(
            f"state: of the instance {given['instance_id']!r}, but here it is "
            f"{bounds.instance_id!r}"
        )
    return dict(given)


def _consistent(kept: Kept, simulation: Any, bounds: Bounds) -> None:
    """ValueError if step, end and clock contradict each other."""
    died = kept.report.diverged and not kept.setbacks
    if kept.over != (died or kept.step >= bounds.n_steps):
        raise ValueError(
            f"state: over: expected {not kept.over} at step {kept.step} of {bounds.n_steps} "
            f"{'after' if died else 'without'} a blow-up, got {kept.over}"
        )
    if not isinstance(simulation, Mapping) or "time" not in simulation:
        raise ValueError("state: simulation: expected a snapshot of the solver")
    frames = number("state: simulation: time", simulation["time"]) / bounds.frame
    earliest = kept.step - died
    if not earliest - CLOCK <= frames <= kept.step + CLOCK:
        raise ValueError(
            f"state: step: expected a clock of {kept.step} frames at step {kept.step}, "
            f"got one of {frames:g}"
        )
