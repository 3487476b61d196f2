"""Which runs are made: every knob alone, then those that pay together at all resolutions."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.kernels import KERNELS
from sph_gym.solver.simulation import DTYPES
from sph_gym.studies.accuracy.gains import LONGEST, Tried, Turned, gain
from sph_gym.studies.accuracy.policies import RULES, available
from sph_gym.studies.accuracy.problems import Problem, names
from sph_gym.studies.accuracy.settings import DENSITIES, FIXED, Setting, nominal
from sph_gym.studies.accuracy.trust import mush

# Beyond this h / dx nobody goes: 50 neighbours.
WIDEST = 5.0
# At how many resolutions the knobs are turned: the nominal one and the next two coarser.
TURNED = 3
# The same for agents, whose search and training cost more than the runs, and where chance decides.
FEWER = 2
# Knobs whose values are numbers, for which an elasticity makes sense; runs of several at once.
NUMBERS = ("resolution", "width", "step", "sound", "xsph")
COMBINED = "combined"
# Knobs in the order in which their best values are taken over, one upon the other.
CHAIN = ("dtype", "step", "sound", "width", "kernel", "density", "integrator", "xsph")
# What a value must buy by itself to be taken over.
WORTHWHILE = 1.1
# Knobs whose best value is also run by itself at all resolutions, where its luck ends.
ALONE = ("width", "kernel", "density", "sound")


class Plan(NamedTuple):
    """What is tried: scenes; factors of h / dx, of the stable step and of c0; epsilons; names.

    sizes: how many resolutions, coarse first, None for all; chain: whether what pays is combined;
    promises: whether recommendations are tried out; repeats: runs of which a time is the median.
    """

    scenes: tuple[str, ...] = tuple(names())
    widths: tuple[float, ...] = (0.7, 0.85, 1.2, 1.45)
    steps: tuple[float, ...] = (0.25, 0.5, 1.5, 2.0)
    sounds: tuple[float, ...] = (0.35, 0.5, 0.7, 1.4, 2.0)
    epsilons: tuple[float, ...] = (0.0, 0.15, 0.3, 0.5)
    kernels: tuple[str, ...] = tuple(KERNELS)
    densities: tuple[str, ...] = DENSITIES
    dtypes: tuple[str, ...] = tuple(DTYPES)
    integrators: tuple[str, ...] = tuple(INTEGRATORS)
    controllers: tuple[str, ...] = ("cfl", "tuned_cfl", "lookahead", "ppo", "sac")
    sizes: int | None = None
    chain: bool = True
    promises: bool = True
    repeats: int = 3


FULL = Plan()
QUICK = Plan(
    scenes=("elliptical_drop", "taylor_green"), widths=(0.85,), steps=(1.5,), sounds=(0.5,),
    epsilons=(), kernels=(), densities=(), dtypes=("float32",), integrators=(),
    controllers=("cfl",), sizes=3, chain=True, promises=True, repeats=2,
)  # fmt: skip


def sizes(plan: Plan, problem: Problem) -> tuple[int, ...]:
    """The resolutions of a scene."""
    return problem.sizes[: plan.sizes]


def middle(plan: Plan, problem: Problem) -> int:
    """The resolution at which the knobs are turned: the nominal one, if it is run at all."""
    return min(problem.nominal, sizes(plan, problem)[-1])


def turned(plan: Plan, problem: Problem) -> list[int]:
    """Resolutions at which the knobs are turned, the nominal one first."""
    return [n for n in reversed(sizes(plan, problem)) if n <= middle(plan, problem)][:TURNED]


def sweeps(plan: Plan, problem: Problem) -> Iterator[tuple[str, Setting]]:
    """Knob and setting of every run in which one knob alone is turned; the nominal run first.

    Agents, which search or were trained, play at fewer resolutions; so do erratic scenes.
    """
    start = nominal(problem, middle(plan, problem))
    yield "nominal", start
    for across in sizes(plan, problem):
        if across != start.across:
            yield "resolution", start._replace(across=across)
    for k, across in enumerate(turned(plan, problem)):
        for knob, values in _values(plan, problem, start).items():
            for value in values:
                bold = start._replace(**{"across": across, knob: value})  # type: ignore[arg-type]
                dear = problem.erratic or bold.controller not in (FIXED, *RULES)
                if bold.line != start.line and not (dear and k >= FEWER):
                    yield knob, bold


def _values(plan: Plan, problem: Problem, start: Setting) -> dict[str, Iterable[float | str]]:
    widest = min(problem.widest, WIDEST)
    widths = (round(factor * start.width, 2) for factor in plan.widths)
    walled = problem.build(start.across).walls
    like_fluid = walled is not None and walled.pressure == "like fluid"
    return {
        "width": [width for width in widths if width <= widest],
        "step": plan.steps,
        "sound": plan.sounds,
        "kernel": plan.kernels,
        # boundary particles that are like fluid sum their densities
        "density": () if like_fluid else plan.densities,
        "dtype": plan.dtypes,
        "integrator": plan.integrators,
        "xsph": plan.epsilons,
        "controller": [name for name in plan.controllers if available(name, problem.scene)],
    }


def lines(plan: Plan, problem: Problem, found: Mapping[Setting, Tried]) -> Iterator[Setting]:
    """Settings, at no resolution, that are run at all resolutions besides the nominal one.

    One knob after the other takes the value that buys most by itself, by deterministic work and
    at equal error. Each line keeps what the one before has, if that was better for it and went
    well at every resolution. The tuned CFL rule by itself comes last. found: the runs so far, to
    which those of a line have been added when the next one is asked for. None for an erratic scene,
    which has no front.
    """
    start = nominal(problem, middle(plan, problem))
    nominal_line = [found[s] for s in ladder(plan, problem, start.line)]
    chained = plan.chain and not problem.erratic
    values = _worthwhile(plan, problem, found) if chained else {}
    faster = values["dtype"].gain if "dtype" in values else 1.0
    present, best = start, 1.0
    for knob, worth in values.items():
        bold = present._replace(**{knob: worth.value})
        yield bold.line
        runs = [found[s] for s in ladder(plan, problem, bold.line)]
        bought = _gain(nominal_line, runs, "interactions")
        bought *= faster if bold.dtype != start.dtype else 1.0
        if bought > best and not mush(runs):
            present, best = bold, bought
    if chained and "tuned_cfl" in plan.controllers:
        yield start.line._replace(controller="tuned_cfl")


def alone(plan: Plan, problem: Problem, found: Mapping[Setting, Tried]) -> list[Setting]:
    """Settings, at no resolution, in which one knob has its best value: are they more than luck?"""
    line = nominal(problem, middle(plan, problem)).line
    if not plan.chain or problem.erratic:
        return []
    values = _worthwhile(plan, problem, found)
    return [line._replace(**{knob: values[knob].value}) for knob in ALONE if knob in values]


class Best(NamedTuple):
    """A value of a knob and what it buys by itself."""

    value: Any
    gain: float


def _worthwhile(plan: Plan, problem: Problem, found: Mapping[Setting, Tried]) -> dict[str, Best]:
    """Of each knob of the chain the value that buys most by itself, if it buys enough.

    Pairs are counted, since no noise is in them; of the precision, which changes their number by
    nothing, the measured effort tells.
    """
    swept = list(sweeps(plan, problem))
    nominal_line = [found[s] for knob, s in swept if knob in ("nominal", "resolution")]
    values = {}
    for knob in CHAIN:
        tried: dict[Any, list[Tried]] = {}
        for name, s in swept:
            if name == knob and s.step <= LONGEST:
                tried.setdefault(getattr(s, knob), []).append(found[s])
        cost = "effort" if knob == "dtype" else "interactions"
        bought = [
            Best(value, _gain(nominal_line, runs, cost))
            for value, runs in tried.items()
            if not mush(runs)
        ]
        best = max(bought, key=lambda best: best.gain, default=None)
        if best is not None and best.gain >= WORTHWHILE:
            values[knob] = best
    return values


def _gain(nominal_line: Sequence[Tried], runs: Sequence[Tried], cost: str) -> float:
    bought = gain(nominal_line, runs, cost)
    return bought if math.isfinite(bought) else 0.0


def ladder(plan: Plan, problem: Problem, line: Setting) -> list[Setting]:
    """A line at all resolutions."""
    return [line._replace(across=across) for across in sizes(plan, problem)]


# --- Finding one's way in the points --------------------------------------------------------


Run = TypeVar("Run", bound=Turned)


def rungs(points: Sequence[Run]) -> list[Run]:
    """The nominal settings at all resolutions, the nominal one first."""
    return [found for found in points if found.knob in ("nominal", "resolution")]


def knobs(points: Sequence[Turned]) -> list[str]:
    """Those that were turned alone, in the order of the points."""
    alone = dict.fromkeys(found.knob for found in points)
    return [knob for knob in alone if knob not in ("nominal", COMBINED)]
