"""Solvers of many styles for the checks of motion: brute force, each choice a keyword."""

import numpy as np

from tests.doctor.solvers.motion_schemes import Schemes
from tests.doctor.solvers.motion_walls import Walls
from tests.doctor.solvers.shared import SLOPES, WEIGHTS, showing

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


class Solver(Schemes, Walls):
    """A solver of the protocol; see `_DEFAULTS` for its choices. Walls stand in `walls`."""

    def __init__(self, case, **choices):
        self.__dict__.update(_DEFAULTS | choices)
        self.case, self.h, self.n = case, case.h, len(case.x)
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

    def W(self, r):
        return WEIGHTS[self.kernels[0]](r / self.h) / self.h**2

    def dW(self, r):
        return -SLOPES[self.kernels[1]](r / self.h) / self.h**3

    def _pairs(self, x):
        every = np.concatenate([x, self.wall_x, *self._images(x)]).astype(self.dtype)
        d = x[:, None] - every[None]
        r = np.sqrt((d**2).sum(axis=2))
        e = np.where((r > 1e-9)[..., None], d / np.maximum(r, 1e-9)[..., None], 0.0)
        return every, r, e

    def _pressure(self, rho):
        p = self.B * ((rho / self.case.rho0) ** self.case.gamma - 1)
        return np.maximum(p, 0.0) if self.clamp and self.density == "sum" else p

    def _densities(self, r):
        """Return rho of particles, of particles in walls, and of images."""
        w = self.m * self.W(r)
        inside = w.sum(axis=1)
        around = self.wall_rho + w[:, self.n : self.n + len(self.wall_x)].sum(axis=0)
        images = (r.shape[1] - self.n - len(around)) // self.n
        return np.concatenate([inside, around, np.tile(inside, images)])

    def _push(self, rho, p):
        """Return what is to be multiplied by the slope of the kernel, (n, all)."""
        n = self.n
        if self.force == "monaghan":
            s = p / rho**2
            return -self.m * (s[:n, None] + s[None])
        return -self.m * (p[:n, None] + p[None]) / (2 * rho[:n, None] * rho[None])

    def _friction(self, r, e, dv, rho):
        """Return the accelerations by viscosity, Mueller's and Monaghan's."""
        case = self.case
        a = np.zeros((self.n, 2))
        if case.viscosity:
            lap = 40 / (np.pi * self.h**5) * np.maximum(self.h - r, 0)
            a -= case.viscosity * self.m * ((lap / rho[None])[..., None] * dv).sum(axis=1)
        if self.alpha:
            closing = np.minimum((dv * e).sum(axis=2) * r, 0.0)
            mu = self.h / 2 * closing / (r**2 + 0.01 * self.h**2)
            Pi = -self.alpha * case.c0 * mu / ((rho[: self.n, None] + rho[None]) / 2)
            a += ((-self.m * Pi * self.dW(r))[..., None] * e).sum(axis=1)
        return a

    def _gravity(self, r):
        g = self.case.gravity * {"gravity twice": 2, "gravity sign": -1}.get(self.fault, 1)
        if self.fault == "hidden gravity":
            g = g + np.array([0.0, -9.81])
        if self.fault == "gravity in the loop":
            g = g * (r < self.h).sum(axis=1)[:, None]
        return g

    def _accelerate(self, x, v):
        n = self.n
        every, r, e = self._pairs(x)
        rho = self._densities(r) if self.density == "sum" else self.R
        p = self._pressure(rho)
        if self.density == "continuity":
            p[n:] = np.maximum(p[n:], 0.0)
        if self.frozen:
            p[n:] = 0.0
        dv = v[:, None] - np.concatenate([v, np.zeros((len(every) - n, 2))])[None]
        a = ((self._push(rho, p) * self.dW(r))[..., None] * e).sum(axis=1)
        a = a + self._friction(r, e, dv, rho) + self._gravity(r) + self._wall_force(x, v)
        if self.density == "continuity":
            rate = self.m * self.dW(r) * (dv * e).sum(axis=2)
            self.drho = np.concatenate([rate.sum(axis=1), rate[:, n:].sum(axis=0)])
        if self.fault == "one axis":
            a[:, 0] = 0
        if self.fault == "drag":
            a = a - 20 * (r[:, :n] < self.h).sum(axis=1)[:, None] * v + 20 * v
        self.rho, self.p = rho[:n].copy(), p[:n].copy()
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


def maker(hide=(), **choices):
    """Return a factory of such solvers; hide: names of what they don't show."""

    def make(case):
        return Solver(case, **choices)

    return showing(make, *(name for name in OPTIONAL if name not in hide)) if hide else make


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
