"""Where a tunable scene stays stable: runs with constant controls on a grid of all three."""

import itertools
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sph_gym.env import instances
from sph_gym.solver import stepping, teams
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls
from sph_gym.studies.results import Results, as_record
from sph_gym.studies.stability.limits import STEP, as_limit, known_limit
from sph_gym.studies.table import Row

# Mean compression that a run is judged by, as the environments do.
TOLERANCE = 0.01
# Spurious energy, as a share of what is at stake, beyond which a run counts as blown up; it is
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
    """The runs of a scene, and what they lead to.

    points: [epsilon][sound speed][dt]; limits: (n_xsph, n_sound) largest stable steps [s], nan
    where none is; own: the scene as it comes.
    """

    scene: Scene
    grid: MapGrid
    points: list[list[list[MapPoint]]]
    limits: Any
    own: MapPoint

    def values(self, field: str) -> Any:
        """Return a field of the points, (n_xsph, n_sound, n_dt)."""
        return np.array([[[getattr(p, field) for p in row] for row in one] for one in self.points])

    @property
    def steps(self) -> Any:
        """(n_dt,) time steps [s]."""
        return np.array(self.grid.dt) * unit(self.scene)

    def rules(self) -> dict[str, Any]:
        """Return the article's limits, (n_sound,) [s] each, inf where there is none.

        The force is that of the finest stable runs.
        """
        scene, c = self.scene, np.array(self.grid.sound) * self.scene.fluid.c0
        finest, cause = (self.values(name)[..., 0] for name in ("acceleration", "cause"))
        a, nu = np.where(cause == "", finest, 0.0).max(axis=0), scene.effects.laminar_viscosity
        with np.errstate(divide="ignore"):
            force = stepping.FORCE * np.sqrt(scene.h / a)
        viscous = scene.viscous_share * scene.h**2 / nu if nu else math.inf
        cfl = stepping.COURANT * scene.h / c
        return {"CFL": cfl, "force": force, "viscous": np.full(len(c), viscous)}


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
        found = results.get(key, compute, as_record(MapPoint))
        look()
        return found

    # compiled loops let go of the interpreter; the first run compiles
    play(grid.dt[-1], grid.sound[0], grid.xsph[0])
    columns = itertools.product(grid.xsph, grid.sound)
    with ThreadPoolExecutor(teams.most_threads()) as pool:
        found = list(pool.map(lambda column: _column(grid.dt, play, *column), columns))
    n = len(grid.sound)
    points = [[column for column, _ in found[k : k + n]] for k in range(0, len(found), n)]
    limits = unit(scene) * np.array([limit for _, limit in found]).reshape(-1, n)
    usual = Simulation(scene, threads=1)
    sound = usual.sound_speed / scene.fluid.c0
    own = play(usual.controls.dt / unit(scene), sound, usual.controls.xsph)
    return StabilityMap(scene, grid, points, limits, own)


def _column(
    steps: tuple[float, ...], play: Play, xsph: float, sound: float
) -> tuple[list[MapPoint], float]:
    """Return the points of an epsilon and a sound speed, and the largest stable step [unit]."""
    points = [play(dt, sound, xsph) for dt in steps]
    bad = next((k for k, point in enumerate(points) if point.cause), len(points))
    low = steps[bad - 1] if bad > 0 else math.nan
    if 0 < bad < len(points):
        high = steps[bad]
        for _ in range(HALVINGS):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if play(middle, sound, xsph).cause else (middle, high)
    return points, low


def n_runs(grid: MapGrid) -> int:
    """Return the most runs that a scene takes."""
    columns = len(grid.xsph) * len(grid.sound)
    # before them one that compiles, after them the scene as it comes
    return columns * (len(grid.dt) + HALVINGS) + 2


def rows(name: str, found: StabilityMap) -> Iterator[Row]:
    """Yield the measured limits as multiples of the article's rule: at least 1 where it holds."""
    grid = found.grid
    multiples = found.limits / np.min([*found.rules().values()], axis=0)
    for (i, xsph), (j, sound) in itertools.product(enumerate(grid.xsph), enumerate(grid.sound)):
        case = f"{name}, c = {sound:.2g} c0, epsilon = {xsph:g}"
        row = Row(STEP, case, float(multiples[i, j]), "", 1.0, at_least=True)
        known = known_limit(name, f"{sound:.2g}", STEP)
        yield row if known is None or row.holds else as_limit(row, known)
    causes = found.values("cause")
    blown, silent, of = (causes != "").sum(), (causes == UNREPORTED).sum(), f"of {causes.size}"
    yield Row("runs that blew up", name, float(blown), of)
    yield Row(SILENT, name, float(silent), of, 0.0)
    # that of the column nearest to its stiffness and epsilon
    sim = Simulation(found.scene, threads=1)
    own = sim.controls.xsph, sim.sound_speed / found.scene.fluid.c0
    nearest = (
        int(np.abs(np.array(values) - value).argmin())
        for values, value in zip((grid.xsph, grid.sound), own, strict=True)
    )
    limit = float(found.limits[tuple(nearest)])
    yield Row("nominal step / limit", name, sim.controls.dt / limit, "", 1.0)
