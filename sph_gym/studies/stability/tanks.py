"""Hard cases in tanks: violent flows, extreme shapes, controls that no user should set."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from sph_gym import scenes
from sph_gym.scenes.shared import waves
from sph_gym.solver.geometry import disc, lattice, snap, tank_particles
from sph_gym.solver.gravity import ShakenGravity
from sph_gym.solver.scene import Effects, Fluid, Scene, sound_speed
from sph_gym.solver.walls import Motion, Walls
from sph_gym.studies.stability import bodies, case, events
from sph_gym.studies.stability.bodies import AWAY, NONE, ROUNDED
from sph_gym.studies.stability.case import HardCase, hard_case, stable_step

G = 9.81
# Least median density of water that falls and runs [rho0]; 0.95 is what is seen at 3 stable steps.
TOGETHER = 0.9
# Share of the particles that may be closer than 0.6 dx beyond that at the nominal epsilon: the
# environments' own tolerance, and at epsilons that they do not play.
SMOOTH, CLUMPY = 0.15, 0.3
# Largest density of a particle in the second half [rho0]: two and a half times what the densest
# hundredth may have.
PEAK = 1.1
# Share of a case's multiple of the stable step that the largest step must reach.
REACHED = 0.999
DX = 0.04
FRAME = 10
# Amplitude and frequency of the swinging wall [m, Hz]: 0.4 m/s at the most.
STROKE, STROKES = 0.04, 1.6
# Diffusion of a density by continuity, which drifts without it.
DIFFUSION = 0.1
# Particles across a channel: so few that viscosity is the limit.
ACROSS = 14


# --- Scenes ---------------------------------------------------------------------------------


def tank(
    x: Any, dx: float, width: float, height: float, c0: float, v: Any = None, **effects: Any
) -> Scene:
    """Return particles in a tank of boundary particles with a clamping box behind their face.

    Its right wall stands at the width itself, which need not be a multiple of dx.
    """
    walls = tank_particles(width, height, dx, layers=3)
    fitting = snap(width, dx)
    walls[walls[:, 0] > fitting, 0] += width - fitting
    acting: dict[str, Any] = {"gravity": (0.0, -G), "xsph": True, "artificial_viscosity": 0.05}
    return Scene(
        "hard case",
        x=x,
        v=v,
        dx=dx,
        h=2.6 * dx,
        fluid=Fluid(c0=c0, kernel="mueller"),
        effects=Effects(**acting | effects),
        walls=Walls(particles=walls, box=(0.0, width, 0.0, math.inf)),
        frame=FRAME * 0.4 * 2.6 * dx / c0,
    )


def with_walls(scene: Scene, particles: Any = None, **settings: Any) -> Scene:
    """Return the scene with other walls; particles: what the boundary particles become."""
    assert scene.walls is not None
    if particles is not None:
        settings["particles"] = particles(np.asarray(scene.walls.particles))
    return replace(scene, walls=replace(scene.walls, **settings))


def speed(height: float) -> float:
    """Return the sound speed [m/s] for what falls from a height [m]."""
    return sound_speed(math.sqrt(2 * G * height))


def dam(dx: float, width: float = 0.4, height: float = 0.8, **effects: Any) -> Scene:
    """Return a column that collapses in a tank of 1.2 m."""
    x = lattice(0.0, width, 0.0, height, dx)
    return tank(x, dx, snap(1.2, dx), 1.25 * height, speed(height), **effects)


def inviscid(dx: float) -> Scene:
    """Return a dam break that XSPH alone smooths, with kernels that are a pair.

    Others need viscosity: without any, those of the article make 0.2 to 0.35 of the energy at
    stake at an epsilon of 0.6, and 0.3 to 1.4 of it at 1.
    """
    scene = dam(dx, artificial_viscosity=None)
    return replace(scene, fluid=replace(scene.fluid, kernel="wendland_c2"))


def block(dx: float) -> tuple[float, float, float, float]:
    """Return the sides of an obstacle on the floor of `flooded` [m]."""
    left = snap(0.7, dx)
    return left, left + 4 * dx, 0.0, 5 * dx


def flooded(dx: float) -> Scene:
    """Return a dam that collapses onto an obstacle of boundary particles, which no box guards."""
    obstacle = lattice(*block(dx), dx)
    return with_walls(dam(dx), lambda walls: np.concatenate([walls, obstacle]))


def within_block(x: Any, dx: float) -> Any:
    """Return which positions are behind the first layer of the obstacle."""
    left, right, _, top = block(dx)
    return (x[:, 0] > left + dx) & (x[:, 0] < right - dx) & (x[:, 1] < top - dx)


def slammed(dx: float) -> Scene:
    """Return the dam's column after a fall from its own height, as it meets the floor."""
    scene = dam(dx)
    return replace(scene, v=np.tile((0.0, -math.sqrt(2 * G * 0.8)), (len(np.asarray(scene.x)), 1)))


