"""Records of what compiled calls take."""

import copy

import numpy as np

from sph_gym import Controls
from sph_gym.solver.records import Kept
from tests.cases import configurations, simulation

CONTROLS = [Controls(1e-4, 123.0, 0.0), Controls(1e-4, 1e6 / 3, 0.7), Controls(1e-4, 2.0, 1e-3)]


@configurations
def test_numbers_of_the_controls_are_written_to_their_places(configuration, dtype):
    engine = simulation(configuration, dtype=dtype).engine
    for controls in CONTROLS:
        engine.set_controls(controls)
        rows = engine.records()[1]
        assert rows.tobytes() == Kept().follow(engine.model).rows.tobytes()
        assert engine.model.eos.stiffness == np.dtype(dtype).type(controls.stiffness)


def test_a_record_that_a_call_may_still_read_stays_as_it_was():
    engine = simulation("open space").engine
    before = engine.records()[1]
    kept = before.copy()
    engine.set_controls(CONTROLS[0])
    assert engine.records()[1] is not before
    assert (before == kept).all()


def test_a_copy_has_records_of_its_own_arrays():
    sim = simulation("everything")
    twin = copy.deepcopy(sim)
    assert sim.engine.records()[0].tobytes() != twin.engine.records()[0].tobytes()


def test_a_stiffness_beyond_single_precision_is_infinite():
    engine = simulation("none", dtype="float32").engine
    engine.set_controls(Controls(1e-4, 1e300, 0.0))
    engine.records()
    assert np.isinf(engine.model.eos.stiffness)
