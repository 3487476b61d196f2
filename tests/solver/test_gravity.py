"""Gravity fields as what they are meant to be, apart from their formulas."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sph_gym import CentralGravity, Effects, Gravity, RecordedGravity, RollingTank, ShakenGravity
from tests import naive

pytestmark = pytest.mark.without_jit

RECORD = [(0.0, -9.0), (3.0, -7.0), (-1.0, -10.0)]
FIELDS = {
    "uniform": Gravity(1.5, -9.81),
    "ramp": Gravity(1.5, -9.81, ramp=0.05),
    "central": CentralGravity(3.0, 0.2, -0.1),
    "shaken": ShakenGravity(1.0, -9.81, (5.0, 3.0), 2.5),
    "recorded": RecordedGravity(RECORD, 0.02),
    "rolling": RollingTank(9.81, 0.3, 1.5, (0.1, -0.05)),
}
fields = pytest.mark.parametrize("field", FIELDS.values(), ids=FIELDS)
X = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2))
V = np.random.default_rng(1).normal(0.0, 2.0, (20, 2))
TIMES = (0.0, 0.013, 0.02, 0.031, 0.04, 0.05, 0.3, 7.7)


@fields
@pytest.mark.parametrize("time", TIMES)
def test_formula(field, time):
    assert field.on(time, X, V) == pytest.approx(naive.gravity(field, time, X, V), rel=1e-12)


@fields
def test_what_is_everywhere_the_same(field):
    for time in TIMES:
        still = np.zeros((1, 2))
        everywhere = field.on(time, still, still)[0]
        if isinstance(field, CentralGravity):
            everywhere = np.zeros(2)
        if isinstance(field, RollingTank):
            # without what depends on the place, which is what the rest of it does at the pivot
            everywhere = field.on(time, np.array([field.pivot]), still)[0]
        assert field.at(time) == pytest.approx(everywhere, rel=1e-12, abs=1e-12)
        assert Effects(gravity=field).gravity_at(time) == pytest.approx(field.at(time))


@fields
def test_what_lasts_is_the_mean_over_a_long_time(field):
    # whole periods of what oscillates, and all of the record; a rolling tank's is that at rest
    times = {"recorded": np.linspace(0.0, 0.04, 2001)}.get(
        _name(field), 40.0 + np.arange(2e3) / 1e3
    )
    mean = np.mean([field.at(time) for time in times], axis=0)
    assert field.lasting() == pytest.approx(naive.mean_gravity(field))
    loose = {"rolling": 0.3, "recorded": 0.7}.get(_name(field), 1e-9)
    assert field.lasting() == pytest.approx(mean, abs=loose)


def _name(field):
    return next(name for name, one in FIELDS.items() if one is field)


@fields
def test_nothing_is_stronger_than_the_strongest(field):
    most = field.strongest(np.abs(X).max() * math.sqrt(2))
    sizes = [np.hypot(*field.on(t, X, 0 * V).T).max() for t in np.linspace(0.0, 2.0, 300)]
    assert 0.3 * most < max(sizes) <= most * (1 + 1e-12)


def test_a_particle_in_a_rolling_tank_flies_the_parabola_that_the_ground_sees():
    tank = RollingTank(9.81, 0.4, 0.7, (0.3, -0.2))
    pivot, omega = np.array(tank.pivot), 2 * np.pi * tank.frequency

    def turned(angle):
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def rates(time, state):
        x, v = state[None, :2], state[None, 2:]
        return np.concatenate([v[0], tank.on(time, x, v)[0]])

    # seen from the ground: x + v t - g t^2 / 2 from the pivot, the tank's angle being 0 at first
    start, speed = np.array([0.5, 0.4]), np.array([1.0, 2.0])
    spin = tank.amplitude * omega
    seen = speed - spin * np.array([-(start - pivot)[1], (start - pivot)[0]])
    end = 0.9
    flight = solve_ivp(rates, (0.0, end), [*start, *seen], rtol=1e-11, atol=1e-12)
    ground = start - pivot + speed * end - np.array([0.0, 9.81]) * end**2 / 2
    angle = tank.amplitude * math.sin(omega * end)
    assert flight.y[:2, -1] == pytest.approx(pivot + turned(-angle) @ ground, abs=1e-8)


def test_a_record_is_a_copy_that_cannot_be_changed():
    vectors = np.array(RECORD)
    field = RecordedGravity(vectors, 0.1)
    vectors[:] = 0.0
    assert field.at(0.0) == pytest.approx(RECORD[0])
    with pytest.raises(ValueError, match="read-only"):
        field.vectors[0] = 1.0


def test_records_in_any_order_of_memory_are_compiled_alike():
    tables = [
        RecordedGravity(np.asfortranarray(RECORD), 0.1).compiled().table,
        RecordedGravity(RECORD, 0.1).compiled().table,
    ]
    assert all(table.flags.c_contiguous and table.flags.writeable for table in tables)
    assert (tables[0] == tables[1]).all()
