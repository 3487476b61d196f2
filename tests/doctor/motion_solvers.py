"""Solvers of many styles for the checks of motion: brute force, each choice a keyword."""

import numpy as np

# name: shape and slope by q = r / support, before they are normalised in two dimensions
_KERNELS = {
    "poly6": (lambda q: (1 - q**2) ** 3, lambda q: -6 * q * (1 - q**2) ** 2),
    "spiky": (lambda q: (1 - q) ** 3, lambda q: -3 * (1 - q) ** 2),
    "wendland": (lambda q: (1 - q) ** 4 * (1 + 4 * q), lambda q: -20 * q * (1 - q) ** 3),
    "cubic": (
        lambda q: np.where(q < 0.5, 1 - 6 * q**2 + 6 * q**3, 2 * (1 - q) ** 3),
        lambda q: np.where(q < 0.5, -12 * q + 18 * q**2, -6 * (1 - q) ** 2),
    ),
    "quintic": (
        lambda q: sum(
            c * np.maximum(k / 3 - q, 0) ** 5 for k, c in ((3, 1.0), (2, -6.0), (1, 15.0))
        ),
        lambda q: sum(
            -5 * c * np.maximum(k / 3 - q, 0) ** 4 for k, c in ((3, 1.0), (2, -6.0), (1, 15.0))
        ),
    ),
    "gauss": (lambda q: np.exp(-9 * q**2), lambda q: -18 * q * np.exp(-9 * q**2)),
}
_Q = np.linspace(0.0, 1.0, 4001)


def _kernel(name, h):
    shape, slope = _KERNELS[name]
    area = 2 * np.pi * np.trapezoid(shape(_Q) * _Q, _Q)

    def weight(r):
        q = np.minimum(r / h, 1.0)
        return np.where(r < h, shape(q), 0.0) / (area * h**2)

    def gradient(r):
        q = np.minimum(r / h, 1.0)
        return np.where(r < h, slope(q), 0.0) / (area * h**3)

    return weight, gradient


_DEFAULTS = {
    "kernels": ("poly6", "spiky"),
    "calibrated": True,
    "density": "sum",  # or "continuity"
    "force": "monaghan",  # or "mueller"
    "scheme": "euler",
    "walls": "clamp",
    "restitution": 0.0,
    "layers": 4,
    "first": 0.5,  # the first layer of wall particles is so many dx outside of the side
    "frozen": False,  # wall particles without pressure
    "alpha": 0.0,  # artificial viscosity that is always there
    "xsph": True,
    "dtype": np.float64,
    "clamp": True,
    "fault": "",
}


