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


def particle_mass(scene: Scene) -> float:
    """Mass of every particle [kg/m], calibrated on the rest lattice in double precision."""
    return calibrated_mass(KERNELS[scene.fluid.kernel](scene.h), scene.fluid.rho0, scene.dx)


def make_model(scene: Scene, controls: Controls, mass: float, number: Any) -> Model:
    """What doesn't change within a call, in the precision `number` (np.float64 or np.float32).

    Absurd but legal numbers may become infinite in float32; the tripwire tells of what follows.
    """
    with np.errstate(over="ignore"):
        return _make_model(scene, controls, mass, number)


def _make_model(scene: Scene, controls: Controls, mass: float, number: Any) -> Model:
    kernel, fluid = KERNELS[scene.fluid.kernel](scene.h), scene.fluid
    constants = Constants(
        number(scene.h**2),
        number(0.01 * scene.h**2),
        number(mass * kernel.weight_scale),
        number(mass * kernel.gradient_scale),
    )
    artificial, laminar, xsph = _pair_effects(scene, controls, kernel, mass, number)
    return Model(
        KERNELS[fluid.kernel](scene.h, number),
        make_eos(controls.stiffness, fluid.rho0, fluid.exponent, fluid.clamp, number),
        constants,
        PairEffects(artificial, laminar, xsph),
        # walls take part like fluid, but hold no velocity that would smooth the advection
        PairEffects(artificial, laminar, None),
        _gravity(scene),
        _box(scene, number),
    )


def _pair_effects(
    scene: Scene, controls: Controls, kernel: Any, mass: float, number: Any
) -> tuple[ArtificialViscosity | None, LaminarViscosity | None, Xsph | None]:
    """The effects that the scene names; None for the others."""
    named = scene.effects
    artificial = laminar = xsph = None
    if named.artificial_viscosity is not None:
        strength = 2 * named.artificial_viscosity * scene.fluid.c0 * scene.h
        artificial = ArtificialViscosity(number(strength))
    if named.laminar_viscosity is not None:
        ratio = kernel.viscosity_scale / kernel.gradient_scale
        laminar = LaminarViscosity(number(2 * named.laminar_viscosity * ratio))
    if named.xsph:
        xsph = Xsph(number(2 * controls.xsph * mass * kernel.weight_scale))
    return artificial, laminar, xsph


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
