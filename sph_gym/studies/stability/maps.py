"""Where a tunable scene stays stable: runs with constant controls on a grid of all three."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sph_gym.env import instances
from sph_gym.solver import stepping, teams
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.studies.results import Results, is_record
from sph_gym.studies.table import Row

# Mean compression that a run is judged by, as the environments do.
TOLERANCE = 0.01
# Energy from nowhere, as a share of what is at stake, beyond which a run counts as blown up; it is
# followed to its end, and for so many frames at least, and if the solver never reports it, that is
# given as its cause.
EXCESS, FOLLOWED, UNREPORTED = 0.5, 20, "unreported"
SILENT = "runs that failed in silence"
# How finely the limit of a column is found: this often the ratio of two steps is halved.
HALVINGS = 3


class MapGrid(NamedTuple):
    """Steps in multiples of 0.4 h / c0, sound speeds in multiples of c0, epsilons.

    share: of the scene's duration that is run.
    """

    dt: tuple[float, ...] = tuple(np.geomspace(0.25, 16.0, 10).tolist())
    sound: tuple[float, ...] = tuple(np.geomspace(0.1, 1.6, 7).tolist())
    xsph: tuple[float, ...] = (0.0, 0.3, 0.6)
    share: float = 1.0


FULL = MapGrid()
QUICK = MapGrid((0.5, 2.0, 8.0), (0.2, 1.0), (0.3,), 0.1)


class MapPoint(NamedTuple):
    """Numbers of a run with constant controls.

    cause: of its blow-up, `UNREPORTED` if the solver never reported it, or "" if there was none;
    density: mean over time of the mean compression; substeps: taken until the end or the blow-up;
    acceleration: the largest [m/s^2]; pairs: in all substeps taken, the mean over the particles
    of the neighbours that each had to do with.
    """

    cause: str
    density: float
    substeps: int
    acceleration: float
    pairs: float


class StabilityMap(NamedTuple):
    """The runs of a scene by index of epsilon, sound speed and dt, and what they lead to.

    limits: (n_xsph, n_sound) largest stable steps [s]; nan where none is. acceleration: (n_sound,)
    largest [m/s^2] of the finest stable run of each sound speed. own: the scene as it comes.
    """

    scene: Scene
    grid: MapGrid
    points: dict[tuple[int, int, int], MapPoint]
    limits: Any
    acceleration: Any
    own: MapPoint

    @property
    def steps(self) -> list[float]:
        """The time steps [s]."""
        return [dt * unit(self.scene) for dt in self.grid.dt]

    def rule(self, k: int) -> dict[str, float]:
        """Return the article's three limits [s] at sound speed number k; inf where none is."""
        scene, a = self.scene, float(self.acceleration[k])
        c, nu = self.grid.sound[k] * scene.fluid.c0, scene.effects.laminar_viscosity
        return {
            "CFL": stepping.COURANT * scene.h / c,
            "force": stepping.FORCE * math.sqrt(scene.h / a) if a > 0 else math.inf,
            "viscous": scene.viscous_share * scene.h**2 / nu if nu else math.inf,
        }


def unit(scene: Scene) -> float:
    """Return the article's acoustic step [s] at the nominal stiffness."""
    return stepping.COURANT * scene.h / scene.fluid.c0


def nominal(name: str) -> Scene:
    """Return the scene of an environment as it is."""
    return instances.instance(name, "nominal", 0).build()


def run(scene: Scene, dt: float, sound: float, xsph: float, share: float) -> MapPoint:
    """Run with dt [s], sound speed `sound` c0 and epsilon over a share of the duration."""
    sim = Simulation(scene, threads=1)
    sim.controls = Controls(dt, scene.fluid.stiffness(sound * scene.fluid.c0), xsph)
    # a frame, but never less than a step, which would be cut
    seconds = max(round(scene.frame / dt), 1) * dt
    end, looks = share * scene.duration, [0.0]
    substeps, pairs, fastest, blown = 0, 0.0, 0.0, False
    while sim.time < end - 1e-9:
        report = sim.advance(seconds)
        numbers = sim.diagnostics()
        substeps += report.n_substeps
        pairs += report.n_substeps * numbers["mean_neighbors"]
        if report.diverged:
            return MapPoint(report.cause, math.nan, substeps, fastest, pairs)
        if not blown and not numbers["energy_excess"] <= EXCESS:
            # nothing to build upon, though the tripwire may have room for more
            blown, end = True, max(end, sim.time + FOLLOWED * seconds)
        looks.append(numbers["density_error"])
        fastest = max(fastest, numbers["max_acceleration"])
    if blown:
        return MapPoint(UNREPORTED, math.nan, substeps, fastest, pairs)
    return MapPoint("", float(np.mean(looks)), substeps, fastest, pairs)


