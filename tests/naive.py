"""The slow, obvious solver that everything is checked against.

Textbook formulas in float64, over all pairs at once, with nothing taken from the solver: a `Scene`
and its `Controls` are only read for their numbers. Arrays over pairs have shape (n, n), fluid
particles first, then wall particles; `h` is the support radius.
"""

import copy
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


def wendland(r, h):
    """W(r) [1/m^2] of Wendland's C2 kernel: 7 / (pi h^2) (1 - q)^4 (1 + 4 q)."""
    q = r / h
    return np.where(q < 1, 7 / (np.pi * h**2) * (1 - q) ** 4 * (1 + 4 * q), 0.0)


def wendland_slope(r, h):
    """dW/dr [1/m^3]: (1 - q)^4 (1 + 4 q) has the derivative -20 q (1 - q)^3."""
    q = r / h
    return np.where(q < 1, -140 / (np.pi * h**3) * q * (1 - q) ** 3, 0.0)


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


def mueller_in_3d(r, h):
    """W(r) [1/m^3] with Mueller's own constant."""
    return np.where(r < h, 315 / (64 * np.pi * h**9) * (h**2 - r**2) ** 3, 0.0)


def mueller_slope_in_3d(r, h):
    """dW/dr [1/m^4] with Mueller's own constant."""
    return np.where(r < h, -45 / (np.pi * h**6) * (h - r) ** 2, 0.0)


def third_of_spiky_slope(r, h):
    """dW/dr [1/m^3] without the 3 from the exponent."""
    return spiky_slope(r, h) / 3


def poly6_slope(r, h):
    """dW/dr [1/m^3] of poly6."""
    return np.where(r < h, -24 / (np.pi * h**8) * r * (h**2 - r**2) ** 2, 0.0)


def friction(r, h):
    """(h - r)^3 [m^3], the weight of laminar viscosity."""
    return np.where(r < h, (h - r) ** 3, 0.0)


def friction_scale(h, dx):
    """K [1/m^5]: on the rest lattice, sum K friction y^2 is the Laplacian 2 of y^2."""
    reach = np.arange(-np.ceil(h / dx), np.ceil(h / dx) + 1) * dx
    moment = sum(friction(np.hypot(x, y), h) * y**2 for x in reach for y in reach)
    most = 2.0 * dx**2 * 280 / (np.pi * h**7)
    return min(2 / moment, most) if moment > 0 else most


# --- Noise ----------------------------------------------------------------------------------


def smooth_flow(x, v, h, period=np.inf):
    """(n, 2) velocity at every particle of the affine flow that fits best around it.

    Least squares over the particles within h, itself included, with weights (1 - r^2/h^2)^2. With
    less than seven particles, or all nearly on a line, it is the particle's own velocity.
    """
    flow = v.copy()
    for i in range(len(x)):
        offset = x - x[i]
        if np.isfinite(period):
            offset -= period * np.round(offset / period)
        r2 = (offset**2).sum(axis=1)
        near = r2 < h**2
        d, weight = offset[near], (1 - r2[near] / h**2) ** 2
        if near.sum() < 7:
            continue
        spread = np.cov(d.T, aweights=weight, ddof=0)
        most = (weight @ (d**2).sum(axis=1) / weight.sum()) ** 2 / 4
        if np.linalg.det(spread) <= 0.02 * most:
            continue
        root = np.sqrt(weight)[:, None]
        basis = np.column_stack([np.ones(len(d)), d])
        fit, *_ = np.linalg.lstsq(root * basis, root * v[near], rcond=None)
        flow[i] = fit[0]
    return flow


class Kernel(NamedTuple):
    density: object
    slope: object


KERNELS = {
    "mueller": Kernel(poly6, spiky_slope),
    "wendland_c2": Kernel(wendland, wendland_slope),
    "spiky": Kernel(spiky, spiky_slope),
    "cubic_spline": Kernel(cubic_spline, cubic_slope),
    "quintic_spline": Kernel(quintic_spline, quintic_slope),
    "wrong_3d_constants": Kernel(mueller_in_3d, mueller_slope_in_3d),
    "wrong_spiky_gradient": Kernel(poly6, third_of_spiky_slope),
    "wrong_poly6_gradient": Kernel(poly6, poly6_slope),
}


