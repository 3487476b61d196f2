"""Healthy solvers with habits that a doctor must not take for faults."""

import math

import numpy as np

from tests.doctor.solvers.laws_styles import Styled


class PureCells:
    """Pure Python with a dictionary of cells; cubic spline; shows nothing but x and v."""

    def __init__(self, case):
        self.case, self.h = case, case.h
        self.x, self.v = case.x.copy(), case.v.copy()
        self.m = case.rho0 * case.dx**2
        self.B = case.rho0 * case.c0**2 / case.gamma

    def W(self, r):
        s = self.h / 2
        q, k = r / s, 10 / (7 * math.pi * s * s)
        if q < 1:
            return k * (1 - 1.5 * q * q + 0.75 * q**3)
        return k * 0.25 * (2 - q) ** 3 if q < 2 else 0.0

    def dW(self, r):
        s = self.h / 2
        q, k = r / s, 10 / (7 * math.pi * s**3)
        if q < 1:
            return k * (-3 * q + 2.25 * q * q)
        return -k * 0.75 * (2 - q) ** 2 if q < 2 else 0.0

    def near(self, i, cells):
        x, y = self.x[i]
        cx, cy = int(x // self.h), int(y // self.h)
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                for j in cells.get((cx + a, cy + b), ()):
                    dx, dy = x - self.x[j][0], y - self.x[j][1]
                    r = math.sqrt(dx * dx + dy * dy)
                    if r < self.h:
                        yield j, dx, dy, r

    def step(self, dt):
        n, cells = len(self.x), {}
        for i, (x, y) in enumerate(self.x):
            cells.setdefault((int(x // self.h), int(y // self.h)), []).append(i)
        lists = [list(self.near(i, cells)) for i in range(n)]
        rho = [sum(self.m * self.W(r) for _, _, _, r in each) for each in lists]
        p = [max(0.0, self.B * ((d / self.case.rho0) ** self.case.gamma - 1)) for d in rho]
        for i, each in enumerate(lists):
            ax, ay = self.case.gravity
            for j, dx, dy, r in each:
                if r > 1e-9 and j != i:
                    f = -self.m * (p[i] / rho[i] ** 2 + p[j] / rho[j] ** 2) * self.dW(r) / r
                    ax, ay = ax + f * dx, ay + f * dy
            self.v[i] += dt * np.array([ax, ay])
        self.x += dt * self.v


class Floor(Styled):
    """Densities never read below rho0, in place of a clamp."""

    def _pressure(self, rho):
        np.maximum(rho, self.case.rho0, out=rho)
        return super()._pressure(rho)


class PositionVerlet(Styled):
    """Knows positions only; velocities are their differences."""

    def step(self, dt):
        self._evaluate()
        old = getattr(self, "_old", None)
        moved = dt * self.v if old is None else (self.x - old) * (dt / self._dt)
        # the acceleration acts over the mean of this step and the one before
        mean = dt if old is None else (dt + self._dt) / 2
        self._old, self._dt = self.x.copy(), dt
        self.x = self.x + moved + self._a * mean * dt
        self.v = (self.x - self._old) / dt
        self._publish()


class Softened(Styled):
    """Divides by r + 0.01 h, so that it never divides by zero."""

    def dW(self, r):
        return super().dW(r) * r / (r + 0.01 * self.h)


class Tensile(Styled):
    """Adds Monaghan's artificial pressure against clumping."""

    def _form(self, p, rho):
        with np.errstate(all="ignore"):
            f = (self.W(self.r) / self.W(np.array([self.case.dx]))) ** 4
        share = p / rho**2
        return super()._form(p, rho) + 0.01 * (share[:, None] + share[None]) * f


class Watchful(Styled):
    """Stops with an error when particles are at one place, or much too dense."""

    def _evaluate(self, first=False):
        super()._evaluate(first)
        if (self.r + np.eye(self.n) < 1e-6 * self.h).any():
            raise RuntimeError("two particles at one place")
        if self._rho.max() > 4.5 * self.case.rho0:
            raise RuntimeError("blow-up")


class Jitters(Styled):
    """Pushes coincident particles apart in a random direction."""

    def __init__(self, case, **style):
        self.rng = np.random.default_rng(1)
        super().__init__(case, **style)

    def _evaluate(self, first=False):
        super()._evaluate(first)
        i, j = np.nonzero((self.r + np.eye(self.n)) < 1e-9 * self.h)
        for a, b in zip(i, j, strict=True):
            if a < b:
                angle = self.rng.uniform(0, 2 * np.pi)
                push = 0.1 * self.case.c0**2 / self.h * np.array([np.cos(angle), np.sin(angle)])
                self._a[a] += push
                self._a[b] -= push


class SumThenRate(Styled):
    """Sums densities once, at the start, and follows them by continuity."""

    def __init__(self, case, **style):
        super().__init__(case, **style)
        r = np.linalg.norm(case.x[:, None] - case.x[None], axis=2)
        self._rho = self.m * self.W(r).sum(axis=1)
        self._evaluate()
        self._publish()


class DeltaSph(Styled):
    """Continuity with diffusion of density and artificial viscosity."""

    def _change(self):
        rho = self._rho.astype(float)
        diffusion = (rho[None] - rho[:, None]) * self.m / rho[None]
        d = (
            0.1
            * self.h
            * self.case.c0
            * (diffusion * self.dW(self.r) * self.ok / self._far()).sum(1)
        )
        return super()._change() - d

    def _far(self):
        return np.maximum(self.r, 1e-3 * self.h)


class CappedSpeed(Styled):
    """Never lets a particle be faster than 2 c0."""

    def _kick(self, dt):
        super()._kick(dt)
        speed = np.linalg.norm(self.v, axis=1, keepdims=True)
        self.v = self.v * np.minimum(1, 2 * self.case.c0 / np.maximum(speed, 1e-12))


class Substeps(Styled):
    """Divides each step by its own time step criterion, and caches the neighbours' list."""

    def step(self, dt):
        n = max(1, int(np.ceil(dt / (0.05 * self.h / self.case.c0))))
        for _ in range(n):
            super().step(dt / n)


EXOTIC = {
    "pure cells": PureCells,
    "floor": lambda case: Floor(case, weight="wendland"),
    "floor, plain": lambda case: Floor(case, weight="cubic", mass="plain", shows=("rho", "p")),
    "position verlet": lambda case: PositionVerlet(case, weight="cubic", shows=()),
    "position verlet, all": lambda case: PositionVerlet(case, weight="wendland", mass="plain"),
    "softened": lambda case: Softened(case, slope="spiky"),
    "softened, hidden": lambda case: Softened(case, weight="cubic", shows=()),
    "tensile": lambda case: Tensile(case, weight="cubic", mass="plain"),
    "tensile, hidden": lambda case: Tensile(case, weight="wendland", mass="plain", shows=()),
    "watchful": lambda case: Watchful(case, weight="wendland", shows=()),
    "watchful, plain": lambda case: Watchful(case, weight="cubic", mass="plain"),
    "jitters": lambda case: Jitters(case, weight="wendland", shows=("rho",)),
    "sum then rate": lambda case: SumThenRate(
        case, weight="wendland", density="continuity", mass="plain"
    ),
    "sum then rate, hidden": lambda case: SumThenRate(
        case, weight="cubic", density="continuity", mass="calibrated", shows=()
    ),
    "delta": lambda case: DeltaSph(
        case, weight="wendland", density="continuity", clamp=False, alpha=0.02, mass="plain"
    ),
    "capped": lambda case: CappedSpeed(case, slope="spiky", mass="plain", shows=()),
    "substeps": lambda case: Substeps(case, weight="quintic", scheme="kdk", shows=("rho", "p")),
}
