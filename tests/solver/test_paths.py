"""The whole step on every path, for every number of lanes and older processors, against the naive
solver.

Every path compiles the grid in double precision, some in single precision too. Brute force, whose
pair loops are the same ones without lists, is compiled for two lanes and the processor's own number
only. Each takes as long as compiling the solver does.
"""

import numpy as np
import pytest

from tests.cases import DYNAMIC_PRESSURE, assert_close, fluid, simulation
from tests.naive import Naive
from tests.paths import every_path, run_tests
from tests.solver.test_forces import TOLERANCE

N_STEPS, DT = 3, 1e-4
WITH_BRUTE_FORCE = {"2 lanes"}
IN_SINGLE_PRECISION = {"2 lanes", "16 lanes", "avx2"}


@pytest.mark.parametrize(
    ("neighbors", "dtype"),
    [("grid", "float64"), ("grid", "float32"), ("brute", "float64")],
)
def test_fields_and_steps_are_those_of_the_naive_solver(neighbors, dtype):
    sim = simulation("everything", "jittered", dtype, neighbors)
    naive, tolerance = Naive(sim.scene, sim.controls), TOLERANCE[dtype]
    start, v = np.asarray(sim.scene.x), np.asarray(sim.scene.v)
    sim.controls = sim.controls._replace(dt=DT)
    rho = naive.density(start)
    assert_close(sim.rho, rho, tolerance)
    assert_close(sim.p, naive.pressure(rho), tolerance, at_least=DYNAMIC_PRESSURE)
    assert_close(fluid(sim, "a"), naive.acceleration(start, v, 0.0), tolerance, at_least=9.81)
    x = start
    for k in range(N_STEPS):
        x, v = naive.step(x, v, k * DT, DT)
    assert sim.advance(N_STEPS * DT).n_substeps == N_STEPS
    assert_close(fluid(sim, "x") - start, x - start, tolerance)
    assert_close(fluid(sim, "v"), v, tolerance)
    assert_close(sim.rho, naive.density(x), tolerance)


@pytest.mark.slow
@every_path
def test_so_they_are_on_every_path(path, tmp_path):
    chosen = "naive"
    if path not in WITH_BRUTE_FORCE:
        chosen += " and grid"
    if path not in IN_SINGLE_PRECISION:
        chosen += " and float64"
    run_tests(path, tmp_path, __file__, "-k", chosen)
