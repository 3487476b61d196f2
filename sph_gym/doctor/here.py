"""This package's own solver through the doctor's door."""

from typing import Any

import numpy as np

from sph_gym import scenes
from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.foreign.shared import boundary
from sph_gym.doctor.subject import Factory
from sph_gym.solver.checks import known
from sph_gym.solver.geometry import LAYERS
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.kernels import ALL_KERNELS
from sph_gym.solver.scene import Effects, Fluid, Scene
from sph_gym.solver.simulation import DTYPES, NEIGHBORS, Simulation
from sph_gym.solver.state import Controls
from sph_gym.solver.walls import Walls

DENSITIES = ("summation", "continuity")
WALLS = ("box", "like fluid", "extrapolated")


class Here:
    """A `Simulation` of a case, as the protocol wants it."""

    def __init__(self, case: Case, scene: Scene, **settings: str) -> None:
        self.n, self.time = case.n, 0.0
        self.sim = Simulation(scene, **settings)  # type: ignore[arg-type]
        self.c0, self.stiffness = case.c0, scene.fluid.stiffness(case.c0)

    def __getattr__(self, name: str) -> Array:
        """Return x, v, rho or p of the fluid, without the particles of walls."""
        if name not in ("x", "v", "rho", "p"):
            raise AttributeError(name)
        return getattr(self.sim, name)[: self.n]

    @property
    def a(self) -> Array:
        """Return accelerations (n, 2) [m/s^2]."""
        engine, found = self.sim.engine, np.zeros((self.n, 2))
        for axis, column in enumerate(engine.accelerations(self.time)):
            found[engine.fluid.id, axis] = column[: self.n]
        return found

    def evaluate(self) -> None:
        """Do nothing: densities and pressures belong to the present positions at all times."""

    def step(self, dt: float) -> None:
        """Do a time step of dt seconds.

        The engine's alone: what `Simulation` adds to it are tripwires, and the doctor has its own.
        Raises RuntimeError if a value is no longer finite, or a particle is within a wall.
        """
        _, bad = self.sim.engine.run(self.time, dt, 1)
        self.time += dt
        if bad >= 0:
            raise RuntimeError(f"particle {self.sim.engine.fluid.id[bad]} is lost")


def here(
    kernel: str = "wendland_c2",
    density: str = "summation",
    walls: str = "box",
    integrator: str = "symplectic_euler",
    dtype: str = "float64",
    neighbors: str = "grid",
) -> Factory:
    """Return a factory of this solver with the given settings.

    kernel, integrator: as in `Scene`; density: "summation" or "continuity"; walls: the sides of
    the box as mirrors, "box", or with boundary particles, "like fluid" or "extrapolated"; dtype,
    neighbors: as in `Simulation`. Raises ValueError for unknown names.
    """
    known("kernel", kernel, ALL_KERNELS)
    known("density", density, DENSITIES)
    known("walls", walls, WALLS)
    known("integrator", integrator, INTEGRATORS)
    known("dtype", dtype, DTYPES)
    known("neighbors", neighbors, NEIGHBORS)

    def make(case: Case) -> Here:
        """Return this solver, set up for a case."""
        scene = Scene(
            "doctor",
            x=case.x,
            v=case.v,
            dx=case.dx,
            h=case.h,
            fluid=Fluid(case.c0, case.rho0, case.gamma, kernel),
            # each is present in all cases, so that one compiled version does for them
            effects=Effects(
                gravity=(float(case.gravity[0]), float(case.gravity[1])),
                xsph=True,
                laminar_viscosity=case.viscosity,
                continuity=density == "continuity",
            ),
            walls=_walls(case, walls),
            controls=Controls(case.dt, case.rho0 * case.c0**2 / case.gamma, case.xsph),
            integrator=integrator,
        )
        return Here(case, scene, dtype=dtype, neighbors=neighbors)

    return make


def of_scene(name: str) -> Factory:
    """Return a factory of this solver with the kernel, density, walls and scheme of a scene.

    Its clamp and its other effects are left out: the cases of the doctor are not its flow.
    Raises ValueError for unknown scenes.
    """
    scene = scenes.make(name)
    walls, settings = scene.walls, {"kernel": scene.fluid.kernel, "integrator": scene.integrator}
    if scene.effects.continuity:
        settings["density"] = "continuity"
    if walls is not None and walls.particles is not None:
        settings["walls"] = walls.pressure
    return here(**settings)


def short_name(name: str) -> Factory | str:
    """Return the factory that a short name stands for; other names as they are."""
    settings = {"grid": {}, "brute": {"neighbors": "brute"}, "float32": {"dtype": "float32"}}
    if name == "plain":
        return "sph_gym.doctor.plain:make"
    return here(**settings[name]) if name in settings else name


def _walls(case: Case, kind: str) -> Walls | None:
    if case.box is None or not np.isfinite(case.box).any():
        return None
    box: Any = case.box
    # fast particles pass boundary particles alone: as in the scenes, the box is there, too
    return Walls(box=box) if kind == "box" else Walls(boundary(case, LAYERS), box, pressure=kind)
