"""Bodies of fluid that nothing holds, and the drop that falls: references, errors, coarse runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes import colliding_patches as c
from sph_gym.scenes import drop_impact as i
from sph_gym.scenes import perturbed_lattice as pl
from sph_gym.scenes import relaxation as rx
from sph_gym.scenes import rotating_square as r
from sph_gym.scenes.colliding_patches import colliding_patches
from sph_gym.scenes.drop_impact import drop_impact
from sph_gym.scenes.perturbed_lattice import perturbed_lattice
from sph_gym.scenes.relaxation import relaxation
from sph_gym.scenes.rotating_square import rotating_square
from sph_gym.scenes.shared import free_bodies
from sph_gym.scenes.shared.reference import Run
from tests.scenes.planted import planted


def measures(reference, run):
    return {measure.quantity: measure for measure in reference.judge(run)}


def as_it_began(scene, **numbers):
    v = np.zeros_like(scene.x) if scene.v is None else np.asarray(scene.v)
    return planted(scene, v, **numbers)


@pytest.mark.parametrize(
    ("build", "name", "value"),
    [
        (rotating_square, "side", 0.05),
        (colliding_patches, "length", 0.05),
        (colliding_patches, "height", 0.05),
        (perturbed_lattice, "side", 0.2),
        (perturbed_lattice, "noise", 0.3),
        (perturbed_lattice, "kernel", "gauss"),
        (perturbed_lattice, "seed", 0.5),
        (relaxation, "diameter", 0.01),
        (relaxation, "seed", 0.5),
        (drop_impact, "diameter", 0.05),
        (drop_impact, "drop_height", 0.01),
        (drop_impact, "width", 0.1),
    ],
)
def test_wrong_arguments_are_named(build, name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        build(**{name: value})


# --- What a body conserves ------------------------------------------------------------------


def test_rings_fill_a_disc():
    for radius, dx in ((1.0, 0.05), (0.3, 0.02)):
        x = free_bodies.rings(radius, dx)
        assert np.hypot(*x.T).max() + dx / 2 == pytest.approx(radius)
        assert len(x) * dx**2 == pytest.approx(math.pi * radius**2, rel=0.01)
        assert x.mean(axis=0) == pytest.approx((0.0, 0.0), abs=1e-12)
        assert free_bodies.semi_axes(x) == pytest.approx((radius, radius), rel=0.01)
        apart = np.hypot(*(x[:, None] - x[None]).T)
        np.fill_diagonal(apart, np.inf)
        assert apart.min() > 0.8 * dx


def test_semi_axes_are_those_of_an_ellipse():
    x = free_bodies.rings(1.0, 0.02) * (3.0, 0.5) + (7.0, -2.0)
    assert free_bodies.semi_axes(x) == pytest.approx((3.0, 0.5), rel=1e-3)


def test_changes_of_momentum_are_measured():
    scene = rotating_square(dx=0.1)
    before = as_it_began(scene)
    mass = before.mass * before.n_fluid
    size = math.hypot(0.45, 0.45)
    # at 1 / s
    fastest = size
    after = planted(scene, np.asarray(scene.v) * 0.5 + (0.03, 0.04))
    seen = [free_bodies.conserved(sim) for sim in (before, after, before)]
    spin = seen[0]["angular_momentum"]
    linear, angular = free_bodies.momentum_measures(Run(before, np.arange(3.0), seen))
    assert seen[0]["speed"] == pytest.approx(fastest)
    assert linear.value == pytest.approx(0.05 / fastest)
    assert angular.value == pytest.approx(abs(spin) / 2 / (mass * fastest * size))
    assert (linear.bound, angular.bound) == (1e-12, 1e-12)
    run = Run(before, np.zeros(1), seen[:1])
    free = free_bodies.momentum_measures(run, linear=False, angular=False)
    assert [(one.value, one.bound) for one in free] == [(0.0, None), (0.0, None)]


def test_energy_may_go_from_motion_to_sound():
    scene = rotating_square(dx=0.1)
    before = as_it_began(scene)
    kinetic = before.diagnostics()["kinetic_energy"]
    sound = planted(scene, 0.9 * np.asarray(scene.v), internal_energy=0.19 * kinetic)
    lost = planted(scene, 0.9 * np.asarray(scene.v))
    for after, share in ((sound, 0.0), (lost, 19.0)):
        seen = [free_bodies.conserved(before), free_bodies.conserved(after)]
        motion, total = free_bodies.energy_measures(Run(after, np.arange(2.0), seen), 5.0)
        assert motion.value == pytest.approx(19.0)
        assert motion.bound == 5.0
        assert total.value == pytest.approx(share, abs=1e-9)


def test_spurious_kinetic_energy_counts_as_much_as_what_is_lost():
    scene = rotating_square(dx=0.1)
    before, after = as_it_began(scene), planted(scene, math.sqrt(1.5) * np.asarray(scene.v))
    seen = [free_bodies.conserved(before), free_bodies.conserved(after)]
    motion, _ = free_bodies.energy_measures(Run(after, np.arange(2.0), seen), 3.0)
    assert motion.value == pytest.approx(50.0)
    assert motion.value > motion.bound


# --- The rotating square --------------------------------------------------------------------


def test_the_first_pressure_solves_poissons_equation():
    side, omega, step = 2.0, 3.0, 0.01
    there = r.initial_pressure(0.7, 1.2, side, omega)
    around = [
        r.initial_pressure(0.7 + dx, 1.2 + dy, side, omega)
        for dx, dy in ((step, 0), (-step, 0), (0, step), (0, -step))
    ]
    laplacian = (sum(around) - 4 * there) / step**2
    assert laplacian == pytest.approx(2 * 1000 * omega**2, rel=1e-2)
    for x, y in ((0.0, 1.0), (side, 0.3), (0.5, 0.0), (1.5, side)):
        assert r.initial_pressure(x, y, side, omega) == pytest.approx(0.0, abs=1e-6)


def test_the_first_pressure_is_that_of_a_twisted_bar():
    # Prandtl's function of a square bar is 0.0736713 side^2 in the middle where its laplacian is -1
    for side, omega in ((1.0, 1.0), (0.5, 4.0)):
        middle = r.initial_pressure(side / 2, side / 2, side, omega)
        assert middle == pytest.approx(-2000 * omega**2 * 0.0736713 * side**2, rel=1e-4)


def test_a_square_of_any_size_and_speed_is_recognized():
    assert r.start(rotating_square(dx=0.1, side=2.0, omega=3.0)) == pytest.approx((2.0, 3.0))


def test_the_error_of_the_square_is_its_loss_of_energy():
    scene = rotating_square(dx=0.1)
    assert r.error(as_it_began(scene)) == pytest.approx(0.0, abs=1e-9)
    slower = planted(scene, math.sqrt(0.93) * np.asarray(scene.v))
    assert r.error(slower) == pytest.approx(7.0)


def test_the_tensile_correction_relieves_tension_only():
    scene = rotating_square(dx=0.1)
    n = len(np.asarray(scene.x))
    relief = r.relief(scene)
    assert 0.0 < relief < r.EPSILON
    # neighbours along the axes alone have all of it
    assert r.relief(replace(scene, h=1.4 * scene.dx)) == pytest.approx(r.EPSILON)
    without = replace(scene, effects=replace(scene.effects, tensile_correction=None))
    assert r.relief(without) == 0.0
    for p, seen in ((200.0, 200.0), (-200.0, -200.0 * (1 - relief))):
        sim = as_it_began(scene, p=np.full(n, p))
        assert r.central_pressure(sim) == pytest.approx(seen)
        assert r.observe(sim)["pressure"] == pytest.approx(seen)
    away = planted(scene, np.asarray(scene.v), x=np.asarray(scene.x) + 3.0, p=np.zeros(n))
    assert np.isnan(r.central_pressure(away))


def test_the_first_pressure_is_a_mean_over_the_sound():
    scene = rotating_square(dx=0.1)
    sim = as_it_began(scene)
    exact = r.initial_pressure(0.5, 0.5, 1.0, 1.0)
    times = np.linspace(0.0, 0.5, 1001)
    # the slowest wave of a square with free sides, at c0 = 20 m/s
    wave = np.cos(2 * math.pi * times / (math.sqrt(2) / 20))
    for off in (1.0, 1.05):
        seen = free_bodies.conserved(sim)
        run = Run(sim, times, [seen | {"pressure": off * exact * (1 - one)} for one in wave])
        assert r.early_pressure(run) == pytest.approx(off * exact, rel=1e-2)
        first = measures(r.REFERENCE, run)["first pressure in the middle"]
        assert first.value == pytest.approx(100 * (off - 1), abs=1.0)
        assert first.bound == 2.0


def test_a_coarse_square_keeps_turning():
    run = r.REFERENCE.run(Simulation(rotating_square(dx=1 / 20), threads=1))
    found = measures(r.REFERENCE, run)
    assert 0 < found["change of kinetic energy"].value < 25.0
    assert run.series("kinetic")[-1] < run.series("kinetic")[0]
    assert found["first pressure in the middle"].value < 1.0
    assert found["change of momentum"].value < 1e-12
    assert found["change of angular momentum"].value < 1e-12
    seen, exact = r.REFERENCE.chart(run).curves
    assert exact.y[0] == pytest.approx(-147.34, abs=0.01)
    # arms grow out of the corners
    assert np.hypot(*run.sim.x.T).max() > 1.2 * math.hypot(0.5, 0.5)
    assert len(seen.y) == len(run.times)


# --- Colliding patches ----------------------------------------------------------------------


def second_derivative(n, step, left):
    """Of values at the middles of n cells; 0 at the right end, at the left as `left` says."""
    matrix = (np.eye(n, k=1) + np.eye(n, k=-1) - 2 * np.eye(n)) / step**2
    matrix[0, 0] += (1 if left == "no flux" else -1) / step**2
    matrix[-1, -1] -= 1 / step**2
    return matrix


@pytest.mark.parametrize(("length", "height"), [(1.0, 1.0), (0.5, 1.0), (1.0, 0.5)])
def test_the_loss_is_the_energy_of_the_impulsive_flow(length, height):
    # laplacian P = 0, P = 0 on the free sides, - dP/dx = 1 where they meet, by differences
    n = 24
    dx, dy = length / n, height / n
    along = np.kron(second_derivative(n, dx, "no flux"), np.eye(n))
    across = np.kron(np.eye(n), second_derivative(n, dy, "none"))
    blow = np.zeros((n, n))
    blow[0] = -1 / dx
    impulse = np.linalg.solve(along + across, blow.ravel()).reshape(n, n)
    # by Green's identity the energy is that of the blow
    loss = (impulse[0] + dx / 2).mean() / length
    assert c.impact_loss(length, height) == pytest.approx(loss, rel=0.03)


def test_thin_plates_lose_all_and_long_rods_lose_little():
    assert c.impact_loss(0.01, 1.0) == pytest.approx(1.0, abs=0.02)
    zeta_3 = 1.2020569
    assert c.impact_loss(50.0, 1.0) == pytest.approx(7 * zeta_3 / math.pi**3 / 50.0, rel=1e-5)


def test_the_error_of_the_patches_is_that_of_the_state():
    scene = colliding_patches(dx=0.1, height=0.5, speed=3.0)
    assert c.start(scene) == pytest.approx((1.0, 0.5))
    assert c.energy_lost(as_it_began(scene)) == pytest.approx(0.0, abs=1e-12)
    left = 1 - c.impact_loss(1.0, 0.5)
    after = planted(scene, math.sqrt(left) * np.asarray(scene.v))
    assert c.error(after) == pytest.approx(0.0, abs=1e-9)
    slower = planted(scene, math.sqrt(left - 0.07) * np.asarray(scene.v))
    assert c.error(slower) == pytest.approx(7.0)
    assert c.observe(slower)["lost"] == pytest.approx(1 - left + 0.07)


def test_twins_mirror_each_other():
    scene = colliding_patches(dx=0.1, gap=0.4)
    assert c.asymmetry(as_it_began(scene)) == pytest.approx(0.0, abs=1e-12)
    x = np.array(scene.x)
    assert np.abs(x[:, 0]).min() == pytest.approx(0.2 + 0.05)
    x[: len(x) // 2] += (0.018, 0.024)
    assert c.asymmetry(planted(scene, np.asarray(scene.v), x=x)) == pytest.approx(0.3)
    # they need time to meet
    assert scene.duration == pytest.approx(1.0 + 0.2)


def test_coarse_patches_lose_what_the_impact_costs():
    run = c.REFERENCE.run(Simulation(colliding_patches(dx=1 / 20), threads=1))
    found = measures(c.REFERENCE, run)
    assert found["energy lost, against the impact"].value < 10.0
    assert found["energy lost, against the impact"].bound is None
    assert found["asymmetry"].value < 1e-6
    assert found["change of momentum"].value < 1e-12
    assert found["change of angular momentum"].value < 1e-12
    seen, exact = c.REFERENCE.chart(run).curves
    assert seen.y[0] == pytest.approx(1.0)
    assert seen.y[-1] == pytest.approx(exact.y[-1], abs=0.1)


# --- The perturbed lattice ------------------------------------------------------------------


def test_the_noise_is_that_of_the_seed():
    x = [np.asarray(perturbed_lattice(seed=seed).x) for seed in (1, 1, 2)]
    assert np.array_equal(x[0], x[1])
    assert not np.array_equal(x[0], x[2])
    still = np.asarray(perturbed_lattice(noise=0.0).x)
    off = (x[0] - still + 0.5) % 1.0 - 0.5
    assert off.std() == pytest.approx(1e-3 * 0.025, rel=0.05)


def test_spurious_energy_is_the_error_of_the_lattice():
    scene = perturbed_lattice(dx=1 / 12)
    sim = Simulation(scene, threads=1)
    assert pl.scale(sim) == pytest.approx(1000.0 * 10.0**2, rel=0.01)
    assert pl.error(sim) == 0.0
    for share in (0.003, -0.003):
        energy = pl.energy(sim) + share * pl.scale(sim)
        other = as_it_began(scene, mass=sim.mass, internal_energy=energy)
        assert pl.error(other) == pytest.approx(0.003)
    # motion counts as much as sound: 10 % of c0
    v = np.full((sim.n_fluid, 2), (1.0, 0.0))
    moving = planted(scene, v, mass=sim.mass, internal_energy=pl.energy(sim))
    assert pl.error(moving) == pytest.approx(0.005)


@pytest.mark.parametrize(("kernel", "bound"), [("wendland_c2", 2e-8), ("mueller", None)])
def test_a_drift_of_the_energy_is_judged_if_the_kernel_is_matched(kernel, bound):
    scene = perturbed_lattice(dx=1 / 12, kernel=kernel)
    sim = planted(scene, np.full((144, 2), (0.1, 0.0)))
    energy = 2.0 + 0.4 * np.repeat([0, 1, 2, 3], 5)
    seen = free_bodies.conserved(sim)
    run = Run(sim, np.arange(20.0), [seen | {"energy": one} for one in energy])
    found = measures(pl.REFERENCE, run)
    assert found["largest change of energy"].value == pytest.approx(1.2e-5)
    assert found["drift of energy"].value == pytest.approx(1.2e-5)
    assert found["drift of energy, against the start"].value == pytest.approx(0.6)
    assert found["drift of energy"].bound == bound
    # all of it moves to the right
    assert found["momentum"].value == pytest.approx(1.0)


def test_a_small_lattice_keeps_its_energy():
    run = pl.REFERENCE.run(Simulation(perturbed_lattice(dx=1 / 12), threads=1))
    found = measures(pl.REFERENCE, run)
    assert all(one.bound is None or one.value <= one.bound for one in found.values())
    kinetic, whole, conserved = pl.REFERENCE.chart(run).curves
    assert np.allclose(whole.y, conserved.y[0], atol=1e-5)
    assert (kinetic.y <= whole.y).all()


# --- The relaxation -------------------------------------------------------------------------


def test_the_error_of_the_blob_is_its_swelling():
    scene = relaxation(dx=0.05)
    assert rx.error(as_it_began(scene)) == 0.0
    x = np.asarray(scene.x)
    for share in (1.05, 0.95):
        swollen = planted(scene, np.zeros_like(x), x=share * x)
        assert rx.error(swollen) == pytest.approx(5.0)


@pytest.mark.parametrize("dx", [0.025, 0.031, 0.047, 0.07])
def test_the_blob_is_round_at_any_spacing(dx):
    x = np.asarray(relaxation(dx=dx, jitter=0.0).x)
    apart = np.hypot(*(x[:, None] + x[None]).T)
    assert apart.min(axis=0).max() < 1e-9
    assert len(x) * dx**2 == pytest.approx(math.pi * 0.25**2, rel=0.1)


def test_a_blob_that_does_not_settle_is_found_out():
    scene = relaxation(dx=0.05)
    v = 0.3 * np.asarray(scene.x)
    x = np.array(scene.x)
    x += (0.003, 0.004)
    sims = [
        planted(scene, v, median_spacing=1.0),
        planted(scene, 0.1 * v, x=x, median_spacing=1.07),
    ]
    found = measures(rx.REFERENCE, Run(sims[1], np.arange(2.0), [rx.observe(sim) for sim in sims]))
    assert found["kinetic energy"].value == pytest.approx(0.01)
    assert found["median spacing off dx"].value == pytest.approx(7.0)
    assert found["centre of mass"].value == pytest.approx(0.005)
    too_much = [name for name, one in found.items() if one.bound and one.value > one.bound]
    assert too_much == ["kinetic energy", "median spacing off dx", "centre of mass"]


def test_a_coarse_blob_settles_where_it_was():
    run = rx.REFERENCE.run(Simulation(relaxation(dx=0.05), threads=1))
    found = measures(rx.REFERENCE, run)
    assert all(one.bound is None or one.value <= one.bound for one in found.values())
    seen, start = rx.REFERENCE.chart(run).curves
    assert np.allclose(seen.y, start.y[0], rtol=0.05)


def test_more_rings_than_fit_are_refused():
    with pytest.raises(ValueError, match="larger dx"):
        free_bodies.rings(1.0, 1e-9)


# --- The drop that falls; more of it in test_dam_break.py ------------------------------------


def test_the_error_of_the_fall_is_the_distance_from_the_parabola():
    scene = drop_impact(dx=0.03)
    free, x = i.fall(scene), np.array(scene.x)
    still, time = np.zeros_like(x), 0.7 * free.until
    x[free.drop] -= (0.0, free.gravity / 2 * time**2)
    there = planted(scene, still, time, x)
    assert i.error(there) == pytest.approx(0.0, abs=1e-9)
    assert i.centre(there) == pytest.approx((free.start[0], free.height(time)))
    # 5 cm off: sideways too
    x[free.drop] += (0.03, 0.04)
    aside = planted(scene, still, time, x, energy_excess=0.0, density_error=0.0)
    assert i.error(aside) == pytest.approx(100 * 0.05 / free.gap)
    assert i.observe(aside)["height"] == pytest.approx(free.height(time) + 0.04)
    # where the pool is doesn't matter
    x[~free.drop] += (0.0, 0.01)
    assert i.error(planted(scene, still, time, x)) == pytest.approx(100 * 0.05 / free.gap)


def test_a_fine_drop_must_fall_freely():
    for dx, bound in ((0.02, None), (0.01, 0.1)):
        scene = drop_impact(dx=dx)
        sim = as_it_began(scene, energy_excess=0.0, density_error=0.0)
        found = measures(i.REFERENCE, Run(sim, np.zeros(1), [i.observe(sim)]))
        assert found["free fall"].value == pytest.approx(0.0, abs=1e-9)
        assert found["free fall"].bound == bound


def test_a_drop_in_the_pool_has_no_error_and_is_judged_by_its_fall():
    scene = drop_impact(dx=0.03)
    free, x = i.fall(scene), np.array(scene.x)
    still = np.zeros_like(x)
    first = as_it_began(scene, energy_excess=0.0, density_error=0.0)
    last = planted(
        scene, still, 1.01 * free.until, x, energy_excess=0.0, density_error=0.0
    )  # fmt: skip
    assert np.isnan(i.error(last))
    run = Run(
        last, np.array([0.0, last.time]), [i.observe(first) | {"error": 7.0}, i.observe(last)]
    )
    assert measures(i.REFERENCE, run)["free fall"].value == 7.0
