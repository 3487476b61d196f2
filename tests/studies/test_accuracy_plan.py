import math
from dataclasses import replace

import pytest

from sph_gym.studies.accuracy import gains, plan, policies, problems
from sph_gym.studies.accuracy.settings import nominal

DROP = replace(problems.problem("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
SMALL = plan.Plan(
    scenes=("elliptical_drop",), widths=(0.9,), steps=(1.5,), sounds=(0.5,), epsilons=(),
    kernels=(), densities=(), dtypes=(), integrators=(), controllers=(), repeats=1,
)  # fmt: skip


def test_every_sweep_turns_one_knob_and_every_setting_is_run_once():
    turned = list(plan.sweeps(plan.FULL, DROP))
    start = turned[0][1]
    assert turned[0] == ("nominal", nominal(DROP))
    assert len({setting for _, setting in turned}) == len(turned)
    for knob, setting in turned[1:]:
        name = "across" if knob == "resolution" else knob
        differing = {f for f in setting._fields if getattr(setting, f) != getattr(start, f)}
        assert name in differing
        assert differing <= {name, "across"}
    swept = {knob for knob, _ in turned}
    assert swept == {
        "nominal", "resolution", "width", "step", "sound", "kernel", "density", "dtype",
        "integrator", "xsph", "controller",
    }  # fmt: skip


def test_walls_limit_what_is_swept():
    problem = problems.problem("dam_break")
    turned = list(plan.sweeps(plan.FULL, problem))
    assert all(setting.width <= problem.widest for _, setting in turned)
    assert "density" not in {knob for knob, _ in turned}


class Faked:
    """A run whose error and work follow from its setting."""

    def __init__(self, setting, good=True):
        self.setting = setting
        self.error = 0.1 / setting.across * (1.01 if setting.step > 1 else 1.0)
        self.interactions = setting.across**3 / setting.step * setting.sound
        self.good = good


def test_settings_are_combined_while_they_pay():
    small = SMALL._replace(controllers=())
    found = {setting: Faked(setting) for _, setting in plan.sweeps(small, DROP)}
    chain = []
    for line in plan.lines(small, DROP, found):
        chain.append(line)
        found |= {s: Faked(s) for s in plan.ladder(small, DROP, line)}
    assert [(line.step, line.sound) for line in chain] == [(1.5, 1.0), (1.5, 0.5)]
    assert all(line.across == 0 for line in chain)


def test_a_line_that_blew_up_is_not_built_upon():
    small = SMALL._replace(controllers=())
    found = {setting: Faked(setting) for _, setting in plan.sweeps(small, DROP)}
    chain = []
    for line in plan.lines(small, DROP, found):
        chain.append(line)
        found |= {s: Faked(s, line.step == 1.0) for s in plan.ladder(small, DROP, line)}
    assert [(line.step, line.sound) for line in chain] == [(1.5, 1.0), (1.0, 0.5)]


def test_a_gain_is_the_lower_median_of_all_resolutions():
    ladder = [Faked(nominal(DROP, n)) for n in (6, 8, 10)]
    faster = [Faked(run.setting._replace(sound=0.5)) for run in ladder]
    assert gains.gain(ladder, faster, "interactions") == pytest.approx(2.0)
    # an error that crosses zero at one resolution buys nothing
    faster[1].error = 1e-9
    assert gains.gain(ladder, faster, "interactions") == pytest.approx(2.0, rel=0.1)
    assert math.isnan(gains.gain(ladder, faster[:1], "interactions"))
    faster[0].good = False
    assert math.isnan(gains.gain(ladder, faster, "interactions"))


def test_agents_are_where_they_can_be():
    assert policies.available("lookahead", "dam_break")
    assert not policies.available("lookahead", "couette")
    assert policies.available("tuned_cfl", "couette")
    assert not policies.available("ppo", "couette")


def test_an_unknown_scene_is_told_the_known_ones():
    with pytest.raises(ValueError, match="expected one of elliptical_drop"):
        problems.problem("lake")
