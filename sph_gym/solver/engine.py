"""`Engine`: the arrays of a running simulation, and the compiled calls that work on them."""

from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import boundary, diagnostics, hydrostatics, stepping, teams
from sph_gym.solver.diagnostics import FORCES, NEIGHBORS, Request
from sph_gym.solver.integrators import INTEGRATORS, KEEPING_RATES
from sph_gym.solver.model import DT, control_row, make_model
from sph_gym.solver.neighbors import Lists, make_lists, make_sorting
from sph_gym.solver.records import Record
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import (
    Controls,
    Particles,
    allocate_particles,
    column,
    empty_like,
    state_like,
)
from sph_gym.solver.stepping import (
    BAD,
    FRESH,
    FULL,
    N_STATUS,
    STEPS,
    UNKNOWN,
    UNPRESSED,
    UNSORTED,
    WHOLE,
    Cells,
    WallSource,
    World,
)
from sph_gym.solver.target import n_lanes
from sph_gym.solver.thickness import close_pairs

# Least work that other threads are woken for: particles of each, and particle-steps of one call.
PARTICLES_PER_THREAD = 256
WORTH_WAKING = 20_000
NO_BOUNDS = np.empty(0, np.int64)
# STEPS, BAD, FULL and WHOLE before a call; the other columns stay from the last one.
NOT_RUN = np.array([0, -1, 0, 0])
N_SURVEYED = len(diagnostics.Survey._fields)
# First guess of the length of a neighbour list; it grows where that is too short.
ENTRIES_PER_GROUP = 70

# Columns of every state; some scenes have more. All else follows from them.
STATE = ("x", "y", "u", "v", "id")


