"""From a scene and its controls to the numbers that the compiled loops take."""

from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.density import LEAP, REACH, Alone, Constants, Extrapolation
from sph_gym.solver.effects import (
    ArtificialViscosity,
    Continuity,
    DensityDiffusion,
    LaplacianViscosity,
    MorrisViscosity,
    PairEffects,
    QuadraticViscosity,
    Shifting,
    SurfaceTension,
    TensileCorrection,
    Xsph,
)
from sph_gym.solver.equation_of_state import make_eos
from sph_gym.solver.integrators import INTEGRATORS, TWO_HALVES
from sph_gym.solver.kernels import ALL_KERNELS, calibrated_mass, primitive_scale, weight
from sph_gym.solver.neighbors import WIDEST_GROUP
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Controls
from sph_gym.solver.stepping import Model
from sph_gym.solver.surface import (
    DISORDER,
    HELD_BACK,
    SHAPE_SCALE,
    calibrated_stress,
    inverse_weight,
)
from sph_gym.solver.walls import make_box, make_period, make_plates

# Of h^2, for the lists: whoever is within h must be on them, however distances were rounded.
ROUNDING = 1.0001
# Of W(0): a boundary particle with less fluid around it is dry.
DRY = 1e-6
# The speed that c0 is meant for, and the share of it that particles are shifted with at most.
MACH, TOP_SHIFT = 0.1, 0.5


def particle_mass(scene: Scene) -> float:
    """Mass of every particle [kg/m], calibrated on the rest lattice in double precision."""
    return calibrated_mass(ALL_KERNELS[scene.fluid.kernel](scene.h), scene.fluid.rho0, scene.dx)


def make_model(scene: Scene, controls: Controls, mass: float, number: Any) -> Model:
    """What doesn't change within a call, in the precision `number` (np.float64 or np.float32).

    Absurd but legal numbers may become infinite in float32; the tripwire tells of what follows.
    """
    with np.errstate(over="ignore"):
        kernel, fluid = ALL_KERNELS[scene.fluid.kernel](scene.h, number), scene.fluid
        integrator = INTEGRATORS[scene.integrator]
        effects = _pair_effects(scene, mass, number)
        model = Model(
            kernel,
            make_eos(controls.stiffness, fluid.rho0, fluid.exponent, fluid.clamp, number),
            _constants(scene, mass, number),
            effects,
            _wall_effects(scene, effects),
            None if scene.effects.field is None else scene.effects.field.compiled(),
            make_box(scene.walls, number),
            make_plates(scene.walls, scene.dx, number),
            _alone(scene, number),
            _extrapolation(scene, kernel),
            None if scene.walls is None or scene.walls.motion is None
            else scene.walls.motion.stroke(),
            integrator,
            integrator if isinstance(integrator, TWO_HALVES) else None,
        )  # fmt: skip
        return with_steered(model, steered(model, scene, controls), number)


class Steered(NamedTuple):
    """The numbers of a model that controls change; 0 where it has no such part.

    stiffness: Tait's B [Pa]; xsph: of `Xsph`; hydro_x, hydro_y: of `DensityDiffusion`.
    """

    stiffness: float
    xsph: float
    hydro_x: float
    hydro_y: float


def steered(model: Model, scene: Scene, controls: Controls) -> Steered:
    """The numbers that go with controls, as Python floats, in which 1/h^8 fits."""
    hydro_x = hydro_y = 0.0
    if model.effects.density_diffusion is not None and scene.effects.field is not None:
        # of the hydrostatic gradient of the lasting gravity
        slope = scene.fluid.rho0 / scene.fluid.sound_speed(controls.stiffness) ** 2
        hydro_x, hydro_y = (slope * g for g in scene.effects.field.lasting().tolist())
    smoothing = 2 * controls.xsph * float(model.constants.density_scale)
    return Steered(controls.stiffness, smoothing, hydro_x, hydro_y)


def with_steered(model: Model, numbers: Steered, number: Any) -> Model:
    """The same model with these numbers, in the precision `number`."""
    with np.errstate(over="ignore"):
        stiffness, xsph, hydro_x, hydro_y = (number(each) for each in numbers)
    effects = model.effects
    if effects.xsph is not None:
        effects = effects._replace(xsph=Xsph(xsph))
    if effects.density_diffusion is not None:
        diffusion = effects.density_diffusion._replace(hydro_x=hydro_x, hydro_y=hydro_y)
        effects = effects._replace(density_diffusion=diffusion)
    return model._replace(eos=model.eos._replace(stiffness=stiffness), effects=effects)