def far_dam(dx: float) -> Scene:
    """Return the dam break, walls and box included, 10 km from the origin."""
    scene = dam(dx)
    assert scene.walls is not None
    left, right, bottom, top = np.asarray(scene.walls.box) + np.repeat(AWAY, 2)
    particles = np.asarray(scene.walls.particles) + AWAY
    walls = replace(scene.walls, particles=particles, box=(left, right, bottom, top))
    return replace(scene, x=np.add(scene.x, AWAY), walls=walls)


def packaged(name: str, dx: float, **arguments: Any) -> Scene:
    """Return a scene of the package."""
    return scenes.make(name, dx=dx, **arguments)


def film(dx: float) -> Scene:
    """Return one layer of particles on a floor 60 spacings wide."""
    width = 60 * DX
    return tank(lattice(0.0, width, 0.0, dx, dx), dx, width, 0.3, speed(0.3))


def scattered(dx: float) -> Scene:
    """Return a tank filled at random."""
    n = round(0.8 * 0.4 / dx**2)
    x = np.random.default_rng(3).uniform(0.0, 1.0, (n, 2)) * (0.8, 0.4)
    return tank(x, dx, snap(0.8, dx), 0.6, speed(0.6))


def pool(dx: float) -> Any:
    """Return the particles of water at rest, 0.8 m wide and 0.24 m deep."""
    return lattice(0.0, snap(0.8, dx), 0.0, 0.24, dx)


def stray(dx: float) -> Scene:
    """Return a particle that hits a pool at 100 m/s."""
    x = np.concatenate([pool(dx), [(0.4, 0.24 + 3 * dx)]])
    v = np.zeros_like(x)
    v[-1] = 30.0, -95.4
    return tank(x, dx, snap(0.8, dx), 0.6, speed(0.6), v=v)


def fast_drop(dx: float) -> Scene:
    """Return a drop that hits a pool at half the speed of sound."""
    drop, still = disc(0.4, 0.24 + 0.16 + 2 * dx, 0.16, dx), pool(dx)
    v = np.concatenate([np.zeros_like(still), np.tile((0.0, -0.5 * 20.0), (len(drop), 1))])
    return tank(np.concatenate([still, drop]), dx, snap(0.8, dx), 0.8, 20.0, v=v)


def shaken(dx: float) -> Scene:
    """Return a tank that is shaken along x in the first natural period of its water."""
    width, depth = snap(0.8, dx), 0.24
    frequency = waves.frequency(1, width, depth, G) / (2 * math.pi)
    gravity = ShakenGravity(0.0, -G, (0.15 * G, 0.0), frequency)
    return tank(pool(dx), dx, width, 0.8, speed(0.8), gravity=gravity)


def piston(dx: float) -> Scene:
    """Return a pool whose left wall, boundary particles and box alike, swings on the floor."""
    scene = tank(pool(dx), dx, snap(0.8, dx), 0.8, speed(0.8))
    assert scene.walls is not None
    x, y = np.asarray(scene.walls.particles).T
    # not what is below it, which would be pressed into the floor
    swings = (x < 0) & (y > 0)
    motion = Motion(amplitude=(STROKE, 0.0), frequency=STROKES, particles=swings, sides=("left",))
    return with_walls(scene, motion=motion)


def long_tank(dx: float, length: float) -> Scene:
    """Return a shallow pool in a tank of any length, with as many columns as fit in."""
    x = lattice(0.0, math.floor(length / dx + 1e-9) * dx, 0.0, 4 * dx, dx)
    return tank(x, dx, length, 8 * dx, speed(8 * dx))


def by_scheme(
    dx: float, build: Callable[[float], Scene], integrator: str, continuity: bool
) -> Scene:
    """Return a scene by another integrator, with densities that are summed or by continuity."""
    scene = build(dx)
    diffusion = DIFFUSION if continuity else None
    effects = replace(scene.effects, continuity=continuity, density_diffusion=diffusion)
    if continuity and scene.walls is not None and scene.walls.particles is not None:
        # those that are like fluid sum their densities
        scene = with_walls(scene, pressure="extrapolated")
    return replace(scene, effects=effects, integrator=integrator)


