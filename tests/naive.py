"""The slow, obvious solver that everything is checked against.

Textbook formulas in float64, over all pairs at once, with nothing taken from the solver: a `Scene`
and its `Controls` are only read for their numbers. Arrays over pairs have shape (n, n), fluid
particles first, then wall particles; `h` is the support radius.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

# --- Kernels in two dimensions --------------------------------------------------------------


def poly6(r, h):
    """W(r) [1/m^2], Mueller 2003 with the constant for two dimensions."""
    return np.where(r < h, 4 / (np.pi * h**8) * (h**2 - r**2) ** 3, 0.0)


def spiky_slope(r, h):
    """dW/dr [1/m^3] of the spiky kernel 10 / (pi h^5) (h - r)^3."""
    return np.where(r < h, -30 / (np.pi * h**5) * (h - r) ** 2, 0.0)


def mueller_laplacian(r, h):
    """Laplacian [1/m^4] of Mueller's viscosity kernel."""
    return np.where(r < h, 40 / (np.pi * h**5) * (h - r), 0.0)


def wendland(r, h):
    """W(r) [1/m^2] of Wendland's C2 kernel: 7 / (pi h^2) (1 - q)^4 (1 + 4 q)."""
    q = r / h
    return np.where(q < 1, 7 / (np.pi * h**2) * (1 - q) ** 4 * (1 + 4 * q), 0.0)


def wendland_slope(r, h):
    """dW/dr [1/m^3]: (1 - q)^4 (1 + 4 q) has the derivative -20 q (1 - q)^3."""
    q = r / h
    return np.where(q < 1, -140 / (np.pi * h**3) * q * (1 - q) ** 3, 0.0)


def wendland_laplacian(r, h):
    """Morris 1997: -2 (dW/dr) / r, with its limit at r = 0."""
    q = r / h
    return np.where(q < 1, 280 / (np.pi * h**4) * (1 - q) ** 3, 0.0)


def spiky(r, h):
    """W(r) [1/m^2] of the spiky kernel."""
    return np.where(r < h, 10 / (np.pi * h**5) * (h - r) ** 3, 0.0)


def cubic_spline(r, h):
    """W(r) [1/m^2] of the M4 spline, Monaghan 1992; its smoothing length s is half of h."""
    s = h / 2
    q = r / s
    parts = [1 - 3 / 2 * q**2 + 3 / 4 * q**3, 1 / 4 * (2 - q) ** 3]
    return 10 / (7 * np.pi * s**2) * np.select([q < 1, q < 2], parts)


def cubic_slope(r, h):
    """dW/dr [1/m^3]."""
    s = h / 2
    q = r / s
    parts = [-3 * q + 9 / 4 * q**2, -3 / 4 * (2 - q) ** 2]
    return 10 / (7 * np.pi * s**3) * np.select([q < 1, q < 2], parts)


def cubic_laplacian(r, h):
    """Morris 1997: -2 (dW/dr) / r, with its limit at r = 0."""
    s = h / 2
    q = r / s
    parts = [3 - 9 / 4 * q, 3 / 4 * (2 - q) ** 2 / np.maximum(q, 1)]
    return 20 / (7 * np.pi * s**4) * np.select([q < 1, q < 2], parts)


def quintic_spline(r, h):
    """W(r) [1/m^2] of the M6 spline, Morris 1997; its smoothing length s is a third of h."""
    s = h / 3
    q = r / s
    outer = (3 - q) ** 5
    middle = outer - 6 * (2 - q) ** 5
    inner = middle + 15 * (1 - q) ** 5
    return 7 / (478 * np.pi * s**2) * np.select([q < 1, q < 2, q < 3], [inner, middle, outer])


def quintic_slope(r, h):
    """dW/dr [1/m^3]."""
    s = h / 3
    q = r / s
    outer = (3 - q) ** 4
    middle = outer - 6 * (2 - q) ** 4
    inner = middle + 15 * (1 - q) ** 4
    return -35 / (478 * np.pi * s**3) * np.select([q < 1, q < 2, q < 3], [inner, middle, outer])


