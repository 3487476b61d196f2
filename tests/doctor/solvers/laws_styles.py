"""A brute-force solver that can be written in many styles, and with one thing wrong.

make = build(weight="cubic", mass="plain", scheme="kdk", shows=("rho", "p"))
make = build(shows=(), fault="no self")
"""

import numpy as np

from tests.doctor.solvers.shared import PI, SLOPES, WEIGHTS


class Styled:
    def __init__(self, case, **style):
        self.case = case
        s = self.s = {
            "weight": "poly6",
            "slope": "",
            "mass": "calibrated",
            "density": "summation",
            "form": "monaghan",
            "scheme": "euler",
            "clamp": True,
            "dtype": np.float64,
            "alpha": 0.0,
            "fault": "",
            "shows": ("rho", "p", "a", "evaluate", "neighbors", "c0", "stiffness"),
        } | style
        self.x, self.v = case.x.astype(s["dtype"]), case.v.astype(s["dtype"])
        self.n = len(self.x)
        self.h = case.h * {"half support": 0.5, "double support": 2.0}.get(s["fault"], 1.0)
        self.m = self._mass()
        self.B = case.rho0 * case.c0**2 / case.gamma
        self._rho = np.full(self.n, case.rho0, dtype=s["dtype"])
        if s["fault"] in ("lag",):
            self._rho = np.zeros(self.n) + case.rho0
        self._old_p = None
        self._evaluate(first=True)
        self._publish()

    # kernels
    def W(self, r):
        f = self._solid(self.s["weight"]) if self.fault in ("3D density", "3D both") else 1.0
        return f * WEIGHTS[self.s["weight"]](r / self.h) / self.h**2

    def _solid(self, name):
        """Return the normalisation in three dimensions over that in two."""
        q = np.linspace(0, 1, 4001)
        return 1 / (4 * PI * np.mean(WEIGHTS[name](q) * q**2)) / self.h

    def dW(self, r):
        name = self.s["slope"] or self.s["weight"]
        if self.fault == "poly6 slope":
            name = "poly6"
        f = {
            "third": 1 / 3,
            "3D force": self._solid(name),
            "3D both": self._solid(name),
            "sign": -1.0,
            "twice": 2.0,
        }.get(self.fault, 1.0)
        return f * SLOPES[name](r / self.h) / self.h**3

    @property
    def fault(self):
        return self.s["fault"]

    def _mass(self):
        c = self.case
        plain = c.rho0 * c.dx**2
        if self.fault == "mass":
            plain *= 2
        if self.s["mass"] == "plain":
            return plain
        if self.s["mass"] == "arrangement":
            d = np.linalg.norm(c.x[:, None] - c.x[None], axis=2)
            return c.rho0 / self.W(d).sum(axis=1).max()
        k = np.arange(-6, 7) * c.dx
        m = c.rho0 / self.W(np.hypot(*np.meshgrid(k, k))).sum()
        return 2 * m if self.fault == "mass" else m

    # the chain
    def _evaluate(self, first=False):
        s, c = self.s, self.case
        x = self.x.astype(float)
        d = x[:, None] - x[None]
        r = np.sqrt((d**2).sum(axis=2))
        near = (r < self.h) & ~np.eye(self.n, dtype=bool)
        if self.fault == "few":
            rank = np.argsort(np.argsort(np.where(near, r, 9e9), axis=1), axis=1)
            near &= rank < 12
        if self.fault == "cells":
            cell = np.floor(x / (self.h / 2)).astype(int)
            near &= (np.abs(cell[:, None] - cell[None]) <= 1).all(axis=2)
        if self.fault == "one-sided":
            near &= np.triu(np.ones_like(near))
        twice = 2.0 if self.fault == "pairs twice" else 1.0
        self.near, self.r = near, r
        if s["density"] == "summation":
            own = {"no self": 0.0, "two selves": 2.0}.get(self.fault, 1.0)
            rho = self.m * (own * self.W(np.zeros(1))[0] + twice * (near * self.W(r)).sum(1))
            if self.fault == "frozen" and not first:
                rho = self._rho
            old, self._rho = self._rho, rho.astype(s["dtype"])
        else:
            old = self._rho
        self._p = self._pressure(old if self.fault == "lag" else self._rho).astype(s["dtype"])
        ok = near & (r > 1e-9) if self.fault != "coincident" else near
        with np.errstate(all="ignore"):
            u = np.where(
                ok[..., None],
                d / (r if self.fault == "coincident" else np.where(ok, r, 1))[..., None],
                0,
            )
        self.u, self.ok = u, ok
        p, rho, m = self._p.astype(float), self._rho.astype(float), self.m
        with np.errstate(all="ignore"):
            pair = self._form(p, rho)
        if s["alpha"]:
            dv = self.v[:, None].astype(float) - self.v[None]
            closing = -(dv * d).sum(2)
            mu = self.h / 2 * np.maximum(closing, 0) / (r**2 + 0.01 * self.h**2)
            pair = pair + s["alpha"] * c.c0 * mu / ((rho[:, None] + rho[None]) / 2)
        a = (twice * m * (pair * self.dW(r) * ok)[..., None] * u).sum(axis=1)
        if self.fault == "x only":
            a[:, 1] = 0
        self._a = (a + c.gravity).astype(s["dtype"])

    def _form(self, p, rho):
        i, j = (slice(None), None), (None, slice(None))
        if self.fault == "asymmetric":
            return 2 * p[i] / rho[i] ** 2 + 0 * p[j]
        if self.fault == "difference":
            return (p[i] - p[j]) / (rho[i] * rho[j]) * -1
        if self.fault == "not divided":
            return (p[i] + p[j]) / (2 * rho[j]) / 1000.0
        if self.s["form"] == "mueller":
            return (p[i] + p[j]) / (2 * rho[j]) / rho[i]
        if self.s["form"] == "product":
            return (p[i] + p[j]) / (rho[j] * rho[i])
        return p[i] / rho[i] ** 2 + p[j] / rho[j] ** 2

    def _pressure(self, rho):
        c = self.case
        with np.errstate(all="ignore"):
            p = self.B * ((rho / c.rho0) ** c.gamma - 1)
        f = self.fault
        if f == "no gamma":
            p = p * c.gamma
        if f == "linear":
            p = c.c0**2 * (rho - c.rho0)
        if f == "linear B":
            p = self.B * (rho / c.rho0 - 1)
        if f == "gamma 3":
            p = c.rho0 * c.c0**2 / 3 * ((rho / c.rho0) ** 3 - 1)
        if f == "no c0":
            p = p * (10.0 / c.c0) ** 2
        if f == "wrong clamp":
            return np.minimum(p, 0.0)
        return p if f == "no clamp" or not self.s["clamp"] else np.maximum(p, 0.0)

    def _change(self):
        v = self.v.astype(float)
        dv = v[:, None] - v[None]
        sign = -1.0 if self.fault == "continuity sign" else 1.0
        return -sign * self.m * ((dv * self.u).sum(2) * self.dW(self.r) * self.ok).sum(1)

    def step(self, dt):
        s = self.s["scheme"]
        if s == "kdk":
            self._kick(dt / 2)
            self._drift(dt)
            self._evaluate()
            self._kick(dt / 2)
        elif s == "dkd":
            self._drift(dt / 2)
            self._evaluate()
            self._kick(dt)
            self._drift(dt / 2)
        elif s == "midpoint":
            x, v, rho = self.x.copy(), self.v.copy(), self._rho.copy()
            self._evaluate()
            self._kick(dt / 2)
            self._drift(dt / 2)
            self._evaluate()
            self.x, self.v = x + dt * self.v, v + dt * self._a
            if self.s["density"] == "continuity":
                self._rho = rho + dt * self._change()
        else:
            self._evaluate()
            self._kick(dt)
            self._drift(dt)
        self._publish()

    def _kick(self, dt):
        self.v = (self.v + dt * self._a).astype(self.s["dtype"])

    def _drift(self, dt):
        if self.s["density"] == "continuity":
            self._rho = (self._rho + dt * self._change()).astype(self.s["dtype"])
        self.x = (self.x + dt * self.v).astype(self.s["dtype"])

    def _publish(self):
        shows = self.s["shows"]
        for name in ("rho", "p", "a"):
            if name in shows:
                setattr(self, name, getattr(self, "_" + name))
        if "c0" in shows:
            self.c0 = self.case.c0
        if "stiffness" in shows:
            self.stiffness = self.B
        if "evaluate" in shows:
            self.evaluate = self._renew
        if "neighbors" in shows:
            self.neighbors = lambda i: np.flatnonzero(self.near[i])

    def _renew(self):
        self._evaluate()
        self._publish()


def build(**style):
    def make(case):
        return Styled(case, **style)

    return make