def outside_channel(x: Any, dx: float) -> Any:
    """Return which positions are behind the first layer of either wall, 1 m apart."""
    return (x[:, 1] < -dx) | (x[:, 1] > 1 + dx)


# --- Cases ----------------------------------------------------------------------------------


def flows() -> Iterator[HardCase]:
    """Yield cases whose flow is hard."""
    flow = partial(hard_case, dx=DX, density=0.01, quick=50, peak=PEAK)
    whole = partial(flow, typical=TOGETHER)
    yield flow(
        "random places in a tank", scattered, events.rose(2.0, 1.0), typical=0.25,
        unmatched={"excess": 0.13},
    )  # fmt: skip
    # its energy, shared by n particles, compresses them by M / sqrt(n): 2.9 / 11
    yield flow("stray particle at 100 m/s", stray, events.moved(5.0, 5.0), gain=0.26, typical=0.4)
    # where it hits, a flow at Mach M is compressed by M^2 / 2, here an eighth, and for a moment,
    # as in a water hammer, both bodies by M / 2
    yield flow(
        "drop impact at Mach 0.5", fast_drop, events.turned(2.0, 2.0), density=0.05, gain=0.25,
        p99=0.125, peak=1.25, typical=0.7,
    )  # fmt: skip
    # until its front has run against the other wall
    column = partial(dam, width=0.24, height=2.4)
    yield whole("column 10:1", column, events.ran(0.9, 0.3), frames=200, quick=70)
    yield whole("dam break on an obstacle", flooded, events.ran(0.7, 0.7), behind=within_block)
    # a row alone has but 0.7 of rho0
    yield flow(
        "film of one particle", film, events.moved(0.01, 0.01), density=NONE, p99=NONE, left=0.8,
        typical=0.65,
    )  # fmt: skip
    # calm as the scene itself asks for, a second after its ramp; the quick one has hardly any ramp
    at_rest = partial(packaged, "hydrostatic_tank", width=0.4, depth=0.4, seconds=60.0)
    yield whole(
        "water at rest for 60 s", at_rest, events.pressed(0.97, 0.9), frames=1200, quick=12,
        soon=partial(at_rest, ramp=0.1), left=0.9, calm=2.0, kinetic=1e-5,
    )  # fmt: skip
    # ten periods, and one
    yield whole("shaken at resonance", shaken, events.flowed(0.15, 0.05), frames=1120, quick=112)
    # the work of its wall counts as spurious energy
    yield whole("swinging wall", piston, events.moved(0.4, 0.3), excess=0.1)
    # where its wall leaves a gap, water slumps into it, and keeps 0.88; where it doesn't, it
    # settles by its own compression
    yield whole(
        "tanks of 0.5 to 5 m", long_tank, events.moved(0.015, 0.01), frames=60, quick=10, left=0.8,
        sizes=tuple(np.linspace(0.5, 5.0, 50).tolist()),
    )  # fmt: skip
    thick = partial(dam, laminar_viscosity=5.0)
    yield whole("high viscosity", thick, events.fell(0.04, 0.02), left=0.9)
    # long enough for the shock to run up to its top and back: v / c = 0.1 of compression behind
    # it, over no more than half of the column; what runs out at its foot relieves the rest. The
    # quick one ends when it has passed 2 % of it
    yield flow(
        "100,000 particles", slammed, events.turned(1.0, 0.04), dx=0.00178, quick=1, gain=0.05,
        typical=0.8,
    )  # fmt: skip


# A dam break that has run against the other wall in the end.
collapse = partial(
    hard_case, build=dam, event=events.ran(0.7, 0.7), dx=DX, quick=50, density=0.01,
    typical=TOGETHER, peak=PEAK,
)  # fmt: skip


def steps() -> Iterator[HardCase]:
    """Yield dam breaks by other steps than the stable one."""

    def stepped(factor: float, **more: Any) -> HardCase:
        steer = partial(stable_step, times=factor)
        return collapse(f"dt x {factor:g}", steer=steer, step=REACHED * factor, **more)

    for factor in (0.05, 0.3, 1.0):
        yield stepped(factor)
    # beyond the stable step a run may blow up, and multiplies what rounding began; one that
    # doesn't blow up may be a little hotter
    for factor in (1.5, 2.0, 2.5, 3.0, 4.0):
        soon = events.ran(0.7, 0.06)
        yield stepped(factor, stable=False, observables=None, excess=0.05, event=soon, quick=12)
    yield collapse("dt of the start for ever", steer=case.constant_step)


