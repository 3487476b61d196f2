"""Moments that one can go back to: the same to the last bit, or computed anew when asked for."""

import numpy as np
import pytest

from sph_gym import Controls, Simulation, scenes
from sph_gym.solver.offender import Offender
from sph_gym.solver.warnings import Warning
from sph_gym.view import History
from sph_gym.view.history import KEPT, LEAST, SUBSTEPS


def simulation():
    return Simulation(scenes.make("dam_break", dx=0.05))


def history(sim, **more):
    return History(sim, lambda: sim.advance(sim.scene.frame), **more)


def bits(sim):
    snapshot = sim.snapshot()
    # looking at warnings changes what is known of them, not the fluid
    parts = [snapshot["fluid"][name] for name in sorted(snapshot["fluid"])]
    rest = [snapshot["time"], *snapshot["controls"], *snapshot["ledger"]]
    return [part.tobytes() for part in parts], rest


def test_300_frames_back_are_the_same_to_the_last_bit():
    sim, seen = simulation(), []
    past = history(sim)
    for _ in range(LEAST - 1):
        seen.append(bits(sim))
        # a look at everything must not change what follows
        sim.evaluate()
        assert past.forward()
    seen.append(bits(sim))
    assert past.n == LEAST
    for k in reversed(range(past.n)):
        past.go(k)
        assert bits(sim) == seen[k]
    bare = simulation()
    for _ in range(LEAST - 1):
        bare.advance(bare.scene.frame)
    assert bits(bare) == seen[-1]
    for k in range(past.n):
        assert bits(sim) == seen[k]
        past.forward()


def test_going_on_from_a_kept_moment_computes_nothing():
    sim, calls = simulation(), []

    def advance():
        calls.append(sim.time)
        return sim.advance(sim.scene.frame)

    past = History(sim, advance)
    for _ in range(4):
        past.forward()
    past.go(1)
    past.forward()
    assert (past.at, past.n, len(calls)) == (2, 5, 4)
    past.go(-7)
    assert past.at == 0
    past.go(99)
    assert past.is_newest


def test_other_controls_drop_what_came_later_and_compute_it_anew():
    sim, rewound = simulation(), []
    past = history(sim, rewind=lambda: rewound.append(sim.time))
    for _ in range(4):
        past.forward()
    late = bits(sim)
    past.go(2)
    past.set_controls(sim.controls._replace(dt=sim.controls.dt / 2))
    past.forward()
    assert (past.at, past.n) == (3, 4)
    assert rewound == [past.time(2)]
    past.forward()
    assert sim.time == pytest.approx(late[1][0])
    assert bits(sim) != late


def test_what_was_changed_and_not_run_is_taken_back():
    sim = simulation()
    past = history(sim)
    past.forward()
    before = bits(sim)
    past.set_controls(Controls(1e-5, 1e4, 0.0))
    past.go(past.at)
    assert bits(sim) == before
    with pytest.raises(ValueError, match=r"controls\.dt"):
        past.set_controls(Controls(-1.0, 1e4, 0.0))


def test_a_controller_sets_the_controls_until_it_is_relieved():
    sim = simulation()
    past, wanted = history(sim), sim.controls._replace(xsph=0.1)
    past.forward()
    past.steer = lambda given: wanted if given is sim else None
    past.forward()
    assert sim.controls == wanted
    past.steer = None
    past.forward()
    assert sim.controls == wanted
    # from before it took over, the run without it is another one
    past.go(1)
    past.forward()
    assert past.n == 3


def test_the_end_of_a_run_is_the_end():
    sim = simulation()
    past = History(sim, lambda: None)
    assert not past.forward()
    assert past.n == 1
    assert not History(sim).forward()


def test_old_moments_make_room_for_new_ones(monkeypatch):
    monkeypatch.setattr("sph_gym.view.history.LEAST", 5)
    monkeypatch.setattr("sph_gym.view.history.ROOM", 1)
    sim = simulation()
    past = history(sim)
    for _ in range(8):
        past.forward()
    assert (past.n, past.at) == (5, 4)
    assert past.time(0) == pytest.approx(4 * sim.scene.frame)
    assert KEPT >= LEAST == 300


def test_the_last_substeps_are_run_once_more():
    sim = simulation()
    past = history(sim)
    for _ in range(12):
        past.forward()
    end, report = bits(sim), sim.last_report
    steps = past.last_substeps()
    assert (steps.n, steps.at) == (SUBSTEPS + 1, SUBSTEPS)
    assert bits(sim) == end
    times = [steps.time(k) for k in range(steps.n)]
    np.testing.assert_allclose(np.diff(times), report.dt)
    steps.go(0)
    first = bits(sim)
    assert first != end
    assert sim.last_report == report
    steps.go(steps.n - 1)
    assert not steps.forward()
    steps.go(3)
    steps.close()
    assert bits(sim) == end


