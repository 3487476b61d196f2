"""Contexts: the numerics of an instance, which an agent has to find out from what it observes.

The article's kernels heat what isn't damped. With weak artificial viscosity a fluid therefore turns
into a gas unless a large epsilon smooths it, and with a strong one a large epsilon makes particles
pair. The instances come from these two ends, and a few from between them.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sph_gym.solver.scene import Scene

# Ranges of alpha of the two ends, beyond them and between.
NOISY, DAMPED = (0.0045, 0.006), (0.08, 0.2)
BEYOND_NOISY, BETWEEN, BEYOND_DAMPED = (0.003, 0.004), (0.03, 0.06), (0.25, 0.35)
# Support radii [dx] of the two ends, and of all other fluids: a narrow one is noisier still, and in
# a wide one particles pair sooner.
NARROW, WIDE, USUAL = (2.3, 2.6), (2.8, 3.0), 2.6
# The kinds in turns: the same shares in every set, however small.
KINDS = ("noisy", "damped") * 4 + ("plain",)
# Limits of alpha between the kinds.
LEAST_PLAIN, LEAST_DAMPED = 0.01, 0.06
# Laminar viscosity of the viscous fluids, in multiples of h c0.
LAMINAR = (0.003, 0.01)
# Kernel of the article, whose density and force don't match; and two that do.
UNMATCHED = "mueller"
MATCHED = ("wendland_c2", "cubic_spline")
INTEGRATORS = ("kick_drift_kick", "predictor_corrector")


class Context(NamedTuple):
    """Numerics of a scene.

    alpha: strength of the artificial viscosity; support: h / dx; kernel, integrator: by name;
    viscosity: laminar, in multiples of h c0; 0 leaves a scene's own.
    """

    alpha: float = 0.02
    support: float = USUAL
    kernel: str = UNMATCHED
    viscosity: float = 0.0
    integrator: str = "symplectic_euler"

    @property
    def kind(self) -> str:
        """ "noisy", "damped" or "plain", by alpha."""
        if self.alpha < LEAST_PLAIN:
            return "noisy"
        return "damped" if self.alpha > LEAST_DAMPED else "plain"

    def apply(self, scene: Scene) -> Scene:
        """Return a scene with these numerics."""
        h = self.support * scene.dx
        effects = replace(scene.effects, artificial_viscosity=self.alpha or None)
        if self.viscosity:
            nu = self.viscosity * h * scene.fluid.c0
            effects = replace(effects, laminar_viscosity=nu)
        fluid = replace(scene.fluid, kernel=self.kernel)
        return replace(scene, h=h, fluid=fluid, effects=effects, integrator=self.integrator)


def of(scene: Scene) -> Context:
    """Return the numerics of a scene."""
    nu = scene.effects.laminar_viscosity or 0.0
    return Context(
        scene.effects.artificial_viscosity or 0.0,
        scene.h / scene.dx,
        scene.fluid.kernel,
        nu / (scene.h * scene.fluid.c0),
        scene.integrator,
    )


def draw(rng: np.random.Generator, number: int) -> Context:
    """Return the context of flow `number` of a set."""
    kind = KINDS[number % len(KINDS)]
    if kind == "plain":
        return Context()
    alphas, supports = (NOISY, NARROW) if kind == "noisy" else (DAMPED, WIDE)
    return Context(_log_uniform(rng, *alphas), float(rng.uniform(*supports)))


def shifted(rng: np.random.Generator, number: int, shift: str, usual: Context) -> Context:
    """Return a context that no other set has; `usual` if the shift is none of the numerics.

    number: of the flow among those with this shift.
    """
    turn = number % 2
    if shift == "between":
        return usual._replace(alpha=_log_uniform(rng, *BETWEEN), support=USUAL)
    if shift == "beyond":
        ends = (BEYOND_NOISY, BEYOND_DAMPED)[turn]
        return usual._replace(alpha=_log_uniform(rng, *ends), support=USUAL)
    if shift == "kernel":
        return usual._replace(kernel=MATCHED[turn])
    if shift == "viscosity":
        return usual._replace(viscosity=float(rng.uniform(*LAMINAR)))
    return usual._replace(integrator=INTEGRATORS[turn]) if shift == "integrator" else usual


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    # numpy's exp of one number differs in the last bit from one kind of processor to another
    return math.exp(rng.uniform(math.log(low), math.log(high)))
