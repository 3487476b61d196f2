"""`Simulation`: a running solver in the hands of a Python user."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver import diagnostics, failure, hydrostatics, stepping, teams
from sph_gym.solver.checks import instance_of, known, whole
from sph_gym.solver.contact import force_on
from sph_gym.solver.diagnostics import ALL, Request
from sph_gym.solver.energy import GravityWork, make_ledger
from sph_gym.solver.engine import Engine
from sph_gym.solver.gravity import CentralGravity
from sph_gym.solver.model import particle_mass
from sph_gym.solver.origin import moved, origin
from sph_gym.solver.pressures import pressure_at
from sph_gym.solver.report import Report, Underway, count_substeps
from sph_gym.solver.sampling import level_at, velocity_at
from sph_gym.solver.scene import Scene, check_controls
from sph_gym.solver.snapshot import read_snapshot
from sph_gym.solver.state import Controls
from sph_gym.solver.warnings import Warning
from sph_gym.solver.watch import FAST, LEVEL_AFTER, LOOK_EVERY, ODD_ENERGY, Watch

DTYPES: dict[str, Any] = {"float64": np.float64, "float32": np.float32}
NEIGHBORS = ("grid", "brute")
# Work of one compiled call [particle-steps]: short enough for Ctrl-C, long enough to cost nothing.
CHUNK = 2_000_000
# Particles for each thread by default: small fluids mostly come in numbers, side by side.
DEFAULT_PER_THREAD = 2000
DEFAULT_XSPH = 0.3

Array = NDArray[np.float64]


class Simulation:
    """A scene in motion.

    dtype: "float64" or "float32", the precision of the particles; neighbors: "grid" or "brute";
    threads: the most to use, by default one for every 2000 fluid particles and no more than the
    CPUs that the process may use; where more wouldn't pay, fewer are used, and the result is
    bitwise the same for any number. `controls` may be set at any time between two calls.

    `x`, `v`, `rho`, `p` and `a` are copies: they may be written to, which changes no simulation.
    To go on from another state, make a `Simulation` of `dataclasses.replace(scene, x=..., v=...)`;
    rho, p and a follow from x.

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
        self.scene = instance_of("scene", scene, Scene)
        self.dtype = known("dtype", dtype, DTYPES)
        self.neighbors = known("neighbors", neighbors, NEIGHBORS)
        most = whole("threads", self._default_threads() if threads is None else threads, 1)
        self._float = DTYPES[self.dtype]
        self.mass = particle_mass(scene)
        self.time = 0.0
        stiffness = scene.fluid.stiffness(scene.fluid.c0)
        self._controls = scene.controls or Controls(1.0, stiffness, DEFAULT_XSPH)
        brute = self.neighbors == "brute"
        # where the engine's scene counts positions from
        self._origin = origin(scene, self._float)
        self._shift: tuple[float, float] = tuple(self._origin.tolist())
        self._local = hydrostatics.pressed(moved(scene, -self._origin), self._controls.stiffness)
        self.engine = Engine(self._local, self._controls, self.mass, self._float, brute, most)
        densities = self._check_densities()
        hydrostatics.settle(self.engine, self._local, self._controls.stiffness)
        at_rest = hydrostatics.rest_densities(scene, self._controls.stiffness)
        self._watch = Watch(scene, self.mass, densities / at_rest)
        self._acceleration: tuple[Any, Any] | None = None
        self._underway: Underway | None = None
        self.last_report = Report(0, self._controls.dt)
        self._totals = self._sum()
        self._ledger = make_ledger(self._local, self.mass, self._totals)
        self._gravity = GravityWork(self._local, self.mass)
        self._gravity.look(0.0, self._local_x, self.v)
        self._substeps, self._onset = 0.0, failure.Onset()
        if scene.controls is None:
            self._controls = self._controls._replace(dt=self.stable_dt())
        self.nominal_controls = self._controls

    def _check_densities(self) -> Array:
        """Return the summed densities (n,) [kg/m^3], in the order of the arrays.

        Refuse lengths whose powers the precision can't hold: no density comes out of them.
        """
        rho = self.engine.fluid.rho[: self.n_fluid]
        if not (np.isfinite(rho) & (rho > 0)).all():
            raise ValueError(
                f"dtype: expected one that holds powers of h = {self.scene.h:g} m, got "
                f"{self.dtype!r}, in which densities are from {rho.min():g} to {rho.max():g}"
            )
        offset = self.engine.fluid.offset
        return np.asarray(rho if offset is None else rho - offset[: self.n_fluid], np.float64)

    def _default_threads(self) -> int:
        n_fluid = len(np.asarray(self.scene.x))
        return max(min(teams.most_threads(), n_fluid // DEFAULT_PER_THREAD), 1)

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
        """Spurious energy [J/m] so far; friction takes from it, so it may well be negative."""
        return self._ledger.surplus(self._totals)

    @property
    def energy_at_stake(self) -> float:
        """The energy that the surplus is measured by [J/m]; see `energy.Ledger`."""
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
        """The article's stable step [s] for the present state; see `stepping.stable_dt`.

        Surface tension, which the article doesn't have, has a limit of its own.
        """
        a_max = float(self._acceleration_sizes().max())
        nu = self.scene.effects.laminar_viscosity
        share = self.scene.viscous_share
        of_article = stepping.stable_dt(self.scene.h, self.sound_speed, a_max, nu, share)
        return min(of_article, self.scene.surface_dt)

    # --- time -------------------------------------------------------------------------------

    def advance(self, seconds: float) -> Report:
        """Run for `seconds` of physical time with the present controls.

        dt is snapped down so that a whole number of substeps fits. After a failure the state is
        the last finite one; the report is also kept as `last_report`. Ctrl-C stops between two
        substeps and leaves a state to go on from. Raises ValueError if `seconds` isn't positive
        or would take more than 10^12 substeps.
        """
        self.begin(seconds)
        while self.is_underway:
            try:
                steps, bad = self.engine.run(*self.next_chunk())
            except KeyboardInterrupt:
                self.interrupt()
                raise
            self.finish_chunk(steps, bad)
        return self.last_report

    # An `advance` in parts, which `batch.advance_all` does for many simulations at once.

    def begin(self, seconds: float) -> None:
        """Plan an `advance` in chunks of at most a frame: `next_chunk`, `finish_chunk`."""
        n_substeps = count_substeps(seconds, self._controls.dt)
        dt = seconds / n_substeps
        longest = max(CHUNK // self.n_particles, 1)
        longest = max(math.ceil(min(self.scene.frame / dt, longest)), 1)
        self._underway = Underway(seconds, n_substeps, dt, self.time, longest)
        self.last_report = Report(0, dt)

    @property
    def is_underway(self) -> bool:
        """True if an `advance` was begun and is not finished."""
        return self._underway is not None

    def next_chunk(self) -> tuple[float, float, int]:
        """Return time [s] at its start, dt [s] and number of substeps of the next chunk."""
        plan = self._plan()
        n_substeps = min(plan.n_substeps - plan.done, plan.longest)
        return plan.time(plan.done), plan.dt, n_substeps

    def finish_chunk(self, steps: int, bad: int) -> None:
        """Enter a chunk into sums, clock and report.

        steps: that were done; bad: place in the arrays of a particle that failed, or -1.
        """
        plan = self._plan()
        plan.done += steps
        self._substeps += steps
        began, self.time = self.time, plan.time(plan.done - (bad >= 0 and not self.engine.whole))
        self._acceleration = None
        report = Report(plan.done, plan.dt)
        self.last_report = self._failed(report, bad) if bad >= 0 else self._audit(report, began)
        if self.max_speed > FAST * self.sound_speed:
            self._watch.look_at_speeds(self.engine, self.sound_speed, self.time)
        before = self._substeps - steps
        if self._substeps // LOOK_EVERY > before // LOOK_EVERY:
            self._watch.look_at_neighbors(self.engine, self.time)
            if self._substeps * self.n_fluid > LEVEL_AFTER:
                self._look_at_level()
        if self.last_report.diverged:
            self._underway = None
        elif plan.done == plan.n_substeps:
            self.time, self._underway = plan.began + plan.seconds, None

    def interrupt(self) -> None:
        """End an interrupted `advance`, and leave a state to go on from."""
        plan, steps = self._plan(), self.engine.steps
        self.engine.recover(plan.time(plan.done + steps))
        self.finish_chunk(steps, -1)
        self._underway = None

    def _plan(self) -> Underway:
        if self._underway is None:
            raise RuntimeError("no advance is under way")
        return self._underway

    def _audit(self, report: Report, began: float) -> Report:
        """Book the energy of a chunk; more of it than there can be is a blow-up."""
        surplus, before, self._totals = self.energy_surplus, self._totals, self._sum()
        if self.scene.effects.field is not None:
            self._ledger.add_gravity(self._gravity_work(before, began))
        if self._ledger.excess(self._totals) > ODD_ENERGY:
            self._watch.look_at_energy(self.energy_surplus, self.energy_at_stake, self.time)
        if not self._ledger.blown(self._totals, surplus):
            return report
        fluid = self.engine.fluid
        return self._failed(report, int(np.argmax(fluid.u**2 + fluid.v**2)))

    def _gravity_work(self, before: diagnostics.Totals, began: float) -> float:
        """Return the work of gravity [J/m] since `began` [s]."""
        if self._gravity.uniform is not None:
            return self._gravity.along_path(began, self.time, before, self._totals)
        return self._gravity.trapezoidal(began, self.time, self._local_x, self.v)

    # --- warnings ---------------------------------------------------------------------------

    @property
    def warnings(self) -> tuple[Warning, ...]:
        """Oddities of the run so far that are no blow-up, at most one of each kind.

        Energy, speed and walls are looked at after each frame, neighbours and levels now and then;
        reading this looks at the present state as well. It belongs to a snapshot.
        """
        self._watch.look_at_neighbors(self.engine, self.time)
        self._look_at_level()
        return self._watch.warnings()

    def _look_at_level(self) -> None:
        self._watch.look_at_level(self.engine, self._totals, self._shift, self.time)

    # --- failure ----------------------------------------------------------------------------

    def _failed(self, report: Report, bad: int) -> Report:
        """Find out which particle, which link, and why; `bad` is a place in the arrays."""
        engine = self.engine
        # no other particle fails at the end of a step
        walled, index = engine.whole and engine.bad >= 0, engine.fluid.id[bad]
        engine.recover(self.time)
        self._totals = self._sum()
        bad = int(np.flatnonzero(engine.fluid.id == index)[0])
        link, place, a = "walls", bad, self._acceleration_sizes()
        if walled:
            self._watch.count_passed(engine.count_walled(), self.time)
        else:
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
        x = self._local_x
        return (x + self._origin).astype(self._float) if self._origin.any() else x

    @property
    def _local_x(self) -> Array:
        """(n, 2) positions [m] from the engine's origin."""
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

    # measured at points, in columns of water and on walls, as documented there
    pressure_at, velocity_at, level_at = pressure_at, velocity_at, level_at
    force_on = force_on

    def diagnostics(self) -> dict[str, float]:
        """The state in numbers. All are floats:

        time [s]; density_error: mean over the fluid of max(rho/rho0 - 1, 0), since a deficit at
        a free surface is no error; density_error_p99: its 99th percentile; surface: share of
        particles below 0.9 rho0; clumping: share of particles with another one closer than
        0.6 dx; min_spacing: smallest distance / dx (inf for a lonely particle or none within h);
        median_spacing: median distance to the nearest neighbour / dx; mean_neighbors;
        kinetic_energy, potential_energy, internal_energy [J/m]; energy_excess: spurious
        energy as a share of what is at stake; com_x, com_y: centre of mass [m]; extent_x,
        extent_y: standard deviations of x and y [m]; lowest: smallest y [m]; front: largest x
        [m]; adrift: share of particles with |a - g| < 0.1 g, 0 without gravity; momentum_x,
        momentum_y [kg/s]; angular_momentum [kg m/s]; max_speed [m/s]; velocity_noise: mean of
        |v - local affine fit|^2 [m^2/s^2]; flow_speed: 99th percentile of the speed of these fits
        [m/s]; max_acceleration [m/s^2]; mach: max_speed / c; courant: dt c / h; and of the last
        blow-up, -1 if there was none: blowup_cause, its place in `failure.CAUSES`;
        blowup_substep, substeps from the start to it; time_to_failure [s].
        """
        totals, scene, (x, y) = self._totals, self.scene, self._shift
        gravity = scene.effects.gravity_at(self.time)
        gx, gy = gravity.tolist()
        clumped = diagnostics.CLUMPED * scene.dx
        request = Request(ALL, self.time, gx, gy, totals.com_x, totals.com_y, clumped)
        survey = self.engine.survey(self._acceleration is None, request)
        self._acceleration = self.engine.known_accelerations()
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
            "flow_speed": math.sqrt(survey.flow),
            "velocity_noise": survey.noise,
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
            r2 = ((self._local_x[:n].astype(np.float64) - (field.x, field.y)) ** 2).sum()
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
            "power": self._gravity.power,
            "totals": tuple(self._totals),
            "substeps": self._substeps,
            "onset": tuple(self._onset),
            "warnings": self._watch.state(),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Go back to a snapshot of a simulation of the same scene and precision.

        Raises ValueError if it is of another size, precision or form.
        """
        counts = len(self._ledger.state()), len(self._watch.state())
        state = read_snapshot(snapshot, self.engine, *counts)
        self.time, self._controls, self._totals = state.time, state.controls, state.totals
        self._gravity.power, self._underway = state.power, None
        self._ledger.set_state(state.ledger)
        self._watch.set_state(state.warnings)
        self._substeps, self._onset = state.substeps, state.onset
        self.engine.set_controls(state.controls)
        self.engine.set_state(state.fluid, state.clock)
        self._acceleration = None
