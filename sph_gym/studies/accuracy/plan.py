"""Runs of the study: every knob alone, then those that pay together at all resolutions."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from sph_gym.recommend.series import too_soft
from sph_gym.recommend.settings import DENSITIES, LONGEST, Setting, is_agent, nominal
from sph_gym.scenes.shared.refinement import Refinement, names
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.kernels import KERNELS
from sph_gym.solver.simulation import DTYPES
from sph_gym.studies.accuracy.analysis import gain_of_series
from sph_gym.studies.accuracy.points import Point, available

# The largest h / dx that is tried: 50 neighbours.
WIDEST = 5.0
# At how many resolutions the knobs are turned: the nominal one and the next two coarser.
TURNED = 3
# Number of them for agents, whose search and training cost more than the runs; chance decides.
FEWER = 2
# Knobs in the order in which their best values are taken over, one upon the other.
CHAIN = ("dtype", "step", "sound", "width", "kernel", "density", "integrator", "xsph")
# Gain of a value by itself that is enough to take it over.
WORTHWHILE = 1.1
# Knobs whose best value is also run by itself at all resolutions, which ends its luck.
ALONE = ("width", "kernel", "density", "sound")

FoundPoints = Mapping[Setting, Point]


# Values of each knob: factors of h / dx, of the stable step and of c0; epsilons; names.
VALUES: Mapping[str, Sequence[Any]] = {
    "width": (0.7, 0.85, 1.2, 1.45),
    "step": (0.25, 0.5, 1.5, 2.0),
    "sound": (0.35, 0.5, 0.7, 1.4, 2.0),
    "kernel": tuple(KERNELS),
    "density": DENSITIES,
    "dtype": tuple(DTYPES),
    "integrator": tuple(INTEGRATORS),
    "xsph": (0.0, 0.15, 0.3, 0.5),
    "controller": ("cfl", "tuned_cfl", "lookahead", "ppo_warm-absolute"),
}


class StudyPlan(NamedTuple):
    """Scenes, and the values of each knob that are tried there, as in VALUES.

    sizes: how many resolutions, coarse first, None for all; chain: whether what pays is combined;
    repeats: runs of which a time is the median.
    """

    scenes: tuple[str, ...] = tuple(names())
    values: Mapping[str, Sequence[Any]] = VALUES
    sizes: int | None = None
    chain: bool = True
    repeats: int = 3


FULL = StudyPlan()
QUICK = StudyPlan(
    scenes=("elliptical_drop", "taylor_green"), sizes=3, repeats=2,
    values={
        "width": (0.85,), "step": (1.5,), "sound": (0.5,), "dtype": ("float32",),
        "controller": ("cfl",),
    },
)  # fmt: skip


def sizes(plan: StudyPlan, case: Refinement) -> tuple[int, ...]:
    """Return the resolutions of a scene."""
    return case.sizes[: plan.sizes]


def start_of(plan: StudyPlan, case: Refinement) -> Setting:
    """Return the setting from which the knobs are turned: the nominal one, if it is run at all."""
    return nominal(case, min(case.nominal, sizes(plan, case)[-1]))


def at_all_sizes(plan: StudyPlan, case: Refinement, series: Setting) -> list[Setting]:
    """Return a setting at all resolutions."""
    return [series._replace(across=across) for across in sizes(plan, case)]


def sweeps(plan: StudyPlan, case: Refinement) -> Iterator[tuple[str, Setting]]:
    """Yield knob and setting of every run in which one knob is turned alone; the nominal one first.

    Agents, which search or were trained, play at fewer resolutions; so do erratic scenes.
    """
    start = start_of(plan, case)
    yield "nominal", start
    for setting in at_all_sizes(plan, case, start.series):
        if setting != start:
            yield "resolution", setting
    coarser = [n for n in reversed(sizes(plan, case)) if n <= start.across]
    for k, across in enumerate(coarser[:TURNED]):
        for knob, values in _values(plan, case, start).items():
            for value in values:
                turned = start._replace(**{"across": across, knob: value})
                dear = case.erratic or is_agent(turned.controller)
                if turned.series != start.series and not (dear and k >= FEWER):
                    yield knob, turned


def _values(plan: StudyPlan, case: Refinement, start: Setting) -> dict[str, Sequence[Any]]:
    """Return the values of each knob that a scene can have."""
    values, walls = dict(plan.values), case.build(start.across).walls
    widths = [round(factor * start.width, 2) for factor in values.get("width", ())]
    values["width"] = [width for width in widths if width <= min(case.widest, WIDEST)]
    if walls is not None and walls.pressure == "like fluid":
        # boundary particles that are like fluid sum their densities
        values["density"] = ()
    controllers = values.get("controller", ())
    values["controller"] = [name for name in controllers if available(name, case.scene)]
    return values


def combined(plan: StudyPlan, case: Refinement, found: FoundPoints) -> Iterator[Setting]:
    """Yield the series that are run besides the nominal one, as settings at no resolution.

    One knob after the other takes the value with the largest gain by itself, by deterministic work
    and at equal error. Each series keeps what the one before has, if that was better for it and
    went well at every resolution. The tuned CFL rule by itself comes last. None for an erratic
    scene, which has no front. found: the runs so far, to which those of a series have been added
    when the next one is asked for.
    """
    if not plan.chain or case.erratic:
        return
    start = start_of(plan, case)
    own = [found[s] for s in at_all_sizes(plan, case, start.series)]
    values = _worthwhile(plan, case, found)
    faster = values["dtype"][1] if "dtype" in values else 1.0
    present, most = start, 1.0
    for knob, (value, _) in values.items():
        turned = present._replace(**{knob: value})
        yield turned.series
        runs = [found[s] for s in at_all_sizes(plan, case, turned.series)]
        gain = _gain(own, runs, "interactions") * (faster if turned.dtype != start.dtype else 1.0)
        if gain > most and not too_soft(runs):
            present, most = turned, gain
    if "tuned_cfl" in plan.values.get("controller", ()):
        yield start.series._replace(controller="tuned_cfl")


def alone(plan: StudyPlan, case: Refinement, found: FoundPoints) -> list[Setting]:
    """Return the series in which one knob has its best value: is it more than luck?"""
    if not plan.chain or case.erratic:
        return []
    own, values = start_of(plan, case).series, _worthwhile(plan, case, found)
    return [own._replace(**{knob: values[knob][0]}) for knob in ALONE if knob in values]


def _worthwhile(
    plan: StudyPlan, case: Refinement, found: FoundPoints
) -> dict[str, tuple[Any, float]]:
    """Return value and gain of each knob whose best value by itself is worthwhile.

    Pairs are counted, since no noise is in them; for the precision, which hardly changes their
    number, the measured effort counts.
    """
    swept = list(sweeps(plan, case))
    own = [found[s] for knob, s in swept if knob in ("nominal", "resolution")]
    values = {}
    for knob in CHAIN:
        tried: dict[Any, list[Point]] = {}
        for name, s in swept:
            if name == knob and s.step <= LONGEST:
                tried.setdefault(getattr(s, knob), []).append(found[s])
        cost = "effort" if knob == "dtype" else "interactions"
        gains = {v: _gain(own, runs, cost) for v, runs in tried.items() if not too_soft(runs)}
        best = max(gains, key=lambda value: gains[value], default=None)
        if gains.get(best, 0.0) >= WORTHWHILE:
            values[knob] = best, gains[best]
    return values


def _gain(own: Sequence[Point], runs: Sequence[Point], cost: str) -> float:
    gain = gain_of_series(own, runs, cost).gain
    return gain if math.isfinite(gain) else 0.0