def stiffnesses() -> Iterator[HardCase]:
    """Yield dam breaks in softer and stiffer fluids, and in fluids that change."""
    softest, soft, usual, stiff, stiffest = (
        partial(stable_step, stiffer=factor) for factor in (0.01, 0.04, 1.0, 25.0, 100.0)
    )
    # a hundred times the energy in the same disorder, of which kernels that are no pair make more
    yield collapse("stiffness x 100", steer=stiffest, unmatched={"rise": 0.05})
    # as fast as its sound: the most compressed may be so by half
    yield collapse("stiffness / 100", steer=softest, density=0.2, p99=None, peak=1.5)
    yield collapse(
        "stiffness x 100 at the old dt", steer=partial(case.stiff_at_once, factor=100.0),
        stable=False, observables=None, step=10.0 * REACHED, causes=("stiffness",),
    )  # fmt: skip
    # each jump compresses and throws
    yield collapse(
        "stiffness switched every frame", steer=case.switching(usual, stiff, soft), density=0.05,
        p99=None, peak=1.5, typical=0.4, unmatched={"excess": 0.17},
    )  # fmt: skip
    short = partial(stable_step, times=0.05)
    yield collapse("dt switched every frame", steer=case.switching(usual, short))


def smoothing() -> Iterator[HardCase]:
    """Yield dam breaks by epsilons at the ends of what is ever set, against the nominal one."""
    usual, alone = collapse("dam break"), collapse("dam break", build=inviscid)
    # 0.6 is the largest that the environments play; beyond it, particles do clump: 0.12 to 0.27
    for epsilon, clumped in ((0.0, SMOOTH), (0.6, SMOOTH), (1.0, CLUMPY)):
        smooth = partial(collapse, steer=partial(stable_step, epsilon=epsilon), clumped=clumped)
        yield smooth(f"epsilon = {epsilon:g}", twin=usual)
        if epsilon > 0:
            yield smooth(
                f"epsilon = {epsilon:g}, no other viscosity", build=inviscid, twin=alone,
                kernel="cubic_spline", event=events.ran(0.7, 0.06), quick=12,
            )  # fmt: skip


def schemes() -> Iterator[HardCase]:
    """Yield all integrators, with summed densities and with those by continuity.

    Rotating squares are by kick_drift_kick and continuity, other cases by neither.
    """
    kick, corrector = "kick_drift_kick", "predictor_corrector"
    for scheme in ((kick, False), (corrector, False), ("symplectic_euler", True)):
        yield collapse(**_schemed("dam break", dam, *scheme))
    for continuity in (False, True):
        patches = _schemed("colliding patches", bodies.patches, corrector, continuity)
        yield bodies.body(**patches, event=events.turned(0.7, 0.7), gain=0.1, quick=40)
    for integrator in (kick, corrector):
        channel = _schemed("Poiseuille flow", partial(packaged, "poiseuille"), integrator, False)
        # two thirds of the 1 m/s on the centre line, in the end
        yield hard_case(
            **channel, event=events.flowed(0.6, 0.1), dx=1 / ACROSS, frames=200, quick=10,
            behind=outside_channel, typical=0.98, peak=1.05,
        )  # fmt: skip


def _schemed(
    name: str, build: Callable[[float], Scene], integrator: str, continuity: bool
) -> dict[str, Any]:
    """Return the name and the builder of a case by another scheme."""
    density = "by continuity" if continuity else "summed"
    built = partial(by_scheme, build=build, integrator=integrator, continuity=continuity)
    return {"name": f"{name}, {integrator}, {density}", "build": built}


def cases() -> Iterator[HardCase]:
    """Yield all cases but those by other schemes."""
    yield from flows()
    yield from steps()
    yield from stiffnesses()
    yield from smoothing()
    # no longer: a splash makes dx of what rounding began
    yield collapse(
        "far from the origin, in a tank", build=far_dam, unlike=ROUNDED, dtype="float32",
        twin=collapse("dam break", dtype="float32"), frames=60,
    )  # fmt: skip
