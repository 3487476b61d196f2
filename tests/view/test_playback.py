"""Recordings as a source of moments, of this solver and of any other."""

import numpy as np
import pytest

from sph_gym import Simulation, scenes, trajectory
from sph_gym.doctor import Tripped, watch
from sph_gym.doctor.case import DX, case, lattice
from sph_gym.doctor.plain import make
from sph_gym.trajectory import Recorder, Trajectory
from sph_gym.view import Painter, Recording
from sph_gym.view.colors import QUANTITIES, available
from sph_gym.view.state import Still, columns_of


def frames(n=6, side=5, **changes):
    """Return a recording of a lattice that drifts to the right, by a solver without a name."""
    x = lattice(side, side)
    times = np.arange(n) * 1e-3
    fields = {
        "x": np.stack([x + np.array([time, 0.0]) for time in times]),
        "v": np.full((n, len(x), 2), (1.0, 0.0)),
        "rho": np.full((n, len(x)), 1000.0),
    }
    given = {
        "times": times,
        "controls": np.full((n, 3), np.nan),
        "fields": fields,
        "parameters": {"n_fluid": len(x), "kind": np.zeros(len(x), np.uint8)},
        "gauges": {"floor": np.ones((n, 2)), "level": np.arange(n)[:, None]},
    }
    return Trajectory(**given | changes)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Return the simulation and the path of a recorded run."""
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    path = tmp_path_factory.mktemp("saved") / "run.npz"
    with Recorder(path, sim) as recorder:
        for _ in range(3):
            sim.advance(sim.scene.frame)
            recorder.record()
    return sim, path


def test_what_a_run_saved_looks_like_the_run(saved):
    sim, path = saved
    recording = Recording(trajectory.read(path))
    recording.go(recording.n - 1)
    state = recording.state
    assert state.time == sim.time
    assert state.controls == sim.controls
    assert state.sound_speed == sim.sound_speed
    assert recording.unit == "frame"
    assert recording.estimated == []
    np.testing.assert_array_equal(state.x, sim.x)
    np.testing.assert_array_equal(state.neighbor_counts, sim.neighbor_counts)
    for name in available(state):
        shown, of_sim = (QUANTITIES[name].values(each) for each in (state, sim))
        np.testing.assert_allclose(shown, of_sim, err_msg=name)
        # pictures of both are the same, but for the colour of a particle at the edge of two colours
        pictures = [Painter(sim.scene, 480, name).paint(each).astype(int) for each in (state, sim)]
        assert (pictures[0] != pictures[1]).mean() < 1e-3


def test_measures_of_a_recording_are_those_of_the_run(saved):
    sim, path = saved
    recording = Recording(trajectory.read(path))
    numbers = {title: values[-1] for title, values in recording.series().items()}
    assert numbers["largest speed [m/s]"] == pytest.approx(sim.max_speed)
    error = 100 * sim.diagnostics()["density_error"]
    assert numbers["mean density error [%]"] == pytest.approx(error)


def test_one_goes_back_and_forth(saved):
    recording = Recording(trajectory.read(saved[1]))
    assert (recording.n, recording.at) == (3, 0)
    assert recording.forward()
    assert recording.state.time == recording.time(1)
    recording.go(9)
    assert recording.at == 2
    assert not recording.forward()
    recording.go(-1)
    assert recording.state.time == recording.time(0)


def test_only_what_was_recorded_is_shown():
    recording = Recording(frames())
    assert available(recording.state) == [
        "speed", "density", "density_error", "neighbors", "clumping", "energy",
    ]  # fmt: skip
    with pytest.raises(ValueError, match="p: the recording has no pressures"):
        _ = recording.state.p
    bare = frames()
    del bare.fields["rho"]
    assert available(Recording(bare).state) == ["speed", "neighbors", "clumping", "energy"]
    np.testing.assert_allclose(QUANTITIES["energy"].values(Recording(bare).state), 0.5)


def test_what_a_solver_does_not_tell_is_estimated():
    recording = Recording(frames())
    assert recording.estimated == ["dx", "h", "rho0", "c0"]
    assert recording.scene.dx == pytest.approx(DX)
    assert recording.scene.fluid.rho0 == 1000.0
    assert recording.scene.fluid.c0 == pytest.approx(10.0)
    told = {"solver": "Mine", "dx": 2 * DX, "h": 5 * DX, "rho0": 998.0, "c0": 33.0}
    recording = Recording(frames(parameters=told))
    assert recording.estimated == []
    scene = recording.scene
    assert (scene.name, scene.dx, scene.h, scene.fluid.c0) == ("Mine", 2 * DX, 5 * DX, 33.0)


def test_gauges_are_drawn_over_time_too():
    series = Recording(frames()).series()
    np.testing.assert_array_equal(series["floor x"], np.ones(6))
    np.testing.assert_array_equal(series["floor y"], np.ones(6))
    np.testing.assert_array_equal(series["level"], np.arange(6))


def test_the_view_holds_all_moments_but_no_strays():
    flown = frames()
    flown.fields["x"][-1, 0] = (1e9, 1e9)
    flown.fields["x"][-1, 1] = np.nan
    bounds = Recording(flown).bounds
    inside = flown.fields["x"][:-1].reshape(-1, 2)
    assert (inside > (bounds.x_min, bounds.y_min)).all()
    assert (inside < (bounds.x_max, bounds.y_max)).all()
    assert bounds.width < 1.0


def test_numbers_that_are_none_are_shown_as_such():
    broken = frames()
    for name in ("v", "rho"):
        broken.fields[name][-1, 3] = np.nan
    recording = Recording(broken)
    recording.go(recording.n - 1)
    for name in available(recording.state):
        Painter(recording.scene, 480, name, bounds=recording.bounds).paint(recording.state)
    assert np.isnan(recording.series()["largest speed [m/s]"][-1])


def test_what_watch_wrote_is_opened(tmp_path):
    start = case(lattice(4, 4, 0.95 * DX))
    solver = make(start)
    watched = watch(solver, path=tmp_path / "last.npz")

    def run():
        for k in range(150):
            watched.step(start.dt)
            if k == 120:
                solver.v[5] = (3e3, 0.0)

    with pytest.raises(Tripped):
        run()
    recording = Recording(trajectory.read(tmp_path / "last.npz"))
    assert (recording.n, recording.unit) == (100, "step")
    assert recording.tripped["particle"] == 5
    assert "a" in columns_of(recording.state)
    assert recording.scene.h == start.h
    assert "c0" not in recording.estimated


def test_walls_that_were_left_out_are_those_of_the_scene(tmp_path):
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    watched = watch(sim, path=tmp_path / "last.npz")
    watched.controls = watched.controls._replace(dt=0.05)
    with pytest.raises(Tripped):
        watched.advance(1.0)
    recording = Recording(trajectory.read(tmp_path / "last.npz"))
    state = recording.state
    np.testing.assert_array_equal(state.x[sim.n_fluid :], sim.x[sim.n_fluid :])
    assert len(state.rho) == sim.n_particles
    assert np.isnan(state.rho[sim.n_fluid :]).all()
    assert isinstance(state, Still)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fields": {"x": np.zeros((1, 2, 2))}}, "expected the field 'v'"),
        ({"times": np.zeros(0)}, "expected at least one moment"),
        ({"fields": {"x": np.zeros((6, 0, 2)), "v": np.zeros((6, 0, 2))}}, "with particles"),
    ],
)
def test_what_is_no_recording_of_particles_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Recording(frames(**changes))


def test_a_lone_particle_can_be_shown():
    one = frames(side=1)
    recording = Recording(one)
    assert recording.scene.dx == 1.0
    Painter(recording.scene, 480, bounds=recording.bounds).paint(recording.state)
