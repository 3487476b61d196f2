"""What every run of a case must keep, as rows of a table."""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from sph_gym.solver.scene import Scene
from sph_gym.studies.stability.case import REACHED, Case, Variant
from sph_gym.studies.stability.runs import Outcome
from sph_gym.studies.table import Row

# Of the mass times the largest speed; what summing up in the two precisions leaves.
ROUND_OFF = {"float64": 1e-14, "float32": 1e-6}
# Of the largest magnitude, in the two precisions, and for the observables of runs.
SAME, ALIKE = {"float64": 1e-12, "float32": 5e-5}, 1e-8

# Of a lonely particle's density, which no other can be below; what float32 leaves of it.
LONELY = 1 - 1e-5

Found = tuple[Variant, Outcome]
Catalogue = dict[str, tuple[Case, Sequence[Found]]]


def rows(case: Case, found: Sequence[Found], quick: bool = False) -> Iterator[Row]:
    """Every demand on a case, with the variant that is worst at it; quick: of the quick version."""
    substeps = float(sum(one.substeps for _, one in found))
    yield Row("substeps", case.name, substeps, "")
    blowups = [(variant, one) for variant, one in found if one.blowups]
    if case.pushed > 0:
        yield _worst(case, found, "step", REACHED * case.pushed, at_least=True)
    names = ", ".join(f"{variant.name}: {one.cause}" for variant, one in blowups)
    label = f"{case.name} ({names})" if names else case.name
    yield Row("reported blow-ups", label, float(len(blowups)), "", 0.0 if case.stable else None)
    if not case.stable:
        odd = float(sum(one.cause not in case.causes for _, one in blowups))
        yield Row("blow-ups whose cause is not that of the case", label, odd, "", 0.0)
    for name, bound in (("silent", 0.0), ("passed", 0.0), ("threads", 0.0)):
        yield _worst(case, found, name, bound)
    if any(one.held for _, one in found):
        yield _worst(case, found, "held", None)
    yield from _drifts(case, found)
    yield from _exact(case, found)
    # who blows up may be anything by then; who doesn't, at whatever step, is held to all of it
    held = [pair for pair in found if case.stable or not pair[1].blowups]
    if held:
        yield _event(case, held, quick)
        yield from _by_kernels(case, held, "excess", case.allowed_excess)
        yield from _by_kernels(case, held, "rise", case.allowed_rise)
        yield from _densities(case, held)
        yield from _company(case, held, quick)


def _event(case: Case, found: Sequence[Found], quick: bool) -> Row:
    """What must have happened, in the run in which least of it did."""
    event = case.event
    least = event.quick if quick else event.full
    row = _worst(case, found, "happened", least, at_least=True)
    return row._replace(quantity=event.title, unit=event.unit)


def _company(case: Case, found: Sequence[Found], quick: bool) -> Iterator[Row]:
    """What it must have in common with another case, and how calm it must have become."""
    # the quick version ends before
    if case.calm is not None and not quick:
        yield _worst(case, found, "kinetic", case.calm[1])
    for name, bound in (("unlike", case.alike), ("clumped", case.clumped)):
        if bound is not None:
            yield _worst(case, found, name, bound)


def _exact(case: Case, found: Sequence[Found]) -> Iterator[Row]:
    """What brute force says, of the runs that it was asked about."""
    for dtype, bound in SAME.items():
        compared = [
            pair for pair in found if case.precision(pair[0]) == dtype and pair[1].grid != -math.inf
        ]
        if compared:
            yield _worst(case, compared, "grid", bound)
    compared = [pair for pair in found if pair[1].observables != -math.inf]
    if compared:
        # a run that blows up multiplies what rounding began
        yield _worst(case, compared, "observables", ALIKE if case.stable else None)


def _densities(case: Case, found: Sequence[Found]) -> Iterator[Row]:
    gain = case.density if case.gain is None else case.gain
    yield _worst(case, found, "gain", gain)
    if case.burst is not None:
        yield _worst(case, found, "burst", case.burst)
    yield _worst(case, found, "density", case.density)
    yield _worst(case, found, "p99", case.p99)
    if case.clumping is not None:
        yield from _by_kernels(case, found, "clumping", case.allowed_clumping)
    if case.peak is not None:
        yield _worst(case, found, "peak", case.peak)
    yield _worst(case, found, "lowest", LONELY, at_least=True)
    if case.alone:
        yield _worst(case, found, "highest", 2 - LONELY)
    if case.least > 0:
        yield _worst(case, found, "left", case.least, at_least=True)
    if case.typical > 0:
        yield _worst(case, found, "typical", case.typical, at_least=True)


