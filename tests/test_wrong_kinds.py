"""An argument of a wrong kind is named where it is given, not deep inside."""

import numpy as np
import pytest

from sph_gym import Effects, Fluid, Gauge, Scene, Simulation, advance_all, scenes
from sph_gym.doctor.recordings import check_recording
from sph_gym.env import instances
from sph_gym.recommend import parse_budget, parse_error
from sph_gym.solver.checks import countable, finite_array, number, positive
from sph_gym.trajectory import Recorder, read
from sph_gym.view import Painter


@pytest.fixture(scope="module")
def sim():
    return Simulation(scenes.make("relaxation", dx=0.1))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: advance_all(3, 0.1), "simulations: expected Simulation objects, got 3"),
        (lambda: Gauge("pressure", (0, 0)).read(3), "sim: expected a Simulation, got 3"),
        (lambda: Recorder("x.npz", 3), "sim: expected a Simulation, got 3"),
        (lambda: Simulation(3), "scene: expected a Scene, got 3"),
        (lambda: read(3), "path: expected a path, got 3"),
        (lambda: check_recording(3), "recording: expected a path, got 3"),
        (lambda: parse_error(3), "error: expected a text such as 0.01 or 1%, got 3"),
        (lambda: parse_budget(3), "budget: expected a text such as 10s, .*, got 3"),
        (
            lambda: instances.instance("dam_break", "train", "a"),
            "from 0 to 255 in 'train', got 'a'",
        ),
        (lambda: Effects(gravity=9.81), r"effects.gravity: expected shape \(2,\), got 9.81$"),
        (lambda: Scene("s", None, 0.1, 0.3, Fluid(10.0)), r"x: expected shape .n, 2., got None$"),
        (lambda: finite_array("a", [1.0], (2,)), r"a: expected shape .*, got \(1,\)$"),
        (lambda: positive("a", np.float64(-1.0)), "a: expected a number above 0, got -1.0$"),
        (lambda: number("a", np.float32("nan")), "a: expected a finite number, got nan$"),
        (lambda: countable(1e9, "drops", "fewer"), "drops: expected at most .* fewer makes fewer"),
    ],
)
def test_the_message_names_the_argument(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_recorder_and_a_painter_name_what_they_are_given(sim, tmp_path):
    with pytest.raises(ValueError, match="gauges: expected a Gauge, got 'level:0'"):
        Recorder(tmp_path / "x.npz", sim, ["level:0"])
    with pytest.raises(ValueError, match="sim: expected a Simulation or a state of a recording"):
        Painter(sim.scene).paint(3)


@pytest.mark.parametrize("suffix", [".h5", ".npz", ".pvd"])
def test_a_recording_that_is_not_there_is_named(suffix, tmp_path):
    with pytest.raises(FileNotFoundError, match=f"path: there is no file '.*nope{suffix}'"):
        read(tmp_path / f"nope{suffix}")


def test_a_snapshot_tells_what_it_lacks(sim):
    with pytest.raises(ValueError, match="it has no fluid, time, clock, controls, ledger"):
        sim.restore({})
    with pytest.raises(
        ValueError, match=r"snapshot: expected one of Simulation.snapshot\(\), got 3"
    ):
        sim.restore(3)
    partly = sim.snapshot()
    del partly["power"]
    with pytest.raises(ValueError, match=r"it has no power$"):
        sim.restore(partly)
