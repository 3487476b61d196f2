"""What every run of a case must keep, as rows of a table."""

from collections.abc import Iterator, Sequence

from sph_gym.studies.stability.case import Case, Variant
from sph_gym.studies.stability.runs import Outcome
from sph_gym.studies.table import Row

# Of the mass times the largest speed; what summing up in the two precisions leaves.
ROUND_OFF = {"float64": 1e-13, "float32": 1e-6}
# Of the largest magnitude, and for the observables of runs.
SAME, ALIKE = 1e-12, 1e-6

Found = tuple[Variant, Outcome]


def rows(case: Case, found: Sequence[Found]) -> Iterator[Row]:
    """Every demand on a case, with the variant that is worst at it."""
    substeps = float(sum(one.substeps for _, one in found))
    yield Row("substeps", case.name, substeps, "")
    blowups = [(variant, one) for variant, one in found if one.blowups]
    names = ", ".join(f"{variant.name}: {one.cause}" for variant, one in blowups)
    label = f"{case.name} ({names})" if names else case.name
    yield Row("reported blow-ups", label, float(len(blowups)), "", 0.0 if case.stable else None)
    for name, bound in (("silent", 0.0), ("passed", 0.0), ("threads", 0.0)):
        yield _worst(case, found, name, bound)
    yield from _energies(case, found)
    yield from _drifts(case, found)
    exact = [(variant, one) for variant, one in found if variant.dtype == "float64"]
    if case.brute:
        yield _worst(case, exact, "grid", SAME)
        # a run that blows up multiplies what rounding began
        yield _worst(case, exact, "observables", ALIKE if case.stable else None)
    density = case.density if case.stable else None
    yield _worst(case, found, "density", density)
    variant, least = min(found, key=lambda pair: pair[1].lowest)
    yield Row("least density", _label(case, variant), least.lowest, "rho0", 0.0, at_least=True)


TITLES = {
    "silent": ("frames that failed in silence", ""),
    "passed": ("particles behind a wall", ""),
    "threads": ("fields that differ on two threads", ""),
    "grid": ("grid against brute force, rho, p, a", "of the largest"),
    "observables": ("runs on grid and brute force", "dx, energy"),
    "density": ("largest mean compression", "rho0"),
    "excess": ("energy from nowhere", "of what is at stake"),
    "drift": ("momentum from nowhere", "of the largest"),
}


def _label(case: Case, variant: Variant) -> str:
    return f"{case.name}, {variant.name}"


def _worst(case: Case, found: Sequence[Found], name: str, bound: float | None) -> Row:
    variant, one = max(found, key=lambda pair: float(getattr(pair[1], name)))
    quantity, unit = TITLES[name]
    value = float(getattr(one, name))
    return Row(quantity, _label(case, variant) if value > 0 else case.name, value, unit, bound)


def _energies(case: Case, found: Sequence[Found]) -> Iterator[Row]:
    """By kernels, since those that are no pair have a bound of their own."""
    size = case.sizes[0]
    bounds = [case.allowed_excess(case.scene(variant, size)) for variant, _ in found]
    for bound in sorted(set(bounds)):
        alike = [pair for pair, own in zip(found, bounds, strict=True) if own == bound]
        yield _worst(case, alike, "excess", bound if case.stable else None)


def _drifts(case: Case, found: Sequence[Found]) -> Iterator[Row]:
    if not case.conserves:
        return
    for dtype, bound in ROUND_OFF.items():
        alike = [(variant, one) for variant, one in found if variant.dtype == dtype]
        if alike:
            yield _worst(case, alike, "drift", bound)


def summary(found: dict[str, tuple[Case, Sequence[Found]]]) -> Iterator[Row]:
    """The promises, over all cases."""
    runs = [(case, one) for case, several in found.values() for _, one in several]
    least = min(len(several) for _, several in found.values())
    yield Row("cases", "all", float(len(found)), "", 30.0, at_least=True)
    yield Row("variants of each, at least", "all", float(least), "", 3.0, at_least=True)
    stable = sum(one.blowups for case, one in runs if case.stable)
    yield Row("blow-ups at or below the stable step", "all", float(stable), "", 0.0)
    for name in ("silent", "passed"):
        total = float(sum(getattr(one, name) for _, one in runs))
        yield Row(TITLES[name][0], "all", total, "", 0.0)