# dt [unit], sound speed [c0], epsilon -> point
Play = Callable[[float, float, float], MapPoint]


def survey(
    name: str, grid: MapGrid, results: Results, look: Callable[[], Any] = lambda: None
) -> StabilityMap:
    """Run a scene with all controls of the grid, on all processors.

    look: called after every run.
    """
    scene = nominal(name)

    def play(dt: float, sound: float, xsph: float) -> MapPoint:
        compute = partial(run, scene, dt * unit(scene), sound, xsph, grid.share)
        key = [name, dt, sound, xsph, grid.share]
        found = results.get(key, compute, is_record(MapPoint))
        look()
        return MapPoint(*found)

    columns = list(itertools.product(range(len(grid.xsph)), range(len(grid.sound))))
    points: dict[tuple[int, int, int], MapPoint] = {}
    limits = np.full((len(grid.xsph), len(grid.sound)), math.nan)
    # compiled loops let go of the interpreter; the first run compiles
    play(grid.dt[-1], grid.sound[0], grid.xsph[0])
    with ThreadPoolExecutor(teams.most_threads()) as pool:
        found = pool.map(lambda column: _column(grid, play, *column), columns)
        for (i, j), (column, limit) in zip(columns, found, strict=True):
            points |= {(i, j, k): point for k, point in enumerate(column)}
            limits[i, j] = limit * unit(scene)
    usual = Simulation(scene, threads=1)
    sound = usual.sound_speed / scene.fluid.c0
    own = play(usual.controls.dt / unit(scene), sound, usual.controls.xsph)
    return StabilityMap(scene, grid, points, limits, _accelerations(grid, points), own)


def _column(grid: MapGrid, play: Play, i: int, j: int) -> tuple[list[MapPoint], float]:
    """Return the points of an epsilon and a sound speed, and the largest stable step [unit]."""
    sound, xsph = grid.sound[j], grid.xsph[i]
    points = [play(dt, sound, xsph) for dt in grid.dt]
    bad = next((k for k, point in enumerate(points) if point.cause), len(points))
    if bad == 0:
        return points, math.nan
    low = grid.dt[bad - 1]
    if bad == len(points):
        return points, low
    high = grid.dt[bad]
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if play(middle, sound, xsph).cause else (middle, high)
    return points, low


def _accelerations(grid: MapGrid, points: dict[tuple[int, int, int], MapPoint]) -> Any:
    largest = np.zeros(len(grid.sound))
    for j in range(len(grid.sound)):
        fine = [points[i, j, 0] for i in range(len(grid.xsph))]
        largest[j] = max((point.acceleration for point in fine if not point.cause), default=0.0)
    return largest


def n_runs(grid: MapGrid) -> int:
    """Return the most runs that a scene takes."""
    columns = len(grid.xsph) * len(grid.sound)
    # before them one that compiles, after them the scene as it comes
    return columns * (len(grid.dt) + HALVINGS) + 2


def rows(name: str, found: StabilityMap) -> Iterator[Row]:
    """Yield the measured limits as multiples of the article's rule: at least 1 where it holds."""
    grid = found.grid
    rules = np.array([min(found.rule(j).values()) for j in range(len(grid.sound))])
    for i, xsph in enumerate(grid.xsph):
        multiples = found.limits[i] / rules
        for j, sound in enumerate(grid.sound):
            case = f"{name}, c = {sound:.2g} c0, epsilon = {xsph:g}"
            yield Row("limit / article's rule", case, float(multiples[j]), "", 1.0, at_least=True)
    causes = [point.cause for point in found.points.values()]
    total, n_blown = len(causes), len(causes) - causes.count("")
    yield Row("runs that blew up", name, float(n_blown), f"of {total}")
    yield Row(SILENT, name, float(causes.count(UNREPORTED)), f"of {total}", 0.0)
    yield Row("nominal step / limit", name, _margin(found), "", 1.0)


def _margin(found: StabilityMap) -> float:
    """Return the scene's own step as a share of the limit nearest to its stiffness and epsilon."""
    grid, scene = found.grid, found.scene
    sim = Simulation(scene, threads=1)
    j = _nearest(grid.sound, sim.sound_speed / scene.fluid.c0)
    i = _nearest(grid.xsph, sim.controls.xsph)
    return sim.controls.dt / float(found.limits[i, j])


def _nearest(values: Sequence[float], wanted: float) -> int:
    return int(np.argmin(np.abs(np.array(values) - wanted)))