def quintic_laplacian(r, h):
    """Morris 1997: -2 (dW/dr) / r, near r = 0 from the bracket 66 - 60 q^2 + 30 q^4 - 10 q^5."""
    s = h / 3
    near = 7 / (478 * np.pi * s**4) * (240 - 240 * (r / s) ** 2 + 100 * (r / s) ** 3)
    return np.where(r < s / 10, near, -2 * quintic_slope(r, h) / np.maximum(r, s / 10))


def mueller_in_3d(r, h):
    """W(r) [1/m^3] with Mueller's own constant."""
    return np.where(r < h, 315 / (64 * np.pi * h**9) * (h**2 - r**2) ** 3, 0.0)


def mueller_slope_in_3d(r, h):
    """dW/dr [1/m^4] with Mueller's own constant."""
    return np.where(r < h, -45 / (np.pi * h**6) * (h - r) ** 2, 0.0)


def mueller_laplacian_in_3d(r, h):
    """Laplacian [1/m^5] with Mueller's own constant."""
    return np.where(r < h, 45 / (np.pi * h**6) * (h - r), 0.0)


def third_of_spiky_slope(r, h):
    """dW/dr [1/m^3] without the 3 from the exponent."""
    return spiky_slope(r, h) / 3


def poly6_slope(r, h):
    """dW/dr [1/m^3] of poly6."""
    return np.where(r < h, -24 / (np.pi * h**8) * r * (h**2 - r**2) ** 2, 0.0)


class Kernel(NamedTuple):
    density: object
    slope: object
    laplacian: object


KERNELS = {
    "mueller": Kernel(poly6, spiky_slope, mueller_laplacian),
    "wendland_c2": Kernel(wendland, wendland_slope, wendland_laplacian),
    "spiky": Kernel(spiky, spiky_slope, mueller_laplacian),
    "cubic_spline": Kernel(cubic_spline, cubic_slope, cubic_laplacian),
    "quintic_spline": Kernel(quintic_spline, quintic_slope, quintic_laplacian),
    "wrong_3d_constants": Kernel(mueller_in_3d, mueller_slope_in_3d, mueller_laplacian_in_3d),
    "wrong_spiky_gradient": Kernel(poly6, third_of_spiky_slope, mueller_laplacian),
    "wrong_poly6_gradient": Kernel(poly6, poly6_slope, mueller_laplacian),
}


def calibrated_mass(kernel, h, dx, rho0):
    """rho0 divided by the kernel sum at a particle of the endless square lattice."""
    reach = range(-int(h / dx) - 1, int(h / dx) + 2)
    return rho0 / sum(
        float(kernel.density(np.hypot(i * dx, j * dx), h)) for i, j in product(reach, reach)
    )


# --- The solver -----------------------------------------------------------------------------


