"""Peer of `study throughput`: the same dam break by a plain SPH solver in Taichi, on one thread.

    python -m sph_gym study throughput --peers sph_gym/studies/peer_solvers --peers-python PYTHON

PYTHON is one that has taichi and numpy; this file needs nothing else. The scheme is the cheapest
that is usual: density by the continuity equation, Tait's equation, Wendland's C2 kernel, artificial
viscosity, boundary particles, and a predictor with the last rates (Monaghan 1989), so that there is
one loop over pairs a step. Particles are sorted into cells of one support radius in every step,
which keeps neighbours close in memory.
"""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import taichi as ti

# Column and tank [m], layers of boundary particles, support radius / spacing.
WIDTH, HEIGHT, TANK, LAYERS, REACH = 1.0, 2.0, 4.0, 3, 2.6
RHO0, GRAVITY, ALPHA, GAMMA = 1000.0, 9.81, 0.05, 7.0
COURANT = 0.2
# Steps before anything is timed, and the least number of timed runs.
WARM_UP, RUNS = 5, 3


def lattice(x_min: int, x_max: int, y_min: int, y_max: int) -> Any:
    """Return (n, 2) centres of the squares from column x_min and row y_min on, in spacings."""
    columns, rows = np.arange(x_min, x_max) + 0.5, np.arange(y_min, y_max) + 0.5
    return np.stack(np.meshgrid(columns, rows, indexing="ij"), axis=-1).reshape(-1, 2)


@ti.data_oriented
class DamBreak:
    """The fluid and its solver.

    x, v, rho: state of all particles at the end of a step; a, growth: rates of v and rho in the
    middle of the last step. sorted_*: the same in the order of cells, the state predicted for the
    middle of the step.
    """

    def __init__(self, n: int, real: Any) -> None:
        self.dx = dx = (WIDTH * HEIGHT / n) ** 0.5
        self.h = REACH * dx
        self.c0 = 10 * (2 * GRAVITY * HEIGHT) ** 0.5
        self.dt = COURANT * self.h / self.c0
        self.mass = RHO0 * dx**2
        width, height, tank = (round(size / dx) for size in (WIDTH, HEIGHT, TANK))
        fluid = lattice(0, width, 0, height)
        around = lattice(-LAYERS, tank + LAYERS, -LAYERS, tank)
        inside = (around[:, 0] > 0) & (around[:, 0] < tank) & (around[:, 1] > 0)
        places = dx * np.concatenate([fluid, around[~inside]])
        self.n_fluid, self.n = len(fluid), len(places)
        # one empty cell on each side, so that every cell has all its neighbours
        self.low = -LAYERS * dx - self.h
        self.columns = int((tank + 2 * LAYERS) * dx / self.h) + 4
        vector = ti.types.vector(2, real)
        self.x, self.v, self.a = (vector.field(shape=self.n) for _ in range(3))
        self.sorted_x, self.sorted_v, self.sorted_a = (vector.field(shape=self.n) for _ in range(3))
        self.rho, self.growth = ti.field(real, self.n), ti.field(real, self.n)
        self.sorted_rho, self.sorted_growth = ti.field(real, self.n), ti.field(real, self.n)
        self.stress = ti.field(real, self.n)
        self.is_fluid, self.sorted_is_fluid = ti.field(ti.i32, self.n), ti.field(ti.i32, self.n)
        self.cell = ti.field(ti.i32, self.n)
        self.start = ti.field(ti.i32, self.columns**2 + 1)
        self.cursor = ti.field(ti.i32, self.columns**2)
        self.x.from_numpy(places.astype(np.float64 if real == ti.f64 else np.float32))
        self.is_fluid.from_numpy((np.arange(self.n) < self.n_fluid).astype(np.int32))
        self.rho.fill(RHO0)

    def step(self) -> None:
        """Advance everything by one time step."""
        self.count()
        self.find_starts()
        self.sort()
        self.move()

    @ti.func
    def place(self, x):
        """Return column and row of the cell of a position."""
        column = ti.cast((x[0] - self.low) / self.h, ti.i32)
        row = ti.cast((x[1] - self.low) / self.h, ti.i32)
        last = self.columns - 2
        return min(max(column, 1), last), min(max(row, 1), last)

    @ti.kernel
    def count(self):
        """Count the predicted particles of every cell."""
        for c in self.cursor:
            self.cursor[c] = 0
        for i in self.x:
            column, row = self.place(self.x[i] + 0.5 * self.dt * self.v[i])
            self.cell[i] = row * self.columns + column
            ti.atomic_add(self.cursor[self.cell[i]], 1)

    @ti.kernel
    def find_starts(self):
        """Turn counts into the first particle of every cell."""
        ti.loop_config(serialize=True)
        for c in range(self.columns**2):
            self.start[c + 1] = self.start[c] + self.cursor[c]
            self.cursor[c] = self.start[c]

    @ti.kernel
    def sort(self):
        """Predict particles and put them into the order of their cells; compute p / rho^2."""
        half = ti.static(0.5 * self.dt)
        for i in self.x:
            k = ti.atomic_add(self.cursor[self.cell[i]], 1)
            rho = self.rho[i] + half * self.growth[i]
            self.sorted_x[k] = self.x[i] + half * self.v[i]
            self.sorted_v[k], self.sorted_a[k] = self.v[i] + half * self.a[i], self.a[i]
            self.sorted_rho[k], self.sorted_growth[k] = rho, self.growth[i]
            self.sorted_is_fluid[k] = self.is_fluid[i]
            square = (rho / RHO0) ** 2
            tait = RHO0 * self.c0**2 / GAMMA * (square * square * square * rho / RHO0 - 1.0)
            self.stress[k] = max(tait, 0.0) / (rho * rho)

    @ti.kernel
    def move(self):
        """Sum forces and divergences over neighbours and correct the prediction with them."""
        h, dt, half = ti.static(self.h, self.dt, 0.5 * self.dt)
        # grad W = -slope (1 - r/h)^3 (x_i - x_j)
        slope = 140.0 / (np.pi * h**4) * self.mass
        damping, eta2 = ALPHA * self.c0 * h, 0.01 * h * h
        for i in self.sorted_x:
            x, v, rho = self.sorted_x[i], self.sorted_v[i], self.sorted_rho[i]
            stress, a, growth = self.stress[i], 0.0 * x, 0.0 * rho
            column, row = self.place(x)
            for above in range(row - 1, row + 2):
                first = above * self.columns + column
                for j in range(self.start[first - 1], self.start[first + 2]):
                    d = x - self.sorted_x[j]
                    r2 = d.dot(d)
                    if r2 < h * h:
                        rest = 1.0 - ti.sqrt(r2) / h
                        weight = slope * rest * rest * rest
                        approach = (v - self.sorted_v[j]).dot(d)
                        total = stress + self.stress[j]
                        if approach < 0.0:
                            mean = 0.5 * (rho + self.sorted_rho[j])
                            total -= damping * approach / ((r2 + eta2) * mean)
                        a += total * weight * d
                        growth -= weight * approach
            self.is_fluid[i] = self.sorted_is_fluid[i]
            self.rho[i] = rho - half * self.sorted_growth[i] + dt * growth
            self.growth[i] = growth
            if self.is_fluid[i] == 1:
                a[1] -= GRAVITY
                v += dt * a - half * self.sorted_a[i]
                x += half * v
                self.a[i] = a
            else:
                self.a[i] = 0.0 * a
            self.x[i], self.v[i] = x, v

    @ti.kernel
    def mean_neighbors(self) -> ti.f64:
        """Return the mean number of neighbours of a fluid particle, itself left out."""
        total = 0
        for i in self.sorted_x:
            if self.sorted_is_fluid[i] == 1:
                column, row = self.place(self.sorted_x[i])
                for above in range(row - 1, row + 2):
                    first = above * self.columns + column
                    for j in range(self.start[first - 1], self.start[first + 2]):
                        d = self.sorted_x[i] - self.sorted_x[j]
                        if j != i and d.dot(d) < self.h**2:
                            total += 1
        return total / self.n_fluid


