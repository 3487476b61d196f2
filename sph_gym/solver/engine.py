"""`Engine`: the arrays of a running simulation, and the compiled calls that work on them."""

from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import diagnostics, stepping, teams
from sph_gym.solver.integrators import INTEGRATORS, TWO_HALVES
from sph_gym.solver.model import Steered, make_model, steered, with_steered
from sph_gym.solver.neighbors import make_lists, make_sorting
from sph_gym.solver.records import Kept
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import (
    Controls,
    Particles,
    allocate_particles,
    column,
    empty_like,
)
from sph_gym.solver.stepping import (
    BAD,
    FRESH,
    FULL,
    N_STATUS,
    STAGE,
    STEPS,
    UNKNOWN,
    UNSORTED,
    Model,
    World,
)
from sph_gym.solver.target import n_lanes

# Other threads aren't worth waking for less: particles of each, and particle-steps of one call.
PARTICLES_PER_THREAD = 256
WORTH_WAKING = 20_000
NO_BOUNDS = np.empty(0, np.int64)
N_SURVEYED = len(diagnostics.Survey._fields)
# First guess of the length of a neighbour list; it grows where that is too short.
ENTRIES_PER_GROUP = 70

# What makes a state, besides what some scenes integrate or keep; all else follows from it.
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
        self._listed_by = 1
        self._pace = teams.Pace()
        self._world_record, self._model_record = Kept(), Kept()
        self._leg, self._dt = np.empty((1, 4)), np.empty(1, dtype)
        self._work: NDArray[Any] | None = None
        self._model = make_model(scene, controls, mass, dtype)
        self._steered = steered(self._model, scene, controls)
        more = (*_kept_rates(scene), *(("offset",) if scene.effects.continuity else ()))
        normals = ("nx", "ny") if scene.effects.surface_tension is not None else ()
        columns = (*more, *normals)
        fluid = allocate_particles(scene.x, scene.v, dtype, columns)  # type: ignore[arg-type]
        self.state_columns = (*STATE, *more)
        walls = _wall_particles(scene, dtype)
        n_walls = 0 if walls is None else walls.id.size
        sorting = make_sorting(n, n_walls, brute, self._most)
        n_cells = sorting.counts.shape[1]
        per_particle = ENTRIES_PER_GROUP / n_lanes(dtype)
        self.world = World(
            fluid=empty_like(fluid),
            spare=fluid,
            start=np.zeros(n_cells + 1, np.int32),
            walls=None if walls is None else empty_like(walls),
            wall_source=walls,
            wall_rest=None if walls is None or not _moving(scene) else _copy(walls),
            moves=None if walls is None or not _moving(scene) else scene.walls.moves,  # type: ignore[union-attr]
            wall_start=None if walls is None else np.zeros(n_cells + 1, np.int32),
            wall_sums=None if walls is None else column(n_walls, dtype),
            source_sums=None if walls is None else self._sum_walls(walls),
            sorting=sorting,
            lists=None if brute else make_lists(n, self._most, per_particle),
            status=np.zeros((self._most, N_STATUS), np.int64),
            team=teams.make_team(),
            totals=np.zeros(9),
            clock=np.zeros(1),
        )
        self._scene = scene
        self._sort_spare(UNKNOWN)
        if scene.effects.continuity:
            self.fluid.offset[:n] = scene.fluid.rho0 - self.fluid.rho[:n]
            self.renew(0.0)

    def _sum_walls(self, walls: Particles) -> NDArray[Any]:
        """What boundary particles that are like fluid add to each other's densities, once for all.

        Walls that move sum anew in every step; those with the fluid's pressure need no sum.
        """
        sums = column(walls.id.size, self.dtype)
        if self._model.extrapolation is None:
            stepping.sum_walls(0, walls, sums, self._model.kernel, self._model.constants)
        return sums

    @property
    def fluid(self) -> Particles:
        """The fluid, in the order of its cells; only the first n entries of a column count."""
        return self.world.fluid

    @property
    def walls(self) -> Particles | None:
        """The wall particles, in the order of their cells."""
        return self.world.walls

    @cached_property
    def kind(self) -> str:
        """What two simulations must share to run the same machine code."""
        return str((self.dtype, _structure(self.world), _structure(self._model)))

    def set_controls(self, controls: Controls) -> None:
        """Go on with another stiffness and XSPH epsilon; pressures follow with `renew`."""
        self._steered = steered(self._model, self._scene, controls)

    @property
    def model(self) -> Model:
        """What the compiled loops take, with the present controls."""
        return self._model_with(self._steered)

    def _model_with(self, numbers: Steered) -> Model:
        return with_steered(self._model, numbers, self.dtype)

    # --- time -------------------------------------------------------------------------------

    def run(self, time: float, dt: float, n_substeps: int) -> tuple[int, int]:
        """Up to n_substeps steps of length dt [s] from `time` [s] on.

        Returns how many were done, the one that failed included, and the place of the particle
        that failed, or -1. Lists that are too short grow, and the call goes on. Ctrl-C is
        delivered when a compiled call is over; `interrupted` then leaves a state to go on from.
        """
        self.call(FRESH, time, dt, n_substeps)
        return self.finish(time, dt, n_substeps)

    def finish(self, time: float, dt: float, n_substeps: int) -> tuple[int, int]:
        """What `run` returns, once a call has been made; goes on if a list was too short."""
        while self.full:
            self._grow()
            self.call(self.stage, time, dt, n_substeps, self.steps)
        return self.steps, self.bad

    def call(self, stale: int, time: float, dt: float, n_substeps: int, done: int = 0) -> None:
        """One compiled call, on as many threads as it is worth; see `stepping.advance`."""
        with teams.borrow(self._worthwhile(n_substeps - done)) as n_threads:
            stale = self.begin(n_threads, stale, done)
            leg = self._leg[0]
            leg[0], leg[1], leg[2], leg[3], self._dt[0] = stale, time, done, n_substeps, dt
            arguments = NO_BOUNDS, *self.records(), self._leg, self._dt
            if self._most == 1:
                stepping.advance(0, 1, *arguments)
                return
            began = perf_counter()
            teams.run(stepping.advance, n_threads, self.world.team, *arguments)
            work = self.n * (n_substeps - done)
            self._pace.note(n_threads, work, perf_counter() - began)

    def begin(self, n_threads: int, stale: int = FRESH, done: int = 0) -> int:
        """Get ready for a call on so many threads; what then isn't up to date.

        Each thread has its own list, so that other shares want other lists.
        """
        before, self._listed_by = self._listed_by, n_threads
        status = self.world.status
        status[:, STEPS], status[:, BAD], status[:, FULL] = done, -1, 0
        if n_threads != before and stale == FRESH:
            self._spare_the_state()
            return UNSORTED
        return stale

    def _worthwhile(self, n_substeps: int) -> int:
        """Number of threads for so many substeps."""
        if n_substeps == 0:
            return self._listed_by
        if self.n * n_substeps < WORTH_WAKING:
            return 1
        return self._pace.choose(self._most)

    @property
    def steps(self) -> int:
        """Steps that the last `run` did."""
        return int(self.world.status[0, STEPS])

    @property
    def bad(self) -> int:
        """Place of the particle that failed in the last call, or -1."""
        return next((place for place in self.world.status[:, BAD].tolist() if place >= 0), -1)

    @property
    def whole(self) -> bool:
        """Whether `fluid` is the state at the end of the last step, even if somebody failed."""
        return self.stage == FRESH

    @property
    def full(self) -> bool:
        """Whether a list was too short, so that `fluid` is not up to date but `spare` is."""
        return any(self.world.status[:, FULL].tolist())

    @property
    def stage(self) -> int:
        """What isn't up to date after a call whose list was too short."""
        return int(self.world.status[0, STAGE])

    def follow_stiffness(self, time: float) -> None:
        """Bring pressures, and what depends on them, up to date with the present controls."""
        if self._model.extrapolation is None and self._model.halves is None:
            stepping.renew_pressures(*self.records())
        else:
            # extrapolated pressures and kept rates follow the whole chain
            self.renew(time)

    def renew(self, time: float) -> None:
        """Bring everything up to date with the present state, walls and controls, at a time [s]."""
        self._spare_the_state()
        self._sort_spare(UNKNOWN, time)

    def _sort_spare(self, stale: int, time: float = 0.0) -> None:
        """Sort the state in `spare` into cells; densities, pressures, lists and sums follow."""
        self.call(stale, time, 1.0, 0)
        while self.full:
            self._grow()
            self.call(self.stage, time, 1.0, 0)

    def _spare_the_state(self) -> None:
        """A copy of the state in `spare`, in whichever order."""
        for name in ("id", *self.state_columns):
            getattr(self.world.spare, name)[:] = getattr(self.world.fluid, name)

    def recover(self, time: float) -> None:
        """After a failed step or an interrupted call: go back to the last whole state."""
        if self.full:
            self._grow()
            self._sort_spare(UNKNOWN, time)
        else:
            self.renew(time)

    def _grow(self) -> None:
        """Neighbour lists of twice the length."""
        lists = self.world.lists
        assert lists is not None
        lists = lists._replace(entries=np.zeros(2 * lists.entries.size, np.int32))
        self.world = self.world._replace(lists=lists)

    def records(self) -> tuple[Any, Any, Any, Any]:
        """Records of world and model (1, n_bytes), and their shapes: what compiled calls take."""
        world = self._world_record.follow(self.world)
        model = self._model_record.follow_numbers(self._steered, self.dtype, self._model_with)
        return world.rows, model.rows, world.shape, model.shape

    # --- measures ---------------------------------------------------------------------------

    def accelerations(self, time: float) -> tuple[NDArray[Any], NDArray[Any]]:
        """ax and ay (n,) [m/s^2] in the order of `fluid`."""
        n = self.n
        ax, ay = column(n, self.dtype), column(n, self.dtype)
        lists = self.world.lists
        stepping.evaluate_acceleration(
            0, self.fluid, self.walls, lists, self.model, float(time), ax, ay
        )
        return ax[:n], ay[:n]

    def nearest_and_count(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """(n,) squared distance [m^2] to the nearest other, and how many are within h."""
        n = self.n
        nearest, count = column(n, self.dtype), column(n, self.dtype)
        h2, constants = self._model.kernel.h2, self._model.constants
        diagnostics.nearest_and_count(
            0, self.fluid, self.walls, self.world.lists, constants, h2, nearest, count
        )
        return nearest[:n].astype(np.float64), count[:n].astype(np.int32)

    def survey(
        self, acceleration: Any, time: float, gravity: Any, com: Any, dx: float
    ) -> tuple[diagnostics.Survey, tuple[NDArray[Any], NDArray[Any]]]:
        """A look at every particle, and what `accelerations` gives.

        acceleration: the latter, or None if that isn't known; gravity: (2,) [m/s^2]; com: (2,)
        centre of mass [m].
        """
        n, stale = self.n, acceleration is None
        ax, ay = (column(n, self.dtype), column(n, self.dtype)) if stale else acceleration
        if self._work is None:
            self._work = np.stack([column(n, self.dtype), column(n, self.dtype)])
        numbers, clumped = np.zeros(N_SURVEYED), diagnostics.CLUMPED * dx
        stepping.examine(
            *self.records(), stale, float(time), ax, ay, gravity, com, clumped, self._work, numbers
        )
        return diagnostics.Survey(*numbers.tolist()), (ax[:n], ay[:n])

    # --- the state --------------------------------------------------------------------------

    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of the columns that make the state, (n,) each."""
        n = self.n
        return {name: getattr(self.fluid, name)[:n].copy() for name in self.state_columns}

    @property
    def clock(self) -> float:
        """Time [s] of the present state; but for rounding that of the simulation."""
        return float(self.world.clock[0])

    def set_state(self, columns: dict[str, NDArray[Any]], clock: float) -> None:
        """Take back what `state` gave when it was that time [s]."""
        for name, values in columns.items():
            getattr(self.world.spare, name)[: len(values)] = values
        self.world.clock[0] = clock
        self._sort_spare(UNSORTED, clock)


def _structure(value: Any) -> Any:
    """The types of nested tuples, as numba sees them."""
    if isinstance(value, tuple):
        return type(value).__name__, *map(_structure, value)
    return type(value).__name__


def _kept_rates(scene: Scene) -> tuple[str, ...]:
    """The columns of rates that the scene's integrator goes on from."""
    if not isinstance(INTEGRATORS[scene.integrator], TWO_HALVES):
        return ()
    drifts = scene.effects.xsph or scene.effects.shifting is not None
    return (
        "ax",
        "ay",
        *(("tx", "ty") if drifts else ()),
        *(("growth",) if scene.effects.density_diffusion is not None else ()),
    )


def _moving(scene: Scene) -> bool:
    return scene.walls is not None and scene.walls.motion is not None


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
