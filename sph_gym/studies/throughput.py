"""The speed of the solver: by size, precision, threads, phase, kernel and effect; and of peers.

Everything but the environments is the dam break with about 20 neighbours, a column one wide and two
high. A particle-step is one particle, fluid or wall, advanced by one step. Runs that are compared
take turns; phases, sizes and variants are timed by the processor time of their thread, the rest by
the wall clock.
"""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym import scenes
from sph_gym.solver import teams
from sph_gym.solver.batch import advance_all
from sph_gym.solver.model import with_controls
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import DTYPES, Simulation
from sph_gym.studies import drawing, environments, picture, startup, variants
from sph_gym.studies.peers import NAME, SCRIPT, Peers, compare
from sph_gym.studies.phases import PHASES
from sph_gym.studies.table import Part, Row, measure_parts
from sph_gym.timing import (
    WARM_UP,
    Runner,
    clocked,
    in_turns,
    nanoseconds,
    own_clock,
    pinned,
    same_home,
)

# Bounds: two threads against one, where there is work for two; the cost of a particle at 100k
# and at 1k against 5k; the speed of many small fluids [M particle-steps/s].
TWICE, NO_SLOWER = 1.7, 1.0
LARGE, SMALL = 1.15, 1.2
BATCH = 34.0
RATE = "M particle-steps/s"
UNIT = "ns/fluid particle"
# Pictures of each kind that are painted.
PICTURES = 300


class ThroughputPlan(NamedTuple):
    """Sizes in fluid particles, repetitions, and how many fluids at once.

    reference: the size that others are compared with; work: particle-steps of one timed call.
    """

    sizes: tuple[int, ...] = (1000, 5000, 20_000, 100_000)
    rounds: int = 15
    peer_rounds: int = 3
    batch: int = 64
    batch_size: int = 500
    reference: int = 5000
    work: int = 400_000
    agents: environments.EnvironmentPlan = environments.EnvironmentPlan()


FULL = ThroughputPlan()
QUICK = ThroughputPlan(
    sizes=(1000, 5000), rounds=7, peer_rounds=1, work=200_000,
    agents=environments.EnvironmentPlan(rounds=7),
)  # fmt: skip


def dam_break(n: int) -> Scene:
    """Return the benchmark with about n fluid particles."""
    return scenes.make("dam_break", dx=(2.0 / n) ** 0.5, width=1.0, height=2.0, tank=4.0)


def case(n: int, dtype: str, threads: int = 1) -> str:
    """Return the name of a run in rows."""
    return f"{n}, {dtype}, {threads} thread{'s' if threads > 1 else ''}"


def measure(quick: bool, peers: Peers | None = None) -> Iterator[Row]:
    """Yield all rows, as they are measured, with a progress bar.

    Raises ImportError that names the extra to install, ValueError if the peers have no script.
    """
    if peers is not None:
        peers.check(SCRIPT)
    return measure_parts(parts(QUICK if quick else FULL, peers))


def parts(plan: ThroughputPlan, peers: Peers | None = None) -> list[Part]:
    """Return title and rows of every part of the study."""
    found: list[Part] = []
    for dtype in DTYPES:
        for n in plan.sizes:
            found.append((case(n, dtype), partial(by_threads, plan, n, dtype)))
            found.append((f"phases, {n}, {dtype}", partial(by_phase, plan, n, dtype)))
        found.append((f"sizes, {dtype}", partial(by_size, plan, dtype)))
        found.append((f"many, {dtype}", partial(many, plan, dtype)))
    found.append(("kernels, effects", partial(by_variant, plan)))
    for scene in plan.agents.spacings:
        rows = partial(environments.measure, plan.agents, *scene)
        found.append((f"environments, {scene[0]}", rows))
    shown = dam_break(min(plan.sizes)), dam_break(plan.reference)
    found.append(("pictures", partial(drawing.measure, *shown, PICTURES)))
    found.append(("compiling", startup.compiling))
    if peers is not None:
        sizes = [n for n in plan.sizes if n >= plan.reference]
        for dtype, n in product(DTYPES, sizes):
            found.append((f"{NAME}, {n}, {dtype}", partial(by_peer, plan, peers, n, dtype)))
    return found


def by_threads(plan: ThroughputPlan, n: int, dtype: str) -> Iterator[Row]:
    """Yield the speed on one thread and on two, neighbours and memory."""
    counts = [1, 2] if teams.most_threads() > 1 else [1]
    runners = [Runner(dam_break(n), dtype, threads, plan.work) for threads in counts]
    seconds = in_turns([runner.seconds for runner in runners], plan.rounds)
    sim = runners[0].sim
    for threads, times in zip(counts, seconds.T, strict=True):
        name, cost = case(n, dtype, threads), nanoseconds(times, sim.n_particles)
        yield Row("throughput", name, 1e3 / cost, RATE)
        yield Row("cost per particle", name, cost, "ns")
        cost = nanoseconds(times, sim.n_fluid)
        yield Row("cost per fluid particle, walls included", name, cost, "ns")
    if len(counts) > 1:
        bound = TWICE if n >= plan.reference else NO_SLOWER
        ratio = float(np.median(seconds[:, 0] / seconds[:, 1]))
        yield Row("two threads against one", f"{n}, {dtype}", ratio, "", bound, at_least=True)
    yield Row("mean neighbours", f"{n}, {dtype}", float(sim.neighbor_counts.mean()), "")
    yield Row("memory", f"{n}, {dtype}", runners[0].bytes() / sim.n_particles, "bytes/particle")


