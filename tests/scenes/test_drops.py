"""Drops in empty space: ellipses against what they come from, surface tension, coarse runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Effects, Fluid, Scene, Simulation, Walls, disc, lattice
from sph_gym.scenes import droplet as d
from sph_gym.scenes import elliptical_drop as e
from sph_gym.scenes import oscillating_drop as o
from sph_gym.scenes.droplet import droplet
from sph_gym.scenes.elliptical_drop import elliptical_drop
from sph_gym.scenes.oscillating_drop import oscillating_drop
from sph_gym.scenes.shared.free_bodies import ellipse, semi_axes
from sph_gym.scenes.shared.reference import Run, read
from tests.scenes.planted import planted


def measures(reference, run):
    return {measure.quantity: measure for measure in reference.judge(run)}


def with_axes(scene, a, b):
    """A simulation whose particles fill the ellipse with these second moments."""
    x = np.asarray(scene.x)
    return planted(scene, np.asarray(scene.v), x=x * np.array([a, b]) / semi_axes(x))


@pytest.mark.parametrize(
    ("build", "name", "value"),
    [
        (elliptical_drop, "radius", 0.05),
        (oscillating_drop, "radius", 0.05),
        (oscillating_drop, "rate", 2.1),
        (droplet, "side", 0.15),
        (droplet, "shape", "star"),
        (droplet, "ohnesorge", -0.1),
    ],
)
def test_wrong_arguments_are_named(build, name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        build(**{name: value})


# --- The ellipse ----------------------------------------------------------------------------


@pytest.mark.parametrize(("rate", "omega"), [(-100.0, 0.0), (0.5, 1.0), (-2.0, 1.0)])
def test_an_ellipse_keeps_its_area_and_energy(rate, omega):
    times = np.linspace(0.0, 2 / abs(rate), 9)
    a, b, strain = ellipse(times, rate, omega).T
    assert np.allclose(a * b, 1.0, rtol=1e-9)
    # motion and spring: the mean of x^2 is a^2 / 4
    energy = (strain**2 + omega**2) * (a**2 + b**2)
    assert np.allclose(energy, energy[0], rtol=1e-9)


def test_one_pressure_pushes_an_ellipse_along_both_axes():
    # p = p0 (1 - x^2 / a^2 - y^2 / b^2): a'' + omega^2 a goes with 1 / a, b'' with 1 / b
    omega, step = 1.3, 1e-3
    for middle in (0.5, 1.0, 2.0):
        times = middle + step * np.array([-1.0, 0.0, 1.0])
        axes = ellipse(times, 0.7, omega)[:, :2]
        curvature = (axes[0] - 2 * axes[1] + axes[2]) / step**2
        along_x, along_y = (curvature + omega**2 * axes[1]) * axes[1]
        assert along_x == pytest.approx(along_y, rel=1e-5)
        assert along_x > 0


# --- The elliptical drop --------------------------------------------------------------------


def test_the_stretched_axis_is_as_tabulated():
    scene = elliptical_drop()
    times, major = read("elliptical_drop.csv").T
    assert e.start(scene) == pytest.approx((1.0, 100.0))
    assert np.allclose([e.major_axis(scene, t) for t in times], major, atol=1e-6)
    # a drop of half the size at a fifth of the rate is similar
    small = elliptical_drop(dx=0.05, radius=0.5, rate=20.0)
    assert e.major_axis(small, 5 * times[2]) == pytest.approx(major[2] / 2, abs=1e-6)


def test_the_error_of_the_tip_is_that_of_the_state():
    scene = elliptical_drop(dx=0.05)
    x, time = np.asarray(scene.x), 0.0057
    exact = read("elliptical_drop.csv")[3, 1]
    stretch = (exact - 0.025) / x[:, 1].max()
    there = planted(scene, np.asarray(scene.v), time, x * (1 / stretch, stretch))
    assert e.tip(there) == pytest.approx(exact)
    assert e.error(there) < 1e-4
    farther = (1.03 * exact - 0.025) / x[:, 1].max()
    too_far = planted(scene, np.asarray(scene.v), time, x * (1 / farther, farther))
    assert e.error(too_far) == pytest.approx(3.0, abs=1e-3)
    # it stays as it began
    still = planted(scene, np.asarray(scene.v), time)
    assert e.error(still) == pytest.approx(100 * (1 - 1 / exact), abs=0.1)


def test_the_elliptical_drop_is_judged_at_its_end():
    scene = elliptical_drop(dx=0.05)
    radius, _ = e.start(scene)
    exact = e.major_axis(scene, scene.duration)
    first, last = with_axes(scene, radius, radius), with_axes(scene, 1 / exact, 0.96 * exact)
    last.time, last.v = scene.duration, 0.9 * last.v
    run = Run(last, np.array([0.0, last.time]), [e.observe(first), e.observe(last)])
    # less motion, which turns up nowhere else
    run.seen[1]["kinetic"] = run.seen[1]["energy"] = 0.81 * run.seen[0]["kinetic"]
    found = measures(e.REFERENCE, run)
    assert found["the same by second moments"].value == pytest.approx(4.0)
    assert found["error of the major semi-axis"].value == pytest.approx(e.error(last))
    assert found["change of kinetic energy"].value == pytest.approx(19.0)
    assert found["change of kinetic energy"].bound == 3.0
    assert found["change of the whole energy"].value == pytest.approx(19.0)
    assert found["error of the major semi-axis"].bound is None


def test_forty_particles_along_the_radius_are_enough_for_a_bound():
    for dx, bound in ((1 / 40, 0.5), (1 / 39, None)):
        scene = elliptical_drop(dx=dx)
        sim = planted(scene, np.asarray(scene.v))
        found = measures(e.REFERENCE, Run(sim, np.zeros(1), [e.observe(sim)]))
        assert found["error of the major semi-axis"].bound == bound


def test_a_coarse_drop_is_stretched_as_it_should():
    run = e.REFERENCE.run(Simulation(elliptical_drop(dx=1 / 20), threads=1))
    found = measures(e.REFERENCE, run)
    assert found["error of the major semi-axis"].value < 2.0
    assert found["the same by second moments"].value < 0.5
    assert found["change of kinetic energy"].value < 1.0
    assert found["change of the whole energy"].value < 0.1
    assert found["change of momentum"].value < 1e-12
    assert found["change of angular momentum"].value < 1e-12
    tip, moments, exact = e.REFERENCE.chart(run).curves
    assert np.allclose(tip.y, exact.y, rtol=0.02)
    assert np.allclose(moments.y, exact.y, rtol=0.01)


# --- The oscillating drop -------------------------------------------------------------------


def test_the_semi_axes_and_the_period_are_as_tabulated():
    scene = oscillating_drop()
    eighths, state = read("oscillating_drop.csv").T
    period = o.period(0.5, 1.0)
    assert period == pytest.approx(4.567375, abs=3e-6)
    assert o.start(scene) == pytest.approx((1.0, 0.5, 1.0))
    assert np.allclose(o.axis(scene, eighths * period / 8), state, atol=2e-6)
    assert scene.duration == pytest.approx(5 * period)
    assert scene.frame == pytest.approx(period / 40)


def test_a_weak_drop_swings_harmonically():
    omega, rate = 3.0, 1e-4
    period = o.period(rate, omega)
    assert period == pytest.approx(math.sqrt(2) * math.pi / omega, rel=1e-6)
    times = np.linspace(0.0, period, 17)
    swing = np.log(ellipse(times, rate, omega)[:, 0])
    assert np.allclose(swing, rate * period / (2 * np.pi) * np.sin(2 * np.pi * times / period))
    # stronger ones take longer, up to the strongest that is allowed
    slower = [o.period(share * omega, omega) for share in (0.01, 0.5, 1.0, 2.0)]
    assert np.all(np.diff(slower) > 0)
    assert np.isfinite(oscillating_drop(omega=omega, rate=2 * omega).duration)


def test_the_error_of_the_axis_is_that_of_the_state():
    scene = oscillating_drop(dx=0.05)
    radius, _, _ = o.start(scene)
    quarter = o.period(0.5, 1.0) / 4
    exact = math.sqrt(2) * radius
    there = with_axes(scene, exact, 1 / exact)
    there.time = quarter
    assert o.error(there) == pytest.approx(0.0, abs=1e-3)
    assert o.observe(there)["a"] == pytest.approx(exact)
    assert o.observe(there)["b"] == pytest.approx(1 / exact)
    flat = with_axes(scene, exact - 0.05 * radius, 1 / exact)
    flat.time = quarter
    assert o.error(flat) == pytest.approx(5.0, abs=1e-3)


def oscillation(scene, slower=1.0, share=1.0):
    """A run as exact as can be, but for a period and an amplitude that are off."""
    sim = planted(scene, np.asarray(scene.v))
    times = np.arange(0.0, scene.duration, scene.frame)
    a = 1 + share * (o.axis(scene, times / slower) - 1)
    rest = o.observe(sim)
    return Run(sim, times, [rest | {"a": one, "b": 1 / one} for one in a])


def test_a_drop_that_is_late_or_tired_is_found_out():
    scene = oscillating_drop(dx=0.1, periods=1.5)
    # every other frame will do
    scene = replace(scene, frame=2 * scene.frame)
    exact = oscillation(scene)
    found = measures(o.REFERENCE, exact)
    assert found["RMS error of the semi-axis"].value == pytest.approx(0.0, abs=1e-9)
    assert found["error of the period"].value < 0.05
    assert found["amplitude lost by the last period"].value == pytest.approx(0.0, abs=1e-9)
    late = measures(o.REFERENCE, oscillation(scene, slower=1.02))
    assert late["error of the period"].value == pytest.approx(2.0, abs=0.05)
    assert late["error of the period"].bound == 1.0
    tired = measures(o.REFERENCE, oscillation(scene, share=0.9))
    assert tired["amplitude lost by the last period"].value == pytest.approx(10.0)
    swing = exact.series("a") - 1
    rms = 100 * 0.1 * math.sqrt((swing**2).mean())
    assert tired["RMS error of the semi-axis"].value == pytest.approx(rms)


def test_the_amplitude_is_that_of_the_whole_last_period():
    scene = oscillating_drop(dx=0.1, periods=1.5)
    scene = replace(scene, frame=2 * scene.frame)
    beats = np.arange(0.0, scene.duration, scene.frame) / o.period(0.5, 1.0)
    # neither what was before nor the end, in which it passes no peak
    share = np.select([beats < 0.48, beats < 1.4], [0.5, 0.8], 1.0)
    found = measures(o.REFERENCE, oscillation(scene, share=share))
    assert found["amplitude lost by the last period"].value == pytest.approx(20.0)


def test_a_period_needs_two_round_moments():
    times = np.linspace(0.0, 1.0, 50)
    swing = np.exp(np.sin(5.0 * times))
    assert np.isnan(o.observed_period(times, swing, 1 / swing))
    times = np.linspace(0.0, 3.0, 150)
    swing = np.exp(np.sin(5.0 * times))
    assert o.observed_period(times, swing, 1 / swing) == pytest.approx(2 * np.pi / 5, rel=1e-3)


def test_a_coarse_drop_oscillates_as_it_should():
    scene = oscillating_drop(dx=1 / 14, periods=1.5)
    run = o.REFERENCE.run(Simulation(scene, threads=1))
    found = measures(o.REFERENCE, run)
    assert found["RMS error of the semi-axis"].value < 2.0
    assert found["error of the period"].value < 0.5
    assert found["change of the whole energy"].value < 1.0
    assert found["change of momentum"].bound is None
    assert found["change of angular momentum"].value < 1e-12
    seen, exact = o.REFERENCE.chart(run).curves
    assert np.allclose(seen.y, exact.y, atol=0.06)


# --- The droplet ----------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1.0, 0.4])
def test_a_droplet_is_pressed_by_what_its_edge_costs(side):
    scene = droplet(dx=0.02, side=side, sigma=500.0)
    radius = d.radius_of(scene)
    assert radius == pytest.approx(side / math.sqrt(math.pi))
    # swelling by dR costs sigma 2 pi dR, and p 2 pi R dR pays for it
    assert d.jump(scene) * 2 * math.pi * radius == pytest.approx(500.0 * 2 * math.pi)


def test_a_droplet_rings_as_stiff_as_its_edge_and_as_heavy_as_its_flow():
    scene = droplet(shape="ellipse", sigma=700.0)
    radius, s = d.radius_of(scene), 1e-2
    # axes R exp(s) and R exp(-s): the flow is linear, its energy rho pi R^4 / 4 (ds/dt)^2
    angle = (np.arange(4000) + 0.5) * math.pi / 2000
    slopes = np.hypot(math.exp(s) * np.sin(angle), math.exp(-s) * np.cos(angle))
    edge = 2 * math.pi * radius * (slopes.mean() - 1)
    stiffness = 700.0 * 2 * edge / s**2
    inertia = 1000.0 * math.pi * radius**4 / 2
    assert d.frequency(scene) == pytest.approx(math.sqrt(stiffness / inertia), rel=1e-4)


def test_a_square_is_told_from_an_ellipse():
    square, flat = droplet(dx=0.04), droplet(dx=0.04, shape="ellipse")
    assert d.is_square(square)
    assert not d.is_square(flat)
    a, b = semi_axes(np.asarray(flat.x))
    assert a / b == pytest.approx(1.21, rel=0.01)
    assert d.radius_of(flat) == pytest.approx(d.radius_of(square), rel=0.05)


@pytest.mark.parametrize(("omega", "decay"), [(4.3, 0.2), (5.0, 0.0), (6.0, 1.5)])
def test_a_damped_wave_is_read_off(omega, decay):
    times = np.linspace(0.0, 4.0, 120)
    wave = 0.02 + 0.2 * np.exp(-decay * times) * np.cos(omega * times + 0.3)
    found = d.damped(times, wave, 5.0)
    assert found == pytest.approx((omega, decay), abs=0.01)


def test_the_roughness_is_the_range_of_the_radius():
    scene = droplet(dx=0.04)
    radius = d.radius_of(scene)
    # two points in each of 24 sectors
    angle = (np.arange(48) + 0.5) * math.pi / 24
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    still = np.zeros_like(circle)
    assert d.roughness(planted(scene, still, x=circle + 3.0)) == pytest.approx(0.0, abs=1e-12)
    squeezed = circle * (1 + 0.1 * np.cos(8 * angle))[:, None]
    largest, smallest = (1 + 0.1 * math.cos(8 * k * math.pi / 48) for k in (1, 5))
    found = d.roughness(planted(scene, still, x=squeezed))
    assert found == pytest.approx(largest - smallest)


def test_the_error_of_the_pressure_is_that_of_the_state():
    scene = droplet(dx=0.05)
    still, inside = np.zeros_like(np.asarray(scene.x)), np.full(len(scene.x), d.jump(scene))
    assert d.error(planted(scene, still, p=inside)) == pytest.approx(0.0, abs=1e-9)
    assert d.error(planted(scene, still, p=0.93 * inside)) == pytest.approx(7.0)
    seen = d.observe(planted(scene, still, p=0.93 * inside))
    assert seen["pressure"] == pytest.approx(0.93 * d.jump(scene))
    assert seen["swing"] == pytest.approx(0.0, abs=1e-9)
    away = np.asarray(scene.x) * 50.0
    assert np.isnan(d.inner_pressure(planted(scene, still, x=away, p=inside)))


def test_a_droplet_at_rest_is_judged_late():
    scene = droplet(dx=0.04)
    v = np.asarray(scene.x) * (1.0, -1.0)
    sim = planted(scene, v, p=np.full(len(v), d.jump(scene)))
    times = np.linspace(0.0, scene.duration, 101)
    seen = [
        d.observe(sim)
        | {
            "pressure": d.jump(scene) * (1.04 if after else 3.0),
            "roughness": 0.02 if after else 0.5,
            "kinetic": 0.003 if after else 2.0,
        }
        for after in times > 0.55 * scene.duration
    ]
    found = measures(d.REFERENCE, Run(sim, times, seen))
    assert found["error of the pressure jump"].value == pytest.approx(4.0)
    assert found["its scatter in time"].value == pytest.approx(0.0, abs=1e-9)
    assert found["roughness"].value == pytest.approx(2.0)
    assert found["kinetic energy at rest"].value == pytest.approx(0.0015)
    simulated, expected = d.REFERENCE.chart(Run(sim, times, seen)).curves
    assert simulated.y[-1] == pytest.approx(1.04 * expected.y[-1])


def test_a_ringing_droplet_is_judged_without_its_decay():
    scene = droplet(dx=0.04, shape="ellipse")
    sim = planted(scene, np.asarray(scene.x), p=np.zeros(len(scene.x)))
    times, natural = np.linspace(0.0, scene.duration, 141), d.frequency(scene)
    decay = 0.2 * natural
    for off in (1.0, 1.1):
        omega = math.sqrt((off * natural) ** 2 - decay**2)
        swing = 0.19 * np.exp(-decay * times) * np.cos(omega * times)
        run = Run(sim, times, [d.observe(sim) | {"swing": one} for one in swing])
        found = measures(d.REFERENCE, run)
        assert found["error of the frequency"].value == pytest.approx(100 * (off - 1), abs=0.2)
        assert found["decay"].value == pytest.approx(0.2, abs=0.005)
        seen, exact = d.REFERENCE.chart(run).curves
        assert np.allclose(seen.y, exact.y, atol=1e-3 if off == 1.0 else 0.1)


def test_a_drop_of_water_rings_and_does_not_boil():
    """A radius of 1 mm and an Ohnesorge number of 0.004: hardly any viscosity of its own."""
    rho0, radius, sigma, n = 1000.0, 1e-3, 0.0728, 12
    dx, period = radius / n, 2 * math.pi * math.sqrt(rho0 * radius**3 / (6 * sigma))
    h = 3.3 * dx
    scene = replace(
        droplet(shape="ellipse"),
        x=disc(0.0, 0.0, radius, dx),
        v=0.2 * math.pi / period * disc(0.0, 0.0, radius, dx) * (1, -1),
        dx=dx,
        h=h,
        fluid=Fluid(c0=11 * math.sqrt(sigma / (rho0 * h)), rho0=rho0, kernel="quintic_spline"),
        effects=Effects(surface_tension=sigma, laminar_viscosity=1e-6),
    )
    sim = Simulation(scene, threads=1)
    times, swings, farthest, excess = [], [], 0.0, 0.0
    for _ in range(5 * 40):
        assert not sim.advance(period / 40).diverged
        a, b = semi_axes(sim.x)
        times.append(sim.time / period)
        swings.append(a - b)
        farthest = max(farthest, float(np.hypot(*sim.x.T).max()) / radius)
        excess = max(excess, sim.energy_surplus / sim.energy_at_stake)
    ends = [
        t for t, before, after in zip(times[1:], swings, swings[1:], strict=False)
        if before > 0 >= after
    ]  # fmt: skip
    assert len(ends) == 5
    assert (ends[-1] - ends[0]) / 4 == pytest.approx(1.0, abs=0.05)
    assert farthest < 1.3
    assert excess < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("ohnesorge", [0.13, 0.004])
def test_a_drop_on_a_plate_comes_to_rest(ohnesorge):
    """But for short bursts in which the lattice that it began with falls in."""
    rho0, radius, sigma, n = 1000.0, 1e-3, 0.0728, 12
    dx, time = radius / n, math.sqrt(rho0 * radius**3 / sigma)
    x = disc(0.0, 0.0, radius, dx)
    scene = Scene(
        "sessile drop",
        x - (0.0, x[:, 1].min() - dx / 2),
        dx,
        3 * dx,
        Fluid(c0=11 * math.sqrt(sigma / (rho0 * 3 * dx))),
        effects=Effects(
            gravity=(0.0, -9.81),
            surface_tension=sigma,
            laminar_viscosity=ohnesorge * math.sqrt(sigma * radius / rho0),
        ),
        walls=Walls(particles=lattice(-4 * radius, 4 * radius, -4 * dx, 0.0, dx)),
    )
    sim = Simulation(scene, threads=1)
    energies = []
    for _ in range(60):
        assert not sim.advance(time / 3).diverged
        energies.append(sim.diagnostics()["kinetic_energy"] / sim.energy_at_stake)
        assert sim.energy_surplus < 0.02 * sim.energy_at_stake
    assert np.median(energies[30:]) < 2e-3
    fluid = sim.x[: sim.n_fluid]
    assert np.ptp(fluid[:, 0]) < 2.3 * radius
    assert fluid[:, 1].max() < 2.1 * radius
