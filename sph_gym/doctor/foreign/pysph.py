"""PySPH, by its Python interface: `pip install pysph`, which needs a C++ compiler.

Its WCSPHScheme as it comes: cubic spline, densities by continuity, Tait's equation without a clamp,
Monaghan's momentum equation, Morris' viscosity, its predictor-corrector. Walls are layers of
particles at rest. A new solver takes 0.1 s; its first run compiles for 15 s, once without viscosity
and once with it, and keeps the result in ~/.pysph.
"""

from itertools import count

import numpy as np
from pysph.base.nnps import BoxSortNNPS
from pysph.base.utils import get_particle_array_wcsph
from pysph.sph import equation
from pysph.sph.scheme import WCSPHScheme

from sph_gym.doctor.case import Case
from sph_gym.doctor.foreign.shared import boundary


class PySPH:
    """A case in PySPH, whose smoothing length is half of the case's support."""

    def __init__(self, case: Case) -> None:
        arrays = [
            get_particle_array_wcsph(
                name=name, x=x[:, 0], y=x[:, 1], u=v[:, 0], v=v[:, 1], h=case.h / 2,
                m=case.rho0 * case.dx**2, rho=case.rho0,
            )
            for name, x, v in (
                ("fluid", case.x, case.v),
                ("wall", boundary(case), np.zeros_like(boundary(case))),
            )
            if len(x)
        ]  # fmt: skip
        scheme = WCSPHScheme(
            ["fluid"], ["wall"] * (len(arrays) - 1), 2, case.rho0, case.c0, case.h / 2,
            case.h / 2 / case.dx, case.gamma, *case.gravity, alpha=0.0, nu=case.viscosity,
            hg_correction=True,
        )  # fmt: skip
        scheme.configure_solver()
        # groups are numbered on from one solver to the next, and each new number compiles anew
        equation.group_counter = count()
        equations = scheme.get_equations()
        equations[-1].equations[-1].eps = case.xsph
        scheme.solver.set_parallel_manager(None)
        # its usual search, LinkedListNNPS, writes past its arrays where there is one particle
        scheme.solver.setup(arrays, equations, BoxSortNNPS(2, arrays, radius_scale=2.0))
        self.fluid, self.solver = arrays[0], scheme.solver
        self.evaluate()

    def step(self, dt: float) -> None:
        """Advance by dt [s]."""
        self.solver.integrator.step(0.0, dt)
        self.evaluate()

    def evaluate(self) -> None:
        """Renew everything that is shown."""
        self.solver.nnps.update()
        self.solver.integrator.initial_acceleration(0.0, 0.0)
        self.x, self.v, self.a, self.rho, self.p = (
            np.array([self.fluid.get(name) for name in names]).T
            for names in (("x", "y"), ("u", "v"), ("au", "av"), ("rho",), ("p",))
        )


make = PySPH
