"""Rules that set the controls from the present state of the solver."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from sph_gym.solver.checks import in_range, positive
from sph_gym.solver.integrators import VISCOUS_SHARES
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.solver.state import Controls

# Artificial viscosity of the article's scenes, and the epsilons of the tuned rule.
USUAL_ALPHA, XSPH_RANGE = 0.02, (0.1, 0.6)

Controller = Callable[[Simulation], Controls]

# Step that an artificial viscosity nu allows, as a share of h^2 / nu: 5 / 3 over the integral of
# h^2 times the Laplacian weight of the kernel, for the article's that of Mueller et al. 2003.
DAMPING_SHARES = {
    "mueller": 0.125,
    "spiky": 0.125,
    "wendland_c2": 0.0595,
    "cubic_spline": 0.0729,
    "quintic_spline": 0.0479,
}


def nominal(sim: Simulation) -> Controls:
    """Return the scene's own constants, whatever happens."""
    return sim.nominal_controls


@dataclass(frozen=True)
class Static:
    """Constant settings for the whole run.

    courant: dt c / h; sound: sound speed as a multiple of the scene's nominal c0; xsph: epsilon.
    """

    courant: float
    sound: float
    xsph: float

    def __post_init__(self) -> None:
        positive("courant", self.courant)
        positive("sound", self.sound)
        in_range("xsph", self.xsph, 0.0)

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        return from_numbers(sim, self.courant, self.sound * sim.scene.fluid.c0, self.xsph)


class ArticleCfl:
    """The article's rule: nominal stiffness, and in every frame the largest step it allows."""

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        stiffness, xsph = sim.nominal_controls[1:]
        sim.controls = sim.controls._replace(stiffness=stiffness)
        return Controls(sim.stable_dt(), stiffness, xsph)


@dataclass(frozen=True)
class TunedCfl:
    """A CFL rule as a practitioner would tune it, and the unit in which work is counted.

    The sound speed follows the flow, c = max(`mach` v, `fastest` v_max, `floor` c0), where v is the
    flow speed without velocity noise (`Simulation.diagnostics`): a rule that follows the fastest
    particle alone stiffens a noisy fluid, which makes it noisier still. The step follows the sound
    speed: 1 / dt = c / (`courant` h) + the viscous rates, since waves and friction share one
    stability limit. A Courant multiple of 1.0 is beyond what symplectic Euler can take, and at 0.8
    some impacts squeeze weakly damped water so hard that the step is too long for it.

    Epsilon makes up for a lack of artificial viscosity: it is `xsph` where alpha is that of the
    article's scenes, and `xsph_slope` larger for every decade below, within XSPH_RANGE.
    """

    courant: float = 0.75
    mach: float = 8.0
    fastest: float = 5.0
    floor: float = 0.42
    xsph: float = 0.45
    xsph_slope: float = 0.3

    def __post_init__(self) -> None:
        positive("courant", self.courant)
        for name in ("mach", "fastest", "floor", "xsph", "xsph_slope"):
            in_range(name, getattr(self, name), 0.0)

    def __call__(self, sim: Simulation) -> Controls:
        """Return the controls for the present state."""
        return self.at(sim, sim.diagnostics())

    def at(self, sim: Simulation, numbers: Mapping[str, float]) -> Controls:
        """Return the controls for the present state, whose diagnostics are known."""
        scene, h = sim.scene, sim.scene.h
        follow = max(self.mach * numbers["flow_speed"], self.fastest * numbers["max_speed"])
        c = max(follow, self.floor * scene.fluid.c0)
        dt = min(1 / (c / (self.courant * h) + viscous_rate(scene)), scene.surface_dt)
        alpha = scene.effects.artificial_viscosity or 0.0
        return Controls(dt, scene.fluid.stiffness(c), self.smoothing(alpha))

    def smoothing(self, alpha: float) -> float:
        """Return the epsilon for the alpha of an artificial viscosity, 0 for none."""
        low, high = XSPH_RANGE
        decades = math.log10(USUAL_ALPHA / alpha) if alpha > 0 else math.inf
        return min(max(self.xsph + self.xsph_slope * decades, low), high)


def viscous_rate(scene: Scene) -> float:
    """Return 1 / dt [1/s] of the longest step that viscosity alone allows."""
    h = scene.h
    nu = scene.effects.laminar_viscosity or 0.0
    alpha = scene.effects.artificial_viscosity or 0.0
    # the continuum's nu is alpha c0 h / 8, but the shortest waves feel twice as much
    damping = alpha * scene.fluid.c0 / (4 * h * damping_share(scene))
    return nu / (scene.viscous_share * h * h) + damping


def damping_share(scene: Scene) -> float:
    """Return the step that an artificial viscosity nu allows, as a share of h^2 / nu."""
    share = DAMPING_SHARES.get(scene.fluid.kernel, DAMPING_SHARES["mueller"])
    return VISCOUS_SHARES.get(scene.integrator, 1.0) * share


def from_numbers(sim: Simulation, courant: float, c: float, xsph: float) -> Controls:
    """Return controls from the Courant multiple dt c / h, the sound speed c [m/s] and epsilon."""
    return Controls(courant * sim.scene.h / c, sim.scene.fluid.stiffness(c), xsph)
