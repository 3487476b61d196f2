"""A PI controller that keeps the density error at a setpoint."""

import math
from dataclasses import dataclass, field, replace

from sph_gym.controllers.rules import TunedCfl
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls

# Density errors that count as 1: the mean of max(rho/rho0 - 1, 0), and its 99th percentile.
MEAN, P99 = 0.01, 0.04
# Bounds of the error as a multiple of the setpoint, so that a fluid at rest or in free fall, whose
# error is 0, has a logarithm; and bounds of the sound speed [c0].
ERROR, SOUND = (0.1, 10.0), (0.1, 1.25)


@dataclass
class PiController:
    """A PI controller of the sound speed c, with the time step and epsilon of the tuned rule.

    With e the density error as a multiple of `setpoint`, log c changes in every call by
    `proportional` times the change of log e, and `integral` times log e, as time steps do in
    solvers of differential equations. It is to be called once a frame, remembers a run, and begins
    anew at time 0, at c0.

    Source: Gustafsson 1991, ACM Transactions on Mathematical Software 17.
    """

    setpoint: float = 0.5
    proportional: float = 0.2
    integral: float = 0.1
    rule: TunedCfl = field(default_factory=TunedCfl)

    def __post_init__(self) -> None:
        self._sound, self._before = 1.0, 0.0

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        numbers = sim.diagnostics()
        e = max(numbers["density_error"] / MEAN, numbers["density_error_p99"] / P99)
        now = math.log(min(max(e / self.setpoint, ERROR[0]), ERROR[1]))
        if sim.time == 0.0:
            self._sound, self._before = 1.0, now
        change = self.proportional * (now - self._before) + self.integral * now
        self._sound = min(max(self._sound * math.exp(change), SOUND[0]), SOUND[1])
        self._before = now
        # a rule that follows nothing keeps to its floor
        return replace(self.rule, mach=0.0, fastest=0.0, floor=self._sound).at(sim, numbers)
