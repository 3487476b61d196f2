"""`Simulation`: a running solver in the hands of a Python user."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import diagnostics, failure, forces, stepping
from sph_gym.solver.checks import known, positive
from sph_gym.solver.model import make_model, particle_mass
from sph_gym.solver.neighbors import make_grid, scratch, sort_into_cells
from sph_gym.solver.scene import Gravity, Scene, check_controls
from sph_gym.solver.state import (
    Controls,
    Indices,
    Particles,
    WallParticles,
    allocate_particles,
    empty_like,
)

DTYPES: dict[str, Any] = {"float64": np.float64, "float32": np.float32}
NEIGHBORS = ("grid", "brute")
# Work of one compiled call [particle-steps]: short enough for Ctrl-C, long enough to cost nothing.
CHUNK = 2_000_000
MAX_SUBSTEPS = 10**12
DEFAULT_XSPH = 0.3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Report:
    """What one `advance` did.

    n_substeps: steps taken (the one that failed included); dt: their length [s]; diverged: x, v,
    rho or p no longer finite, a speed above 5000 m/s, or more energy from nowhere than the
    ledger tolerates (`diagnostics.Ledger`); cause: "" | "cfl" | "stiffness" | "clumping" |
    "tunnelling" | "energy" | "nan"; link: the link of the chain where it first showed, "" |
    "neighbours" | "density" | "pressure" | "force" | "integration" | "walls"; bad_particle: its
    public index, or -1.
    """

    n_substeps: int
    dt: float
    diverged: bool = False
    cause: str = ""
    link: str = ""
    bad_particle: int = -1


class Simulation:
    """A scene in motion.

    dtype: "float64" or "float32", the precision of the particles; neighbors: "grid" or "brute".
    `controls` may be set at any time between two calls. Raises ValueError for unknown names.
    """

    def __init__(self, scene: Scene, dtype: str = "float64", neighbors: str = "grid") -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene: expected a Scene, got {scene!r}")
        self.scene = scene
        self.dtype = known("dtype", dtype, DTYPES)
        self.neighbors = known("neighbors", neighbors, NEIGHBORS)
        self._float = DTYPES[self.dtype]
        self._h2 = self._float(scene.h**2)
        self.mass = particle_mass(scene)
        self.time = 0.0
        self._fluid = allocate_particles(scene.x, scene.v, self._float)  # type: ignore[arg-type]
        self._spare = empty_like(self._fluid)
        self._controls = self._initial_controls()
        self._model = make_model(scene, self._controls, self.mass, self._float)
        self._make_walls()
        self._progress = np.zeros(2, np.int64)
        self._ax, self._ay = np.zeros_like(self._fluid.x), np.zeros_like(self._fluid.x)
        self.last_report = Report(0, self._controls.dt)
        self._evaluate_density()
        self._totals = self._sum()
        self._ledger = diagnostics.Ledger(self._totals, *self._energy_scales())
        self._nominal_dt()

    # --- what it is made of -----------------------------------------------------------------

    def _make_walls(self) -> None:
        self._walls: WallParticles | None = None
        self._wall_source: WallParticles | None = None
        self._wall_start: Indices | None = None
        self._grid: Any = ()
        walls = self.scene.walls
        if walls is not None and walls.particles is not None:
            positions = np.asarray(walls.particles)
            bare = allocate_particles(positions, np.zeros_like(positions), self._float)
            wall_sum = np.zeros_like(bare.x)
            self._wall_source = WallParticles(*bare, wall_sum)
            self._walls = WallParticles(*empty_like(bare), wall_sum)
            self._regrid()
            forces.compute_wall_sums(
                self._walls, self._wall_start, self._grid, self._model.kernel, self._h2
            )

    def _regrid(self) -> None:
        """Lay the grid anew over where the particles are now, and sort the walls into it."""
        grid = None
        if self.neighbors == "grid":
            grid = make_grid(self._fluid, self._wall_source, self.scene.h)
        if grid == self._grid:
            return
        self._grid = grid
        self._start, self._cells = scratch(grid, self._fluid.x.size)
        if self._walls is not None and self._wall_source is not None:
            # always from the same order, so that a restored run sums in the order of the first
            self._wall_start, cells = scratch(grid, self._walls.x.size)
            sort_into_cells(grid, self._wall_source, self._walls, self._wall_start, cells)

    def _initial_controls(self) -> Controls:
        if self.scene.controls is not None:
            return self.scene.controls
        fluid = self.scene.fluid
        return Controls(1.0, fluid.stiffness(fluid.c0), DEFAULT_XSPH)

    def _nominal_dt(self) -> None:
        if self.scene.controls is None:
            self._controls = self._controls._replace(dt=self.stable_dt())
        self.nominal_controls = self._controls

    # --- controls ---------------------------------------------------------------------------

    @property
    def controls(self) -> Controls:
        """dt [s], stiffness [Pa] and xsph of the next `advance`."""
        return self._controls

    @controls.setter
    def controls(self, controls: Controls) -> None:
        before, self._controls = self._controls, check_controls(controls)
        if self._controls[1:] == before[1:]:
            return
        self._model = make_model(self.scene, self._controls, self.mass, self._float)
        if self._controls.stiffness != before.stiffness:
            # densities stay, pressures and the stored energy follow the stiffness
            self._evaluate_density()
            held, self._totals = self._totals, self._sum()
            self._ledger.add_control(self._totals.internal - held.internal)

    @property
    def sound_speed(self) -> float:
        """Sound speed [m/s] at the present stiffness."""
        return self.scene.fluid.sound_speed(self._controls.stiffness)

    @property
    def max_speed(self) -> float:
        """Largest speed of a fluid particle [m/s]."""
        return self._totals.max_speed

    def stable_dt(self) -> float:
        """The article's stable step [s] for the present state; see `stepping.stable_dt`."""
        self.evaluate()
        a_max = float(np.sqrt(np.max(self._ax**2 + self._ay**2)))
        nu = self.scene.effects.laminar_viscosity
        return stepping.stable_dt(self.scene.h, self.sound_speed, a_max, nu)

    # --- time -------------------------------------------------------------------------------

    def advance(self, seconds: float) -> Report:
        """Run for `seconds` of physical time with the present controls.

        dt is snapped down so that a whole number of substeps fits. After a failure the state is
        the last finite one; the report is also kept as `last_report`. Ctrl-C stops between two
        substeps and leaves a state to go on from. Raises ValueError if `seconds` isn't positive
        or would take more than 10^12 substeps.
        """
        self.last_report = self._advance(seconds)
        return self.last_report

    def _advance(self, seconds: float) -> Report:
        positive("seconds", seconds)
        ratio = seconds / self._controls.dt - 1e-9
        if not ratio < MAX_SUBSTEPS:
            raise ValueError(
                f"seconds: {seconds:g} s in steps of {self._controls.dt:g} s are more than "
                f"{MAX_SUBSTEPS:g} substeps"
            )
        n_substeps = max(math.ceil(ratio), 1)
        dt = seconds / n_substeps
        began, done = self.time, 0
        report = Report(0, dt)
        while done < n_substeps and not report.diverged:
            interrupt = self._leg(began + done * dt, dt, n_substeps - done)
            steps, bad = map(int, self._progress)
            done += steps
            report = self._book(Report(done, dt), bad, began + (done - (bad >= 0)) * dt)
            if interrupt is not None:
                self.last_report = report
                raise interrupt
        if not report.diverged:
            self.time = began + seconds
        return report

    def _book(self, report: Report, bad: int, now: float) -> Report:
        """Bring everything up to date after a leg, and look whether it went well."""
        began, self.time = self.time, now
        if bad >= 0:
            self._swap()
            return self._failed(report, bad)
        self._evaluate_density()
        return self._audit(report, began)

    def _leg(self, time: float, dt: float, n_substeps: int) -> KeyboardInterrupt | None:
        """As many of the substeps as one compiled call should take, at most a frame's worth.

        Ctrl-C is delivered when the compiled call is over, so what it did is read from
        `_progress` and the interrupt is handed on.
        """
        longest = max(math.ceil(self.scene.frame / dt), 1)
        self._progress[:] = 0, -1
        try:
            self._regrid()
            stepping.advance(
                self._fluid,
                self._spare,
                self._start,
                self._cells,
                self._walls,
                self._wall_start,
                self._grid,
                self._model,
                time,
                self._float(dt),
                min(n_substeps, longest, max(CHUNK // self.n_particles, 1)),
                self._progress,
            )
        except KeyboardInterrupt as interrupt:
            self._grid = ()  # it may have been half laid
            return interrupt
        return None

    def _swap(self) -> None:
        self._fluid, self._spare = self._spare, self._fluid
        self._stale = True

    def _audit(self, report: Report, began: float) -> Report:
        """Book the energy of this call; more of it than there can be is a blow-up."""
        before, self._totals = self._totals, self._sum()
        effects = self.scene.effects
        moved = np.subtract(self._totals[2:4], before[2:4])
        mean = (effects.gravity_at(began) + effects.gravity_at(self.time)) / 2
        self._ledger.add_gravity(self.mass * self.n_fluid * float(mean @ moved))
        excess = self._ledger.excess(self._totals)
        if np.isfinite(excess) and excess <= self._ledger.TOLERANCE:
            return report
        fastest = int(np.argmax(self._fluid.u**2 + self._fluid.v**2))
        return self._failed(report, fastest)

    def _energy_scales(self) -> tuple[float, float]:
        """Weight times size of the fluid, and an energy that is nothing: rest at 1e-4 c0."""
        fluid_mass = self.mass * self.n_fluid
        gravity = self.scene.effects.gravity
        size = float(np.ptp(self._fluid.x)) + float(np.ptp(self._fluid.y)) + self.scene.dx
        g = math.hypot(gravity.x, gravity.y) if isinstance(gravity, Gravity) else 0.0
        return fluid_mass * g * size, fluid_mass * (1e-4 * self.scene.fluid.c0) ** 2

    # --- failure ----------------------------------------------------------------------------

    def _failed(self, report: Report, bad: int) -> Report:
        """Which particle, which link, and why; `bad` is a place in the arrays."""
        self._totals = self._sum()
        self.evaluate()
        search = failure.Search(self._start, self._grid, self._model.kernel, self._h2)
        a = np.hypot(self._ax, self._ay)
        link, place = failure.broken_link(self._fluid, self._walls, a, search, bad, self.scene.dx)
        nearest = float(np.sqrt(self._nearest()[0].min())) / self.scene.dx
        cause = failure.cause(self.scene, report.dt, self.sound_speed, link, nearest)
        index = int(self._fluid.id[place])
        return Report(report.n_substeps, report.dt, True, cause, link, index)

    # --- evaluation -------------------------------------------------------------------------

    def evaluate(self) -> None:
        """Bring rho, p and a up to date with the present positions, without a time step."""
        if self._stale:  # densities never are: every change of positions or stiffness renews them
            self._evaluate_acceleration()
            self._stale = False

    def _evaluate_density(self) -> None:
        self._regrid()
        stepping.evaluate_density(
            self._fluid,
            self._spare,
            self._start,
            self._cells,
            self._walls,
            self._wall_start,
            self._grid,
            self._model,
        )
        self._swap()

    def _evaluate_acceleration(self) -> None:
        stepping.evaluate_acceleration(
            self._fluid,
            self._start,
            self._walls,
            self._wall_start,
            self._grid,
            self._model,
            self.time,
            self._ax,
            self._ay,
        )

    def _sum(self) -> diagnostics.Totals:
        fluid = self.scene.fluid
        return diagnostics.totals(
            self._fluid,
            self._walls,
            self.mass,
            float(self._controls.stiffness),
            float(fluid.rho0),
            fluid.exponent,
            fluid.clamp,
        )

    def _nearest(self) -> tuple[Array, NDArray[np.int32]]:
        return diagnostics.nearest_and_count(
            self._fluid,
            self._start,
            self._walls,
            self._wall_start,
            self._grid,
            self._h2,
        )

    # --- what users read --------------------------------------------------------------------

    @property
    def n_fluid(self) -> int:
        """Number of fluid particles."""
        return int(self._fluid.x.size)

    @property
    def n_particles(self) -> int:
        """Number of fluid and wall particles."""
        return self.n_fluid + (0 if self._walls is None else int(self._walls.x.size))

    def _public(self, fluid: Any, wall: Any = None) -> Array:
        """A column in public order, fluid first; walls are 0 where they have no such value."""
        column = np.zeros(self.n_particles, self._float)
        column[self._fluid.id] = fluid
        if self._walls is not None and wall is not None:
            column[self.n_fluid + self._walls.id] = wall
        return column

    def _columns(self, first: tuple[Any, Any], second: tuple[Any, Any]) -> Array:
        return np.stack([self._public(*first), self._public(*second)], axis=-1)

    @property
    def x(self) -> Array:
        """(n, 2) positions [m], fluid first, in the order of the scene."""
        walls = self._walls
        wall_x, wall_y = (None, None) if walls is None else (walls.x, walls.y)
        return self._columns((self._fluid.x, wall_x), (self._fluid.y, wall_y))

    @property
    def v(self) -> Array:
        """(n, 2) velocities [m/s], not smoothed."""
        return self._columns((self._fluid.u, None), (self._fluid.v, None))

    @property
    def rho(self) -> Array:
        """(n,) densities [kg/m^3] at the present positions."""
        return self._public(self._fluid.rho, None if self._walls is None else self._walls.rho)

    @property
    def p(self) -> Array:
        """(n,) pressures [Pa] at the present positions and stiffness."""
        fluid, walls = self._fluid, self._walls
        wall = None if walls is None else walls.stress * walls.rho**2
        return self._public(fluid.stress * fluid.rho**2, wall)

    @property
    def a(self) -> Array:
        """(n, 2) accelerations [m/s^2] at the present positions; 0 for wall particles."""
        self.evaluate()
        return self._columns((self._ax, None), (self._ay, None))

    @property
    def neighbor_counts(self) -> NDArray[np.int32]:
        """(n_fluid,) how many others, wall particles included, are within the support radius."""
        counts = np.zeros(self.n_fluid, np.int32)
        counts[self._fluid.id] = self._nearest()[1]
        return counts

    def diagnostics(self) -> dict[str, float]:
        """The state in numbers. All are floats:

        time [s]; density_error: mean over the fluid of max(rho/rho0 - 1, 0), since a deficit at
        a free surface is no error; density_error_p99: its 99th percentile; clumping: share of
        particles with another one closer than 0.6 dx; min_spacing: smallest distance / dx (inf
        for a lonely particle or none within h); median_spacing: median distance to the nearest
        neighbour / dx; mean_neighbors; kinetic_energy, potential_energy, internal_energy [J/m];
        energy_excess: energy from nowhere as a share of what is at stake; com_x, com_y: centre of
        mass [m]; momentum_x, momentum_y [kg/s]; angular_momentum [kg m/s]; max_speed [m/s];
        max_acceleration [m/s^2]; mach: max_speed / c; courant: dt c / h.
        """
        self.evaluate()
        totals, scene = self._sum(), self.scene
        nearest, counts = self._nearest()
        spacing = np.sqrt(nearest) / scene.dx
        g = scene.effects.gravity_at(self.time)
        excess = np.maximum(self._fluid.rho / scene.fluid.rho0 - 1.0, 0.0)
        return {
            "time": self.time,
            "density_error": totals.compression,
            "density_error_p99": float(np.quantile(excess, 0.99)),
            "clumping": float(np.mean(spacing < diagnostics.CLUMPED)),
            "min_spacing": float(spacing.min()),
            "median_spacing": float(np.median(spacing)),
            "mean_neighbors": float(counts.mean()),
            "kinetic_energy": totals.kinetic,
            "potential_energy": -self.mass * self.n_fluid * float(g @ totals[2:4]),
            "internal_energy": totals.internal,
            "energy_excess": self._ledger.excess(totals),
            "com_x": totals.com_x,
            "com_y": totals.com_y,
            "momentum_x": totals.momentum_x,
            "momentum_y": totals.momentum_y,
            "angular_momentum": totals.angular_momentum,
            "max_speed": totals.max_speed,
            "max_acceleration": float(np.sqrt(np.max(self._ax**2 + self._ay**2))),
            "mach": totals.max_speed / self.sound_speed,
            "courant": self._controls.dt * self.sound_speed / scene.h,
        }

    # --- snapshots --------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """The whole state as plain arrays and numbers; going on from it is bit-exact."""
        return {
            "fluid": {name: array.copy() for name, array in self._fluid._asdict().items()},
            "time": self.time,
            "controls": tuple(self._controls),
            "ledger": self._ledger.state(),
            "totals": tuple(self._totals),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a snapshot of a simulation of the same scene and precision.

        Raises ValueError if it is of another size, precision or form.
        """
        try:
            fluid = Particles(**{name: a.copy() for name, a in snapshot["fluid"].items()})
            time, controls = float(snapshot["time"]), check_controls(snapshot["controls"])
            numbers, totals = snapshot["ledger"], diagnostics.Totals(*snapshot["totals"])
            if len(numbers) != len(self._ledger.state()):
                raise ValueError(f"ledger of {len(numbers)} numbers")
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"snapshot: not one of Simulation.snapshot(): {error!r}") from None
        for name, array in self._fluid._asdict().items():
            given = getattr(fluid, name)
            if name in "xyuv" and not np.isfinite(given).all():
                raise ValueError(f"snapshot: expected finite numbers in {name}")
            if given.shape != array.shape or given.dtype != array.dtype:
                raise ValueError(
                    f"snapshot: expected {name} of shape {array.shape} and type {array.dtype}, "
                    f"got {given.shape} and {given.dtype}"
                )
        if not np.array_equal(np.sort(fluid.id), np.arange(self.n_fluid)):
            raise ValueError("snapshot: expected every particle's id once")
        self._fluid, self.time, self._controls = fluid, time, controls
        self._ledger.set_state(numbers)
        self._totals = totals
        self._model = make_model(self.scene, self._controls, self.mass, self._float)
        self._evaluate_density()
