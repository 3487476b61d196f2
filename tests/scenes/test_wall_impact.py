"""The impact of a dam break on the far wall: what was measured, and a coarse run."""

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.scenes.shared.reference import read
from sph_gym.scenes.wall_impact import (
    REFERENCE,
    TABLE,
    error,
    landmarks,
    sensor,
    wall_impact,
)


@pytest.mark.parametrize("name", ["dx", "width", "height", "length", "gravity"])
@pytest.mark.parametrize("value", [0.0, np.nan, "long"])
def test_wrong_arguments_are_named(name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        wall_impact(**{name: value})


def test_the_experiment_has_a_peak_and_a_plateau():
    arrival, peak, plateau = landmarks(*read(TABLE).T)
    assert arrival == pytest.approx(2.56, abs=0.01)
    assert peak == pytest.approx(0.687)
    assert plateau == pytest.approx(0.545, abs=0.002)


def test_the_sensor_is_on_the_far_wall():
    face, low = sensor(wall_impact())
    assert np.allclose(face.at, [3.225, 0.115, 3.225, 0.205])
    assert np.allclose(low.at, [3.225, 0.115])


def test_a_coarse_wave_arrives_in_time_and_piles_up():
    sim = Simulation(wall_impact(dx=0.03))
    assert np.isnan(error(sim))
    run = REFERENCE.run(sim)
    found = {measure.quantity: measure.value for measure in REFERENCE.judge(run)}
    assert found["arrival of the wave there"] < 15
    assert found["plateau at the lower end of the sensor"] < 50
    assert found["spurious energy"] < 0.01
    assert [curve.reference for curve in REFERENCE.chart(run).curves] == [False, False, True]
    # the water pushes against the wall, and weighs on the floor
    assert sim.force_on("right")[0] > 0 > sim.force_on("bottom")[1]
