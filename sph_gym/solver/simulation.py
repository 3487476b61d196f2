"""`Simulation`: a running solver in the hands of a Python user."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import diagnostics, failure, stepping, teams
from sph_gym.solver.checks import known, number, positive, whole
from sph_gym.solver.engine import Engine
from sph_gym.solver.gravity import CentralGravity, Gravity
from sph_gym.solver.model import particle_mass
from sph_gym.solver.origin import moved, origin
from sph_gym.solver.scene import Scene, check_controls
from sph_gym.solver.state import Controls

DTYPES: dict[str, Any] = {"float64": np.float64, "float32": np.float32}
NEIGHBORS = ("grid", "brute")
# Work of one compiled call [particle-steps]: short enough for Ctrl-C, long enough to cost nothing.
CHUNK = 2_000_000
# Particles that a thread gets if nobody says how many threads there should be. Small fluids mostly
# come in numbers, and then there is better use for the other processors.
DEFAULT_PER_THREAD = 2000
MAX_SUBSTEPS = 10**12
DEFAULT_XSPH = 0.3

Array = NDArray[np.float64]


class Report(NamedTuple):
    """What one `advance` did.

    n_substeps: steps taken (the one that failed included); dt: their length [s]; diverged: x, v,
    rho or p no longer finite, a speed above 5000 m/s, a particle inside of boundary particles
    (`density.WALLED`), or more energy from nowhere, or more of it at once, than the ledger
    tolerates (`diagnostics.Ledger`); cause: "" | "cfl" | "stiffness" | "clumping" |
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

    dtype: "float64" or "float32", the precision of the particles; neighbors: "grid" or "brute";
    threads: the most to use, by default one for every 2000 fluid particles and no more than the
    CPUs that the process may use; where more wouldn't pay, fewer are used, and the result is
    bitwise the same for any number. `controls` may be set at any time between two calls.
    Raises ValueError for unknown names, for less than one thread, and for lengths whose powers
    the precision can't hold.
    """

    def __init__(
        self,
        scene: Scene,
        dtype: str = "float64",
        neighbors: str = "grid",
        threads: int | None = None,
    ) -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene: expected a Scene, got {scene!r}")
        self.scene = scene
        self.dtype = known("dtype", dtype, DTYPES)
        self.neighbors = known("neighbors", neighbors, NEIGHBORS)
        if threads is None:
            threads = self._default_threads()
        most = whole("threads", threads, at_least=1)
        self._float = DTYPES[self.dtype]
        self.mass = particle_mass(scene)
        self.time = 0.0
        self._controls = self._initial_controls()
        brute = self.neighbors == "brute"
        # the engine's scene, as seen from there
        self._origin = origin(scene, self._float)
        self._shift: tuple[float, float] = tuple(self._origin.tolist())
        self._local = moved(scene, -self._origin)
        self.engine = Engine(self._local, self._controls, self.mass, self._float, brute, most)
        self._check_densities()
        self._acceleration: tuple[Any, Any] | None = None
        self.last_report = Report(0, self._controls.dt)
        self._totals = self._sum()
        self._ledger = diagnostics.Ledger(self._totals, *self._energy_scales())
        self._uniform = self._uniform_gravity()
        self._power = self._gravity_power()
        self._substeps, self._onset = 0.0, failure.Onset()
        self._nominal_dt()

    def _check_densities(self) -> None:
        """Refuse lengths whose powers the precision can't hold: no density comes out of them."""
        rho = self.engine.fluid.rho[: self.n_fluid]
        if not (np.isfinite(rho) & (rho > 0)).all():
            raise ValueError(
                f"dtype: expected one that holds powers of h = {self.scene.h:g} m, got "
                f"{self.dtype!r}, in which densities are from {rho.min():g} to {rho.max():g}"
            )

    def _default_threads(self) -> int:
        n_fluid = len(np.asarray(self.scene.x))
        return max(min(teams.most_threads(), n_fluid // DEFAULT_PER_THREAD), 1)

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
        self.engine.set_controls(self._controls)
        if self._controls.stiffness != before.stiffness or "tx" in self.engine.state_columns:
            # densities stay, pressures and the stored energy follow the stiffness, and rates that
            # the next step sets out from all controls
            self.engine.follow_stiffness(self.time)
            self._acceleration = None
            held, self._totals = self._totals, self._sum()
            self._ledger.add_control(self._totals.internal - held.internal)

    @property
    def control_work(self) -> float:
        """Energy [J/m] that changes of the stiffness have put into the fluid so far."""
        return self._ledger.control_work

    @property
    def energy_surplus(self) -> float:
        """Energy [J/m] from nowhere so far; friction takes from it, so it may well be negative."""
        return self._ledger.surplus(self._totals)

    @property
    def energy_at_stake(self) -> float:
        """What the tripwire measures it by [J/m]; see `diagnostics.Ledger`."""
        return self._ledger.stake

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
        a_max = float(self._acceleration_sizes().max())
        nu = self.scene.effects.laminar_viscosity
        share = self.scene.viscous_share
        return stepping.stable_dt(self.scene.h, self.sound_speed, a_max, nu, share)

    # --- time -------------------------------------------------------------------------------

    def advance(self, seconds: float) -> Report:
        """Run for `seconds` of physical time with the present controls.

        dt is snapped down so that a whole number of substeps fits. After a failure the state is
        the last finite one; the report is also kept as `last_report`. Ctrl-C stops between two
        substeps and leaves a state to go on from. Raises ValueError if `seconds` isn't positive
        or would take more than 10^12 substeps.
        """
        journey = Journey(self, seconds)
        while not journey.over:
            try:
                steps, bad = self.engine.run(*journey.next_leg())
            except KeyboardInterrupt:
                journey.interrupt()
                raise
            journey.book(steps, bad)
        return self.last_report

    def _count_substeps(self, seconds: float) -> int:
        positive("seconds", seconds)
        ratio = seconds / self._controls.dt - 1e-9
        if not ratio < MAX_SUBSTEPS:
            raise ValueError(
                f"seconds: {seconds:g} s in steps of {self._controls.dt:g} s are more than "
                f"{MAX_SUBSTEPS:g} substeps"
            )
        return max(math.ceil(ratio), 1)

    def _longest_leg(self, dt: float) -> int:
        """As many substeps as one compiled call should take, at most a frame's worth."""
        frame = max(math.ceil(self.scene.frame / dt), 1)
        return min(frame, max(CHUNK // self.n_particles, 1))

    def _book(self, report: Report, bad: int, now: float) -> Report:
        """Bring the sums up to date after a leg, and look whether it went well."""
        began, self.time = self.time, now
        self._acceleration = None
        if bad >= 0:
            return self._failed(report, bad)
        return self._audit(report, began)

    def _audit(self, report: Report, began: float) -> Report:
        """Book the energy of this leg; more of it than there can be is a blow-up."""
        surplus, before, self._totals = self.energy_surplus, self._totals, self._sum()
        if self.scene.effects.field is not None:
            self._ledger.add_gravity(self._gravity_work(before, began))
        if not self._ledger.blown(self._totals, surplus):
            return report
        fluid = self.engine.fluid
        return self._failed(report, int(np.argmax(fluid.u**2 + fluid.v**2)))

    def _gravity_work(self, before: diagnostics.Totals, began: float) -> float:
        """Work of gravity [J/m] since `began` [s]: exact where it is uniform, else trapezoidal."""
        if self._uniform is not None:
            mean_x, mean_y = self._uniform.mean(began, self.time)
            path_x = self._totals.com_x - before.com_x
            path_y = self._totals.com_y - before.com_y
            return self.mass * self.n_fluid * (mean_x * path_x + mean_y * path_y)
        power, self._power = self._power, self._gravity_power()
        return (self.time - began) * (power + self._power) / 2

    def _uniform_gravity(self) -> Gravity | None:
        """The scene's gravity if the path of the centre of mass is all that its work depends on."""
        walls, field = self.scene.walls, self.scene.effects.field
        periodic = walls is not None and walls.is_periodic
        return field if isinstance(field, Gravity) and not periodic else None

    def _gravity_power(self) -> float:
        """Power of gravity [W/m] on the present state."""
        field, n = self._local.effects.field, self.n_fluid
        if field is None:
            return 0.0
        x, v = self._places[:n].astype(np.float64), self.v[:n].astype(np.float64)
        return self.mass * float((field.on(self.time, x, v) * v).sum())

    def _energy_scales(self) -> tuple[float, float, bool]:
        """Energies that are at stake and that are nothing (rest), and whether walls do work.

        At stake are the weight times the size of the fluid, its motion with the speed of the
        walls, and the surface that it may lose.
        """
        scene, fluid_mass = self._local, self.mass * self.n_fluid
        size = float(np.ptp(np.asarray(scene.x), axis=0).sum()) + scene.dx
        reach = float(np.abs(np.asarray(scene.x)).max()) + size
        weight = 0.0 if scene.effects.field is None else scene.effects.field.strongest(reach)
        top_speed = 0.0 if scene.walls is None else scene.walls.top_speed
        surface = 4 * size * (scene.effects.surface_tension or 0.0)
        at_stake = fluid_mass * (weight * size + top_speed**2) + surface
        rest = fluid_mass * (diagnostics.Ledger.REST * scene.fluid.c0) ** 2
        return at_stake, rest, top_speed > 0

    # --- failure ----------------------------------------------------------------------------

    def _failed(self, report: Report, bad: int) -> Report:
        """Which particle, which link, and why; `bad` is a place in the arrays."""
        engine = self.engine
        # no other particle fails at the end of a step
        walled, index = engine.whole and engine.bad >= 0, engine.fluid.id[bad]
        engine.recover(self.time)
        self._totals = self._sum()
        bad = int(np.flatnonzero(engine.fluid.id == index)[0])
        link, place, a = "walls", bad, self._acceleration_sizes()
        if not walled:
            link, place = failure.broken_link(
                engine.fluid, engine.walls, a, bad, self._local, self.mass
            )
        nearest = float(np.sqrt(engine.nearest_and_count()[0].min())) / self.scene.dx
        cause = failure.cause(
            self.scene, report.dt, self.sound_speed, link, nearest, float(a.max())
        )
        index = int(engine.fluid.id[place])
        code = float(failure.CAUSES.index(cause))
        self._onset = failure.Onset(code, self._substeps, self.time)
        return Report(report.n_substeps, report.dt, True, cause, link, index)

    # --- evaluation -------------------------------------------------------------------------

    def evaluate(self) -> None:
        """Bring rho, p and a up to date with the present positions, without a time step."""
        # densities always are: every change of positions or stiffness renews them
        if self._acceleration is None:
            self._acceleration = self.engine.accelerations(self.time)

    def _acceleration_sizes(self) -> Array:
        """(n_fluid,) |a| [m/s^2] in the order of the arrays."""
        self.evaluate()
        assert self._acceleration is not None
        return np.hypot(*self._acceleration)

    def _sum(self) -> diagnostics.Totals:
        return diagnostics.totals(self.engine.world.totals, self.mass)

    # --- what users read --------------------------------------------------------------------

    @property
    def n_fluid(self) -> int:
        """Number of fluid particles."""
        return self.engine.n

    @property
    def n_particles(self) -> int:
        """Number of fluid and wall particles."""
        walls = self.engine.walls
        return self.n_fluid + (0 if walls is None else int(walls.id.size))

    def _public(self, fluid: Any, wall: Any = None) -> Array:
        """A column in public order, fluid first; walls are 0 where they have no such value."""
        n, engine = self.n_fluid, self.engine
        column = np.zeros(self.n_particles, self._float)
        column[engine.fluid.id] = fluid[:n]
        if engine.walls is not None and wall is not None:
            column[n + engine.walls.id] = wall[: engine.walls.id.size]
        return column

    def _columns(self, first: Any, second: Any, *walls: Any) -> Array:
        of_walls = walls or (None, None)
        columns = (self._public(*pair) for pair in zip((first, second), of_walls, strict=True))
        return np.stack(list(columns), axis=-1)

    @property
    def x(self) -> Array:
        """(n, 2) positions [m], fluid first, in the order of the scene."""
        places = self._places
        return (places + self._origin).astype(self._float) if self._origin.any() else places

    @property
    def _places(self) -> Array:
        """(n, 2) positions [m] as the engine counts them."""
        fluid, walls = self.engine.fluid, self.engine.walls
        of_walls = () if walls is None else (walls.x, walls.y)
        return self._columns(fluid.x, fluid.y, *of_walls)

    @property
    def v(self) -> Array:
        """(n, 2) velocities [m/s], not smoothed; of the walls as they move or slide."""
        fluid, walls = self.engine.fluid, self.engine.walls
        of_walls = () if walls is None else (walls.u, walls.v)
        return self._columns(fluid.u, fluid.v, *of_walls)

    @property
    def rho(self) -> Array:
        """(n,) densities [kg/m^3] at the present positions."""
        walls = self.engine.walls
        return self._public(self.engine.fluid.rho, None if walls is None else walls.rho)

    @property
    def p(self) -> Array:
        """(n,) pressures [Pa] at the present positions and stiffness."""
        fluid, walls = self.engine.fluid, self.engine.walls
        wall = None if walls is None else walls.stress * walls.rho**2
        return self._public(fluid.stress * fluid.rho**2, wall)

    @property
    def a(self) -> Array:
        """(n, 2) accelerations [m/s^2] at the present positions; 0 for wall particles."""
        self.evaluate()
        assert self._acceleration is not None
        return self._columns(*self._acceleration)

    @property
    def neighbor_counts(self) -> NDArray[np.int32]:
        """(n_fluid,) how many others, wall particles included, are within the support radius."""
        counts = np.zeros(self.n_fluid, np.int32)
        counts[self.engine.fluid.id] = self.engine.nearest_and_count()[1]
        return counts

    def diagnostics(self) -> dict[str, float]:
        """The state in numbers. All are floats:

        time [s]; density_error: mean over the fluid of max(rho/rho0 - 1, 0), since a deficit at
        a free surface is no error; density_error_p99: its 99th percentile; surface: share of
        particles below 0.9 rho0; clumping: share of
        particles with another one closer than 0.6 dx; min_spacing: smallest distance / dx (inf
        for a lonely particle or none within h); median_spacing: median distance to the nearest
        neighbour / dx; mean_neighbors; kinetic_energy, potential_energy, internal_energy [J/m];
        energy_excess: energy from nowhere as a share of what is at stake; com_x, com_y: centre of
        mass [m]; extent_x, extent_y: standard deviations of x and y [m]; lowest: smallest y [m];
        front: largest x [m]; adrift: share of particles with |a - g| < 0.1 g, 0 without
        gravity; momentum_x, momentum_y [kg/s]; angular_momentum [kg m/s]; max_speed [m/s];
        max_acceleration [m/s^2]; mach: max_speed / c; courant: dt c / h; and of the last blow-up,
        -1 if there was none: blowup_cause, its place in `failure.CAUSES`; blowup_substep,
        substeps from the start to it; time_to_failure [s].
        """
        totals, scene, (x, y) = self._totals, self.scene, self._shift
        gravity = scene.effects.gravity_at(self.time)
        survey, self._acceleration = self.engine.survey(
            self._acceleration, self.time, gravity, totals[2:4], scene.dx
        )
        return {
            "time": self.time,
            "density_error": totals.compression,
            "density_error_p99": survey.density_p99,
            "surface": survey.surface,
            "clumping": survey.clumping,
            "min_spacing": survey.nearest / scene.dx,
            "median_spacing": survey.median / scene.dx,
            "mean_neighbors": survey.neighbors,
            "kinetic_energy": totals.kinetic,
            "potential_energy": self._potential_energy(gravity),
            "internal_energy": totals.internal,
            "energy_excess": self._ledger.excess(totals),
            "com_x": totals.com_x + x,
            "com_y": totals.com_y + y,
            "extent_x": survey.extent_x,
            "extent_y": survey.extent_y,
            "lowest": survey.lowest + y,
            "front": survey.front + x,
            "adrift": survey.adrift,
            "momentum_x": totals.momentum_x,
            "momentum_y": totals.momentum_y,
            # of the engine's origin about the scene's, too
            "angular_momentum": totals.angular_momentum
            + (x * totals.momentum_y - y * totals.momentum_x),
            "max_speed": totals.max_speed,
            "max_acceleration": math.sqrt(survey.acceleration),
            "mach": totals.max_speed / self.sound_speed,
            "courant": self._controls.dt * self.sound_speed / scene.h,
            "blowup_cause": self._onset.cause,
            "blowup_substep": self._onset.substep,
            "time_to_failure": self._onset.time,
        }

    def _potential_energy(self, gravity: Array) -> float:
        """[J/m] in the uniform part of gravity (2,) [m/s^2], or in a central field."""
        field, n = self._local.effects.field, self.n_fluid
        if isinstance(field, CentralGravity):
            r2 = ((self._places[:n].astype(np.float64) - (field.x, field.y)) ** 2).sum()
            return 0.5 * self.mass * field.omega**2 * float(r2)
        (gx, gy), (x, y) = gravity.tolist(), self._shift
        return -self.mass * n * (gx * (self._totals.com_x + x) + gy * (self._totals.com_y + y))

    # --- snapshots --------------------------------------------------------------------------

    def snapshot(self) -> dict[str, Any]:
        """The whole state as plain arrays and numbers; going on from it is bit-exact."""
        return {
            "fluid": self.engine.state(),
            "time": self.time,
            "clock": self.engine.clock,
            "controls": tuple(self._controls),
            "ledger": self._ledger.state(),
            "power": self._power,
            "totals": tuple(self._totals),
            "substeps": self._substeps,
            "onset": tuple(self._onset),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a snapshot of a simulation of the same scene and precision.

        Raises ValueError if it is of another size, precision or form.
        """
        try:
            columns = self.engine.state_columns
            fluid = {name: np.asarray(snapshot["fluid"][name]) for name in columns}
            single = ("power", "clock", "time", "substeps")
            power, clock, time, substeps = (number(name, snapshot[name]) for name in single)
            controls = check_controls(snapshot["controls"])
            numbers = [number("ledger", each) for each in snapshot["ledger"]]
            totals = diagnostics.Totals(*(number("totals", each) for each in snapshot["totals"]))
            onset = failure.Onset(*(number("onset", each) for each in snapshot["onset"]))
            if len(numbers) != len(self._ledger.state()) or numbers[1] <= 0:
                raise ValueError(f"ledger {numbers}")
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise ValueError(f"snapshot: not one of Simulation.snapshot(): {error!r}") from None
        for name, present in self.engine.state().items():
            given = fluid[name]
            if given.shape != present.shape or given.dtype != present.dtype:
                raise ValueError(
                    f"snapshot: expected {name} of shape {present.shape} and type "
                    f"{present.dtype}, got {given.shape} and {given.dtype}"
                )
            if not np.isfinite(given).all():
                raise ValueError(f"snapshot: expected finite numbers in {name}")
        if not np.array_equal(np.sort(fluid["id"]), np.arange(self.n_fluid)):
            raise ValueError("snapshot: expected every particle's id once")
        self.time, self._controls, self._totals, self._power = time, controls, totals, power
        self._ledger.set_state(numbers)
        self._substeps, self._onset = substeps, onset
        self.engine.set_controls(controls)
        self.engine.set_state(fluid, clock)
        self._acceleration = None


class Journey:
    """One `advance`, cut into legs of at most a frame: what is to be done, and what was."""

    def __init__(self, sim: Simulation, seconds: float) -> None:
        self.sim, self._seconds, self._began = sim, seconds, sim.time
        self._n_substeps, self._done = sim._count_substeps(seconds), 0
        self._dt = seconds / self._n_substeps
        self._longest = sim._longest_leg(self._dt)
        self.over = False
        sim.last_report = Report(0, self._dt)

    def _time(self, steps: int) -> float:
        return self._began + steps * self._dt

    def next_leg(self) -> tuple[float, float, int]:
        """Time [s] at its start, dt [s] and number of substeps of the next compiled call."""
        n_substeps = min(self._n_substeps - self._done, self._longest)
        return self._time(self._done), self._dt, n_substeps

    def interrupt(self) -> None:
        """Enter what an interrupted leg did, and leave a state to go on from."""
        steps = self.sim.engine.steps
        self.sim.engine.recover(self._time(self._done + steps))
        self.book(steps, -1)

    def book(self, steps: int, bad: int) -> None:
        """Enter what a leg did into the simulation's sums, clock and report."""
        sim = self.sim
        self._done += steps
        sim._substeps += steps
        now = self._time(self._done - (bad >= 0 and not sim.engine.whole))
        sim.last_report = sim._book(Report(self._done, self._dt), bad, now)
        self.over = sim.last_report.diverged or self._done == self._n_substeps
        if self.over and not sim.last_report.diverged:
            sim.time = self._began + self._seconds