def calibrated_mass(kernel, h, dx, rho0):
    """rho0 divided by the kernel sum at a particle of the endless square lattice."""
    reach = range(-int(h / dx) - 1, int(h / dx) + 2)
    return rho0 / sum(
        float(kernel.density(np.hypot(i * dx, j * dx), h)) for i, j in product(reach, reach)
    )


# --- Gravity --------------------------------------------------------------------------------


def gravity(field, time, x, v):
    """(n, 2) [m/s^2] for a gravity of any kind; in a rolling tank, in the frame of the tank."""
    kind = type(field).__name__
    if field is None:
        return np.zeros_like(x)
    if kind == "Gravity":
        share = min(time / field.ramp, 1.0) if field.ramp > 0 else 1.0
        return np.zeros_like(x) + share * np.array([field.x, field.y])
    if kind == "CentralGravity":
        return -(field.omega**2) * (x - np.array([field.x, field.y]))
    if kind == "ShakenGravity":
        shake = np.sin(2 * np.pi * field.frequency * time)
        return np.zeros_like(x) + np.array([field.x, field.y]) + shake * np.array(field.amplitude)
    if kind == "RecordedGravity":
        vectors = np.asarray(field.vectors)
        times = field.interval * np.arange(len(vectors))
        return np.zeros_like(x) + [np.interp(time, times, column) for column in vectors.T]
    assert kind == "RollingTank"
    # angle, angular velocity and acceleration about the axis that points at the reader
    omega = 2 * np.pi * field.frequency
    angle = field.amplitude * np.sin(omega * time)
    spin = np.array([0, 0, field.amplitude * omega * np.cos(omega * time)])
    change = np.array([0, 0, -field.amplitude * omega**2 * np.sin(omega * time)])
    # a vector that stands still turns the other way when seen from the tank
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    arm, velocity = (np.pad(a, ((0, 0), (0, 1))) for a in (x - np.array(field.pivot), v))
    fictitious = (
        -np.cross(change, arm) - np.cross(spin, np.cross(spin, arm)) - 2 * np.cross(spin, velocity)
    )
    return back @ np.array([0.0, -field.g]) + fictitious[:, :2]


def mean_gravity(field):
    """(2,) [m/s^2] the mean of its uniform part over a long time."""
    kind = type(field).__name__
    if kind in ("Gravity", "ShakenGravity"):
        return np.array([field.x, field.y])
    if kind == "RecordedGravity":
        return np.mean(field.vectors, axis=0)
    return np.array([0.0, -field.g]) if kind == "RollingTank" else np.zeros(2)


# --- Surface tension ------------------------------------------------------------------------


def filled_gradient(offset, r, h, volume):
    """(n, 2) [1/m] sum V grad W, W Wendland's C2, softened: n / (n^2 + (0.3 / h)^2)^(1/4)."""
    direction = np.divide(offset, r[..., None], out=np.zeros_like(offset), where=r[..., None] > 0)
    n = volume * (wendland_slope(r, h)[..., None] * direction).sum(axis=1)
    return n / ((n**2).sum(axis=1) + (0.3 / h) ** 2)[:, None] ** 0.25


def surface_pull(s_i, s_j, offset, r, kernel, h, dx, volume):
    """(n, m, 2) [m] forces on i by j for a stress |s|^2 - s s of 1 N/m, by 1 / m of depth."""
    direction = np.divide(offset, r[..., None], out=np.zeros_like(offset), where=r[..., None] > 0)
    grad = wendland_slope(r, h)[..., None] * direction
    at_dx = float(kernel.density(np.array(dx), h))
    held = 0.45 * (kernel.density(r, h) / at_dx) ** 4 if at_dx > 0 else 0.0
    total = np.zeros_like(offset)
    for s in (s_i[:, None], s_j[None, :]):
        size = (s**2).sum(axis=-1, keepdims=True)
        total += size * grad - s * (s * grad).sum(axis=-1, keepdims=True)
    return volume**2 * (1 - held)[..., None] * total


def slab_tension(kernel, h, dx, volume):
    """Forces across a cut through a slab of the lattice, per surface, for a stress of 1 N/m."""
    deep, reach = 4 * int(np.ceil(h / dx)), int(np.ceil(h / dx))
    columns = np.arange(-2 * reach, 2 * reach)
    place = np.array([(i + 0.5, j) for i in columns for j in range(deep)]) * dx
    offset = place[:, None] - place[None, :]
    r = np.hypot(offset[..., 0], offset[..., 1])
    s = filled_gradient(offset, r, h, volume)
    # the columns at both ends lack neighbours; those of the middle are as in an endless slab
    s = np.tile(s[place[:, 0] == 0.5 * dx], (len(columns), 1))
    left, right = place[:, 0] < 0, place[:, 0] > 0
    forces = surface_pull(
        s[left], s[right], offset[left][:, right], r[left][:, right], kernel, h, dx, volume
    )
    return forces[..., 0].sum() / 2


