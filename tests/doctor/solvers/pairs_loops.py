"""The article's solver in loops of plain Python over all pairs: slow, and shows x and v only."""

import math


class Loops:
    """Poly6 and spiky, Tait with a clamp, mass rho0 dx^2, no viscosity, XSPH as in the article."""

    def __init__(self, case):
        self.case = case
        self.x, self.v = case.x.tolist(), case.v.tolist()
        self.mass = case.rho0 * case.dx**2

    def step(self, dt):
        case, x, v, n = self.case, self.x, self.v, len(self.x)
        h, m = case.h, self.mass
        poly6, spiky = 4 / (math.pi * h**8), -30 / (math.pi * h**5)
        pairs = []
        rho = [m * poly6 * h**6] * n
        for i in range(n):
            xi, yi = x[i]
            for j in range(i):
                dx, dy = xi - x[j][0], yi - x[j][1]
                r2 = dx * dx + dy * dy
                if r2 < h * h:
                    w = m * poly6 * (h * h - r2) ** 3
                    rho[i] += w
                    rho[j] += w
                    pairs.append((i, j, dx, dy, math.sqrt(r2), w))
        stiffness = case.rho0 * case.c0**2 / case.gamma
        p = [max(stiffness * ((each / case.rho0) ** case.gamma - 1), 0.0) for each in rho]
        for i, j, dx, dy, r, _ in pairs:
            if r < 1e-9:
                continue
            push = -m * (p[i] / rho[i] ** 2 + p[j] / rho[j] ** 2) * spiky * (h - r) ** 2 / r * dt
            for k, d in ((0, dx), (1, dy)):
                v[i][k] += push * d
                v[j][k] -= push * d
        for each in v:
            each[0] += dt * case.gravity[0]
            each[1] += dt * case.gravity[1]
        moved = [list(each) for each in v]
        for i, j, _, _, _, w in pairs:
            for k in (0, 1):
                moved[i][k] += case.xsph * w / rho[j] * (v[j][k] - v[i][k])
                moved[j][k] += case.xsph * w / rho[i] * (v[i][k] - v[j][k])
        for each, velocity in zip(x, moved, strict=True):
            each[0] += dt * velocity[0]
            each[1] += dt * velocity[1]
