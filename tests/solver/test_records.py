"""Records of the arguments of compiled calls, and the row of controls."""

import copy

import numpy as np

from sph_gym import Controls
from sph_gym.solver.model import DT, with_controls
from tests.cases import configurations, simulation

CONTROLS = [Controls(1e-4, 123.0, 0.0), Controls(1e-4, 1e6 / 3, 0.7), Controls(1e-4, 2.0, 1e-3)]


@configurations
def test_controls_reach_the_model(configuration, dtype):
    engine = simulation(configuration, dtype=dtype).engine
    number = np.dtype(dtype).type
    for controls in CONTROLS:
        engine.set_controls(controls)
        model, dt = with_controls(engine.model, engine.controls[0])
        assert dt == number(controls.dt) == number(engine.controls[0, DT])
        assert model.eos.stiffness == number(controls.stiffness)
        if model.effects.xsph is not None:
            scale = 2 * controls.xsph * float(model.constants.density_scale)
            assert model.effects.xsph.scale == number(scale)
        # all else stays
        named = {"eos", "effects"}
        for name in set(model._fields) - named:
            assert getattr(model, name) is getattr(engine.model, name)


def test_controls_that_a_call_may_still_read_stay_as_they_were():
    engine = simulation("open space").engine
    before = engine.controls
    kept = before.copy()
    engine.set_controls(CONTROLS[0])
    assert engine.controls is not before
    assert (before == kept).all()


def test_a_copy_has_records_of_its_own_arrays():
    sim = simulation("everything")
    twin = copy.deepcopy(sim)
    assert sim.engine.records()[0].tobytes() != twin.engine.records()[0].tobytes()


def test_a_stiffness_beyond_single_precision_is_infinite():
    engine = simulation("none", dtype="float32").engine
    engine.set_controls(Controls(1e-4, 1e300, 0.0))
    with np.errstate(over="ignore"):
        model, _ = with_controls(engine.model, engine.controls[0])
    assert np.isinf(model.eos.stiffness)
