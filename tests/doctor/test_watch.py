import pickle

import numpy as np
import pytest

from sph_gym import Simulation, scenes, trajectory
from sph_gym.doctor import Limits, Tripped, check_recording, watch
from sph_gym.doctor.case import DX, case, lattice
from sph_gym.doctor.plain import make


class Stub:
    """Particles that move as they are told, with what goes wrong in a step of your choice."""

    def __init__(self, wrong=None, step=5, shows=("rho", "p", "a"), n=9):
        self.x, self.v = lattice(3, n // 3), np.full((n, 2), 0.1)
        self._columns = {"rho": np.full(n, 1000.0), "p": np.zeros(n), "a": np.zeros((n, 2))}
        for name in shows:
            setattr(self, name, self._columns[name])
        self.c0, self.n, self._wrong, self._when = 20.0, 0, wrong, step

    def step(self, dt):
        self.n += 1
        self.x = self.x + dt * self.v
        if self._wrong is not None and self.n == self._when:
            self._wrong(self)
        return self.n


def set_(name, i, value):
    def wrong(stub):
        column = getattr(stub, name).copy()
        column[i] = value
        setattr(stub, name, column)

    return wrong


def run(solver, n=20, **options):
    watched = watch(solver, **options)
    for _ in range(n):
        watched.step(1e-3)
    return watched


def test_it_behaves_like_the_solver():
    stub = Stub()
    watched = watch(stub)
    assert watched.step(1e-3) == 1
    assert watched.c0 == 20.0
    assert watched.x is stub.x
    watched.c0 = 30.0
    assert stub.c0 == 30.0
    assert "rho" in dir(watched)
    with pytest.raises(AttributeError):
        _ = watched.nothing


@pytest.mark.parametrize(
    ("wrong", "link"),
    [
        (set_("rho", 4, np.nan), "density"),
        (set_("p", 4, np.inf), "pressure"),
        (set_("a", 4, np.nan), "force"),
        (set_("v", 4, np.nan), "integration"),
        (set_("x", 4, np.nan), "integration"),
        (set_("rho", 4, 0.0), "density"),
        (set_("rho", 4, 2e4), "density"),
        (set_("v", 4, 300.0), "integration"),
    ],
)
def test_the_first_wrong_value_is_named(wrong, link):
    with pytest.raises(Tripped) as caught:
        run(Stub(wrong))
    tripped = caught.value
    assert (tripped.particle, tripped.link, tripped.step) == (4, link, 5)
    assert tripped.time == pytest.approx(5e-3)
    assert "particle 4" in str(tripped)
    assert "neighbours of particle 4" in str(tripped)


def test_of_several_the_first_of_the_chain_is_named():
    def wrong(stub):
        for name in ("x", "v", "a", "p"):
            set_(name, 2, np.nan)(stub)

    with pytest.raises(Tripped) as caught:
        run(Stub(wrong))
    assert caught.value.link == "pressure"


def test_without_accelerations_a_velocity_is_laid_to_the_forces():
    with pytest.raises(Tripped) as caught:
        run(Stub(set_("v", 1, np.nan), shows=()))
    assert caught.value.link == "force"


def test_what_begins_wrong_is_no_fault_of_a_step():
    stub = Stub()
    stub.v[3] = np.nan
    with pytest.raises(Tripped) as caught:
        run(stub)
    found = caught.value
    assert (found.link, found.particle, found.step) == ("setup", 3, 0)
    assert str(found).startswith("before the first step (t = 0 s): particle 3, ")
    assert stub.n == 0


def test_a_box_and_other_limits():
    with pytest.raises(Tripped) as caught:
        run(Stub(set_("x", 8, (0.0, -1.0))), limits=Limits(box=(-1, 1, -0.5, 1)))
    assert caught.value.link == "walls"
    with pytest.raises(Tripped) as caught:
        run(Stub(), limits=Limits(speed=0.1))
    assert (caught.value.step, caught.value.offender.quantity) == (0, "speed")
    with pytest.raises(Tripped) as caught:
        run(Stub(set_("v", 2, 5.0), step=3), limits=Limits(speed=1.0))
    assert (caught.value.step, caught.value.particle) == (3, 2)


def test_another_number_of_particles():
    def wrong(stub):
        stub.x, stub.v = stub.x[:-1], stub.v[:-1]

    with pytest.raises(Tripped, match="shows 8 particles, one step before it showed 9") as caught:
        run(Stub(wrong))
    assert caught.value.link == "setup"
    assert "nan" not in str(caught.value)
    assert "particle -1" not in str(caught.value)


@pytest.mark.parametrize("name", ["rho", "p", "a"])
def test_a_field_that_is_bad_at_the_start_is_no_fault_of_a_step(name):
    stub = Stub()
    getattr(stub, name)[5] = np.inf
    with pytest.raises(Tripped) as caught:
        run(stub)
    found = caught.value
    assert (found.link, found.particle, found.step) == ("setup", 5, 0)
    assert found.offender.quantity == name


def test_what_was_repaired_before_the_first_step_is_no_fault():
    stub = Stub()
    stub.v[3] = np.nan
    watched = watch(stub)
    stub.v[3] = 0.1
    watched.step(1e-3)
    assert stub.n == 1


def test_a_callback_is_called_once_and_the_run_goes_on():
    found = []
    watched = run(Stub(set_("v", 4, np.nan)), callback=found.append)
    assert len(found) == 1
    assert watched.n == 20


def test_the_last_states_are_in_a_file_that_trajectory_reads(tmp_path):
    path = tmp_path / "trace.npz"
    with pytest.raises(Tripped) as caught:
        run(Stub(set_("rho", 4, np.nan), step=150), n=150, path=path)
    read = trajectory.read(path)
    assert len(read.times) == 100
    assert read.times[-1] == pytest.approx(0.15)
    assert {name: field.shape for name, field in read.fields.items()} == {
        "x": (100, 9, 2), "v": (100, 9, 2), "rho": (100, 9), "p": (100, 9), "a": (100, 9, 2),
    }  # fmt: skip
    assert np.isfinite(read.fields["rho"][:-1]).all()
    assert read.parameters["tripped"]["link"] == "density"
    assert check_recording(path).link == "density"
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.step) == (str(caught.value), 150)


