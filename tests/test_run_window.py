"""`run --window`: a scene that is steered, and recordings that are opened."""

import csv

import numpy as np
import pygame
import pytest

from sph_gym import Simulation, TuningEnv, scenes, trajectory
from sph_gym.__main__ import main
from sph_gym.blowups import CAUSES, explain
from sph_gym.controllers import Network
from sph_gym.doctor import Tripped, watch
from sph_gym.env.layouts import action_layout, observation_layout
from sph_gym.env.observations import Features
from sph_gym.env.rules import Rules
from sph_gym.pilot import Pilot, controllers
from sph_gym.readings import Readings
from sph_gym.run import BAD_START, Course
from sph_gym.solver import break_on, failure
from sph_gym.solver.gauges import Gauge
from sph_gym.solver.report import Report
from sph_gym.view import Window

DAM = ["run", "dam_break", "--set", "dx=0.05", "--window"]


@pytest.fixture
def script(monkeypatch, tmp_path):
    """Return a function that sets what happens whenever the window waits; it is closed at last."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.chdir(tmp_path)
    windows, rest = [], []
    real_init, real_wait = Window.__init__, pygame.event.wait

    def init(self, *arguments, **named):
        real_init(self, *arguments, **named)
        windows.append(self)

    def wait(milliseconds):
        if not pygame.event.peek():
            press(*(rest.pop(0)(windows[-1]) if rest else [pygame.K_q]))
        return real_wait(1)

    monkeypatch.setattr(Window, "__init__", init)
    monkeypatch.setattr(pygame.event, "wait", wait)

    yield rest.extend
    for window in windows:
        window.close()


def press(*keys):
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))


def test_a_run_is_watched_to_its_end_and_beyond(script, capsys):
    seen = []

    def look(window):
        seen.append((window.source.n, window._notice))
        return [pygame.K_LEFT, pygame.K_q]

    script([look])
    assert main([*DAM, "--seconds", "0.1"]) == 0
    frames = len(capsys.readouterr().out.splitlines()) - 1
    assert seen == [(frames + 1, "this is the last frame")]


def test_break_on_freezes_the_window_and_the_exit_status_tells(script, capsys):
    seen = []

    def look(window):
        seen.append((window.picked, window.source.unit, window._message))
        return [pygame.K_q]

    script([look])
    assert main([*DAM, "--dt", "0.02", "--break-on", "nan"]) == 1
    printed = capsys.readouterr().out
    assert f"particle {seen[0][0]}, in the link" in printed
    assert seen[0][1] == "substep"
    assert seen[0][2] in printed


def test_a_bad_start_is_shown_before_the_first_step(script, monkeypatch):
    monkeypatch.setattr(break_on, "DENSEST", 0.5)
    seen = []

    def look(window):
        seen.append((window.picked, window.source.n, window._message))
        return [pygame.K_q]

    script([look])
    assert main([*DAM, "--break-on", "density"]) == 1
    ((picked, n, message),) = seen
    assert n == 1
    assert message.startswith(f"{BAD_START} particle {picked}, ")


def test_the_window_hands_over_to_every_controller(script, capsys):
    seen = []

    def look(window):
        seen.append(window._steered)
        return [pygame.K_h, pygame.K_s]

    names = [*controllers(scenes.make("dam_break", dx=0.05))]
    script([look] * (len(names) + 2))
    assert main([*DAM, "--seconds", "0.05"]) == 0
    assert seen == ["you", *names, "you"]
    assert "default" in names
    assert "tuned_cfl" in names


def test_a_controller_begins_in_the_window(script, capsys):
    seen = []

    def look(window):
        seen.append((window._steered, window.source.sim.controls))
        return [pygame.K_h] if len(seen) == 1 else [pygame.K_q]

    script([look, look])
    assert main([*DAM, "--seconds", "0.05", "--controller", "tuned_cfl"]) == 0
    (name, controls), (then, _) = seen
    assert (name, then) == ("tuned_cfl", "adaptive")
    assert controls.stiffness != Simulation(scenes.make("dam_break", dx=0.05)).controls.stiffness


def test_what_was_saved_is_opened(script, capsys):
    assert main([*DAM[:-1], "--seconds", "0.06", "--save", "run.npz"]) == 0
    n = len(trajectory.read("run.npz").times)
    seen = []

    def look(window):
        seen.append((window.source.at, window._painter.color))
        return [pygame.K_LEFT, pygame.K_q]

    script([look])
    assert main(["run", "run.npz", "--window", "--color", "pressure"]) == 0
    assert seen == [(n - 1, "pressure")]
    assert f"200 particles, {n} frames" in capsys.readouterr().out


def test_what_watch_wrote_is_opened_where_it_tripped(script):
    watched = watch(Simulation(scenes.make("dam_break", dx=0.05)), path="last.npz")
    for _ in range(3):
        watched.advance(0.005)
    watched.controls = watched.controls._replace(dt=0.02)
    with pytest.raises(Tripped) as caught:
        watched.advance(2.0)
    seen = []

    def look(window):
        seen.append((window.source.at, window.picked, window._message, window.paused))
        return [pygame.K_LEFT]

    script([look, look])
    assert main(["run", "last.npz", "--window"]) == 0
    (at, picked, message, paused), (before, *_) = seen
    assert (at, before) == (4, 3)
    assert picked == caught.value.particle
    assert message == str(caught.value).splitlines()[0]
    assert paused


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run.npz"], "got no --window"),
        (["run.npz", "--window", "--seconds", "1"], "got --seconds"),
        (["run.npz", "--window", "--set", "dx=1"], "got --set"),
        (["run.npz", "--window", "--break-on", "nan"], "got --break-on"),
        (["run.npz", "--window", "--color", "smell"], "color: expected one of speed"),
        (["nothing.npz", "--window"], "there is no such file"),
        (["other.npz", "--window"], "expected a recording"),
    ],
    ids=" ".join,
)
def test_wrong_words_about_recordings_give_one_clear_line(script, arguments, message, capsys):
    main([*DAM[:-1], "--seconds", "0.02", "--save", "run.npz"])
    np.savez("other.npz", x=np.zeros(3))
    assert main(["run", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("sph_gym: ")
    assert message in error


def test_a_run_that_goes_on_from_earlier_forgets_what_came_later(tmp_path, capsys):
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    path = tmp_path / "level.csv"
    with Readings(sim, [Gauge("level", 0.5)], path) as readings:
        course = Course(sim, 1.0, 0, readings, None)
        course.advance()
        early = sim.snapshot()
        for _ in range(3):
            course.advance()
        sim.restore(early)
        course.rewind()
        course.advance()
    rows = list(csv.reader(path.read_text().splitlines()))
    times = [float(row[0]) for row in rows[1:]]
    np.testing.assert_allclose(times, [0.0, early["time"], sim.time])
    assert f"went back to t = {early['time']:.6g} s" in capsys.readouterr().out


def test_a_run_that_had_ended_goes_on_after_it_went_back():
    sim = Simulation(scenes.make("dam_break", dx=0.05))
    course = Course(sim, 2.5 * sim.scene.frame, 0, Readings(sim), None)
    start = sim.snapshot()
    assert len(list(course)) == 3
    assert course.advance() is None
    sim.restore(start)
    course.rewind()
    assert course.advance().n_substeps > 0


LAYOUTS = (observation_layout(Rules()), action_layout("absolute"))


def random_network(n_in, n_out=3, squash="clip", layouts=LAYOUTS):
    generator = np.random.default_rng(1)
    weights = generator.normal(0.0, 0.2, (n_out, n_in)).astype(np.float32)
    return Network((weights,), (np.zeros(n_out, np.float32),), "tanh", squash, *layouts)


def test_a_network_steers_a_run_as_it_steers_the_environment():
    env = TuningEnv("dam_break", dx=0.05)
    observation, _ = env.reset(seed=0)
    scene, network = env.sim.scene, random_network(len(observation))
    sim, steer = Simulation(scene), Pilot(network)
    for _ in range(5):
        observation, *_ = env.step(network(observation))
        sim.controls = steer(sim)
        sim.advance(scene.frame)
        np.testing.assert_allclose(sim.controls, env.sim.controls, rtol=1e-9)


@pytest.mark.parametrize(
    ("n_in", "n_out", "squash"),
    [(7, 3, "clip"), (len(Features().rows), 2, "clip"), (len(Features().rows), 3, "none")],
)
def test_networks_of_other_environments_are_refused(n_in, n_out, squash):
    with pytest.raises(ValueError, match=f"network: expected .*, got {n_in} and {n_out}"):
        Pilot(random_network(n_in, n_out, squash))


@pytest.mark.parametrize("layouts", [("features v1", LAYOUTS[1]), (LAYOUTS[0], "absolute v1")])
def test_networks_of_other_versions_are_refused(layouts):
    with pytest.raises(ValueError, match="network: it was trained with"):
        Pilot(random_network(len(Features().rows), layouts=layouts))


def test_every_cause_of_a_blow_up_is_explained():
    assert set(CAUSES) == set(failure.CAUSES)
    for cause in CAUSES:
        text = explain(Report(3, 1e-3, True, cause, "force", 12))
        assert text.startswith("the run blew up: ")
        assert f"(cause {cause})" in text
        assert "particle 12, in the link 'force'; " in text
