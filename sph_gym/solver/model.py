"""The numbers that the compiled loops take: made from a scene, and changed by controls."""

from collections import namedtuple
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.solver.boundary import Extrapolation
from sph_gym.solver.checks import number as finite
from sph_gym.solver.confinement import Box, Plates, Stroke
from sph_gym.solver.effects import Xsph
from sph_gym.solver.equation_of_state import make_eos
from sph_gym.solver.images import FREEBOARD, MirrorPlates, make_mirrors
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.jit import jitable
from sph_gym.solver.kernels import ALL_KERNELS, calibrated_mass, weight
from sph_gym.solver.lanes import like, replaced
from sph_gym.solver.mirror_plates import make_mirror_plates
from sph_gym.solver.neighbors import WIDEST_GROUP
from sph_gym.solver.periodic import Period, make_period
from sph_gym.solver.registry import EFFECTS, Given
from sph_gym.solver.scene import Scene
from sph_gym.solver.state import Controls
from sph_gym.solver.thickness import LINK, is_linked, measure
from sph_gym.solver.tunnelling import GATE, INSIDE_WALL, LEAP, REACH, UnbackedWalls
from sph_gym.solver.walls import Walls

# Factor of h^2 for the lists: all within h must be on them, however distances were rounded.
ROUNDING = 1.0001
# Share of W(0): a boundary particle with less fluid around it is dry.
DRY = 1e-6
# Share of dx: how far in front of a plate a particle that hit it is put.
SKIN = 1e-2

# The numbers of the effects of a scene as the compiled loops take them; None where absent.
_NAMES = [each.name for each in EFFECTS]
ActiveEffects: Any = namedtuple("ActiveEffects", _NAMES, defaults=[None] * len(_NAMES))  # type: ignore[misc]


def active_effects(given: Given, number: Any) -> Any:
    """Return the `ActiveEffects` between fluid particles, in the precision `number`."""
    strengths = {}
    for each in EFFECTS:
        value = getattr(given.effects, each.name)
        if value is not None and value is not False:
            strength = each.strength(value, given)
            strengths[each.name] = type(strength)(*map(number, strength))
    return ActiveEffects(**strengths)


def wall_effects(effects: Any, slip: str) -> Any:
    """Return the effects between fluid and boundary particles, which slip or do not.

    Walls hold no velocity that would smooth the advection and no density that could diffuse, and
    do not attract the fluid; those with free slip do not rub either. They are no free surface.
    """
    if effects.shifting is not None:
        effects = effects._replace(
            shifting=effects.shifting._replace(inv_range=0 * effects.shifting.inv_range)
        )
    acting, layer = {"always", slip}, effects.surface_tension
    effects = effects._replace(**{e.name: None for e in EFFECTS if e.at_walls not in acting})
    if layer is not None:
        # the layer that pulls is not pulled by walls, but rubs against them
        effects = effects._replace(surface_tension=layer._replace(strength=0 * layer.strength))
    return effects


class Constants(NamedTuple):
    """Numbers that all pair loops share, in the precision of the arrays.

    h: support radius [m]; reach2: its square with room for rounding [m^2], infinite for brute
    force; eta2: 0.01 h^2 [m^2]; density_scale: m weight_scale; force_scale: m gradient_scale;
    widest: of a group [m]; period_x, period_y: where space closes upon itself, or None.
    """

    h: Any
    reach2: Any
    eta2: Any
    density_scale: Any
    force_scale: Any
    widest: Any
    period_x: Period | None
    period_y: Period | None


class Model(NamedTuple):
    """All that does not change within a call; absent parts are None and compiled away."""

    kernel: Any
    eos: Any
    constants: Constants
    effects: Any
    wall_effects: Any
    image_effects: Any
    gravity: Any
    box: Box | None
    mirrors: Box | None
    mirror_plates: MirrorPlates | None
    plates: Plates | None
    unbacked_walls: UnbackedWalls | None
    extrapolation: Extrapolation | None
    stroke: Stroke | None
    integrator: Any


def particle_mass(scene: Scene) -> float:
    """Return the mass of every particle [kg/m], calibrated on the rest lattice."""
    return calibrated_mass(ALL_KERNELS[scene.fluid.kernel](scene.h), scene.fluid.rho0, scene.dx)


def make_model(scene: Scene, mass: float, number: Any, brute: bool) -> Model:
    """Return the numbers of a scene in the precision `number`, np.float64 or np.float32.

    The parts that controls change are set by `with_controls`. Absurd but legal numbers may become
    infinite in float32; the tripwire reports what follows.
    """
    with np.errstate(over="ignore"):
        kernel, fluid, walls = ALL_KERNELS[scene.fluid.kernel](scene.h), scene.fluid, scene.walls
        given = Given(scene.effects, kernel, scene.h, scene.dx, fluid.c0, fluid.rho0, mass)
        effects = active_effects(given, number)
        return Model(
            ALL_KERNELS[fluid.kernel](scene.h, number),
            make_eos(1.0, fluid.rho0, fluid.gamma, fluid.clamp, number),
            _constants(scene, kernel, mass, number, brute),
            effects,
            wall_effects(effects, "no-slip" if walls is None else walls.slip),
            # the density at rest isn't that of a mirror: gravity has no image
            effects._replace(density_diffusion=None),
            None if scene.effects.field is None else scene.effects.field.compiled(),
            _box(scene, number),
            make_mirrors(None if walls is None else walls.mirrored_sides(scene.h), number),
            make_mirror_plates(scene, number),
            _plates(walls, scene.dx, number),
            _unbacked_walls(scene, number),
            _extrapolation(scene, number),
            None if walls is None or walls.motion is None else walls.motion.stroke(),
            INTEGRATORS[scene.integrator],
        )


