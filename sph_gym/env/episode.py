"""One episode: everything of an environment except the running of the solver.

Single and vector environments share this: they only differ in how the simulation advances between
`act` and `conclude`.
"""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from sph_gym.env import actions, contexts, rewards
from sph_gym.env.observations import Moment, measure
from sph_gym.env.reference import n_frames, reference
from sph_gym.env.rules import Rules
from sph_gym.solver.scene import Scene, check_controls
from sph_gym.solver.simulation import Report, Simulation

# The entries of info: unit ("text" for strings) and meaning.
INFO = {
    "instance_id": ("text", "which flow the episode shows"),
    "context": ("text", "noisy, damped or plain: how strong the artificial viscosity is"),
    "blowup_cause": ("text", "cfl, stiffness, clumping, tunnelling, energy or nan; else empty"),
    "alpha": ("-", "strength of the artificial viscosity"),
    "support": ("-", "support radius / dx"),
    "time": ("s", "physical time of the state; of the blow-up in a step that is taken back"),
    "dt": ("s", "time step; a whole number of them fits into a frame"),
    "stiffness": ("Pa", "Tait's B"),
    "xsph": ("-", "XSPH epsilon"),
    "n_substeps": ("-", "time steps that the solver took in this step"),
    "work": ("-", "n_substeps / mean substeps a step of the tuned CFL rule on this instance"),
    "density_error": ("-", "mean of max(rho/rho0 - 1, 0)"),
    "clumping": ("-", "share of particles closer than 0.6 dx to another one"),
    "noise": ("-", "mean squared velocity noise in multiples of (c0 / 10)^2"),
    "fidelity_error": ("-", "drift from the reference in multiples of its tolerance"),
    "error": ("-", "the largest error in multiples of its tolerance"),
    "cost": ("-", "1 where an error is beyond its tolerance or the solver blew up, else 0"),
    "energy_excess": (
        "-",
        "spurious energy as a share of what is at stake, negative where friction took more",
    ),
    "control_work": ("J/m", "energy that the action's change of stiffness put into the fluid"),
    "blowup": ("-", "1 if the solver blew up in this step, else 0"),
    "blowup_substep": ("-", "substeps of the flow until the blow-up, -1 without"),
    "time_to_failure": ("s", "time of the blow-up, -1 without"),
    "rollbacks": ("-", "blow-ups that were taken back in a row"),
    **{f"reward_{term}": ("-", f"weighted term {term} of the reward") for term in rewards.TERMS},
}  # fmt: skip
# Keys of the terms in info, spelt once: a step is short.
_TERMS = tuple(f"reward_{term}" for term in rewards.TERMS)


class StepResult(NamedTuple):
    """Result of a step; reward: the weighted terms in the order of `rewards.TERMS`."""

    observation: NDArray[Any]
    reward: list[float]
    terminated: bool
    truncated: bool
    info: dict[str, Any]


