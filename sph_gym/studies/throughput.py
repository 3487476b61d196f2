"""The speed of the solver: by size, precision, threads, phase, kernel and effect; and of peers.

Everything but the environments is the dam break with about 20 neighbours, a column one wide and two
high. A particle-step is one particle, fluid or wall, advanced by one step. Runs that are compared
take turns; phases, sizes and variants are timed by the processor time of their thread, the rest by
the wall clock.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym import scenes
from sph_gym.solver import teams
from sph_gym.solver.batch import advance_all
from sph_gym.solver.boundary import compute_wall_density
from sph_gym.solver.density import compute_fluid_density
from sph_gym.solver.integrators import move
from sph_gym.solver.jit import jit
from sph_gym.solver.model import with_controls
from sph_gym.solver.neighbors import read_grid, sort_into_cells
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import DTYPES, Simulation
from sph_gym.studies import environments, startup, variants
from sph_gym.studies.peers import NAME, SCRIPT, Peers, compare
from sph_gym.studies.picture import new_figure, save
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
from sph_gym.view import Painter, Window

# Bounds: two threads against one, where there is work for two; the cost of a particle at 100k
# and at 1k against 5k; the speed of many small fluids [M particle-steps/s].
TWICE, NO_SLOWER = 1.7, 1.0
LARGE, SMALL = 1.15, 1.2
BATCH = 34.0
RATE = "M particle-steps/s"
UNIT = "ns/fluid particle"
# Pictures a second of an environment, frames a second of the window, and how long one waits there
# for the numbers of a particle that was picked [ms].
PICTURES, FRAMES, WAIT = 150.0, 60.0, 50.0
PIXELS = (640, 480)


class ThroughputPlan(NamedTuple):
    """Sizes in fluid particles, repetitions, and how many fluids at once.

    reference: the size that others are compared with; work: particle-steps of one timed call;
    pictures: of each kind that are painted.
    """

    sizes: tuple[int, ...] = (1000, 5000, 20_000, 100_000)
    rounds: int = 15
    peer_rounds: int = 3
    batch: int = 64
    batch_size: int = 500
    reference: int = 5000
    work: int = 400_000
    pictures: int = 300
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
    found.append(("pictures", partial(pictures, plan)))
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
        named[f"kernel {kernel}"] = replace(scene, fluid=replace(scene.fluid, kernel=kernel))
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


# --- Phases ---------------------------------------------------------------------------------

# Each is repeated within one compiled call, since a call from Python takes as long as a phase of a
# small fluid. Every phase leaves what the next one needs, as it does within a step.


@jit
def sort(world, model, standstill, repeats):
    """Sort particles into the order of their cells."""
    cells = world.cells
    for _ in range(repeats):
        sort_into_cells(0, 1, world.team, world.spare, cells.fluid, world.sorting, cells.start)


@jit
def wall_density(world, model, standstill, repeats):
    """Compute density and pressure of wall particles."""
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        compute_wall_density(world.cells.walls, 0, 1, world.cells, model, grid)


@jit
def fluid_density(world, model, standstill, repeats):
    """Compute neighbour lists, density and pressure of the fluid."""
    n = world.cells.fluid.id.size
    for _ in range(repeats):
        grid = read_grid(world.sorting.frame)
        compute_fluid_density(0, 1, 0, n, world.cells, model, grid, standstill)


@jit
def force(world, model, standstill, repeats):
    """Integrate by a time step `standstill`, which is 0 in the precision of the particles."""
    n = world.cells.fluid.id.size
    for _ in range(repeats):
        move(model.integrator, 0, 0, n, world.cells, world.spare, model, 0.0, standstill)


# In the order of a step.
PHASES = {
    "sort": sort,
    "wall density": wall_density,
    "lists, fluid density": fluid_density,
    "force, integration": force,
}


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


# --- Pictures -------------------------------------------------------------------------------


def pictures(plan: ThroughputPlan) -> Iterator[Row]:
    """Yield times of pictures of an environment, and of frames of the window, without a screen.

    The clock is the processor time of this thread, since a window waits between frames.
    """
    clock, rounds = own_clock(), plan.pictures
    sim = Simulation(dam_break(min(plan.sizes)), threads=1)
    began = clock()
    painter = Painter(sim.scene, PIXELS)
    painter.paint(sim)
    first = clock() - began
    times = [clocked(lambda: painter.paint(sim), clock) for _ in range(rounds)]
    size = f"{sim.n_fluid} fluid particles"
    yield Row("first picture", size, 1e3 * first, "ms")
    rate = rounds / (first + sum(times))
    yield Row("pictures, the first one included", size, rate, "1/s", PICTURES, at_least=True)
    # a study opens no window on the screen
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    sim = Simulation(dam_break(plan.reference), threads=1)
    size, window = f"{sim.n_fluid} fluid particles", Window(sim.scene)
    free = _frame_time(window, sim, rounds)
    window.picked = 0
    picked = _frame_time(window, sim, rounds)
    window.close()
    yield Row("frames of the window", size, 1 / free, "1/s", FRAMES, at_least=True)
    yield Row("frame with the numbers of a picked particle", size, 1e3 * picked, "ms", WAIT)


def _frame_time(window: Window, sim: Simulation, rounds: int) -> float:
    """Return the median time that a frame of the window takes [s]."""
    clock, times = own_clock(), []
    for _ in range(rounds):
        sim.advance(sim.controls.dt)
        times.append(clocked(lambda: window.show(sim), clock))
    return float(np.median(times))


# --- Plot -----------------------------------------------------------------------------------

# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; markers, filled or not, and
# line styles do the same in grey. Precision is colour and marker, threads are the line.
STYLES = {
    "float64": {"color": "#0072B2", "marker": "o"},
    "float32": {"color": "#D55E00", "marker": "s"},
}
# Line style and label by quantity and threads.
KINDS = {
    ("throughput", "1 thread"): ("-", "1 thread"),
    ("throughput", "2 threads"): ("--", "2 threads"),
    (f"throughput of {NAME}", "1 thread"): (":", f"{NAME}, 1 thread"),
}


def curve(rows: Sequence[Row], quantity: str, ending: str) -> list[tuple[int, float]]:
    """Return particles and speed of the rows of a quantity whose case has an ending."""
    return [
        (int(row.case.removesuffix(ending)), row.value)
        for row in rows
        if row.quantity == quantity and row.case.endswith(ending)
    ]


def finish(rows: Sequence[Row], path: Path) -> None:
    """Draw the throughput over the number of particles.

    Raises ImportError that names the extra to install.
    """
    figure = new_figure(8, 5)
    from matplotlib.ticker import NullLocator, StrMethodFormatter

    axes, sizes = figure.add_subplot(), set[int]()
    for ((quantity, threads), (line, label)), dtype in product(KINDS.items(), STYLES):
        points = curve(rows, quantity, f", {dtype}, {threads}")
        if points:
            look = STYLES[dtype] | {"label": f"{dtype}, {label}"}
            face = look["color"] if line == "-" else "white"
            axes.plot(*zip(*points, strict=True), line, mfc=face, **look)
            sizes |= {n for n, _ in points}
    axes.set_xscale("log")
    axes.set_xticks(sorted(sizes))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_ylim(bottom=0)
    axes.set(xlabel="fluid particles", ylabel="throughput [million particle-steps/s]")
    axes.set_title("Dam break with about 20 neighbours, fluid and wall particles counted")
    axes.grid(alpha=0.3)
    if sizes:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    print(f"plot: {save(figure, path)}")