def run_times(run: Callable[[], None], budget: float) -> tuple[float, float]:
    """Return medians of wall clock and processor time of a run [s], repeated for a budget [s]."""
    began, walls, owns = time.perf_counter(), list[float](), list[float]()
    while len(walls) < RUNS or time.perf_counter() - began < budget:
        wall, own = time.perf_counter(), time.process_time()
        run()
        walls.append(time.perf_counter() - wall)
        owns.append(time.process_time() - own)
    return statistics.median(walls), statistics.median(owns)


def main() -> None:
    """Time steps and print speeds [M particle-steps/s] as one line `RES {json}`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, default=5000, help="fluid particles, about")
    parser.add_argument("--steps", type=int, default=200, help="of one timed run")
    parser.add_argument("--f64", action="store_true", help="double instead of single precision")
    options = parser.parse_args()
    real = ti.f64 if options.f64 else ti.f32
    ti.init(arch=ti.cpu, cpu_max_num_threads=1, default_fp=real, log_level=ti.WARN)
    fluid = DamBreak(options.n, real)

    def run(steps: int = options.steps) -> None:
        for _ in range(steps):
            fluid.step()
        ti.sync()

    run(WARM_UP)
    wall, own = run_times(run, float(os.environ.get("BUDGET", "4")))
    rho, speed = fluid.rho.to_numpy(), np.linalg.norm(fluid.v.to_numpy(), axis=1)
    done = options.steps / 1e6
    result = {
        "Mps_all": fluid.n * done / wall,
        "Mps_fluid": fluid.n_fluid * done / wall,
        "Mps_all_cpu": fluid.n * done / own,
        "nbr": fluid.mean_neighbors(),
        "n_fluid": fluid.n_fluid,
        "n": fluid.n,
        "least_density": float(rho.min()),
        "largest_density": float(rho.max()),
        "top_speed": float(speed.max()),
    }
    print("RES", json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