class Naive:
    """`Simulation` without any of its art; x and v are (n_fluid, 2) and are handed in and out."""

    def __init__(self, scene, controls):
        self.scene, self.controls = scene, controls
        fluid, walls = scene.fluid, scene.walls
        self.h, self.eps = scene.h, controls.xsph if scene.effects.xsph else 0.0
        self.kernel = KERNELS[fluid.kernel]
        self.mass = calibrated_mass(self.kernel, scene.h, scene.dx, fluid.rho0)
        self.gamma = {"tait": fluid.gamma, "linear": 1.0}[fluid.eos]
        has_wall_particles = walls is not None and walls.particles is not None
        self.wall_x = np.array(walls.particles) if has_wall_particles else np.empty((0, 2))

    def offsets(self, x):
        """x_i - x_j (n, n, 2) [m] and their lengths (n, n) [m], walls included."""
        everybody = np.concatenate([x, self.wall_x])
        offset = everybody[:, None] - everybody[None, :]
        return offset, np.hypot(offset[..., 0], offset[..., 1])

    def density(self, x):
        """(n,) [kg/m^3], fluid and walls; every particle counts itself."""
        _, r = self.offsets(x)
        return self.mass * self.kernel.density(r, self.h).sum(axis=1)

    def pressure(self, rho):
        """(n,) [Pa]: B ((rho / rho0)^gamma - 1), cut off at zero if the fluid is clamped."""
        fluid = self.scene.fluid
        p = self.controls.stiffness * ((rho / fluid.rho0) ** self.gamma - 1)
        return np.maximum(p, 0.0) if fluid.clamp else p

    def gravity(self, time):
        """(2,) [m/s^2]."""
        g = self.scene.effects.gravity
        if g is None:
            return np.zeros(2)
        return np.array([g.x, g.y]) * (min(time / g.ramp, 1.0) if g.ramp > 0 else 1.0)

    def acceleration(self, x, v, time):
        """(n_fluid, 2) [m/s^2]; wall particles are at rest."""
        n, h, effects = len(x), self.h, self.scene.effects
        offset, r = self.offsets(x)
        rho = self.density(x)
        p = self.pressure(rho)
        mean_rho = (rho[:, None] + rho[None, :]) / 2
        velocity = np.concatenate([v, np.zeros_like(self.wall_x)])
        relative = velocity[:, None] - velocity[None, :]

        # coincident particles have no direction and so no force between them
        direction = np.divide(
            offset, r[..., None], out=np.zeros_like(offset), where=r[..., None] > 0
        )
        grad = self.kernel.slope(r, h)[..., None] * direction

        stress = p[:, None] / rho[:, None] ** 2 + p[None, :] / rho[None, :] ** 2
        if effects.artificial_viscosity is not None:
            approach = (relative * offset).sum(axis=-1)
            mu = h * approach / (r**2 + 0.01 * h**2)
            pi = -effects.artificial_viscosity * self.scene.fluid.c0 * mu / mean_rho
            pi[approach >= 0] = 0.0
            stress = stress + pi
        a = -self.mass * (stress[..., None] * grad).sum(axis=1)

        if effects.laminar_viscosity is not None:
            drag = self.kernel.laplacian(r, h) / mean_rho
            a -= effects.laminar_viscosity * self.mass * (drag[..., None] * relative).sum(axis=1)
        return a[:n] + self.gravity(time)

    def xsph(self, x, v):
        """(n_fluid, 2) [m/s]: eps sum m (v_j - v_i) W / mean density, over the fluid only."""
        n = len(x)
        r, rho = self.offsets(x)[1][:n, :n], self.density(x)[:n]
        smoothing = self.kernel.density(r, self.h) / ((rho[:, None] + rho[None, :]) / 2)
        differences = v[None, :] - v[:, None]
        return self.eps * self.mass * (smoothing[..., None] * differences).sum(axis=1)

    def step(self, x, v, time, dt):
        """Symplectic Euler: v += a dt, then x += (new v + XSPH of the old v) dt, then the box."""
        new_v = v + self.acceleration(x, v, time) * dt
        new_x = x + (new_v + self.xsph(x, v)) * dt
        return self.confined(new_x, new_v)

    def confined(self, x, v):
        """Whoever has passed a side is put back onto it and bounces off."""
        walls = self.scene.walls
        if walls is None or walls.box is None:
            return x, v
        x, v = x.copy(), v.copy()
        for i, axis in product(range(len(x)), range(2)):
            low, high = walls.box[2 * axis], walls.box[2 * axis + 1]
            if x[i, axis] < low:
                x[i, axis] = low
                v[i, axis] = max(v[i, axis], -walls.restitution * v[i, axis])
            if x[i, axis] > high:
                x[i, axis] = high
                v[i, axis] = min(v[i, axis], -walls.restitution * v[i, axis])
        return x, v
