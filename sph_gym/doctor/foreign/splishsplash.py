"""SPlisHSPlasH, by its Python bindings: `pip install pysplishsplash==2.17.0`.

Its WCSPH in two dimensions: cubic spline, densities by summation that never show less than rho0,
Tait's equation, symplectic Euler, its standard viscosity, single precision. It has no XSPH for
advection alone, and its walls are meshes of a scene file, which the bindings can't make of arrays:
a case with a box it does not do. A new solver takes 1 ms, a step of 100 particles 0.2 ms; set
OMP_NUM_THREADS=1, since threads that wait for each other make so small cases 100 times slower.

Raises ImportError for later versions, whose bindings crash without a scene file, and OSError where
the system has no libGL.so.1.
"""

import ctypes
from importlib.metadata import version

import numpy as np

if tuple(map(int, version("pysplishsplash").split(".")[:2])) > (2, 17):
    raise ImportError("pysplishsplash: expected version 2.17.0, later ones need a scene file")
# the wheel brings a part of OpenGL's libraries and crashes unless the system's are there before
ctypes.CDLL("libGL.so.1")
import pysplishsplash as splash  # noqa: E402

from sph_gym.doctor.case import Array, Case  # noqa: E402

# The area of a particle in squares of its diameter.
AREA = 0.8


class Splash:
    """A case in SPlisHSPlasH, whose support is four radii of its particles.

    Raises NotImplementedError for a case with a box.
    """

    def __init__(self, case: Case) -> None:
        if case.box is not None:
            raise NotImplementedError("its walls are meshes of a scene file")
        # the current simulation is the package's own; without one, it makes and keeps a new one
        splash.Simulation.setCurrent(None)
        self.simulation, self.radius = splash.Simulation.getCurrent(), case.h / 4
        self.simulation.init(self.radius, True)
        # masses follow from the radius of this moment
        self.simulation.setParticleRadius(case.dx / 2 / AREA**0.5)
        flat = [(0, 0), (0, 1)]
        x, v = (splash.Utilities.VecVector3r(np.pad(each, flat)) for each in (case.x, case.v))
        self.simulation.addFluidModel("Fluid", x, v, [0] * case.n, 0)
        self.fluid = self.simulation.getFluidModel(0)
        self.fluid.setDensity0(case.rho0)
        self.simulation.setParticleRadius(self.radius)
        self.simulation.setSimulationMethod(splash.SimulationMethods.WCSPH)
        self.simulation.setValueBool(splash.Simulation.ENABLE_Z_SORT, False)
        self.simulation.setVec3ValueReal(splash.Simulation.GRAVITATION, [*case.gravity, 0.0])
        self.scheme, viscosity = self.simulation.getTimeStep(), self.fluid.getViscosityBase()
        self.scheme.setValueFloat(self.scheme.STIFFNESS, case.rho0 * case.c0**2 / case.gamma)
        self.scheme.setValueFloat(self.scheme.EXPONENT, case.gamma)
        viscosity.setValueFloat(viscosity.VISCOSITY_COEFFICIENT, case.viscosity)
        x, v, self.rho, self.p = (
            np.asarray(self.fluid.getFieldBuffer(name))
            for name in ("position", "velocity", "density", "pressure")
        )
        self.x, self.v = x[:, :2], v[:, :2]
        self.evaluate()

    def step(self, dt: float) -> None:
        """Advance by dt [s]."""
        if splash.Simulation.getCurrent() is not self.simulation:
            splash.Simulation.setCurrent(self.simulation)
            self.simulation.setParticleRadius(self.radius)
        splash.TimeManager.getCurrent().setTimeStepSize(dt)
        self.scheme.step()

    def evaluate(self) -> None:
        """Renew everything that is shown."""
        self.step(0.0)

    @property
    def a(self) -> Array:
        """Return the accelerations (n, 2) [m/s^2]."""
        return np.array([self.fluid.getAcceleration(i)[:2] for i in range(len(self.x))])


make = Splash