TITLES = {
    "step": ("longest step", "stable steps"),
    "silent": ("frames that failed in silence", ""),
    "passed": ("particles behind a wall", ""),
    "held": ("particles that only the box holds", ""),
    "threads": ("fields that differ on two threads", ""),
    "grid": ("grid against brute force, rho, p, a", "of the largest"),
    "observables": ("runs on grid and brute force", "dx, energy"),
    "gain": ("mean compression beyond the start's", "rho0"),
    "burst": ("mean compression after the first frame", "rho0"),
    "density": ("mean compression, second half", "rho0"),
    "p99": ("99th percentile of compression, second half", "rho0"),
    "clumping": ("closer than 0.6 dx, second half", "of the particles"),
    "peak": ("largest density, second half", "rho0"),
    "lowest": ("least density", "a lonely particle's"),
    "highest": ("largest density", "a lonely particle's"),
    "left": ("least density of fluid that stays together", "the start's least"),
    "typical": ("least median density", "rho0"),
    "excess": ("energy from nowhere", "of what is at stake"),
    "rise": ("rise of energy from nowhere", "of what is at stake"),
    "kinetic": ("kinetic energy once at rest", "m g H"),
    "happened": ("what must have happened", ""),
    "unlike": ("end unlike that of its twin", "dx, energy"),
    "clumped": ("more than its twin closer than 0.6 dx", "of the particles"),
    "drift": ("momentum from nowhere", "of the largest"),
}


def _label(case: Case, variant: Variant) -> str:
    return f"{case.name}, {variant.name}"


def _worst(
    case: Case, found: Sequence[Found], name: str, bound: float | None, at_least: bool = False
) -> Row:
    """The row of the worst variant: numpy's extremes are nan wherever one is, Python's aren't."""
    values = np.array([getattr(one, name) for _, one in found], np.float64)
    worst = int(np.argmin(values) if at_least else np.argmax(values))
    quantity, unit = TITLES[name]
    value = float(values[worst])
    label = case.name if value == 0 else _label(case, found[worst][0])
    return Row(quantity, label, value, unit, bound, at_least)


def _by_kernels(
    case: Case, found: Sequence[Found], name: str, allowed: Callable[[Scene], float]
) -> Iterator[Row]:
    """A row for every bound, since kernels that are no pair may have one of their own."""
    bounds = [allowed(case.scene(variant, case.sizes[0])) for variant, _ in found]
    for bound in sorted(set(bounds)):
        alike = [pair for pair, own in zip(found, bounds, strict=True) if own == bound]
        yield _worst(case, alike, name, bound if bound < math.inf else None)


def _drifts(case: Case, found: Sequence[Found]) -> Iterator[Row]:
    if not case.conserves:
        return
    for dtype, bound in ROUND_OFF.items():
        alike = [pair for pair in found if case.precision(pair[0]) == dtype]
        if alike:
            yield _worst(case, alike, "drift", bound)


def summary(found: Catalogue) -> Iterator[Row]:
    """The promises, over all cases."""
    runs = [(case, one) for case, several in found.values() for _, one in several]
    least = min(len(several) for _, several in found.values())
    yield Row("cases", "all", float(len(found)), "", 30.0, at_least=True)
    yield Row("variants of each, at least", "all", float(least), "", 3.0, at_least=True)
    stable = sum(one.blowups for case, one in runs if case.stable)
    yield Row("blow-ups at or below the stable step", "all", float(stable), "", 0.0)
    exact = [one for _, one in runs]
    compared = float(sum(one.grid != -math.inf for one in exact))
    title = "runs compared with brute force"
    yield Row(title, "all", compared, f"of {len(exact)}", float(len(exact)), at_least=True)
    for name in ("silent", "passed"):
        total = float(sum(getattr(one, name) for _, one in runs))
        yield Row(TITLES[name][0], "all", total, "", 0.0)
