"""Walls of many kinds, sound and unsound, for `motion_solvers.Solver`."""

import numpy as np


class Walls:
    """Particles, images, forces and reflections at the sides of a box, as `walls` says."""

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

    def _images(self, x):
        """Mirror images of all particles at each side, and at each corner."""
        if self.walls != "ghosts" or self.case.box is None:
            return []
        x0, x1, y0, y1 = self.case.box
        return [
            np.where([a is not None, b is not None], np.array([2 * (a or 0), 2 * (b or 0)]) - x, x)
            for a in (None, x0, x1) for b in (None, y0, y1) if (a, b) != (None, None)
        ]  # fmt: skip

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
