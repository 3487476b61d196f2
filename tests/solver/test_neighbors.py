"""The grid finds everybody whom brute force finds, and the sort loses nobody."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sph_gym import Controls
from sph_gym.solver.neighbors import (
    CELLS_PER_PARTICLE,
    cell,
    lay_grid,
    make_sorting,
    read_grid,
    sort_into_cells,
)
from sph_gym.solver.state import allocate_particles, empty_like
from sph_gym.solver.teams import make_team
from tests.cases import (
    CONFIGURATIONS,
    DX,
    DYNAMIC_PRESSURE,
    STIFFNESS,
    assert_close,
    clouds,
    fluid,
    scene,
    simulation,
)

H = 2.6 * DX
FAR = 1e4

near = st.tuples(*[st.floats(-2 * H, 8 * H)] * 2)
on_lattice = st.tuples(*[st.integers(-8, 20).map(lambda k: k * H / 4)] * 2)
anywhere = st.tuples(*[st.floats(-FAR, FAR)] * 2)
crowds = st.lists(st.one_of(near, on_lattice, anywhere), min_size=1, max_size=40)
coincident = st.builds(lambda place, n: [place] * n, near, st.integers(1, 20))


def in_both_ways(configuration, x, h=H):
    """Return a moving cloud with the grid and by brute force; in a tank, within its walls."""
    x, walls = np.array(x), CONFIGURATIONS[configuration].get("walls")
    if walls is not None:
        left, right, floor, ceiling = walls.box
        x = np.clip(x, [left, floor], [right, ceiling])
    v = np.random.default_rng(len(x)).normal(size=x.shape)
    controls = Controls(1e-6, STIFFNESS, 0.4)
    return [
        simulation(configuration, neighbors=kind, x=x, v=v, h=h, controls=controls)
        for kind in ("grid", "brute")
    ]


def assert_equal(grid, brute):
    assert (grid.neighbor_counts == brute.neighbor_counts).all()
    for field in ("rho", "p", "a"):
        at_least = {"p": DYNAMIC_PRESSURE, "a": 9.81}.get(field, 0.0)
        assert_close(getattr(grid, field), getattr(brute, field), 1e-12, at_least)
    reports = [sim.advance(sim.controls.dt) for sim in (grid, brute)]
    assert reports[0] == reports[1]
    assert_close(fluid(grid, "v"), fluid(brute, "v"), 1e-12)
    assert grid.x == pytest.approx(brute.x, rel=1e-12, abs=1e-12 * DX)


@pytest.mark.parametrize("configuration", ["none", "everything"])
@given(st.one_of(crowds, coincident))
@example([(0.0, 0.0)])
@example([(0.0, 0.0), (H / 2, 0.0)])
@example([(0.0, 0.0), (FAR, FAR)])
@example([(-FAR, 0.0), (-FAR + H / 2, 0.0), (FAR, 0.0), (FAR, H / 3)])
def test_grid_is_brute_force(configuration, x):
    assert_equal(*in_both_ways(configuration, x))


@clouds
def test_grid_is_brute_force_on_clouds_with_strays(cloud):
    strays = [(FAR, 0.0), (FAR, H / 2), (-FAR, -FAR)]
    where = scene(cloud=cloud)
    assert_equal(*in_both_ways("none", np.concatenate([where.x, strays]), where.h))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("h_over_dx", [2, 3, 4])
@pytest.mark.parametrize("origin", [0.0, 0.3, -17.1])
def test_commensurate_lattices_lose_no_pair(h_over_dx, dtype, origin):
    x = np.asarray(scene(cloud="lattice 2").x) + origin
    grid, brute = (
        simulation("none", dtype=dtype, neighbors=kind, x=x, v=None, h=h_over_dx * DX)
        for kind in ("grid", "brute")
    )
    assert (grid.neighbor_counts == brute.neighbor_counts).all()
    assert_close(grid.rho, brute.rho, {"float64": 1e-14, "float32": 1e-6}[dtype])


@pytest.mark.without_jit
def test_nobody_at_the_edge_of_the_support_is_lost():
    rng = np.random.default_rng(0)
    here = 4.0 * H * np.stack(np.mgrid[:14, :14], axis=-1).reshape(-1, 2)
    here = here + rng.uniform(0.0, H / 2, here.shape)
    angle = rng.uniform(0.0, 2 * np.pi, len(here))
    there = here + (1 - 1e-9) * H * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    sim = simulation("none", x=np.concatenate([here, there]), v=None)
    assert (sim.neighbor_counts == 1).all()


def test_neighbor_counts_leave_the_particle_itself_out():
    sim = simulation("none", x=[(0.0, 0.0), (0.5 * H, 0.0), (0.0, 0.0), (9.0, 9.0)], v=None)
    assert sim.neighbor_counts.tolist() == [2, 2, 2, 0]


# --- The sort -------------------------------------------------------------------------------


def sorted_by_cells(x):
    source = allocate_particles(x, np.arange(2.0 * len(x)).reshape(-1, 2), np.float64)
    sorting, target = make_sorting(len(x), 0, False, 1), empty_like(source)
    n_cells = sorting.counts.shape[1]
    start = np.zeros(n_cells + 1, np.int32)
    assert lay_grid(sorting.frame, source, H, n_cells)
    assert not lay_grid(sorting.frame, source, H, n_cells)  # it is there
    grid = read_grid(sorting.frame)
    assert sort_into_cells(0, 1, make_team(), source, target, sorting, start)
    present = {name: a[: len(x)] for name, a in target._asdict().items() if a is not None}
    return grid, start, target._replace(**present)


@clouds
def test_sort_keeps_every_particle_whole_and_in_its_cell(cloud):
    x = np.concatenate([scene(cloud=cloud).x, [(FAR, -FAR)]])
    grid, start, target = sorted_by_cells(x)
    assert sorted(target.id) == list(range(len(x)))
    assert (np.stack([target.x, target.y], axis=-1) == x[target.id]).all()
    assert (target.u == 2.0 * target.id).all()
    assert (target.v == 2.0 * target.id + 1.0).all()
    assert start[0] == 0
    assert start[grid.n_columns * grid.n_rows] == len(x)
    for c in range(grid.n_columns * grid.n_rows):
        ids = target.id[start[c] : start[c + 1]]
        assert all(cell(grid, *x[i]) == c for i in ids)
        assert (np.diff(ids) > 0).all()  # stable


@pytest.mark.without_jit
def test_a_position_that_is_no_number_has_a_cell():
    grid, _, _ = sorted_by_cells(np.asarray(scene().x))
    assert cell(grid, np.nan, np.nan) == 0
    assert cell(grid, np.inf, np.inf) == grid.n_columns * grid.n_rows - 1
    assert cell(grid, -np.inf, -np.inf) == 0


@given(crowds)
def test_strays_do_not_inflate_the_grid(x):
    grid, _, _ = sorted_by_cells(np.array(x))
    assert 1 <= grid.n_columns * grid.n_rows <= CELLS_PER_PARTICLE * len(x) + 64


@pytest.mark.without_jit
@pytest.mark.parametrize("far", [1e15, -7.5e17, 1e100])
def test_a_fluid_so_far_away_that_all_are_in_one_place_has_a_grid(far):
    x = np.asarray(scene().x) + np.array((far, 0.0))
    grid, _, target = sorted_by_cells(x)
    assert grid.n_columns >= 1
    assert 1 <= grid.n_columns * grid.n_rows <= CELLS_PER_PARTICLE * len(x) + 64
    assert sorted(target.id) == list(range(len(x)))