def _constants(scene: Scene, mass: float, number: Any) -> Constants:
    kernel, walls = ALL_KERNELS[scene.fluid.kernel](scene.h), scene.walls
    periods = (None, None) if walls is None else (walls.period_x, walls.period_y)
    # so that nobody is within h of a group and of its image
    rooms = [0.9 * (ends[1] - ends[0] - 2 * scene.h) for ends in periods if ends is not None]
    return Constants(
        number(scene.h),
        number(ROUNDING * scene.h**2),
        number(0.01 * scene.h**2),
        number(mass * kernel.weight_scale),
        number(mass * kernel.gradient_scale),
        number(min([WIDEST_GROUP * scene.h, *rooms])),
        *(make_period(ends, number) for ends in periods),
    )


def _alone(scene: Scene, number: Any) -> Alone | None:
    walls = scene.walls
    if walls is None or not walls.stand_alone(scene.dx, scene.h):
        return None
    return Alone(number(LEAP * scene.h), number(REACH * scene.dx))


def _extrapolation(scene: Scene, kernel: Any) -> Extrapolation | None:
    walls = scene.walls
    if walls is None or walls.particles is None or walls.pressure == "like fluid":
        return None
    zero = type(kernel.h)(0.0)
    return Extrapolation(float(DRY * weight(kernel, zero, zero)))


def _pair_effects(scene: Scene, mass: float, number: Any) -> PairEffects:
    """Those that the scene names, between fluid particles; None for the others."""
    named, h, c0 = scene.effects, scene.h, scene.fluid.c0
    kernel = ALL_KERNELS[scene.fluid.kernel](h)
    force_scale = mass * kernel.gradient_scale
    effects = PairEffects(
        xsph=Xsph(number(0.0)) if named.xsph else None,
        continuity=Continuity(number(mass * primitive_scale(kernel))) if named.continuity else None,
    )
    if named.artificial_viscosity is not None:
        strength = ArtificialViscosity(number(2 * named.artificial_viscosity * c0 * h))
        effects = effects._replace(artificial_viscosity=strength)
    if named.quadratic_viscosity is not None:
        quadratic = QuadraticViscosity(number(2 * named.quadratic_viscosity * h**2))
        effects = effects._replace(quadratic_viscosity=quadratic)
    if named.laminar_viscosity is not None:
        laminar = _laminar(named.laminar_viscosity, named.viscosity_form, kernel, number)
        effects = effects._replace(laminar_viscosity=laminar)
    if named.tensile_correction is not None:
        at_dx = float(weight(kernel, scene.dx**2, scene.dx))
        # h = dx: nobody at rest is within the support, and nothing is near enough to correct
        inv_weight = 1 / at_dx if h > scene.dx else 0.0
        tensile = TensileCorrection(number(named.tensile_correction), number(inv_weight))
        effects = effects._replace(tensile_correction=tensile)
    if named.surface_tension is not None:
        effects = effects._replace(surface_tension=_surface_tension(scene, kernel, mass, number))
    if named.density_diffusion is not None:
        strength = number(2 * named.density_diffusion * c0 * h)
        # the gradient follows the controls
        gradient = number(0.0), number(0.0)
        effects = effects._replace(density_diffusion=DensityDiffusion(strength, *gradient))
    if named.shifting is not None:
        speed = MACH * c0
        shifting = Shifting(
            number(2 * named.shifting * speed * h * force_scale), number(TOP_SHIFT * speed)
        )
        effects = effects._replace(shifting=shifting)
    return effects


def _laminar(nu: float, form: str, kernel: Any, number: Any) -> Any:
    if form == "morris":
        return MorrisViscosity(number(4 * nu))
    return LaplacianViscosity(number(2 * nu * kernel.viscosity_scale / kernel.gradient_scale))


def _surface_tension(scene: Scene, kernel: Any, mass: float, number: Any) -> SurfaceTension:
    """In a fluid with particles of this mass [kg/m]."""
    sigma, h, volume = scene.effects.surface_tension, scene.h, mass / scene.fluid.rho0
    stress = calibrated_stress(sigma, kernel, volume, scene.dx)  # type: ignore[arg-type]
    shape_scale = SHAPE_SCALE / h**7
    return SurfaceTension(
        number(stress * volume**2 * shape_scale / (mass**2 * kernel.gradient_scale)),
        number(volume * shape_scale),
        number(h),
        number((DISORDER / h) ** 2),
        number(HELD_BACK),
        number(kernel.weight_scale * inverse_weight(kernel, scene.dx)),
    )


def _wall_effects(scene: Scene, effects: PairEffects) -> PairEffects:
    """Those between a fluid and a boundary particle.

    Walls hold no velocity that would smooth the advection, no density that could diffuse, and
    don't attract the fluid; those with free slip don't rub either.
    """
    effects = effects._replace(xsph=None, density_diffusion=None, surface_tension=None)
    if scene.walls is not None and scene.walls.slip == "free-slip":
        effects = effects._replace(
            artificial_viscosity=None, quadratic_viscosity=None, laminar_viscosity=None
        )
    return effects