def test_substeps_do_not_go_back_beyond_the_start():
    sim = simulation()
    past = history(sim)
    past.forward()
    steps = past.last_substeps()
    assert steps.n == sim.last_report.n_substeps + 1
    assert steps.time(0) == 0.0


def test_long_frames_are_skipped_up_to_their_last_substeps():
    sim = simulation()
    sim.controls = sim.controls._replace(dt=sim.controls.dt / 20)
    past = history(sim)
    past.forward()
    assert sim.last_report.n_substeps > 2 * SUBSTEPS
    steps = past.last_substeps()
    assert steps.n == SUBSTEPS + 1
    assert steps.time(0) == pytest.approx(sim.time - SUBSTEPS * sim.last_report.dt)


def test_a_blow_up_is_trouble_and_its_substeps_lead_to_it():
    sim = simulation()
    past = history(sim)
    past.forward()
    assert past.trouble is None
    past.set_controls(sim.controls._replace(dt=0.02))
    while past.trouble is None:
        assert past.forward()
    assert past.trouble.particle == sim.last_report.bad_particle
    assert past.trouble.message.startswith("the run blew up: the time step was too long")
    end = bits(sim)
    steps = past.last_substeps()
    assert steps.n > 2
    assert bits(sim) == end


def test_an_offender_is_trouble():
    sim, found = simulation(), Offender(7, "density", "rho", 9.0, "at most 1")
    past = history(sim, offender=lambda: found)
    past.forward()
    assert past.trouble.particle == 7
    assert "particle 7, link 'density'" in past.trouble.message


@pytest.mark.parametrize("kind", ["mach", "energy", "clumping", "walls", "volume"])
def test_a_new_warning_is_trouble_once(kind, monkeypatch):
    told = [Warning("start", 1.0, 0.5, 0.0, "odd from the start")]
    monkeypatch.setattr(Simulation, "warnings", property(lambda sim: tuple(told)))
    sim = simulation()
    past = history(sim)
    past.forward()
    assert past.trouble is None
    told.append(Warning(kind, 2.0, 1.0, 0.1, "something is odd"))
    past.forward()
    assert past.trouble.message == "warning: something is odd"
    i, n, speed = past.trouble.particle, sim.n_fluid, np.hypot(*sim.v.T)
    if kind in ("mach", "energy"):
        assert speed[i] == speed[:n].max()
    elif kind == "volume":
        assert i == -1
    else:
        start = 0 if kind == "clumping" else n
        others = np.hypot(*(sim.x[:n, None] - sim.x[None, start : n if start == 0 else None]).T).T
        others[others == 0] = np.inf
        assert others[i].min() == others.min()
    past.forward()
    assert past.trouble is None


def test_numbers_over_time_are_those_of_the_moment():
    sim = simulation()
    past = history(sim, more=lambda: {"height [m]": sim.time})
    past.forward()
    numbers = {title: values[1] for title, values in past.series().items()}
    assert numbers["height [m]"] == sim.time
    assert numbers["largest speed [m/s]"] == sim.max_speed
    assert numbers["mean density error [%]"] == 100 * sim.diagnostics()["density_error"]
    assert past.series()["largest speed [m/s]"].tolist() == [0.0, sim.max_speed]
    past.forward()
    assert past.series()["height [m]"].tolist() == [past.time(k) for k in range(3)]
    past.go(0)
    past.set_controls(sim.controls._replace(xsph=0.0))
    past.forward()
    assert len(past.series()["height [m]"]) == 2


def test_a_simulation_that_others_run_is_followed():
    sim = simulation()
    past = History(sim)
    past.follow()
    assert past.n == 1
    sim.advance(0.01)
    past.follow()
    past.follow()
    assert past.n == 2


def test_what_others_change_between_two_frames_is_kept():
    sim = simulation()
    past = History(sim)
    sim.advance(0.01)
    past.follow()
    sim.controls = sim.controls._replace(stiffness=2 * sim.controls.stiffness)
    past.follow()
    before = bits(sim)
    past.go(0)
    past.go(1)
    assert past.n == 2
    assert bits(sim) == before


def test_substeps_of_what_others_ran_are_run_with_their_controls():
    sim, twin = simulation(), simulation()
    past = History(sim)
    for each in (sim, twin):
        each.controls = each.controls._replace(stiffness=2 * each.controls.stiffness, dt=5e-4)
    sim.advance(sim.scene.frame)
    past.follow()
    n, dt = sim.last_report[:2]
    steps = past.last_substeps()
    assert steps.n == n + 1
    steps.go(n - 1)
    twin.controls = twin.controls._replace(dt=dt)
    twin.advance((n - 1) * dt)
    np.testing.assert_allclose(sim.x, twin.x, rtol=1e-9)
    np.testing.assert_allclose(sim.p, twin.p, rtol=1e-6, atol=1e-6)


def test_substeps_are_unknown_where_others_ran_on_in_parts():
    sim = simulation()
    past = History(sim)
    for _ in range(3):
        sim.advance(0.005)
    past.follow()
    assert past.last_substeps().n == 1
