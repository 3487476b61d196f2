"""Runs and evaluations that must agree: any number of threads, grid and brute force."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from sph_gym.solver import engine, teams
from sph_gym.solver.origin import moved, origin
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Report, Simulation
from sph_gym.solver.walls import Walls

FIELDS = ("x", "v", "rho", "p", "a")
LENGTHS = ("com_x", "com_y", "extent_x", "extent_y")
# Particles of a large flow that are compared with brute force.
SAMPLE = 20

Advance = Callable[[Simulation], Report]
# Makes a simulation of the run that is compared, with so many `threads` or by `neighbors`.
MakeTwin = Callable[..., Simulation]


def greatest(values: Sequence[float]) -> float:
    """Return the largest value, or nan if any is: Python's max passes over most of them."""
    return float(np.max(np.asarray(values, np.float64)))


@contextmanager
def eager_threads() -> Iterator[None]:
    """Share even the smallest fluid and the shortest call among all threads.

    The solver shares only what is worth it; its results must not depend on that.
    """
    limits = engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING
    choose: Any = teams.Pace.choose
    engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING = 1, 1
    teams.Pace.choose = lambda self, most: most  # type: ignore[method-assign]
    try:
        yield
    finally:
        engine.PARTICLES_PER_THREAD, engine.WORTH_WAKING = limits
        teams.Pace.choose = choose  # type: ignore[method-assign]


def threads_differ(twin: MakeTwin, advance: Advance, frames: int) -> int:
    """Return how many fields, reports included, differ by any bit between one and two threads."""
    with eager_threads():
        single, double = (twin(threads=n) for n in (1, 2))
        reports = [[advance(sim) for _ in range(frames)] for sim in (single, double)]
    wrong = sum(
        getattr(single, field).tobytes() != getattr(double, field).tobytes() for field in FIELDS
    )
    return wrong + (reports[0] != reports[1])


def grid_gap(sim: Simulation) -> float:
    """Return the largest difference of rho, p and a between grid and brute force.

    It is a multiple of the largest magnitude of each field, and of pressure and acceleration at
    least of those of a flow at Mach 0.1: at rest, both are small differences of densities.
    """
    brute = Simulation(sim.scene, sim.dtype, "brute", threads=1)
    brute.restore(sim.snapshot())
    return _field_gap(sim, slice(sim.n_particles), brute, slice(sim.n_particles))


def sample_gap(sim: Simulation) -> float:
    """Return `grid_gap` of random particles, each against brute force on all within 2 h of it.

    The densities of its neighbours, which its acceleration depends on, need no more. Boundary
    particles must be at rest.
    """
    sim.evaluate()
    rng = np.random.default_rng(0)
    chosen = rng.choice(sim.n_fluid, min(SAMPLE, sim.n_fluid), replace=False)
    scene, x = _from_origin(sim)
    return greatest([_patch_gap(sim, scene, x, int(i)) for i in chosen])


def _from_origin(sim: Simulation) -> tuple[Scene, Any]:
    """Return the scene and the positions (n, 2) [m], counted from where the solver counts.

    Counted from afar, single precision would have no digits for the distances within a patch.
    """
    start, fluid = origin(sim.scene, sim.x.dtype), sim.snapshot()["fluid"]
    scene = moved(sim.scene, -start)
    x = np.stack([fluid["x"], fluid["y"]], axis=-1)[np.argsort(fluid["id"])]
    if scene.walls is not None and scene.walls.particles is not None:
        x = np.concatenate([x, np.asarray(scene.walls.particles).astype(x.dtype)])
    return scene, x.astype(np.float64)


def _patch_gap(sim: Simulation, scene: Scene, x: Any, i: int) -> float:
    n, v = sim.n_fluid, sim.v.astype(np.float64)
    near = np.hypot(*(x - x[i]).T) < 2.001 * scene.h
    fluid, wall = near[:n], x[n:][near[n:]]
    walls = Walls(wall) if len(wall) else None
    # a flow may come nearer to walls than a start may: it begins above them, and is put there
    above = x[:n][fluid] + (0.0, 10 * scene.h)
    patch = dataclasses.replace(scene, x=above, v=v[:n][fluid], walls=walls)
    brute = Simulation(patch, sim.dtype, "brute", threads=1)
    state = brute.snapshot()
    place = (x[:n][fluid] - origin(patch, brute.x.dtype))[state["fluid"]["id"]]
    for name, values in zip("xy", place.T, strict=True):
        state["fluid"][name][:] = values
    brute.restore(state)
    brute.controls = sim.controls
    return _field_gap(sim, i, brute, int(fluid[:i].sum()))


def _field_gap(sim: Simulation, here: Any, brute: Simulation, there: Any) -> float:
    dynamic = (0.1 * sim.sound_speed) ** 2
    # what the largest rho [kg/m^3], p [Pa] and a [m/s^2] count as, at least
    least = {"rho": 0.0, "p": sim.scene.fluid.rho0 * dynamic, "a": dynamic / sim.scene.h}
    gaps = []
    for field, floor in least.items():
        one, other = (getattr(each, field).astype(np.float64) for each in (sim, brute))
        largest = max(float(np.abs(other).max()), floor)
        gaps.append(float(np.abs(one[here] - other[there]).max()) / largest)
    return greatest(gaps)


def run_gap(twin: MakeTwin, advance: Advance, frames: int) -> float:
    """Return how far apart runs on grid and brute force are after some frames.

    Centre of mass and extents in dx, kinetic energy as a share of the larger one and of that of
    Mach 0.01; the largest difference counts.
    """
    ends = []
    for neighbors in ("grid", "brute"):
        sim = twin(neighbors=neighbors)
        for _ in range(frames):
            if advance(sim).diverged:
                break
        ends.append(sim.diagnostics())
    return _observable_gap(sim.scene, ends)


def displaced_gap(sim: Simulation, other: Simulation) -> float:
    """Return `run_gap` of two simulations, each seen from the middle of where it began."""
    ends = []
    for each in (sim, other):
        numbers, middle = each.diagnostics(), np.asarray(each.scene.x).mean(axis=0)
        shift = {"com_x": numbers["com_x"] - middle[0], "com_y": numbers["com_y"] - middle[1]}
        ends.append(numbers | shift)
    return _observable_gap(sim.scene, ends)


def _observable_gap(scene: Scene, ends: Sequence[dict[str, float]]) -> float:
    one, other = ends
    lengths = [abs(one[name] - other[name]) / scene.dx for name in LENGTHS]
    least = 0.5 * 1e-4 * scene.fluid.c0**2 * scene.fluid.rho0 * scene.dx**2
    energies = [each["kinetic_energy"] for each in ends]
    gap = abs(energies[0] - energies[1]) / max(*energies, least)
    return greatest([gap, *lengths])