def calibrated_surface(sigma, kernel, h, dx, volume):
    """K [N/m]: row by row below a surface, its own gradient times what it has along the surface."""
    reach = int(np.ceil(h / dx))
    at_dx = float(kernel.density(np.array(dx), h))
    tension = 0.0
    for depth in range(reach + 1):
        across = along = 0.0
        for i, j in product(range(-reach, reach + 1), range(-reach, depth + 1)):
            r = np.hypot(i, j) * dx
            if r == 0 or r >= h:
                continue
            pull = -volume * float(wendland_slope(r, h)) / r
            across += pull * j * dx
            held = 0.45 * (float(kernel.density(np.array(r), h)) / at_dx) ** 4
            along += pull * (i * dx) ** 2 * (1 - held)
        tension += dx * across**2 / np.sqrt(across**2 + (0.3 / h) ** 2) * along
    return (1 - 0.115 * (h / dx - 3.2)) * sigma / tension


# --- Plates -----------------------------------------------------------------------------------


def cross(x, y, plate):
    """(n, m) whether the straight way from x (n, 2) to y (m, 2) crosses a plate."""

    def turn(a, b, c):
        return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (
            c[..., 0] - a[..., 0]
        )

    x, y, begin, end = x[:, None], y[None, :], plate[:2], plate[2:]
    parted = turn(begin, end, x) * turn(begin, end, y) < 0
    return parted & (turn(x, y, begin) * turn(x, y, end) <= 0)


# --- The solver -----------------------------------------------------------------------------


class Rates(NamedTuple):
    """Acceleration (n, 2) [m/s^2], what is added to the velocity that moves particles (n, 2)
    [m/s], d rho/dt by diffusion (n,) [kg/(m^3 s)].
    """

    a: np.ndarray
    drift: np.ndarray
    growth: np.ndarray


class State(NamedTuple):
    """x (n, 2) [m], v (n, 2) [m/s], rho (n,) [kg/m^3] of the fluid at a time [s], and the rates
    at the last evaluation.
    """

    x: np.ndarray
    v: np.ndarray
    rho: np.ndarray
    time: float
    rates: Rates