def by_size(plan: ThroughputPlan, dtype: str) -> Iterator[Row]:
    """Yield the cost of a particle in a large and in a small fluid over that in the reference."""
    compared = [n for n in (min(plan.sizes), max(plan.sizes)) if n != plan.reference]
    runners = [Runner(dam_break(n), dtype, 1, plan.work) for n in (plan.reference, *compared)]
    seconds = _processor_time(runners, plan.rounds)
    for counted, what in (("n_particles", "a particle"), ("n_fluid", "a fluid particle")):
        costs = seconds / [getattr(runner.sim, counted) for runner in runners]
        for n, times in zip(compared, costs.T[1:], strict=True):
            ratio, limit = float(np.median(times / costs[:, 0])), LARGE if n > 5000 else SMALL
            bound = limit if counted == "n_particles" else None
            name = f"{n} against {plan.reference}, {dtype}"
            yield Row(f"cost of {what}", name, ratio, "", bound)


def _processor_time(runners: list[Runner], rounds: int) -> NDArray[np.float64]:
    clock = own_clock()
    return in_turns([partial(runner.seconds, clock) for runner in runners], rounds)


def by_phase(plan: ThroughputPlan, n: int, dtype: str) -> Iterator[Row]:
    """Yield the parts of a step on one thread."""
    sim = Runner(dam_break(n), dtype).sim
    repeats, clock = max(plan.work // n // 4, 2), own_clock()
    model, _ = with_controls(sim.engine.model, sim.engine.controls[0])
    arguments = sim.engine.world, model, DTYPES[dtype](0.0), repeats

    def seconds(phase: Callable[..., None]) -> float:
        with pinned():
            return clocked(lambda: phase(*arguments), clock) / repeats

    runs = [partial(seconds, phase) for phase in PHASES.values()]
    in_turns(runs, 1)
    for name, times in zip(PHASES, in_turns(runs, plan.rounds).T, strict=True):
        yield Row(f"phase: {name}", f"{n}, {dtype}", nanoseconds(times, sim.n_fluid), UNIT)


def many(plan: ThroughputPlan, dtype: str) -> Iterator[Row]:
    """Yield the speed of many small fluids that are advanced together."""
    threads = min(2, teams.most_threads())
    scene = dam_break(plan.batch_size)
    sims = [Simulation(scene, dtype, threads=1) for _ in range(plan.batch)]
    frame = WARM_UP * sims[0].controls.dt
    advance_all(sims, frame, threads=threads)
    done = sum(sim.n_particles * sim.last_report.n_substeps for sim in sims)
    seconds = in_turns(
        [lambda: clocked(lambda: advance_all(sims, frame, threads=threads))], plan.rounds
    )
    name = f"{plan.batch} of {sims[0].n_fluid} + walls, {dtype}, {threads} threads"
    rate, share = done / float(np.median(seconds)) / 1e6, sims[0].n_fluid / sims[0].n_particles
    bound = BATCH if dtype == "float64" and threads == 2 else None
    yield Row("many small fluids", name, rate, RATE, bound, at_least=bound is not None)
    yield Row("many small fluids, fluid alone", name, rate * share, RATE)


def by_variant(plan: ThroughputPlan) -> Iterator[Row]:
    """Yield the cost with every kernel, and with every effect on and off, in float64."""
    scene, named = dam_break(plan.reference), dict[str, Scene]()
    for kernel in ("mueller", "wendland_c2"):
        fluid = dataclasses.replace(scene.fluid, kernel=kernel)
        named[f"kernel {kernel}"] = dataclasses.replace(scene, fluid=fluid)
    for effect in variants.UNIFORM:
        named[f"{effect} on"] = variants.added(scene, effect)
        named[f"{effect} off"] = variants.left_out(named[f"{effect} on"], effect)
    runners = [Runner(variant, work=plan.work) for variant in named.values()]
    same_home(runners)
    seconds = _processor_time(runners, plan.rounds)
    for name, runner, times in zip(named, runners, seconds.T, strict=True):
        cost = nanoseconds(times, runner.sim.n_fluid)
        yield Row("cost of a variant", f"{name}, {plan.reference}", cost, UNIT)


def by_peer(plan: ThroughputPlan, peers: Peers, n: int, dtype: str) -> Iterator[Row]:
    """Yield our speed and theirs, measured in turns on one core."""
    runner = Runner(dam_break(n), dtype, 1, plan.work)
    return compare(peers, runner, case(n, dtype), n, dtype, plan.peer_rounds)


def finish(rows: list[Row], path: Path) -> None:
    """Draw the throughput over the size."""
    print(f"plot: {picture.draw(rows, path)}")
