"""SPlisHSPlasH, by its Python bindings: `pip install pysplishsplash==2.17.0`.

Its WCSPH in two dimensions: cubic spline, densities by summation that never show less than rho0,
Tait's equation, symplectic Euler, its standard viscosity, single precision. It has no XSPH for
advection alone, and its walls are meshes of a scene file, which the bindings can't make of arrays:
a case with a box it does not do. A new solver takes 1 ms, a step of 100 particles 0.2 ms; set
OMP_NUM_THREADS=1, since threads that wait for each other make so small cases 100 times slower.

Raises ImportError for later versions, whose bindings crash without a scene file, and OSError where
the system has no libGL.so.1.
"""

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.foreign.shared import configure, in_plane, in_space, only_open_space, require

# the wheel brings a part of OpenGL's libraries
require("pysplishsplash", (2, 17), "they need a scene file", library="libGL.so.1")
import pysplishsplash as splash  # noqa: E402
from pysplishsplash.Utilities import VecVector3r  # noqa: E402

# The area of a particle in squares of its diameter.
AREA = 0.8
FIELDS = ("position", "velocity", "density", "pressure")


class Splash:
    """A case in SPlisHSPlasH, whose support is four radii of its particles.

    Raises NotImplementedError for a case with a box.
    """

    def __init__(self, case: Case) -> None:
        only_open_space(case, "its walls are meshes of a scene file")
        # the current simulation is the package's own; without one, it makes and keeps a new one
        splash.Simulation.setCurrent(None)
        self.simulation, self.radius = splash.Simulation.getCurrent(), case.h / 4
        # masses follow from the radius of this moment
        self.simulation.init(case.dx / 2 / AREA**0.5, True)
        self.simulation.addFluidModel(
            "Fluid", *(VecVector3r(in_space(each)) for each in (case.x, case.v)), [0] * case.n, 0
        )
        self.simulation.setSimulationMethod(splash.SimulationMethods.WCSPH)
        self.fluid, scheme = self.simulation.getFluidModel(0), self.simulation.getTimeStep()
        configure(
            (self.simulation, {"ENABLE_Z_SORT": False, "GRAVITATION": [*case.gravity, 0.0]}),
            (self.fluid, {"DENSITY0": case.rho0}),
            (scheme, {"STIFFNESS": case.rho0 * case.c0**2 / case.gamma, "EXPONENT": case.gamma}),
            (self.fluid.getViscosityBase(), {"VISCOSITY_COEFFICIENT": case.viscosity}),
        )
        self.x, self.v, self.rho, self.p = (
            in_plane(self.fluid.getFieldBuffer(name)) for name in FIELDS
        )
        self.evaluate()

    def step(self, dt: float) -> None:
        """Advance by dt [s]; a step of 0 s renews everything that is shown."""
        # kernels belong to the process: another solver may have set theirs
        splash.Simulation.setCurrent(self.simulation)
        configure(
            (self.simulation, {"PARTICLE_RADIUS": self.radius}),
            (splash.TimeManager.getCurrent(), {"TIME_STEP_SIZE": dt}),
        )
        self.simulation.getTimeStep().step()

    def evaluate(self) -> None:
        """Renew everything that is shown."""
        self.step(0.0)

    @property
    def a(self) -> Array:
        """Return the accelerations (n, 2) [m/s^2]."""
        return np.array([self.fluid.getAcceleration(i)[:2] for i in range(len(self.x))])


make = Splash