class Naive:
    """`Simulation` without any of its art; x and v are (n_fluid, 2) and are handed in and out."""

    def __init__(self, scene, controls):
        self.scene, self.controls = scene, controls
        fluid, walls = scene.fluid, scene.walls
        self.h, self.eps = scene.h, controls.xsph if scene.effects.xsph else 0.0
        self.kernel = KERNELS[fluid.kernel]
        self.mass = calibrated_mass(self.kernel, scene.h, scene.dx, fluid.rho0)
        self.gamma = fluid.gamma
        has_wall_particles = walls is not None and walls.particles is not None
        self.wall_x = np.array(walls.particles) if has_wall_particles else np.empty((0, 2))
        self.extrapolates = has_wall_particles and walls.pressure == "extrapolated"
        # plates that mirror; of the tests', those that all fluid is on one side of
        self.plates = []
        for plate in [] if walls is None or walls.plates is None else np.asarray(walls.plates):
            along = (plate[2:] - plate[:2]) / np.hypot(*(plate[2:] - plate[:2]))
            offset = np.array(scene.x) - plate[:2]
            distance = offset @ [-along[1], along[0]]
            if not distance.min() < 0 < distance.max() and not self.periods:
                self.plates.append(plate)
        # pairs of particles that don't see each other
        self.unseen = None
        # whether sides of the box mirror the fluid; no twin of boundary particles beside such sides
        self.mirrors = walls is not None and walls.box is not None and not has_wall_particles

    # --- walls ------------------------------------------------------------------------------

    def stroke(self, time):
        """How far moving walls have moved [m], their velocity and their acceleration."""
        motion = None if self.scene.walls is None else self.scene.walls.motion
        if motion is None:
            return np.zeros(2), np.zeros(2), np.zeros(2)
        constant, amplitude = np.array(motion.velocity), np.array(motion.amplitude)
        omega = 2 * np.pi * motion.frequency
        return (
            constant * time + amplitude * np.sin(omega * time),
            constant + amplitude * omega * np.cos(omega * time),
            -amplitude * omega**2 * np.sin(omega * time),
        )

    def boundary(self, time):
        """Positions, velocities and accelerations (n_walls, 2) of boundary particles."""
        walls, n = self.scene.walls, len(self.wall_x)
        sliding, moves = np.zeros((n, 2)), np.zeros((n, 1))
        if n and walls.velocity is not None:
            sliding = sliding + np.asarray(walls.velocity)
        if n and walls.motion is not None:
            chosen = walls.motion.particles
            moves = np.ones((n, 1)) if chosen is None else np.array(chosen, float)[:, None]
        shift, velocity, acceleration = self.stroke(time)
        return self.wall_x + moves * shift, sliding + moves * velocity, moves * acceleration

    @property
    def periods(self):
        """(axis, low, high) of every periodic direction."""
        walls = self.scene.walls
        ends = (None, None) if walls is None else (walls.period_x, walls.period_y)
        return [(axis, *pair) for axis, pair in enumerate(ends) if pair is not None]

    def offsets(self, x, time=0.0):
        """x_i - x_j (n, n, 2) [m] to the nearest image and their lengths (n, n) [m], walls too."""
        everybody = np.concatenate([x, self.boundary(time)[0]])
        offset = self.nearest(everybody[:, None] - everybody[None, :])
        if self.unseen is not None:
            offset[self.unseen] = 1e6
        n = len(x)
        offset[:n, :n][self.hidden(x)] = 1e6
        return offset, np.hypot(offset[..., 0], offset[..., 1])

    def nearest(self, offset):
        """Offsets to the nearest image in periodic directions."""
        for axis, low, high in self.periods:
            offset[..., axis] -= (high - low) * np.round(offset[..., axis] / (high - low))
        return offset

    def sides(self, time):
        """(low, high, speed of low, speed of high) of the box in x and in y [m], [m/s]."""
        walls = self.scene.walls
        shift, velocity, _ = self.stroke(time)
        for axis, names in enumerate((("left", "right"), ("bottom", "top"))):
            moving = [walls.motion is not None and name in walls.motion.sides for name in names]
            yield (
                *(walls.box[2 * axis + k] + moving[k] * shift[axis] for k in range(2)),
                *(moving[k] * velocity[axis] for k in range(2)),
            )

    def images(self, x, v, time):
        """Positions and velocities (n, 2) of every image behind sides and corners of the box.

        And images in plates; and (n, n) which particles don't see whose image: those outside
        neither have any nor see any, and through a plate one must look at it.
        """
        places = []
        for low, high, slow, fast in self.sides(time) if self.mirrors else []:
            places.append([(1, 0, 0), (-1, 2 * low, 2 * slow), (-1, 2 * high, 2 * fast)])
        for pair in list(product(*places))[1:] if places else []:
            sign, shift, speed = (np.array(each) for each in zip(*pair, strict=True))
            if not np.isfinite(shift).all():
                continue
            x_image, v_image = sign * x + shift, sign * v + speed
            inwards = np.sign(np.median(x, axis=0) - shift / 2)
            outside = ((sign < 0) & (inwards * (x - shift / 2) < 0)).any(axis=1)
            yield x_image, v_image, outside[:, None] | outside[None, :]
        for plate in self.plates:
            along = (plate[2:] - plate[:2]) / np.hypot(*(plate[2:] - plate[:2]))
            matrix = 2 * np.outer(along, along) - np.eye(2)
            x_image = plate[:2] + (x - plate[:2]) @ matrix
            yield x_image, v @ matrix, ~cross(x, x_image, plate)

    def hidden(self, x):
        """(n, n) whether a plate that mirrors is between two particles."""
        return np.any(
            [np.zeros((len(x),) * 2, bool), *(cross(x, x, p) for p in self.plates)], axis=0
        )

    # --- densities and pressures ------------------------------------------------------------

    def density(self, x, time=0.0):
        """(n,) [kg/m^3], fluid and walls, by sums; every particle counts itself."""
        return self.mass * self.total(self.kernel.density, x, time)

    def total(self, shape, x, time):
        """(n,) sums of a shape over all particles and images."""
        total = shape(self.offsets(x, time)[1], self.h).sum(axis=1)
        for image, _, unseen in self.images(x, x, time):
            offset = self.nearest(x[:, None] - image[None, :])
            offset[unseen] = 1e6
            total += shape(np.hypot(offset[..., 0], offset[..., 1]), self.h).sum(axis=1)
        return total

    def pressure(self, rho):
        """(n,) [Pa]: B ((rho / rho0)^gamma - 1), cut off at zero if the fluid is clamped."""
        fluid = self.scene.fluid
        p = self.controls.stiffness * ((rho / fluid.rho0) ** self.gamma - 1)
        return np.maximum(p, 0.0) if fluid.clamp else p

    def density_at(self, p):
        """The inverse, and at least half the rest density."""
        q = np.maximum(p / self.controls.stiffness + 1, 0.5**self.gamma)
        return self.scene.fluid.rho0 * q ** (1 / self.gamma)

    def fields(self, x, v, time=0.0, rho=None):
        """rho, p (n,) of fluid and walls, and the velocities (n, 2) that viscosity sees.

        rho: of the fluid, where it isn't a sum.
        """
        n = len(x)
        wall_x, wall_v, wall_a = self.boundary(time)
        summed = self.density(x, time)
        if rho is not None:
            summed[:n] = rho
        p, seen = self.pressure(summed), np.concatenate([v, wall_v])
        if not self.extrapolates:
            return summed, p, seen
        # Adami, Hu, Adams 2012, eqs. 23, 27 and 28, one boundary particle after the other
        offset, r = self.offsets(x, time)
        pull = gravity(self.scene.effects.gravity, time, wall_x, wall_v) - wall_a
        for k, w in enumerate(range(n, len(summed))):
            weights = self.kernel.density(r[w, :n], self.h)
            if weights.sum() <= 1e-6 * self.kernel.density(np.zeros(1), self.h)[0]:
                p[w], summed[w] = 0.0, self.scene.fluid.rho0
                continue
            column = (summed[:n, None] * offset[w, :n] * weights[:, None]).sum(axis=0)
            p[w] = ((p[:n] * weights).sum() + pull[k] @ column) / weights.sum()
            if self.scene.fluid.clamp:
                p[w] = max(p[w], 0.0)
            summed[w] = self.density_at(p[w])
            if self.scene.walls.slip == "no-slip":
                weights = friction(r[w, :n], self.h)
                mean = (v * weights[:, None]).sum(axis=0) / weights.sum()
                seen[w] = 2 * wall_v[k] - mean
        return summed, p, seen

    # --- rates ------------------------------------------------------------------------------

    def rates(self, x, v, time=0.0, rho=None):
        """All that changes a state."""
        images = list(self.images(x, v, time))
        if images:
            return self.rates_among(images, x, v, time, rho)
        n, h, effects, m = len(x), self.h, self.scene.effects, self.mass
        c0, walls = self.scene.fluid.c0, self.scene.walls
        offset, r = self.offsets(x, time)
        rho, p, seen = self.fields(x, v, time, rho)
        mean_rho = (rho[:, None] + rho[None, :]) / 2
        velocity = np.concatenate([v, self.boundary(time)[1]])
        relative = velocity[:, None] - velocity[None, :]
        # what the fluid rubs against
        rubs = np.ones((n, len(rho)))
        if walls is not None and walls.slip == "free-slip":
            rubs[:, n:] = 0.0
        relative_seen = v[:, None] - seen[None, :]

        # only the rows of the fluid are wanted from here on
        offset, r, mean_rho, relative = offset[:n], r[:n], mean_rho[:n], relative[:n]
        # coincident particles have no direction and so no force between them
        direction = np.divide(
            offset, r[..., None], out=np.zeros_like(offset), where=r[..., None] > 0
        )
        slope = self.kernel.slope(r, h)
        grad = slope[..., None] * direction

        stress = p[:n, None] / rho[:n, None] ** 2 + p[None, :] / rho[None, :] ** 2
        stress = stress + self.tensile(r, p, rho)
        approach = (relative_seen * offset).sum(axis=-1)
        mu = h * np.minimum(approach, 0.0) / (r**2 + 0.01 * h**2)
        alpha, beta = effects.artificial_viscosity or 0.0, effects.quadratic_viscosity or 0.0
        stress = stress + rubs * (-alpha * c0 * mu + beta * mu**2) / mean_rho
        a = -m * (stress[..., None] * grad).sum(axis=1)

        if effects.laminar_viscosity is not None:
            drag = effects.laminar_viscosity * friction_scale(h, self.scene.dx) * friction(r, h)
            drag = drag * self.scene.fluid.rho0 / mean_rho * rubs
            a -= (drag[..., None] * relative_seen).sum(axis=1)
        if effects.surface_tension is not None:
            dx, volume = self.scene.dx, m / self.scene.fluid.rho0
            strength = calibrated_surface(effects.surface_tension, self.kernel, h, dx, volume)
            s = filled_gradient(offset[:, :n], r[:, :n], h, volume)
            pull = surface_pull(s, s, offset[:, :n], r[:, :n], self.kernel, h, dx, volume)
            a += strength * pull.sum(axis=1) / m
            a += self.surface_friction(s, offset, r, relative, mean_rho)
        a += gravity(effects.gravity, time, x, v)
        return Rates(
            a,
            self.smoothing(v, r, mean_rho) + self.shift(grad, r, mean_rho),
            self.growth(rho, offset, r, slope, mean_rho),
        )

    def surface_friction(self, s, offset, r, relative, mean_rho):
        """(n, 2) [m/s^2]: a viscosity 12 sqrt(sigma h / rho0) where |s|^2 isn't 0, as at walls."""
        fluid, h = self.scene.fluid, self.h
        volume = self.mass / fluid.rho0
        nu = 12 * np.sqrt(self.scene.effects.surface_tension * h / fluid.rho0)
        weight = np.divide(-wendland_slope(r, h), r, out=np.zeros_like(r), where=r > 0)
        size = np.zeros(r.shape[1])
        size[: len(s)] = (s**2).sum(axis=1)
        both = size[: len(s), None] + size[None, :]
        parting = (relative * offset).sum(axis=-1) / (r**2 + 0.01 * h**2)
        force = nu * h * volume * both * fluid.rho0 / (2 * mean_rho) * weight * parting
        return -(force[..., None] * offset).sum(axis=1)

    def rates_among(self, images, x, v, time, rho):
        """Return the rates with images as further fluid, of the densities of their particles."""
        rho = self.density(x, time) if rho is None else rho
        alone, n = copy.copy(self), len(x)
        alone.mirrors, alone.plates = False, []
        alone.unseen = np.zeros((n * (1 + len(images)),) * 2, bool)
        alone.unseen[:n] = np.concatenate([self.hidden(x), *(each[2] for each in images)], axis=1)
        moving = [each[:2] for each in images]
        everybody = [np.concatenate(each) for each in zip((x, v), *moving, strict=True)]
        all_rates = alone.rates(*everybody, time, np.tile(rho, 1 + len(images)))
        alone.unseen = None
        growth = alone.rates(x, v, time, rho).growth
        return Rates(all_rates.a[: len(x)], all_rates.drift[: len(x)], growth)

    def tensile(self, r, p, rho):
        """R f^4 of Monaghan 2000: f = W(r) / W(dx), R = R_i + R_j."""
        n, epsilon = len(r), self.scene.effects.tensile_correction
        if epsilon is None or self.h <= self.scene.dx:
            return np.zeros_like(r)
        stress = p / rho**2
        under_tension = np.where(p < 0, epsilon * np.abs(stress), 0.0)
        repulsion = under_tension[:n, None] + under_tension[None, :]
        lesser = np.minimum(stress[:n, None], stress[None, :])
        repulsion += 0.02 * np.maximum(lesser, 0.0)
        f = self.kernel.density(r, self.h) / self.kernel.density(np.array(self.scene.dx), self.h)
        return repulsion * f**4

    def smoothing(self, v, r, mean_rho):
        """(n_fluid, 2) [m/s]: eps sum m (v_j - v_i) W / mean density, over the fluid only."""
        n = len(v)
        share = self.kernel.density(r[:, :n], self.h) / mean_rho[:, :n]
        differences = v[None, :] - v[:, None]
        return self.eps * self.mass * (share[..., None] * differences).sum(axis=1)

    def shift(self, grad, r, mean_rho):
        """(n_fluid, 2) [m/s]: - A h U grad C, with U = 0.1 c0, but not faster than half of U.

        Less its part along the gradient of the openness, and none where that is 1.
        """
        n, strength = len(grad), self.scene.effects.shifting
        speed = 0.1 * self.scene.fluid.c0
        if strength is None:
            return np.zeros((n, 2))
        opening = self.openness(r)
        volume = self.mass / mean_rho[..., None]
        differences = opening[None, :, None] - opening[:n, None, None]
        normal = self.h * (volume * differences * grad).sum(axis=1)
        across = normal / (np.hypot(*normal.T) ** 2 + 0.003**2)[:, None]
        shift = -strength * self.h * speed * (volume * grad).sum(axis=1)
        shift = shift - (shift * normal).sum(axis=1)[:, None] * across
        shift = shift * (1 - opening[:n, None])
        size = np.hypot(*shift.T)[:, None]
        return shift * np.minimum(1.0, 0.5 * speed / np.maximum(size, 1e-300))

    def openness(self, r):
        """(n,) 1 from the density of a free surface on, 0 inside and for walls."""
        n, dx = len(r), self.scene.dx
        reach = np.arange(-np.ceil(self.h / dx), np.ceil(self.h / dx) + 1) * dx
        x, y = np.meshgrid(reach, reach)
        # of the first and the second row below a surface
        first, second = (self.shape(np.hypot(x, y)[y < k * dx]).sum() for k in (0.5, 1.5))
        room = max(0.7 * (second - first), 1e-3 * self.scene.fluid.rho0 / self.mass)
        opening = np.zeros(r.shape[1])
        opening[:n] = np.clip((first + room - self.shape(r).sum(axis=1)) / room, 0.0, 1.0)
        return opening

    def growth(self, rho, offset, r, slope, mean_rho):
        """(n_fluid,) [kg/(m^3 s)]: the diffusion of the density."""
        n, effects, fluid = len(r), self.scene.effects, self.scene.fluid
        if effects.density_diffusion is None:
            return np.zeros(n)
        # Molteni & Colagrossi 2009 with smoothing length h / 2, over the fluid only
        pull = mean_gravity(effects.gravity)
        c2 = self.gamma * self.controls.stiffness / fluid.rho0
        at_rest = fluid.rho0 / c2 * (-offset[:, :n] @ pull)  # of j more than of i
        gap = rho[None, :n] - rho[:n, None] - at_rest
        # (r_j - r_i) . grad W / r^2
        inward = np.divide(-slope[:, :n], r[:, :n], out=np.zeros((n, n)), where=r[:, :n] > 0)
        flux = 2 * gap * inward * self.mass / mean_rho[:, :n]
        return effects.density_diffusion * self.h / 2 * fluid.c0 * flux.sum(axis=1)

    def summed(self, x, time):
        """(n_fluid,) sum m W, W being what the pressure's gradient is the derivative of.

        Its time derivative is the continuity equation's sum m v_ij . grad W.
        """
        return self.mass * self.total(lambda r, h: self.shape(r), x, time)[: len(x)]

    def shape(self, r):
        """W(r) [1/m^2], or by continuity the integral of the slope, which may be another."""
        if self.scene.effects.continuity and self.kernel is KERNELS["mueller"]:
            return -self.kernel.slope(r, self.h) * (self.h - r) / 3
        return self.kernel.density(r, self.h)

    def grown(self, rho, x, time, new_x, new_time, diffused):
        """Densities by continuity at new positions: what the sum has gained, and diffusion."""
        return rho + self.summed(new_x, new_time) - self.summed(x, time) + diffused

    def acceleration(self, x, v, time=0.0, rho=None):
        """(n_fluid, 2) [m/s^2]."""
        return self.rates(x, v, time, rho).a

    # --- steps ------------------------------------------------------------------------------

    def start(self, x, v, time=0.0, rho=None):
        """The state from which to go on; by continuity, densities are those of rest."""
        n = len(x)
        if not self.scene.effects.continuity:
            rho = self.density(x, time)[:n]
        elif rho is None:
            rho = np.full(n, self.scene.fluid.rho0)
        return State(x, v, rho, time, self._rates_of(x, v, rho, time))

    def _rates_of(self, x, v, rho, time):
        return self.rates(x, v, time, rho if self.scene.effects.continuity else None)

    def go_on(self, state, dt):
        """The state a step later, by the scene's integrator."""
        steps = {
            "symplectic_euler": self._symplectic_euler,
            "kick_drift_kick": self._kick_drift_kick,
            "predictor_corrector": self._predictor_corrector,
        }
        new = steps[self.scene.integrator](state, dt)
        if not self.scene.effects.continuity:
            new = new._replace(rho=self.density(new.x, new.time)[: len(new.x)])
        return new

    def _symplectic_euler(self, state, dt):
        """v += a dt, then x += (new v + drift of the old v) dt."""
        now, time = self._rates_of(*state[:4]), state.time + dt
        v = state.v + now.a * dt
        x, v = self.confined(state.x, state.x + (v + now.drift) * dt, v, time)
        rho = self.grown(state.rho, state.x, state.time, x, time, now.growth * dt)
        return State(x, v, rho, time, now)

    def _kick_drift_kick(self, state, dt):
        """Half a kick, a drift, and half a kick by the forces there, as the half step sees them."""
        old, time = state.rates, state.time + dt
        v = state.v + old.a * dt / 2
        x, v = self.confined(state.x, state.x + (v + old.drift) * dt, v, time)
        rho = self.grown(state.rho, state.x, state.time, x, time, old.growth * dt)
        new = self._rates_of(x, v, rho, time)
        return State(x, v + new.a * dt / 2, rho, time, new)

    def _predictor_corrector(self, state, dt):
        """Half a step with the last rates, then a whole one with the rates found there."""
        old, half = state.rates, state.time + dt / 2
        v = state.v + old.a * dt / 2
        x, v = self.confined(state.x, state.x + (v + old.drift) * dt / 2, v, half)
        rho = self.grown(state.rho, state.x, state.time, x, half, old.growth * dt / 2)
        new = self._rates_of(x, v, rho, half)
        # the state before; of a path that a wall cut short, one that would have led here
        start, begin = x - (v + old.drift) * dt / 2, v - old.a * dt / 2
        end = begin + new.a * dt
        there = start + ((begin + end) / 2 + new.drift) * dt
        there, end = self.confined(x, there, end, state.time + dt)
        time = state.time + dt
        rho = self.grown(state.rho, state.x, state.time, there, time, new.growth * dt)
        return State(there, end, rho, time, new)

    def step(self, x, v, time, dt):
        """x and v a step later, of a state whose rates are those of the moment."""
        new = self.go_on(self.start(x, v, time), dt)
        return new.x, new.v

    # --- what a step may not do -------------------------------------------------------------

    def confined(self, old_x, x, v, time):
        """Paths end at the box, and at plates; who leaves a periodic domain comes in again."""
        x, v = self.clamped(x, v, time)
        x, v = self.stopped_at_plates(old_x, x, v)
        x = x.copy()
        for axis, low, high in self.periods:
            x[:, axis] = low + np.mod(x[:, axis] - low, high - low)
        return x, v

    def clamped(self, x, v, time):
        """Whoever has passed a side is put back onto it and bounces off, as the side sees it."""
        walls = self.scene.walls
        if walls is None or walls.box is None:
            return x, v
        x, v, sides = x.copy(), v.copy(), list(self.sides(time))
        for i, axis in product(range(len(x)), range(2)):
            low, high, slow, fast = sides[axis]
            if self.mirrors:
                low, high = low + 0.1 * self.scene.dx, high - 0.1 * self.scene.dx
            if x[i, axis] < low:
                x[i, axis] = low
                v[i, axis] = max(v[i, axis], slow - walls.restitution * (v[i, axis] - slow))
            if x[i, axis] > high:
                x[i, axis] = high
                v[i, axis] = min(v[i, axis], fast - walls.restitution * (v[i, axis] - fast))
        return x, v

    def stopped_at_plates(self, old_x, x, v):
        """A path ends a hundredth of dx in front of the first plate in its way."""
        walls = self.scene.walls
        if walls is None or walls.plates is None:
            return x, v
        x, v = x.copy(), v.copy()
        plates = np.asarray(walls.plates)
        for axis, low, high in self.periods:
            shift = np.zeros(4)
            shift[axis::2] = high - low
            plates = np.concatenate([plates, plates - shift, plates + shift])
        for i in range(len(x)):
            hits = []
            for plate in plates:
                begin, along = plate[:2], plate[2:] - plate[:2]
                path = x[i] - old_x[i]
                if abs(along[0] * path[1] - along[1] * path[0]) < 1e-300:
                    continue
                # old + s path = begin + w along
                s, w = np.linalg.solve(np.stack([path, -along], axis=1), begin - old_x[i])
                if 0 < s <= 1 and 0 <= w <= 1:
                    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
                    hits.append((s, normal * -np.sign(normal @ path)))
            if hits:
                s, normal = min(hits, key=lambda hit: hit[0])
                x[i] = old_x[i] + s * (x[i] - old_x[i]) + 0.01 * self.scene.dx * normal
                v[i] -= (1 + walls.restitution) * min(v[i] @ normal, 0.0) * normal
        return x, v
