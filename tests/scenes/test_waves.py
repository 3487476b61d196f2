"""Standing waves and sloshing: linear theory against what it comes from, and coarse runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes.shared import waves
from sph_gym.scenes.shared.shallow import depths
from sph_gym.scenes.sloshing import REFERENCE as SLOSHING
from sph_gym.scenes.sloshing import error as sloshing_error
from sph_gym.scenes.sloshing import sloshing, theory
from sph_gym.scenes.standing_wave import REFERENCE as STANDING
from sph_gym.scenes.standing_wave import elevation, exact, omega, standing_wave
from sph_gym.scenes.standing_wave import error as standing_error
from sph_gym.solver.gravity import RollingTank

ROLLING = waves.Rolling(length=0.9, depth=0.2, gravity=9.81, roll=0.02, drive=2.0)


@pytest.mark.parametrize(
    ("build", "name", "value"),
    [
        (standing_wave, "dx", 0.0),
        (standing_wave, "length", 0.05),
        (standing_wave, "depth", np.nan),
        (standing_wave, "amplitude", 0.0),
        (standing_wave, "amplitude", 0.2),
        (standing_wave, "periods", 1.5),
        (standing_wave, "gravity", -9.81),
        (sloshing, "dx", -1.0),
        (sloshing, "length", 0.01),
        (sloshing, "height", 0.05),
        (sloshing, "fill", 0.0),
        (sloshing, "degrees", 60.0),
        (sloshing, "period_ratio", 0.0),
        (sloshing, "periods", 0.0),
        (sloshing, "gravity", 0.0),
    ],
)
def test_wrong_arguments_are_named(build, name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        build(**{name: value})


# --- Linear theory --------------------------------------------------------------------------


def test_frequencies_of_deep_and_of_shallow_water():
    deep = waves.frequency(1, 1.0, 10.0, 9.81)
    assert np.isclose(deep, math.sqrt(9.81 * math.pi))
    shallow = waves.frequency(1, 1.0, 1e-3, 9.81)
    assert np.isclose(shallow, math.pi * math.sqrt(9.81 * 1e-3), rtol=1e-4)


def test_an_elevation_shifts_the_centre_of_mass():
    x = (np.arange(2000) + 0.5) / 2000 * 0.9
    for mode in (1, 3):
        elevation = 0.01 * np.cos(mode * math.pi * x / 0.9)
        moved = ((x - 0.45) * elevation).mean() / 0.2
        assert np.isclose(0.01 * waves.shift(mode, 0.9, 0.2), moved, rtol=1e-5)


def test_a_decaying_wave_is_read_off():
    times = np.linspace(0, 10, 400)
    found, rate = waves.ring(times, np.exp(-0.1 * times) * np.cos(3.0 * times))
    assert np.isclose(found, 3.0, rtol=1e-3)
    assert np.isclose(rate, 0.1, rtol=0.02)
    assert np.isnan(waves.ring(times, 1 + times)[0])


@pytest.mark.parametrize("mode", [1, 3])
def test_what_drives_a_mode_is_the_flux_through_the_walls(mode):
    # Green's identity with cos(k x) cosh(k y), its integrals by quadrature
    length, depth = ROLLING.length, ROLLING.depth
    k, n = mode * math.pi / length, 4000
    x, y = (np.arange(n) + 0.5) / n * length, (np.arange(n) + 0.5) / n * depth
    shape, deep = np.cosh(k * y) / np.cosh(k * depth), 1 / np.cosh(k * depth)
    arm = x - length / 2
    floor = -(arm * np.cos(k * x)).mean() * length * deep
    right, left = (-y * math.cos(mode * math.pi) * shape), (y * shape)
    surface = (arm * np.cos(k * x)).mean() * length
    turning = floor + (right + left).mean() * depth + surface
    at_rest = -(arm * np.cos(k * x)).mean() * length
    frequency, force = ROLLING.mode(mode)
    expected = 2 / length * ROLLING.roll * (frequency**2 * at_rest + turning * ROLLING.drive**2)
    assert np.isclose(force, expected, rtol=1e-5)


def test_a_slow_roll_leaves_the_surface_horizontal():
    slow = ROLLING._replace(drive=1e-3)
    assert np.isclose(slow.response(), -0.02 * 0.9**2 / (12 * 0.2), rtol=1e-3)
    assert np.isclose(slow.shift(0.5 * math.pi / 1e-3), slow.response(), rtol=2e-3)


def test_water_starts_at_rest_and_resonance_is_a_limit():
    times = np.linspace(0.0, 3.0, 3001)
    shift = ROLLING.shift(times)
    assert shift[0] == 0
    assert abs(shift[1]) < 1e-8
    tuned = ROLLING._replace(drive=ROLLING.mode(1)[0])
    beside = tuned._replace(drive=tuned.drive * (1 + 1e-5))
    assert np.allclose(tuned.shift(times), beside.shift(times), rtol=1e-3, atol=1e-5)


def test_response_and_frequency_are_found_again():
    times = np.linspace(0.0, 12.0, 200)
    response, found = ROLLING.fit(times, ROLLING.shift(times))
    assert np.isclose(response, ROLLING.response(), rtol=0.01)
    assert np.isclose(found, ROLLING.mode(1)[0], rtol=2e-3)


# --- Standing wave --------------------------------------------------------------------------


def test_the_wave_starts_as_linear_theory_has_it():
    sim = Simulation(standing_wave(), threads=1)
    assert np.isclose(elevation(sim), 0.025, rtol=1e-3)
    assert np.isclose(exact(sim.scene, 0.0), elevation(sim))
    assert standing_error(sim) < 1e-9


def test_the_wave_starts_compressed_as_its_weight_wants_it():
    sim = Simulation(standing_wave(amplitude=1e-6), threads=1)
    x, y = sim.x[: sim.n_fluid].T
    # away from the surface, and from walls whose lattice is not squeezed
    inner = (y > 0.1) & (y < 0.4) & (x > 0.1) & (x < 0.9)
    squeezed = 9.81 * (0.5 - y[inner]) / sim.scene.fluid.c0**2
    assert np.allclose(sim.rho[: sim.n_fluid][inner] / 1000 - 1, squeezed, rtol=0.02)


def test_the_error_sees_a_wave_out_of_phase():
    sim = Simulation(standing_wave(dx=0.05), threads=1)
    sim.time = math.pi / omega(sim.scene)
    assert np.isclose(standing_error(sim), 200.0)


def test_a_coarse_wave_goes_to_and_fro_in_time():
    run = STANDING.run(Simulation(standing_wave(dx=0.05, amplitude=0.05, periods=3), threads=1))
    frequency, _, level, energy = STANDING.judge(run)
    assert level.value <= 15.0
    assert frequency.value < 5.0
    assert frequency.bound is None
    assert energy.value <= energy.bound
    assert len(STANDING.chart(run).curves) == 2


# --- Rolling --------------------------------------------------------------------------------


def lab(tank, time, x):
    """Positions in the tank, as seen from the room; x: (2,)."""
    angle = tank.amplitude * math.sin(2 * math.pi * tank.frequency * time)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return turn @ (np.asarray(x) - tank.pivot)


def flight(tank, start, velocity, time):
    """Where a free body that began in the tank at `start` is at `time`, seen from the room."""
    rate = tank.amplitude * 2 * math.pi * tank.frequency
    arm = np.subtract(start, tank.pivot)
    begun = np.add(velocity, rate * np.array([-arm[1], arm[0]]))
    return arm + begun * time - np.array([0.0, tank.g / 2 * time**2])


def test_a_free_body_flies_along_a_parabola():
    tank = RollingTank(9.81, 0.7, 0.9, pivot=(0.2, -0.1))
    x, v, dt = np.array([[0.5, 0.3]]), np.array([[1.0, 2.0]]), 1e-3

    def rates(time, x, v):
        return v, tank.on(time, x, v)

    for step in range(800):
        t = step * dt
        a = rates(t, x, v)
        b = rates(t + dt / 2, x + dt / 2 * a[0], v + dt / 2 * a[1])
        c = rates(t + dt / 2, x + dt / 2 * b[0], v + dt / 2 * b[1])
        d = rates(t + dt, x + dt * c[0], v + dt * c[1])
        x = x + dt / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        v = v + dt / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    expected = flight(tank, (0.5, 0.3), (1.0, 2.0), 0.8)
    assert np.allclose(lab(tank, 0.8, x[0]), expected, atol=1e-9)


def test_a_lonely_particle_flies_through_the_tank():
    scene = sloshing(dx=0.0155, degrees=20.0)
    start, velocity = [0.6, 0.2], [-1.0, 1.5]
    alone = replace(scene, x=[start], v=[velocity], duration=0.25)
    sim = Simulation(alone, threads=1)
    sim.controls = sim.controls._replace(dt=1e-5)
    sim.advance(0.25)
    tank = scene.effects.field
    expected = flight(tank, start, velocity, 0.25)
    assert np.allclose(lab(tank, 0.25, sim.x[0]), expected, atol=2e-4)


def test_slowly_tilted_water_stays_horizontal():
    scene = sloshing(dx=0.0155, degrees=3.0, period_ratio=12.0)
    sim = Simulation(scene, threads=1)
    sim.advance(scene.duration / 16)
    x, depth = depths(sim)
    slope = np.polyfit(x[1:-1], depth[1:-1], 1)[0]
    assert np.isclose(slope, -math.tan(math.radians(3.0)), rtol=0.2)
    assert sloshing_error(sim) < 15.0


def test_a_small_roll_is_followed_as_linear_theory_has_it():
    scene = sloshing(dx=0.0155, degrees=1.0, period_ratio=2.0, periods=1.5)
    run = SLOSHING.run(Simulation(scene, threads=1))
    response, frequency, *_, outside = SLOSHING.judge(run)
    assert response.value < 10.0
    assert frequency.value < 6.0
    assert outside.value == outside.bound == 0.0
    assert len(SLOSHING.chart(run).curves) == 2
    assert theory(scene).drive < theory(scene).mode(1)[0]


def test_a_violent_roll_has_no_linear_theory():
    scene = sloshing(dx=0.0155, periods=1.0)
    run = SLOSHING.run(Simulation(scene, threads=1))
    density, energy, outside = SLOSHING.judge(run)
    assert outside.value == 0.0
    assert energy.value < energy.bound
    assert density.value < density.bound
    assert len(SLOSHING.chart(run).curves) == 1