class Engine:
    """A scene's particles in the order of their cells, with fresh densities between two calls.

    n: fluid particles; threads: the most that a call may use; where it is small, fewer are, with
    the same result.
    """

    def __init__(
        self, scene: Scene, controls: Controls, mass: float, dtype: Any, brute: bool, threads: int
    ) -> None:
        self.n = n = len(scene.x)  # type: ignore[arg-type]
        self.dtype, self._most = dtype, max(min(threads, n // PARTICLES_PER_THREAD), 1)
        self._listed_by, self._began = 1, (UNKNOWN, 0.0)
        self._pace = teams.Pace()
        self._world_record, self._model_record = Record(), Record()
        self._chunk = np.empty((1, 3))
        self._columns: NDArray[Any] | None = None
        self.model = make_model(scene, mass, dtype, brute)
        self._scene = scene
        self.set_controls(controls)
        more = (*_rate_columns(scene), *(("offset",) if scene.effects.continuity else ()))
        normals = ("nx", "ny") if scene.effects.surface_tension is not None else ()
        columns = (*more, *normals)
        fluid = allocate_particles(scene.x, scene.v, dtype, columns)  # type: ignore[arg-type]
        self.state_columns = (*STATE, *more)
        walls = _wall_particles(scene, dtype)
        n_walls = 0 if walls is None else walls.id.size
        sorting = make_sorting(n, n_walls, brute, self._most)
        n_cells = sorting.counts.shape[1]
        per_group = n + n_walls if brute else ENTRIES_PER_GROUP
        self.world = World(
            cells=Cells(
                fluid=empty_like(fluid),
                start=np.zeros(n_cells + 1, np.int32),
                walls=None if walls is None else empty_like(walls),
                wall_start=None if walls is None else np.zeros(n_cells + 1, np.int32),
                wall_sums=None if walls is None else column(n_walls, dtype),
                lists=make_lists(n, self._most, per_group / n_lanes(dtype)),
            ),
            spare=fluid,
            backup=state_like(fluid),
            walls=self._wall_source(walls),
            sorting=sorting,
            status=np.zeros((self._most, N_STATUS), np.int64),
            team=teams.make_team(),
            totals=np.zeros(9),
            clock=np.zeros(1),
        )
        self._sort_spare(UNKNOWN)
        if scene.effects.continuity:
            rho = np.full(n, scene.fluid.rho0)
            if scene.hydrostatic:
                rho = hydrostatics.densities(scene, controls.stiffness)
            self.fluid.offset[:n] = rho[self.fluid.id] - self.fluid.rho[:n]
            self.renew(0.0)

    def _wall_source(self, walls: Particles | None) -> WallSource:
        """Return boundary particles with what is known of them beforehand.

        Those that are like fluid sum their densities over each other once; walls that move do it
        anew in every step; those with the fluid's pressure need no sum.
        """
        if walls is None:
            return WallSource(None, None, None, None)
        sums = column(walls.id.size, self.dtype)
        if self.model.extrapolation is None:
            everyone = Lists(np.arange(walls.id.size, dtype=np.int32), np.zeros(0, np.int64))
            boundary.sum_walls(walls, everyone, sums, self.model)
        scene_walls = self._scene.walls
        if scene_walls is None or scene_walls.motion is None:
            return WallSource(walls, None, None, sums)
        return WallSource(walls, _copy(walls), scene_walls.moves, sums)

    @property
    def fluid(self) -> Particles:
        """The fluid, in the order of its cells; only the first n entries of a column count."""
        return self.world.cells.fluid

    @property
    def walls(self) -> Particles | None:
        """The wall particles, in the order of their cells."""
        return self.world.cells.walls

    @cached_property
    def kind(self) -> str:
        """A text that is the same for simulations that run the same machine code."""
        return str((self.dtype, _structure(self.world), _structure(self.model)))

    def set_controls(self, controls: Controls) -> None:
        """Go on with other controls; pressures follow with `follow_stiffness`."""
        self.controls = control_row(self._scene, self.model, controls)[None]

    # --- time -------------------------------------------------------------------------------

    def run(self, time: float, dt: float, n_substeps: int) -> tuple[int, int]:
        """Run a chunk: up to n_substeps steps of length dt [s] from `time` [s] on.

        Return how many were done, the one that failed included, and the place of the particle
        that failed, or -1. Where a list was too short, it grows, and the chunk is repeated. Ctrl-C
        is delivered when a compiled call is over; `recover` then leaves a state to go on from.
        """
        self.call(FRESH, time, dt, n_substeps)
        return self.finish(time, dt, n_substeps)

    def finish(self, time: float, dt: float, n_substeps: int) -> tuple[int, int]:
        """Return what `run` returns, once a call was made; repeat it if a list was too short."""
        status = self.world.status.tolist()
        while any(row[FULL] for row in status):
            self.call(self._rewind(), time, dt, n_substeps)
            status = self.world.status.tolist()
        return status[0][STEPS], next((row[BAD] for row in status if row[BAD] >= 0), -1)

    def call(self, stale: int, time: float, dt: float, n_substeps: int) -> None:
        """Make one compiled call, on as many threads as it is worth; see `stepping.advance`."""
        with teams.borrow(self._worthwhile(n_substeps)) as n_threads:
            self._chunk[0] = self.begin(n_threads, stale), time, n_substeps
            self.controls[0, DT] = dt
            arguments = NO_BOUNDS, *self.records(), self._chunk, self.controls
            if self._most == 1:
                stepping.advance(0, 1, *arguments)
                return
            began = perf_counter()
            teams.run(stepping.advance, n_threads, self.world.team, *arguments)
            self._pace.note(n_threads, self.n * n_substeps, perf_counter() - began)

    def begin(self, n_threads: int, stale: int = FRESH) -> int:
        """Get ready for a call on so many threads. Return what is not up to date then.

        Each thread has its own list, so that other shares want other lists.
        """
        before, self._listed_by = self._listed_by, n_threads
        self.world.status[:, : len(NOT_RUN)] = NOT_RUN
        if n_threads != before and stale == FRESH:
            self._spare_the_state(self.fluid)
            stale = UNSORTED
        self._began = stale, self.clock
        return stale

    def _rewind(self) -> int:
        """Go back to where a call with too short a list began. Return what is not up to date."""
        cells = self.world.cells
        entries = np.zeros(2 * cells.lists.entries.size, np.int32)
        cells = cells._replace(lists=cells.lists._replace(entries=entries))
        self.world = self.world._replace(cells=cells)
        self._spare_the_state(self.world.backup)
        stale, self.world.clock[0] = self._began
        return UNSORTED if stale == FRESH else stale

    def _worthwhile(self, n_substeps: int) -> int:
        """Return the number of threads for so many substeps."""
        if n_substeps == 0:
            return self._listed_by
        if self.n * n_substeps < WORTH_WAKING:
            return 1
        return self._pace.choose(self._most)

    @property
    def steps(self) -> int:
        """Steps that the last `run` did."""
        return 0 if self.full else int(self.world.status[0, STEPS])

    @property
    def bad(self) -> int:
        """Place of the particle that failed in the last call, or -1."""
        return next((place for place in self.world.status[:, BAD].tolist() if place >= 0), -1)

    @property
    def whole(self) -> bool:
        """True if `fluid` is the state at the end of the last step, even after a failure."""
        return bool(self.world.status[0, WHOLE])

    @property
    def full(self) -> bool:
        """True if a list was too short, so that `fluid` is not up to date but `backup` is."""
        return any(self.world.status[:, FULL].tolist())

    def follow_stiffness(self, time: float) -> None:
        """Bring pressures, and all that depends on them, up to date with the present controls."""
        if self.model.extrapolation is None and "ax" not in self.state_columns:
            self._chunk[0] = UNPRESSED, time, 0
            stepping.advance(0, 1, NO_BOUNDS, *self.records(), self._chunk, self.controls)
        else:
            # extrapolated pressures and rates follow the whole chain
            self.renew(time)

    def renew(self, time: float) -> None:
        """Bring everything up to date with the present state, walls and controls, at a time [s]."""
        self._spare_the_state(self.fluid)
        self._sort_spare(UNKNOWN, time)

    def _sort_spare(self, stale: int, time: float = 0.0) -> None:
        """Sort the state in `spare` into cells; densities, pressures, lists and sums follow."""
        self.call(stale, time, 1.0, 0)
        while self.full:
            self.call(self._rewind(), time, 1.0, 0)

    def _spare_the_state(self, source: Particles) -> None:
        """Copy a state to `spare`, in whichever order."""
        for name in ("id", *self.state_columns):
            getattr(self.world.spare, name)[:] = getattr(source, name)

    def recover(self, time: float) -> None:
        """Go back to the last whole state, after a failed step or an interrupted call."""
        if self.full:
            self._rewind()
        elif self._began[0] == FRESH or self.whole or self.bad >= 0 or self.steps > 0:
            self._spare_the_state(self.fluid)
        # else the call never ran, and the state still waits in `spare`
        self._sort_spare(UNKNOWN, time)

    def records(self) -> tuple[Any, Any, Any, Any]:
        """Return the records of world and model (1, n_bytes), and their shapes."""
        world, model = self._world_record.follow(self.world), self._model_record.follow(self.model)
        return world.rows, model.rows, world.shape, model.shape

    # --- measures ---------------------------------------------------------------------------

    def accelerations(self, time: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return ax and ay (n,) [m/s^2] in the order of `fluid`, good until the next call."""
        self._examine(True, Request(FORCES, time))
        return self.known_accelerations()

    def known_accelerations(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the accelerations of the last look that evaluated them."""
        return self._column(0), self._column(1)

    def nearest_and_count(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return (n,) squared distances [m^2] to the nearest other, and how many are within h."""
        self._examine(False, Request(NEIGHBORS, 0.0))
        return self._column(2).astype(np.float64), self._column(3).astype(np.int32)

    def survey(self, stale: bool, request: Request) -> diagnostics.Survey:
        """Return measures that take a look at every particle; `accelerations` first if `stale`."""
        return diagnostics.Survey(*self._examine(stale, request).tolist())

    def _examine(self, stale: bool, request: Request) -> NDArray[np.float64]:
        if self._columns is None:
            self._columns = np.stack([column(self.n, self.dtype) for _ in range(6)])
        numbers = np.zeros(N_SURVEYED)
        stepping.examine(
            *self.records(), self.controls, stale, np.array(request), self._columns, numbers
        )
        return numbers

    def count_walled(self) -> int:
        """Return the number of fluid particles that touch boundary particles, at least 1."""
        walls, near = self.world.walls.particles, 0.55 * self._scene.dx
        assert walls is not None
        n_walls, n = walls.id.size, self.n
        x = np.stack([self.fluid.x[:n], self.fluid.y[:n]], axis=-1).astype(np.float64)
        others = np.stack([walls.x[:n_walls], walls.y[:n_walls]], axis=-1).astype(np.float64)
        return max(len({k for i, _, _ in close_pairs(x, others, near) for k in i.tolist()}), 1)

    def _column(self, k: int) -> NDArray[Any]:
        assert self._columns is not None
        return self._columns[k, : self.n]

    # --- the state --------------------------------------------------------------------------

    def state(self) -> dict[str, NDArray[Any]]:
        """Return copies of the columns that make the state, (n,) each."""
        n = self.n
        return {name: getattr(self.fluid, name)[:n].copy() for name in self.state_columns}

    @property
    def clock(self) -> float:
        """Time [s] of the present state; but for rounding that of the simulation."""
        return float(self.world.clock[0])

    def set_state(self, columns: dict[str, NDArray[Any]], clock: float) -> None:
        """Take back the columns that `state` gave, and the time [s] of that moment."""
        for name, values in columns.items():
            getattr(self.world.spare, name)[: len(values)] = values
        self.world.clock[0] = clock
        self._sort_spare(UNSORTED, clock)


def _structure(value: Any) -> Any:
    """Return the types of nested tuples, as numba sees them."""
    if isinstance(value, tuple):
        return type(value).__name__, *map(_structure, value)
    return type(value).__name__


def _rate_columns(scene: Scene) -> tuple[str, ...]:
    """Return the columns of rates that a step of the scene's integrator sets out from."""
    if not isinstance(INTEGRATORS[scene.integrator], KEEPING_RATES):
        return ()
    drifts = scene.effects.xsph or scene.effects.shifting is not None
    return (
        "ax",
        "ay",
        *(("tx", "ty") if drifts else ()),
        *(("growth",) if scene.effects.density_diffusion is not None else ()),
    )


def _wall_particles(scene: Scene, dtype: Any) -> Particles | None:
    """The scene's boundary particles in public order."""
    walls = scene.walls
    if walls is None or walls.particles is None:
        return None
    mirrors = walls.pressure == "extrapolated" and walls.slip == "no-slip"
    more = [*(("ghost_u", "ghost_v") if mirrors else ()), *(("ax", "ay") if walls.motion else ())]
    return allocate_particles(np.asarray(walls.particles), walls.velocities, dtype, more)


def _copy(particles: Particles) -> Particles:
    present = {name: array for name, array in particles._asdict().items() if array is not None}
    return particles._replace(**{name: array.copy() for name, array in present.items()})
