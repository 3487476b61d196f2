"""From a scene and its controls to the numbers that the compiled loops take."""

from typing import Any

import numpy as np

from sph_gym.solver.effects import (
    ArtificialViscosity,
    LaminarViscosity,
    PairEffects,
    UniformGravity,
    Xsph,
)
from sph_gym.solver.equation_of_state import make_eos
from sph_gym.solver.forces import Constants
from sph_gym.solver.kernels import KERNELS, calibrated_mass
from sph_gym.solver.scene import Gravity, Scene
from sph_gym.solver.state import Controls
from sph_gym.solver.stepping import Model
from sph_gym.solver.walls import Box

# Of h^2, for the lists: whoever is within h must be on them, however distances were rounded.
ROUNDING = 1.0001


def particle_mass(scene: Scene) -> float:
    """Mass of every particle [kg/m], calibrated on the rest lattice in double precision."""
    return calibrated_mass(KERNELS[scene.fluid.kernel](scene.h), scene.fluid.rho0, scene.dx)


def make_model(scene: Scene, controls: Controls, mass: float, number: Any) -> Model:
    """What doesn't change within a call, in the precision `number` (np.float64 or np.float32).

    Absurd but legal numbers may become infinite in float32; the tripwire tells of what follows.
    """
    with np.errstate(over="ignore"):
        kernel, fluid = KERNELS[scene.fluid.kernel](scene.h), scene.fluid
        constants = Constants(
            number(scene.h),
            number(ROUNDING * scene.h**2),
            number(0.01 * scene.h**2),
            number(mass * kernel.weight_scale),
            number(mass * kernel.gradient_scale),
        )
        artificial, laminar = _viscosities(scene, kernel, number)
        xsph = Xsph(number(0.0)) if scene.effects.xsph else None
        model = Model(
            KERNELS[fluid.kernel](scene.h, number),
            make_eos(controls.stiffness, fluid.rho0, fluid.exponent, fluid.clamp, number),
            constants,
            PairEffects(artificial, laminar, xsph),
            # walls take part like fluid, but hold no velocity that would smooth the advection
            PairEffects(artificial, laminar, None),
            _gravity(scene),
            _box(scene, number),
        )
        return with_controls(model, controls, number)


def with_controls(model: Model, controls: Controls, number: Any) -> Model:
    """The same model with another stiffness and XSPH epsilon."""
    with np.errstate(over="ignore"):
        model = model._replace(eos=model.eos._replace(stiffness=number(controls.stiffness)))
        if model.effects.xsph is None:
            return model
        # as a Python float, in which 1/h^8 fits
        scale = 2 * controls.xsph * float(model.constants.density_scale)
        return model._replace(effects=model.effects._replace(xsph=Xsph(number(scale))))


def _viscosities(
    scene: Scene, kernel: Any, number: Any
) -> tuple[ArtificialViscosity | None, LaminarViscosity | None]:
    """Those that the scene names; None for the others."""
    named = scene.effects
    artificial = laminar = None
    if named.artificial_viscosity is not None:
        strength = 2 * named.artificial_viscosity * scene.fluid.c0 * scene.h
        artificial = ArtificialViscosity(number(strength))
    if named.laminar_viscosity is not None:
        ratio = kernel.viscosity_scale / kernel.gradient_scale
        laminar = LaminarViscosity(number(2 * named.laminar_viscosity * ratio))
    return artificial, laminar


def _gravity(scene: Scene) -> UniformGravity | None:
    gravity = scene.effects.gravity
    if not isinstance(gravity, Gravity):
        return None
    inv_ramp = 1 / gravity.ramp if gravity.ramp > 0 else 0.0
    return UniformGravity(float(gravity.x), float(gravity.y), inv_ramp)


def _box(scene: Scene, number: Any) -> Box | None:
    if scene.walls is None or scene.walls.box is None:
        return None
    return Box(*(number(side) for side in (*scene.walls.box, scene.walls.restitution)))
