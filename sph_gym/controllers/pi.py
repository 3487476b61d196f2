"""A PI controller that keeps the density error at a setpoint."""

import math
from dataclasses import dataclass, field, replace

from sph_gym.controllers.rules import TunedCfl
from sph_gym.solver.checks import positive
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls

# Density errors that count as 1: the mean of max(rho/rho0 - 1, 0), and its 99th percentile.
MEAN, P99 = 0.01, 0.04
# Bounds of the error as a multiple of the setpoint. Below the first one, the error tells nothing:
# a fluid in free fall has none, however hard it is going to hit something.
ERROR = (0.3, 10.0)


@dataclass
class PiController:
    """A PI controller that corrects the sound speed c of the tuned rule.

    With e the density error as a multiple of `setpoint`, the logarithm of the correction changes in
    every call by `proportional` times the change of log e, and `integral` times log e, as time
    steps do in solvers of differential equations. It stays from `least` to `most`, and as it is
    while e is below the range ERROR. The controller is to be called once a frame, remembers a run,
    and begins anew at time 0.

    Source: Gustafsson 1991, ACM Transactions on Mathematical Software 17.
    """

    setpoint: float = 0.5
    proportional: float = 0.2
    integral: float = 0.05
    least: float = 0.7
    most: float = 1.5
    rule: TunedCfl = field(default_factory=TunedCfl)

    def __post_init__(self) -> None:
        for name in ("setpoint", "least", "most"):
            positive(name, getattr(self, name))
        self._factor, self._before = 1.0, 0.0

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        numbers = sim.diagnostics()
        e = max(numbers["density_error"] / MEAN, numbers["density_error_p99"] / P99)
        share = e / self.setpoint
        now = math.log(min(max(share, ERROR[0]), ERROR[1]))
        if sim.time == 0.0:
            self._factor, self._before = 1.0, now
        if share >= ERROR[0]:
            change = self.proportional * (now - self._before) + self.integral * now
            self._factor = min(max(self._factor * math.exp(change), self.least), self.most)
            self._before = now
        rule, k = self.rule, self._factor
        scaled = replace(rule, mach=k * rule.mach, fastest=k * rule.fastest, floor=k * rule.floor)
        return scaled.at(sim, numbers)