class Episode:
    """A scene in motion, judged against its reference.

    n_steps: frames until it is truncated; step: frames that are over; over: True once it has ended.
    """

    def __init__(
        self, rules: Rules, instance_id: str, scene: Scene, threads: int | None = None
    ) -> None:
        self.rules, self.instance_id, self.scene = rules, instance_id, scene
        self.sim = Simulation(scene, threads=threads)
        self.n_steps, self.step, self.over = n_frames(scene), 0, False
        self.reference, self.context = reference(scene, instance_id), contexts.of(scene)
        fluid_mass = self.sim.mass * self.sim.n_fluid
        self._judge = rewards.Judge(self.reference, scene, fluid_mass, rules.limits)
        self.coordinates = actions.encode(scene, self.sim.controls)
        self._before = self._numbers = measure(self.sim)
        self._report = Report(0, self.sim.controls.dt)
        self._rollbacks, self._control_work = 0, 0.0
        self._safe: dict[str, Any] | None = None
        self.info = self._inform(
            0.0, rewards.Errors(0.0, 0.0, 0.0, 0.0), [0.0] * len(rewards.TERMS)
        )

    # --- a step -----------------------------------------------------------------------------

    def check(self, action: Any) -> None:
        """Raise ValueError unless the action is one."""
        self._asked(action)

    def act(self, action: Any) -> None:
        """Set the controls that an action asks for. Raises ValueError unless it is one."""
        wanted = self._asked(action)
        # a blow-up returns to it
        self._safe = self._keep() if self.rules.rollbacks else None
        self.coordinates = wanted
        booked = self.sim.control_work
        self.sim.controls = actions.decode(self.scene, wanted)
        self._control_work = self.sim.control_work - booked

    def _asked(self, action: Any) -> actions.Coordinates:
        rules = self.rules
        return rules.actions.act(action, self.coordinates, self.scene, rules.rate_limit)

    def conclude(self, report: Report) -> StepResult:
        """Return the result of the step, once the simulation has advanced by a frame."""
        self._report = report
        self._before, self._numbers = self._numbers, measure(self.sim, self._numbers)
        errors = self._judge.errors(self.step + 1, self._numbers)
        work = report.n_substeps / self.reference.cfl_substeps
        taken_back = report.diverged and self._rollbacks < self.rules.rollbacks
        if not report.diverged:
            terms = rewards.terms(errors, work)
        else:
            terms = rewards.blowup_terms(1 if taken_back else self.n_steps - self.step)
        weighted = [self.rules.weights[term] * value for term, value in terms.items()]
        self.info = self._inform(work, errors, weighted)
        if taken_back:
            assert self._safe is not None
            self._return_to(self._safe)
            self._rollbacks += 1
            self.info["rollbacks"] = float(self._rollbacks)
        else:
            self.step, self._rollbacks = self.step + 1, 0
        terminated = report.diverged and not taken_back
        truncated = self.step >= self.n_steps and not terminated
        self.over = terminated or truncated
        return StepResult(self.observe(), weighted, terminated, truncated, dict(self.info))

    def observe(self) -> NDArray[Any]:
        """Return the observation of the present state."""
        return self.rules.observations.observe(
            Moment(
                self.sim,
                self._numbers,
                self._before,
                self.coordinates,
                min(self.step / self.n_steps, 1.0),
                self._report.n_substeps,
                self._rollbacks / max(self.rules.rollbacks, 1),
                self.context,
            )
        )

    def _inform(self, work: float, errors: rewards.Errors, weighted: list[float]) -> dict[str, Any]:
        controls, report, worst = self.sim.controls, self._report, max(errors)
        return {
            "instance_id": self.instance_id,
            "context": self.context.kind,
            "blowup_cause": report.cause,
            "alpha": self.context.alpha,
            "support": self.context.support,
            "time": self.sim.time,
            "dt": report.dt,
            "stiffness": controls.stiffness,
            "xsph": controls.xsph,
            "n_substeps": float(report.n_substeps),
            "work": work,
            "density_error": self._numbers["density_error"],
            "clumping": self._numbers["clumping"],
            "noise": self._numbers["velocity_noise"] / (self.scene.fluid.c0 / 10) ** 2,
            "fidelity_error": errors.fidelity,
            "error": worst,
            "cost": float(report.diverged or worst > 1.0),
            "energy_excess": self._numbers["energy_excess"],
            "control_work": self._control_work,
            "blowup": float(report.diverged),
            "blowup_substep": self._numbers["blowup_substep"] if report.diverged else -1.0,
            "time_to_failure": self._numbers["time_to_failure"] if report.diverged else -1.0,
            "rollbacks": 0.0,
            **dict(zip(_TERMS, weighted, strict=True)),
        }

    def toward(self, controls: Any) -> Any:
        """Return the action that brings the controls as close as possible to the given ones.

        Raises ValueError unless they are controls.
        """
        wanted = actions.encode(self.scene, check_controls(controls))
        return self.rules.actions.toward(wanted, self.coordinates, self.scene)

    # --- the state --------------------------------------------------------------------------

    def _keep(self) -> dict[str, Any]:
        return {
            "simulation": self.sim.snapshot(),
            "past": list(self._judge.past),
            "coordinates": self.coordinates.copy(),
            "before": dict(self._before),
            "numbers": dict(self._numbers),
        }

    def _return_to(self, kept: dict[str, Any]) -> None:
        self.sim.restore(kept["simulation"])
        self._judge.past, self.coordinates = list(kept["past"]), kept["coordinates"].copy()
        self._before, self._numbers = dict(kept["before"]), dict(kept["numbers"])

    def state(self) -> dict[str, Any]:
        """Return everything that changes, as plain arrays, numbers and texts.

        An episode that takes it back goes on bit by bit.
        """
        return self._keep() | {
            "step": self.step,
            "over": self.over,
            "rollbacks": self._rollbacks,
            "control_work": self._control_work,
            "report": tuple(self._report),
            "info": dict(self.info),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to the `state` of an episode with the same rules and instance.

        Raises ValueError if the solver refuses it, and then nothing has changed.
        """
        self._return_to(state)
        self.step, self.over, self._rollbacks = state["step"], state["over"], state["rollbacks"]
        self._control_work, self._report = state["control_work"], Report(*state["report"])
        self.info = dict(state["info"])