class Solver:
    """A solver of the protocol; see `_DEFAULTS` for its choices. Walls stand in `walls`."""

    def __init__(self, case, **choices):
        self.__dict__.update(_DEFAULTS | choices)
        self.case, self.h, self.n = case, case.h, len(case.x)
        self.W, self.dW = (_kernel(name, case.h)[k] for k, name in enumerate(self.kernels))
        self.B = case.rho0 * case.c0**2 / case.gamma
        self.m = case.rho0 * case.dx**2
        if self.calibrated:
            k = np.arange(-8, 9) * case.dx
            self.m = case.rho0 / self.W(np.hypot(*np.meshgrid(k, k))).sum()
        self.X, self.V = case.x.astype(self.dtype), case.v.astype(self.dtype)
        self.wall_x = self._wall_particles()
        walls = self.wall_x[:, None] - self.wall_x[None]
        self.wall_rho = self.m * self.W(np.sqrt((walls**2).sum(axis=2))).sum(axis=1)
        self.R = np.full(self.n + len(self.wall_x), case.rho0)
        self.steps, self.before = 0, None
        self.A = self._accelerate(self.X, self.V)

    x = property(lambda self: self.X.copy())
    v = property(lambda self: self.V.copy())

    def _wall_particles(self):
        case = self.case
        if case.box is None or self.walls not in ("layers", "line"):
            return np.zeros((0, 2))
        x0, x1, y0, y1 = case.box
        k = self.layers
        nx, ny = round((x1 - x0) / case.dx), round((y1 - y0) / case.dx)
        i, j = np.meshgrid(np.arange(-k, nx + k), np.arange(-k, ny + k), indexing="ij")
        outside = (i < 0) | (i >= nx) | (j < 0) | (j >= ny)
        if self.fault == "no right wall":
            outside &= ~((i >= nx) & (j >= 0) & (j < ny))
        grid = np.stack([i[outside] + 0.5, j[outside] + 0.5], axis=1)
        size = np.array([nx, ny])
        grid += (self.first - 0.5) * (np.sign(grid - size) + np.sign(grid)) / 2
        return grid * case.dx + np.array([x0, y0])

    def _pairs(self, x):
        every = np.concatenate([x, self.wall_x, *self._images(x)]).astype(self.dtype)
        d = x[:, None] - every[None]
        r = np.sqrt((d**2).sum(axis=2))
        e = np.where((r > 1e-9)[..., None], d / np.maximum(r, 1e-9)[..., None], 0.0)
        return every, r, e

    def _images(self, x):
        """Mirror images of all particles at each side, and at each corner."""
        if self.walls != "ghosts" or self.case.box is None:
            return []
        x0, x1, y0, y1 = self.case.box
        return [
            np.where([a is not None, b is not None], np.array([2 * (a or 0), 2 * (b or 0)]) - x, x)
            for a in (None, x0, x1) for b in (None, y0, y1) if (a, b) != (None, None)
        ]  # fmt: skip

    def _pressure(self, rho):
        p = self.B * ((rho / self.case.rho0) ** self.case.gamma - 1)
        return np.maximum(p, 0.0) if self.clamp and self.density == "sum" else p

    def _accelerate(self, x, v, rho=None):
        n, case = self.n, self.case
        every, r, e = self._pairs(x)
        if self.density == "sum":
            w = self.m * self.W(r)
            inside = w.sum(axis=1)
            around = self.wall_rho + w[:, n : n + len(self.wall_x)].sum(axis=0)
            images = (len(every) - n - len(around)) // n
            rho = np.concatenate([inside, around, np.tile(inside, images)])
        elif rho is None:
            rho = self.R
        p = self._pressure(rho)
        if self.density == "continuity" and len(self.wall_x):
            p[n:] = np.maximum(p[n:], 0.0)
        if self.frozen:
            p[n:] = 0.0
        slope = self.dW(r)
        if self.force == "monaghan":
            s = p / rho**2
            push = -self.m * (s[:n, None] + s[None])
        else:
            push = -self.m * (p[:n, None] + p[None]) / (2 * rho[:n, None] * rho[None])
        a = ((push * slope)[..., None] * e).sum(axis=1)
        V = np.concatenate([v, np.zeros((len(every) - n, 2))])
        dv = v[:, None] - V[None]
        if case.viscosity:
            lap = 40 / (np.pi * self.h**5) * np.maximum(self.h - r, 0)
            a -= case.viscosity * self.m * ((lap / rho[None])[..., None] * dv).sum(axis=1)
        if self.alpha:
            closing = np.minimum((dv * e).sum(axis=2) * r, 0.0)
            mu = self.h / 2 * closing / (r**2 + 0.01 * self.h**2)
            Pi = -self.alpha * case.c0 * mu / ((rho[:n, None] + rho[None]) / 2)
            a += ((-self.m * Pi * slope)[..., None] * e).sum(axis=1)
        if self.density == "continuity":
            full = np.zeros(len(every))
            full[:n] = self.m * (slope * (dv * e).sum(axis=2)).sum(axis=1)
            full[n:] = self.m * (slope * (dv * e).sum(axis=2))[:, n:].sum(axis=0)
            self.drho = full
        g = case.gravity * {"gravity twice": 2, "gravity sign": -1}.get(self.fault, 1)
        if self.fault == "hidden gravity":
            g = g + np.array([0.0, -9.81])
        if self.fault == "gravity in the loop":
            g = g * (r < self.h).sum(axis=1)[:, None]
        self.rho, self.p = rho[:n].copy(), p[:n].copy()
        a = a + g + self._wall_force(x, v)
        if self.fault == "one axis":
            a[:, 0] = 0
        if self.fault == "drag":
            a = a - 20 * (r[:, : len(x)] < self.h).sum(axis=1)[:, None] * v + 20 * v
        self.a = a * rho[:n, None] if self.fault == "shows forces" else a
        return a

    def _smooth(self, v):
        if not (self.case.xsph and self.xsph):
            return 0.0
        _, r, _ = self._pairs(self.X)
        w = self.case.xsph * self.m * self.W(r)[:, : self.n] / self.case.rho0
        return (w[..., None] * (v[None] - v[:, None])).sum(axis=1)

    def step(self, dt):
        if self.fault == "dt ignored":
            dt = 1e-3
        if self.fault == "dt squared":
            dt = dt * dt * 1e3
        with np.errstate(all="ignore"):
            getattr(self, "_" + self.scheme)(dt)
            self.X, self.V = self.X.astype(self.dtype), self.V.astype(self.dtype)
            if self.fault == "decay":
                self.V = self.V * 0.99
            if self.fault == "speed limit":
                speed = np.linalg.norm(self.V, axis=1, keepdims=True)
                self.V = self.V / np.maximum(speed / (0.05 * self.case.c0), 1.0)
            self._bounce(dt)
        self.steps += 1

    def _flow(self, dt):
        """Continuity: densities by the latest velocities."""
        if self.density == "continuity":
            self._accelerate(self.X, self.V)
            self.R = self.R + dt * self.drho

    def _euler(self, dt):
        A = self._accelerate(self.X, self.V)
        self.V = self.V + dt * A * (0.5 if self.fault == "half kick" else 1)
        self.X = self.X + dt * (self.V + self._smooth(self.V)) * (
            0.5 if self.fault == "half drift" else 1
        )
        self._flow(dt)

    def _old_density(self, dt):
        """Continuity with the velocities from before the kick."""
        A = self._accelerate(self.X, self.V)
        self._flow(dt)
        self.V = self.V + dt * A
        self.X = self.X + dt * (self.V + self._smooth(self.V))

    def _drift_first(self, dt):
        self.X = self.X + dt * (self.V + self._smooth(self.V))
        self._flow(dt)
        self.V = self.V + dt * self._accelerate(self.X, self.V)

    def _kdk(self, dt):
        self.V = self.V + dt / 2 * self.A
        self.X = self.X + dt * (self.V + self._smooth(self.V))
        self._flow(dt)
        self.A = self._accelerate(self.X, self.V)
        self.V = self.V + dt / 2 * self.A

    def _dkd(self, dt):
        self.X = self.X + dt / 2 * (self.V + self._smooth(self.V))
        self._flow(dt / 2)
        self.V = self.V + dt * self._accelerate(self.X, self.V)
        self.X = self.X + dt / 2 * (self.V + self._smooth(self.V))
        self._flow(dt / 2)

    def _half(self, dt):
        """Leapfrog whose v is half a step behind x."""
        A = self._accelerate(self.X, self.V)
        self.V = self.V + (dt if self.steps else dt / 2) * A
        self.X = self.X + dt * self.V
        self._flow(dt)

    def _verlet(self, dt):
        """Stoermer-Verlet on positions, with central velocities."""
        A = self._accelerate(self.X, self.V)
        if self.before is None:
            self.before = self.X - dt * self.V + dt**2 / 2 * A
        X = 2 * self.X - self.before + dt**2 * A
        self.V = (X - self.before) / (2 * dt)
        self.before, self.X = self.X, X

    def _midpoint(self, dt):
        """Predictor-corrector: half a step with the last accelerations, then the whole."""
        xm, vm, R = self.X + dt / 2 * self.V, self.V + dt / 2 * self.A, self.R
        if self.density == "continuity":
            self._accelerate(self.X, self.V)
            self.R = R + dt / 2 * self.drho
        self.A = self._accelerate(xm, vm)
        if self.density == "continuity":
            self.R = R + dt * self.drho
        old, self.V = self.V, self.V + dt * self.A
        self.X = self.X + dt * ((old + self.V) / 2 + self._smooth(vm))

    def _heun(self, dt):
        R = self.R
        A = self._accelerate(self.X, self.V)
        if self.density == "continuity":
            first = self.drho
            self.R = R + dt * first
        xe, ve = self.X + dt * self.V, self.V + dt * A
        B = self._accelerate(xe, ve)
        if self.density == "continuity":
            self.R = R + dt / 2 * (first + self.drho)
        self.X = self.X + dt / 2 * (self.V + ve)
        self.V = self.V + dt / 2 * (A + B)

    def _substeps(self, dt):
        for _ in range(3):
            self._euler(dt / 3)

    def _forward(self, dt):
        A = self._accelerate(self.X, self.V)
        self._flow(dt)
        self.X, self.V = self.X + dt * self.V, self.V + dt * A

    def _lagged(self, dt):
        A = self._accelerate(self.X, self.V)
        self.V = self.V + dt * self.A
        self.X = self.X + dt * self.V
        self.A = A
        self._flow(dt)

    def _taylor(self, dt):
        """Velocity Verlet whose second half was forgotten."""
        A = self._accelerate(self.X, self.V)
        self.X, self.V = self.X + dt * self.V + dt**2 / 2 * A, self.V + dt * A

    # Walls.

    def _sides(self):
        if self.case.box is None:
            return []
        x0, x1, y0, y1 = self.case.box
        sides = [(0, x0, -1), (0, x1, 1), (1, y0, -1), (1, y1, 1)]
        if self.fault == "no right wall":
            del sides[1]
        if self.fault == "no walls":
            return []
        if self.fault == "floor only":
            sides = sides[2:3]
        return sides

    def _wall_force(self, x, v):
        a = np.zeros_like(x, dtype=float)
        if self.walls not in ("penalty", "damped", "lj", "lj by gravity") or not self.case.box:
            return a
        dx, c0 = self.case.dx, self.case.c0
        for axis, side, out in self._sides():
            gap = out * (side - x[:, axis])
            deep = np.maximum(dx / 2 - gap, 0.0)
            if self.walls in ("penalty", "damped"):
                a[:, axis] -= out * (c0 / dx) ** 2 * deep * 0.5
            if self.walls == "damped":
                a[:, axis] -= np.where(deep > 0, 0.5 * c0 / dx * v[:, axis], 0.0)
            if self.walls.startswith("lj"):
                s = dx / np.maximum(gap, 0.3 * dx)
                D = 0.01 * c0**2
                if self.walls == "lj by gravity":
                    D = np.hypot(*self.case.gravity) * 0.5
                a[:, axis] -= out * np.where(gap < dx, D / dx * (s**4 - s**2), 0.0)
        return a

    def _bounce(self, dt):
        if self.walls == "ahead":
            for axis, side, out in self._sides():
                next_x = self.X[:, axis] + dt * self.V[:, axis]
                hit = (out * (next_x - side) > 0) & (out * self.V[:, axis] > 0)
                self.V[hit, axis] *= -self.restitution
        if self.walls not in ("clamp", "mirror", "standoff", "no slip"):
            return
        fault, dx = self.fault, self.case.dx
        e = 1.5 if fault == "restitution" else self.restitution
        for axis, side, out in self._sides():
            if self.walls == "standoff":
                side = side - out * dx / 2
            deep = out * (self.X[:, axis] - side)
            hit = deep > 0
            if fault == "leaks when fast":
                hit &= deep < 0.1 * dx
            if fault == "leaks at c0":
                hit &= np.abs(self.V[:, axis]) < 0.5 * self.case.c0
            if fault == "periodic":
                self.X[hit, axis] -= 2 * side
                continue
            if fault == "walls of nan":
                self.X[hit] = np.nan
            if fault == "first ten only":
                hit &= np.arange(self.n) < 10
            if fault == "all on the wall":
                hit[:] = hit.any()
            self.X[hit, axis] = side - (out * deep[hit] if self.walls == "mirror" else 0.0)
            leaving = hit & (out * self.V[:, axis] > 0)
            if fault == "wrong sign":
                self.V[hit, axis] = out * np.abs(self.V[hit, axis])
            elif fault != "position only":
                self.V[leaving, axis] *= -e
                if self.walls == "no slip":
                    self.V[leaving, 1 - axis] *= -e


