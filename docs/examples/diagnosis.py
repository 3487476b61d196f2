"""
What is wrong with a solver
===========================

The doctor finds the first broken link of an SPH solver: neighbours, density, pressure, force,
viscosity, XSPH, integration or walls. Here it looks at a plain numpy solver with one wrong number.
"""

import matplotlib.pyplot as plt
import numpy as np

from sph_gym.doctor import Case, check_solver
from sph_gym.doctor.plain import Plain


class Mine(Plain):
    """A solver whose spiky gradient has the constant of the kernel itself: a common slip."""

    def slope(self, r):
        """Return the derivative dW/dr [1/m^3] of the kernel for pressure."""
        return -10 / (np.pi * self.h**5) * np.maximum(self.h - r, 0) ** 2


# %%
# A compressed block of fluid expands when it is released. With the mistake it also expands, only
# more slowly. This is hard to see from the particles.

dx = 0.04
block = np.stack(np.meshgrid(*2 * [np.arange(12) * 0.9 * dx]), axis=-1).reshape(-1, 2)
figure, axes = plt.subplots(1, 2, figsize=(8, 3.8), layout="constrained")
for axis, solver_class, title in zip(axes, (Plain, Mine), ("sound", "broken"), strict=True):
    solver = solver_class(Case(x=block.copy(), v=np.zeros_like(block)))
    for _ in range(40):
        solver.step(1e-3)
    speed = np.hypot(*solver.v.T)
    points = axis.scatter(*solver.x.T, c=speed, cmap="cividis", vmin=0, vmax=3, s=22)
    axis.set(title=title, aspect="equal", xlim=(-0.25, 0.65), ylim=(-0.25, 0.65), xlabel="x [m]")
axes[0].set_ylabel("y [m]")
figure.colorbar(points, ax=axes, label="speed [m/s]", shrink=0.85)

# %%
# The doctor makes small experiments in the order of the chain. It needs a function that takes a
# case and returns the solver; here, the class itself is such a function.

diagnosis = check_solver(Mine)
print(diagnosis.counts)
print(diagnosis.verdict)

# %%
# The result of the first broken check says what was measured and what a sound solver shows.

first = diagnosis.first
print(f"{first.check}: {first.measured:.3g} {first.unit}, expected {first.expected:.3g}")
print(first.message)

# %%
# :doc:`/playbook` shows how to wrap your own solver, in any language that Python can call.
