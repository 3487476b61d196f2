"""A solver of many styles: all pairs as a matrix, choices by name, for tests of no false alarm.

`zoo(kernel=..., density=..., ...)` returns a factory. Nothing is shared with `doctor.plain`.
"""

from types import SimpleNamespace

import numpy as np

from tests.doctor.solvers.shared import SLOPES, WEIGHTS, showing

ALL = ("rho", "p", "a", "evaluate", "neighbors")
DEFAULTS = {
    "kernel": "wendland",
    "mass": "usual",  # or calibrated, which is done on the lattice; start: on case.x
    "density": "sum",  # or continuity, never_below (sum that is held at rho0 from below), shepard
    "clamp": True,
    "force": "symmetric",  # or mean: (p_i + p_j) / (2 rho_i rho_j)
    "integrator": "euler",  # or kdk, dkd, predictor, half: v belongs to the middle of the step
    # or mu, article (mu, m_j / rho_j), alpha, alpha_support, switched_nu, morris, monaghan_nu, none
    "viscosity": "nu",
    "always_alpha": 0.0,
    "xsph": "mean",  # or article: m_j / rho_j; none
    "dtype": float,
    "shows": ALL,
    "pairs": None,  # a function of (solver, distances) that returns how often each pair counts
}


class Zoo:
    """One solver; `style` has the choices of DEFAULTS."""

    def __init__(self, case, style):
        self.case, self.style = case, SimpleNamespace(**{**DEFAULTS, **style})
        self.type = self.style.dtype
        self.x, self.v = case.x.astype(self.type), case.v.astype(self.type)
        self.n, self.h, self.c0 = len(self.x), case.h, case.c0
        self.stiffness = case.rho0 * case.c0**2 / case.gamma
        self.m = self.mass()
        self.rho = np.full(self.n, case.rho0, self.type)
        self.a = np.zeros_like(self.x)
        self.evaluate()
        self.started = False

    def kernel(self, r):
        """Return W and dW/dr, zero beyond h."""
        kernel, q = self.style.kernel, r / self.h
        weight, slope = ("poly6", "spiky") if kernel == "article" else (kernel, kernel)
        return WEIGHTS[weight](q) / self.h**2, -SLOPES[slope](q) / self.h**3

    def mass(self):
        case = self.case
        if self.style.mass == "start":
            r = np.linalg.norm(case.x[:, None] - case.x[None], axis=2)
            return case.rho0 / self.kernel(r)[0].sum(axis=1).max()
        if self.style.mass == "calibrated":
            k = np.arange(-6, 7) * case.dx
            return case.rho0 / self.kernel(np.hypot(*np.meshgrid(k, k)))[0].sum()
        return case.rho0 * case.dx**2

    def evaluate(self):
        self.geometry()
        if self.style.density != "continuity":
            self.rho = self.m * self.w.sum(axis=1)
        if self.style.density == "never_below":
            self.rho = np.maximum(self.rho, self.case.rho0)
        if self.style.density == "shepard":
            self.rho = self.rho / np.minimum((self.m * self.w / self.rho).sum(axis=1), 1.0)
        p = self.stiffness * ((self.rho / self.case.rho0) ** self.case.gamma - 1)
        self.p = np.maximum(p, 0) if self.style.clamp else p
        self.a = (self.pressing() + self.thickness() + self.case.gravity).astype(self.type)

    def geometry(self):
        self.d = self.x[:, None] - self.x[None]
        self.r = np.sqrt((self.d**2).sum(axis=2))
        self.count = (self.r < self.h).astype(self.type)
        if self.style.pairs:
            self.count = self.style.pairs(self, self.r).astype(self.type)
        np.fill_diagonal(self.count, 1.0)
        w, slope = self.kernel(self.r)
        self.w, self.slope = self.count * w, self.count * slope
        self.unit = self.d / np.maximum(self.r, 1e-9)[..., None]
        self.dv = self.v[:, None] - self.v[None]

    def pressing(self):
        p, rho = self.p, self.rho
        if self.style.force == "mean":
            share = (p[:, None] + p[None]) / (2 * rho[:, None] * rho[None])
        else:
            share = (p / rho**2)[:, None] + (p / rho**2)[None]
        return -self.m * ((share * self.slope)[..., None] * self.unit).sum(axis=1)

    def thickness(self):
        kind, V = self.style.viscosity, self.case.viscosity
        a = self.artificial(self.style.always_alpha, self.h / 2) if self.style.always_alpha else 0.0
        if not V or kind == "none":
            return a
        mean = (self.rho[:, None] + self.rho[None]) / 2
        product = self.rho[:, None] * self.rho[None]
        r2 = self.r**2 + 0.01 * self.h**2
        along = (self.d * self.dv).sum(axis=2)
        if kind in ("nu", "mu", "article"):
            laplacian = self.count * 40 / (np.pi * self.h**5) * np.maximum(self.h - self.r, 0)
            nu = V if kind == "nu" else V / self.case.rho0
            if kind == "article":
                return a - nu * ((self.m / self.rho[None] * laplacian)[..., None] * self.dv).sum(
                    axis=1
                )
            drag = -nu * self.case.rho0 * self.m * laplacian / product
            return a + (drag[..., None] * self.dv).sum(axis=1)
        if kind == "morris":
            drag = 2 * V * self.m * self.case.rho0 / product * self.r * self.slope / r2
            return a + (drag[..., None] * self.dv).sum(axis=1)
        if kind == "monaghan_nu":
            drag = 8 * V * self.m / mean * along / r2 * self.slope
            return a + (drag[..., None] * self.unit).sum(axis=1)
        if kind == "switched_nu":
            drag = 8 * V * self.m / mean * np.minimum(along, 0) / r2 * self.slope
            return a + (drag[..., None] * self.unit).sum(axis=1)
        return a + self.artificial(V, self.h if kind == "alpha_support" else self.h / 2)

    def artificial(self, alpha, h):
        along = np.minimum((self.d * self.dv).sum(axis=2), 0)
        mu = h * along / (self.r**2 + 0.01 * h**2)
        pi = (-alpha * self.c0 * mu + 2 * alpha * mu**2) / (
            (self.rho[:, None] + self.rho[None]) / 2
        )
        return -self.m * ((pi * self.slope)[..., None] * self.unit).sum(axis=1)

    def smoothing(self):
        if self.style.xsph == "none" or not self.case.xsph:
            return 0.0
        mean = (self.rho[:, None] + self.rho[None]) / 2
        if self.style.xsph == "article":
            mean = self.rho[None] + 0 * mean
        share = self.case.xsph * self.m * self.w / mean
        return -(share[..., None] * self.dv).sum(axis=1)

    def grow(self, dt):
        """Change densities by continuity."""
        if self.style.density == "continuity":
            rate = (self.dv * self.unit).sum(axis=2) * self.slope
            self.rho = self.rho + dt * self.m * rate.sum(axis=1)

    def step(self, dt):
        getattr(self, self.style.integrator)(dt)
        self.bounce()
        self.x, self.v = self.x.astype(self.type), self.v.astype(self.type)

    def bounce(self):
        """Put who has passed a wall back onto it, and stop what goes on outwards."""
        if self.case.box is None:
            return
        low, high = np.reshape(self.case.box, (2, 2)).T
        out = (self.x < low) & (self.v < 0) | (self.x > high) & (self.v > 0)
        self.x, self.v = np.clip(self.x, low, high), np.where(out, 0.0, self.v)

    def euler(self, dt):
        if self.style.density == "continuity":
            self.geometry()
            self.grow(dt)
        self.evaluate()
        self.v = self.v + dt * self.a
        self.x = self.x + dt * (self.v + self.smoothing())

    def kdk(self, dt):
        self.v = self.v + dt / 2 * self.a
        self.x = self.x + dt * (self.v + self.smoothing())
        self.geometry()
        self.grow(dt)
        self.evaluate()
        self.v = self.v + dt / 2 * self.a

    def dkd(self, dt):
        self.x = self.x + dt / 2 * (self.v + self.smoothing())
        self.evaluate()
        self.v = self.v + dt * self.a
        self.dv = self.v[:, None] - self.v[None]
        self.x = self.x + dt / 2 * (self.v + self.smoothing())

    def half(self, dt):
        """Leapfrog whose v belongs to the middle of the step."""
        self.evaluate()
        self.v = self.v + (dt if self.started else dt / 2) * self.a
        self.started = True
        self.x = self.x + dt * (self.v + self.smoothing())

    def predictor(self, dt):
        x, v, rho = self.x, self.v, self.rho
        self.evaluate()
        self.grow(dt / 2)
        self.x, self.v = x + dt / 2 * (v + self.smoothing()), v + dt / 2 * self.a
        self.evaluate()
        if self.style.density == "continuity":
            self.rho = rho
            self.grow(dt)
        smooth = self.smoothing()
        self.v = v + dt * self.a
        self.x = x + dt * (v + dt / 2 * self.a + smooth)

    def neighbors(self, i):
        return np.flatnonzero((self.count[i] > 0) & (np.arange(self.n) != i))


