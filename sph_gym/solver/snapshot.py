"""Snapshots of a simulation: checked before anything is changed."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.checks import number
from sph_gym.solver.diagnostics import Totals
from sph_gym.solver.engine import Engine
from sph_gym.solver.failure import Onset
from sph_gym.solver.scene import check_controls
from sph_gym.solver.state import Controls


class Snapshot(NamedTuple):
    """The parts of a snapshot, see `Simulation.snapshot`.

    fluid: (n,) columns by name; time, clock: [s]; power: of gravity [W/m]; ledger, warnings:
    their numbers.
    """

    fluid: dict[str, NDArray[Any]]
    time: float
    clock: float
    controls: Controls
    ledger: list[float]
    power: float
    totals: Totals
    substeps: float
    onset: Onset
    warnings: list[float]


def read_snapshot(given: Any, engine: Engine, n_ledger: int, n_warnings: int) -> Snapshot:
    """Return the parts of a snapshot that fits an engine, with so many numbers of either kind.

    Raises ValueError if it is of another size, precision or form.
    """
    if not isinstance(given, Mapping):
        raise ValueError(f"snapshot: expected one of Simulation.snapshot(), got {given!r}")
    missing = ", ".join(part for part in Snapshot._fields if part not in given)
    if missing:
        raise ValueError(f"snapshot: expected one of Simulation.snapshot(), it has no {missing}")
    try:
        snapshot = Snapshot(
            {name: np.asarray(given["fluid"][name]) for name in engine.state_columns},
            number("time", given["time"]),
            number("clock", given["clock"]),
            check_controls(given["controls"]),
            [number("ledger", each) for each in given["ledger"]],
            number("power", given["power"]),
            Totals(*(number("totals", each) for each in given["totals"])),
            number("substeps", given["substeps"]),
            Onset(*(number("onset", each) for each in given["onset"])),
            [number("warnings", each) for each in given["warnings"]],
        )
        if len(snapshot.ledger) != n_ledger or snapshot.ledger[1] <= 0:
            raise ValueError(f"ledger {snapshot.ledger}")
        if len(snapshot.warnings) != n_warnings:
            raise ValueError(f"warnings {snapshot.warnings}")
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise ValueError(f"snapshot: not one of Simulation.snapshot(): {error!r}") from None
    _check_columns(snapshot.fluid, engine)
    return snapshot


def _check_columns(fluid: dict[str, NDArray[Any]], engine: Engine) -> None:
    for name, present in engine.state().items():
        given = fluid[name]
        if given.shape != present.shape or given.dtype != present.dtype:
            raise ValueError(
                f"snapshot: expected {name} of shape {present.shape} and type "
                f"{present.dtype}, got {given.shape} and {given.dtype}"
            )
        if not np.isfinite(given).all():
            raise ValueError(f"snapshot: expected finite numbers in {name}")
    if not np.array_equal(np.sort(fluid["id"]), np.arange(engine.n)):
        raise ValueError("snapshot: expected every particle's id once")
