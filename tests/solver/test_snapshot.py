"""Going back and on again, bit by bit."""

import pickle

import numpy as np
import pytest

from sph_gym import Simulation, scenes
from tests.cases import COMPILED, STIFFNESS, marked, simulation
from tests.solver.test_simulation import assert_same

# more than positions and velocities makes the state, or the walls move
PLAIN = ("none", "everything", "open space", "periodic", "plates")
WITH_MORE_STATE = [marked(*one) for one in COMPILED if one[0] not in PLAIN]


def go_on(sim):
    """Something of everything: time, other controls, looks in between."""
    sim.advance(5 * sim.controls.dt)
    sim.controls = sim.controls._replace(stiffness=0.6 * STIFFNESS, xsph=0.1)
    sim.evaluate()
    sim.advance(4 * sim.controls.dt)
    return sim


@pytest.mark.parametrize("detour", ["none", "controls", "time", "pickle", "looks", "blow-up"])
@pytest.mark.parametrize(
    ("dtype", "neighbors"), [("float64", "grid"), ("float32", "grid"), ("float64", "brute")]
)
def test_going_on_from_a_snapshot_is_bit_exact(detour, dtype, neighbors):
    sim = simulation("everything", "jittered", dtype, neighbors)
    sim.controls = sim.controls._replace(stiffness=0.9 * STIFFNESS)
    sim.advance(4 * sim.controls.dt)
    snapshot = sim.snapshot()
    twin = simulation("everything", "jittered", dtype, neighbors)
    if detour == "controls":
        sim.controls = sim.controls._replace(dt=1e-5, stiffness=3 * STIFFNESS, xsph=0.9)
    elif detour == "time":
        sim.advance(11 * sim.controls.dt)
    elif detour == "pickle":
        snapshot = pickle.loads(pickle.dumps(snapshot))
    elif detour == "looks":
        sim.a, sim.rho, sim.stable_dt(), sim.diagnostics(), sim.neighbor_counts
    elif detour == "blow-up":
        sim.controls = sim.controls._replace(stiffness=1e6 * STIFFNESS)
        assert sim.advance(20 * sim.controls.dt).diverged
    for each in (sim, twin):
        each.restore(snapshot)
    original = simulation("everything", "jittered", dtype, neighbors)
    original.controls = original.controls._replace(stiffness=0.9 * STIFFNESS)
    original.advance(4 * original.controls.dt)
    for each in (sim, twin):
        assert each.controls == original.controls
        assert_same(each, original)
        assert each.diagnostics() == original.diagnostics()
    go_on(original)
    for each in (sim, twin):
        assert_same(go_on(each), original)
        assert each.diagnostics() == original.diagnostics()


@pytest.mark.parametrize("detour", ["none", "time", "blow-up"])
@pytest.mark.parametrize(("configuration", "dtype"), WITH_MORE_STATE)
def test_so_it_is_where_more_belongs_to_the_state(configuration, dtype, detour):
    """Densities, rates of the last evaluation, and the time at which walls are where they are."""
    original, sim, twin = (simulation(configuration, dtype=dtype, speed=0.3) for _ in range(3))
    for each in (original, sim):
        assert not each.advance(4.3 * each.controls.dt).diverged
    snapshot = sim.snapshot()
    if detour == "time":
        sim.advance(11 * sim.controls.dt)
    elif detour == "blow-up":
        sim.controls = sim.controls._replace(stiffness=1e6 * STIFFNESS)
        assert sim.advance(20 * sim.controls.dt).diverged
    for each in (sim, twin):
        each.restore(snapshot)
        assert_same(each, original)
    go_on(original)
    for each in (sim, twin):
        assert_same(go_on(each), original)
        assert each.diagnostics() == original.diagnostics()


@pytest.mark.without_jit
def test_a_snapshot_is_a_copy():
    sim = simulation("everything")
    snapshot, x = sim.snapshot(), sim.x
    sim.advance(5 * sim.controls.dt)
    sim.restore(snapshot)
    sim.advance(5 * sim.controls.dt)
    sim.restore(snapshot)
    assert (sim.x == x).all()


def test_a_long_run_goes_on_from_its_middle():
    sim, twin = (Simulation(scenes.make("dam_break", dx=0.05)) for _ in range(2))
    sim.advance(0.3)
    twin.restore(sim.snapshot())
    for each in (sim, twin):
        each.advance(0.1)
    assert_same(sim, twin)


def test_a_snapshot_after_a_blow_up_can_be_taken_up():
    sim, twin = simulation("everything"), simulation("everything")
    sim.controls = sim.controls._replace(stiffness=1e6 * STIFFNESS)
    assert sim.advance(20 * sim.controls.dt).diverged
    twin.restore(sim.snapshot())
    assert (sim.x == twin.x).all()
    assert (sim.v == twin.v).all()
    for each in (sim, twin):
        each.controls = each.controls._replace(dt=1e-7, stiffness=STIFFNESS)
        each.advance(1e-6)
    assert_same(sim, twin)


def without(snapshot, name):
    return {key: value for key, value in snapshot.items() if key != name}


# name: what is made of a snapshot
FOREIGN = {
    "another size": lambda _: simulation("everything", x=TWO, v=None).snapshot(),
    "another precision": lambda _: simulation("everything", dtype="float32").snapshot(),
    "nothing": lambda _: {},
    "no snapshot": lambda _: None,
    "no fluid": lambda own: without(own, "fluid"),
    "a field too few": lambda own: own | {"fluid": {"x": own["fluid"]["x"]}},
    "no arrays": lambda own: own | {"fluid": dict.fromkeys(own["fluid"], 1.0)},
    "time that is no time": lambda own: own | {"time": "noon"},
    "a clock that is none": lambda own: own | {"clock": None},
    "two controls": lambda own: own | {"controls": (1e-4, 1e4)},
    "impossible controls": lambda own: own | {"controls": (-1e-4, 1e4, 0.3)},
    "short ledger": lambda own: own | {"ledger": [0.0]},
    "short totals": lambda own: own | {"totals": (0.0,)},
    "no onset": lambda own: without(own, "onset"),
}
TWO = [(0.1, 0.1), (0.2, 0.1)]


@pytest.mark.parametrize("what", FOREIGN)
def test_a_foreign_snapshot_is_refused_and_changes_nothing(what):
    sim, untouched = simulation("everything"), simulation("everything")
    with pytest.raises(ValueError, match=r"snapshot|controls"):
        sim.restore(FOREIGN[what](sim.snapshot()))
    for each in (sim, untouched):
        each.advance(3 * each.controls.dt)
    assert_same(sim, untouched)


def test_a_snapshot_holds_plain_arrays_and_numbers():
    def leaves(value):
        if isinstance(value, dict):
            return [leaf for part in value.values() for leaf in leaves(part)]
        return (
            [leaf for part in value for leaf in leaves(part)]
            if isinstance(value, list | tuple)
            else [value]
        )

    kinds = {type(leaf) for leaf in leaves(simulation("everything").snapshot())}
    assert kinds <= {np.ndarray, float}