def zoo(make=Zoo, **style):
    """Return a factory of solvers with these choices; make: a class derived from Zoo."""
    return showing(lambda case: make(case, style), *style.get("shows", ALL))


HEALTHY = {
    "article": {"kernel": "article", "mass": "calibrated"},
    "article_usual_mass": {"kernel": "article", "viscosity": "article", "xsph": "article"},
    "cubic_kdk_mu": {"kernel": "cubic", "integrator": "kdk", "viscosity": "mu"},
    "quintic_dkd_alpha": {"kernel": "quintic", "integrator": "dkd", "viscosity": "alpha"},
    "gaussian_morris": {"kernel": "gauss", "viscosity": "morris", "xsph": "none"},
    "continuity": {"density": "continuity", "clamp": False, "viscosity": "alpha_support"},
    "continuity_predictor": {
        "kernel": "cubic",
        "density": "continuity",
        "clamp": False,
        "integrator": "predictor",
        "viscosity": "alpha",
        "always_alpha": 0.1,
    },
    "continuity_kdk": {"density": "continuity", "integrator": "kdk", "viscosity": "none"},
    "never_below": {"kernel": "cubic", "density": "never_below", "force": "mean"},
    "shepard": {"density": "shepard"},
    "mass_of_the_start": {"mass": "start"},
    "single": {"dtype": np.float32},
    "single_article": {"dtype": np.float32, "kernel": "article", "integrator": "dkd"},
    "monaghan_nu": {"viscosity": "monaghan_nu"},
    "switched": {"viscosity": "switched_nu", "force": "mean"},
    "predictor": {"integrator": "predictor", "always_alpha": 0.1},
    "half": {"integrator": "half", "viscosity": "mu", "xsph": "article"},
}
SHOWN = {"all": ALL, "rho": ("rho", "p"), "a": ("a",), "nothing": ()}