def test_a_healthy_solver_is_left_in_peace():
    start = case(lattice(6, 6, 0.95 * DX))
    watched, bare = watch(make(start)), make(start)
    for _ in range(100):
        watched.step(start.dt)
        bare.step(start.dt)
    np.testing.assert_array_equal(watched.x, bare.x)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_densities_that_are_not_computed_yet_are_no_fault(value):
    stub = Stub(set_("rho", slice(None), 1000.0), step=1)
    stub.rho = np.full(9, value)
    run(stub)


def test_densities_that_are_never_computed_are_a_fault():
    stub = Stub()
    stub.rho = np.full(9, np.nan)
    with pytest.raises(Tripped) as caught:
        run(stub)
    assert (caught.value.link, caught.value.step) == ("density", 1)


def test_numbers_of_the_solver_are_in_the_file(tmp_path):
    path = tmp_path / "trace.npz"
    with pytest.raises(Tripped):
        run(Stub(set_("rho", 4, np.nan)), path=path)
    told = trajectory.read(path).parameters
    assert (told["solver"], told["c0"]) == ("Stub", 20.0)
    assert "h" not in told


def test_a_simulation_is_watched_by_its_reports(tmp_path):
    path = tmp_path / "tank.npz"
    sim = Simulation(scenes.make("hydrostatic_tank", dx=0.08))
    watched = watch(sim, path)
    watched.advance(0.01)
    watched.controls = watched.controls._replace(dt=0.05)
    with pytest.raises(Tripped, match=r"the run blew up: .*time step.*cause cfl") as caught:
        watched.advance(1.0)
    report = sim.last_report
    assert (caught.value.link, caught.value.particle) == (report.link, report.bad_particle)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    read = trajectory.read(path)
    assert read.parameters["scene"]["name"] == "hydrostatic_tank"
    assert read.controls[-1, 0] == 0.05


@pytest.mark.parametrize(
    ("solver", "path"),
    [(object(), None), (Stub(), "trace.h5"), (type("Empty", (), {"step": run})(), None)],
)
def test_what_is_no_solver_and_no_path(solver, path):
    with pytest.raises(ValueError, match="expected one"):
        watch(solver, path)
