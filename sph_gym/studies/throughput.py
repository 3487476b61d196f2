"""How fast the solver is: by size, precision, threads, phase, kernel and effect; and its peers.

Everything but the environments is the dam break with about 20 neighbours, a column one wide and two
high. A particle-step is one particle, fluid or wall, moved on by one step. What is compared runs in
turns; phases, sizes and variants by the time that their thread has a core, the rest by the clock on
the wall.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sph_gym import scenes
from sph_gym.solver import teams
from sph_gym.solver.batch import advance_all
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import DTYPES, Simulation
from sph_gym.studies import compilation, environments, variants
from sph_gym.studies.peers import NAME, SCRIPT, Peers, compare
from sph_gym.studies.phases import PHASES
from sph_gym.studies.table import Row
from sph_gym.studies.timing import (
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


class Plan(NamedTuple):
    """What is measured: sizes in fluid particles, repetitions, and how many fluids at once."""

    sizes: tuple[int, ...] = (1000, 5000, 20_000, 100_000)
    rounds: int = 15
    peer_rounds: int = 3
    batch: int = 64
    batch_size: int = 500
    reference: int = 5000
    # particle-steps of one timed call
    work: int = 400_000
    # of the environments
    agents: environments.Plan = environments.Plan()


FULL = Plan()
QUICK = Plan(
    sizes=(1000, 5000), rounds=7, peer_rounds=1, work=200_000,
    agents=environments.Plan(rounds=7),
)  # fmt: skip

Task = tuple[str, Callable[[], Iterable[Row]]]


def dam_break(n: int) -> Scene:
    """The benchmark with about n fluid particles."""
    return scenes.make("dam_break", dx=(2.0 / n) ** 0.5, width=1.0, height=2.0, tank=4.0)


def case(n: int, dtype: str, threads: int = 1) -> str:
    """How a row calls a run."""
    return f"{n}, {dtype}, {threads} thread{'s' if threads > 1 else ''}"


def measure(quick: bool, peers: Peers | None = None) -> Iterator[Row]:
    """All rows, as they are measured, with a progress bar.

    Raises ImportError that names the extra to install, ValueError if the peers have no script.
    """
    if peers is not None and not (peers.folder / SCRIPT).is_file():
        raise ValueError(f"--peers: no {peers.folder / SCRIPT}")
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    with tqdm(tasks(QUICK if quick else FULL, peers), unit="part") as bar:
        for title, rows in bar:
            bar.set_description(title)
            yield from rows()


def tasks(plan: Plan, peers: Peers | None = None) -> list[Task]:
    """Title and rows of every part of the study."""
    parts: list[Task] = []
    for dtype in DTYPES:
        for n in plan.sizes:
            parts.append((case(n, dtype), partial(by_threads, plan, n, dtype)))
            parts.append((f"phases, {n}, {dtype}", partial(by_phase, plan, n, dtype)))
        parts.append((f"sizes, {dtype}", partial(by_size, plan, dtype)))
        parts.append((f"many, {dtype}", partial(many, plan, dtype)))
    parts.append(("kernels, effects", partial(by_variant, plan)))
    for scene in plan.agents.spacings:
        rows = partial(environments.measure, plan.agents, *scene)
        parts.append((f"environments, {scene[0]}", rows))
    parts.append(("compiling", compilation.measure))
    if peers is not None:
        for dtype in DTYPES:
            for n in plan.sizes:
                if n >= plan.reference:
                    parts.append((f"{NAME}, {n}, {dtype}", partial(by_peer, plan, peers, n, dtype)))
    return parts


def by_threads(plan: Plan, n: int, dtype: str) -> Iterator[Row]:
    """Speed on one thread and on two, neighbours and memory."""
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


def by_size(plan: Plan, dtype: str) -> Iterator[Row]:
    """What a particle costs in a large and in a small fluid, against one of the reference size."""
    compared = [n for n in (min(plan.sizes), max(plan.sizes)) if n != plan.reference]
    runners = [Runner(dam_break(n), dtype, 1, plan.work) for n in (plan.reference, *compared)]
    clock = own_clock()
    seconds = in_turns([partial(runner.seconds, clock) for runner in runners], plan.rounds)
    for counted, bounded in (("n_particles", True), ("n_fluid", False)):
        costs = seconds / [getattr(runner.sim, counted) for runner in runners]
        for n, times in zip(compared, costs.T[1:], strict=True):
            ratio, limit = float(np.median(times / costs[:, 0])), LARGE if n > 5000 else SMALL
            what = "a particle" if bounded else "a fluid particle"
            name = f"{n} against {plan.reference}, {dtype}"
            yield Row(f"cost of {what}", name, ratio, "", limit if bounded else None)


def by_phase(plan: Plan, n: int, dtype: str) -> Iterator[Row]:
    """The parts of a step on one thread."""
    sim = Runner(dam_break(n), dtype).sim
    repeats = max(plan.work // n // 4, 2)
    arguments = sim.engine.world, sim.engine.model, DTYPES[dtype](0.0), repeats

    clock = own_clock()

    def timer(phase: Callable[..., None]) -> Callable[[], float]:
        def seconds() -> float:
            with pinned():
                return clocked(lambda: phase(*arguments), clock) / repeats

        return seconds

    runs = [timer(phase) for phase in PHASES.values()]
    in_turns(runs, 1)
    for name, times in zip(PHASES, in_turns(runs, plan.rounds).T, strict=True):
        yield Row(f"phase: {name}", f"{n}, {dtype}", nanoseconds(times, sim.n_fluid), UNIT)


def many(plan: Plan, dtype: str) -> Iterator[Row]:
    """Many small fluids, advanced together."""
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


def by_variant(plan: Plan) -> Iterator[Row]:
    """Every kernel, and every effect on and off, in float64."""
    scene = dam_break(plan.reference)
    named = {
        f"kernel {kernel}": dataclasses.replace(
            scene, fluid=dataclasses.replace(scene.fluid, kernel=kernel)
        )
        for kernel in ("mueller", "wendland_c2")
    }
    for effect in variants.UNIFORM:
        named[f"{effect} on"] = variants.added(scene, effect)
        named[f"{effect} off"] = variants.left_out(scene, effect)
    runners = {name: Runner(variant, work=plan.work) for name, variant in named.items()}
    same_home(list(runners.values()))
    clock = own_clock()
    runs = [partial(runner.seconds, clock) for runner in runners.values()]
    seconds = in_turns(runs, plan.rounds)
    for (name, runner), times in zip(runners.items(), seconds.T, strict=True):
        cost = nanoseconds(times, runner.sim.n_fluid)
        yield Row("cost of a variant", f"{name}, {plan.reference}", cost, UNIT)


def by_peer(plan: Plan, peers: Peers, n: int, dtype: str) -> Iterator[Row]:
    """Ours and theirs in turns, on one core."""
    runner = Runner(dam_break(n), dtype, 1, plan.work)
    return compare(peers, runner, case(n, dtype), n, dtype, plan.peer_rounds)


def finish(rows: list[Row], path: Path) -> None:
    """Draw the throughput over the size."""
    from sph_gym.studies.picture import draw

    print(f"plot: {draw(rows, path)}")