class Hidden:
    """Shows x, v and step of a solver alone."""

    x = property(lambda self: self._solver.x)
    v = property(lambda self: self._solver.v)

    def __init__(self, solver):
        self._solver = solver

    def step(self, dt):
        self._solver.step(dt)


def maker(hide=(), **choices):
    """Return a factory of such solvers; hide: names of what they don't show."""
    shown = {
        name: property(lambda self, name=name: getattr(self._solver, name))
        for name in set(OPTIONAL) - set(hide)
    }
    kind = type("Some", (Hidden,), shown)
    return lambda case: kind(Solver(case, **choices)) if hide else Solver(case, **choices)


OPTIONAL = ("rho", "p", "a")
HEALTHY = {
    "article": {},
    "black box": {"hide": OPTIONAL},
    "wendland, plain mass": {
        "kernels": ("wendland",) * 2,
        "calibrated": False,
        "scheme": "kdk",
        "walls": "layers",
    },
    "cubic, mueller": {
        "kernels": ("cubic",) * 2,
        "force": "mueller",
        "scheme": "dkd",
        "walls": "lj",
        "hide": OPTIONAL,
    },
    "quintic": {
        "kernels": ("quintic",) * 2,
        "scheme": "midpoint",
        "walls": "layers",
        "layers": 3,
        "hide": ("p", "a"),
    },
    "gauss": {"kernels": ("gauss",) * 2, "scheme": "heun", "walls": "penalty", "calibrated": False},
    "continuity": {
        "kernels": ("cubic",) * 2,
        "density": "continuity",
        "scheme": "euler",
        "walls": "layers",
        "alpha": 0.1,
        "calibrated": False,
    },
    "continuity, midpoint": {
        "kernels": ("wendland",) * 2,
        "density": "continuity",
        "scheme": "midpoint",
        "walls": "lj",
        "alpha": 0.02,
        "hide": OPTIONAL,
        "calibrated": False,
    },
    "continuity, leapfrog": {
        "kernels": ("quintic",) * 2,
        "density": "continuity",
        "scheme": "kdk",
        "walls": "layers",
        "calibrated": False,
    },
    "float32": {
        "dtype": np.float32,
        "scheme": "drift_first",
        "walls": "mirror",
        "restitution": 1.0,
    },
    "float32 black box": {
        "dtype": np.float32,
        "scheme": "half",
        "walls": "mirror",
        "restitution": 0.5,
        "hide": OPTIONAL,
    },
    "verlet": {
        "scheme": "verlet",
        "kernels": ("wendland",) * 2,
        "hide": OPTIONAL,
        "walls": "penalty",
    },
    "plain spiky": {"calibrated": False, "scheme": "kdk", "walls": "clamp", "restitution": 0.9},
    "substeps": {"scheme": "substeps", "walls": "penalty", "hide": OPTIONAL},
    "viscous": {"kernels": ("wendland",) * 2, "alpha": 0.3, "walls": "layers"},
}

_SPLINE = {"kernels": ("cubic",) * 2, "calibrated": False}
WALLS = {
    "on the side": {"walls": "layers", "first": 0.0, "layers": 3, **_SPLINE},
    "two layers": {"walls": "layers", "layers": 2},
    "a spacing off": {"walls": "layers", "first": 1.0, "layers": 3},
    "without pressure": {"walls": "layers", "layers": 3, "frozen": True, **_SPLINE},
    "ghosts": {"walls": "ghosts"},
    "damped": {"walls": "damped", **_SPLINE},
    "ahead": {"walls": "ahead", "restitution": 0.5},
    "stand-off": {"walls": "standoff", "restitution": 0.3, **_SPLINE},
    "no slip": {"walls": "no slip", "restitution": 1.0},
    "stiff": {"walls": "penalty", "scheme": "kdk", **_SPLINE},
    "drift first": {"walls": "mirror", "restitution": 1.0, "scheme": "dkd"},
}