# --- Controls -------------------------------------------------------------------------------

# Places in a row of controls.
DT, STIFFNESS, XSPH, HYDRO_X, HYDRO_Y = range(5)


def control_row(scene: Scene, model: Model, controls: Controls) -> NDArray[np.float64]:
    """Return (5,) the numbers that follow from controls.

    dt [s]; Tait's B [Pa]; the scale of `Xsph`; hydro_x and hydro_y of `DensityDiffusion`.
    """
    hydro = [0.0, 0.0]
    if scene.effects.density_diffusion is not None and scene.effects.field is not None:
        # the hydrostatic gradient of the lasting gravity
        slope = scene.fluid.rho0 / scene.fluid.sound_speed(controls.stiffness) ** 2
        hydro = [slope * g for g in scene.effects.field.lasting().tolist()]
    smoothing = 2 * controls.xsph * float(model.constants.density_scale)
    return np.array([controls.dt, controls.stiffness, smoothing, *hydro])


@jitable
def with_controls(model, row):
    """Return the model with a row of controls in it, and dt [s] in the precision of the model."""
    h = model.kernel.h
    model = replaced(model, "eos", replaced(model.eos, "stiffness", like(h, row[STIFFNESS])))
    effects = _with_xsph(model.effects.xsph, model.effects, like(h, row[XSPH]))
    effects = _with_hydro(
        effects.density_diffusion, effects, like(h, row[HYDRO_X]), like(h, row[HYDRO_Y])
    )
    return replaced(model, "effects", effects), like(h, row[DT])


@jitable
def _with_xsph(xsph, effects, scale):
    if xsph is None:
        return effects
    return replaced(effects, "xsph", Xsph(scale))


@jitable
def _with_hydro(diffusion, effects, hydro_x, hydro_y):
    if diffusion is None:
        return effects
    diffusion = replaced(replaced(diffusion, "hydro_x", hydro_x), "hydro_y", hydro_y)
    return replaced(effects, "density_diffusion", diffusion)


# --- Parts ----------------------------------------------------------------------------------


def _constants(scene: Scene, kernel: Any, mass: float, number: Any, brute: bool) -> Constants:
    # so narrow that no particle is within h of a group and of its image
    rooms = [0.9 * (ends[1] - ends[0] - 2 * scene.h) for ends in scene.periods if ends is not None]
    return Constants(
        number(scene.h),
        number(np.inf if brute else ROUNDING * scene.h**2),
        number(0.01 * scene.h**2),
        number(mass * kernel.weight_scale),
        number(mass * kernel.gradient_scale),
        number(np.inf if brute else min([WIDEST_GROUP * scene.h, *rooms])),
        *(make_period(ends, number) for ends in scene.periods),
    )


def _box(scene: Scene, number: Any) -> Box | None:
    walls = scene.walls
    if walls is None or walls.box is None:
        return None
    sides, mirrored = np.array(walls.box), walls.mirrored_sides(scene.h)
    if mirrored is not None:
        gap = FREEBOARD * scene.dx
        sides += np.where(np.isfinite(mirrored), [gap, -gap, gap, -gap], 0.0)
    return Box(*(number(side) for side in (*sides, walls.restitution, *[0.0] * 4)))


def _plates(walls: Walls | None, dx: float, number: Any) -> Plates | None:
    if walls is None or walls.plates is None:
        return None
    shifts = [
        (0.0,) if period is None else (0.0, period[0] - period[1], period[1] - period[0])
        for period in (walls.period_x, walls.period_y)
    ]
    plates = np.asarray(walls.plates)
    # a step may lead through an end of the domain, and to what is behind it
    images = [plates + np.array([x, y, x, y]) for x, y in product(*shifts)]
    ends = np.concatenate(images).astype(number)
    x0, y0, x1, y1 = (np.ascontiguousarray(column) for column in ends.T)
    return Plates(x0, y0, x1, y1, float(walls.restitution), finite("skin", SKIN * dx))


def _unbacked_walls(scene: Scene, number: Any) -> UnbackedWalls | None:
    walls, dx, h = scene.walls, scene.dx, scene.h
    if walls is None or walls.particles is None or not (unbacked := walls.unbacked(dx, h)).any():
        return None
    thickness = measure(np.asarray(walls.particles), scene.fluid.kernel, h, dx)
    thinnest = thickness.share[unbacked & is_linked(thickness, dx)].min(initial=INSIDE_WALL)
    return UnbackedWalls(
        number(LEAP * h), number(REACH * dx), number(GATE * thinnest), number(dx * LINK)
    )


def _extrapolation(scene: Scene, number: Any) -> Extrapolation | None:
    walls = scene.walls
    if walls is None or walls.particles is None or walls.pressure == "like fluid":
        return None
    kernel, zero = ALL_KERNELS[scene.fluid.kernel](scene.h, number), number(0.0)
    return Extrapolation(float(DRY * weight(kernel, zero, zero)))
