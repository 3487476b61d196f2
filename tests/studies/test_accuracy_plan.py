import math
from dataclasses import replace

import pytest

from sph_gym.recommend.settings import nominal
from sph_gym.scenes.shared.refinement import refinement
from sph_gym.studies.accuracy import analysis, plan, points

DROP = replace(refinement("elliptical_drop"), sizes=(6, 8, 10), nominal=8)
ONE_EACH = {"width": (0.9,), "step": (1.5,), "sound": (0.5,)}
SMALL = plan.StudyPlan(scenes=("elliptical_drop",), values=ONE_EACH, repeats=1)


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
    case = refinement("dam_break")
    turned = list(plan.sweeps(plan.FULL, case))
    assert all(setting.width <= case.widest for _, setting in turned)
    assert "density" not in {knob for knob, _ in turned}


class Faked:
    """A run whose error and work follow from its setting."""

    cause = ""

    def __init__(self, setting, good=True, knob="", slower=0.6):
        self.setting, self.knob = setting, knob
        self.error = 0.1 / setting.across * (1.01 if setting.step > 1 else 1.0)
        self.interactions = setting.across**3 / setting.step * setting.sound
        self.effort = self.interactions * (1.0 if setting.dtype == "float64" else slower)
        self.compression, self.mach = 0.001, 0.1
        self.good = good


def test_settings_are_combined_while_they_pay():
    found = {setting: Faked(setting) for _, setting in plan.sweeps(SMALL, DROP)}
    chain = []
    for line in plan.combined(SMALL, DROP, found):
        chain.append(line)
        found |= {s: Faked(s) for s in plan.at_all_sizes(SMALL, DROP, line)}
    assert [(line.step, line.sound) for line in chain] == [(1.5, 1.0), (1.5, 0.5)]
    assert all(series.across == 0 for series in chain)


def test_the_best_values_are_also_run_by_themselves():
    small = SMALL._replace(values=ONE_EACH | {"width": (0.8, 0.9)})
    found = {setting: Faked(setting) for _, setting in plan.sweeps(small, DROP)}
    for run in found.values():
        run.interactions *= run.setting.width
    # dt is left to the chain, since no error depends on it by chance
    assert plan.alone(small, DROP, found) == [
        nominal(DROP).series._replace(width=2.72),
        nominal(DROP).series._replace(sound=0.5),
    ]
    assert plan.alone(small._replace(chain=False), DROP, found) == []


def test_a_line_that_blew_up_is_not_built_upon():
    found = {setting: Faked(setting) for _, setting in plan.sweeps(SMALL, DROP)}
    chain = []
    for line in plan.combined(SMALL, DROP, found):
        chain.append(line)
        found |= {s: Faked(s, line.step == 1.0) for s in plan.at_all_sizes(SMALL, DROP, line)}
    assert [(line.step, line.sound) for line in chain] == [(1.5, 1.0), (1.0, 0.5)]


@pytest.mark.parametrize(("slower", "dtype"), [(0.6, "float32"), (1.5, "float64")])
def test_precision_is_chosen_by_measured_effort(slower, dtype):
    """With a kernel whose tail is below its normal numbers, float32 takes longer."""
    more = {"dtype": ("float32", "float64"), "controller": ("tuned_cfl",)}
    small = SMALL._replace(values=ONE_EACH | more)
    found = {setting: Faked(setting, slower=slower) for _, setting in plan.sweeps(small, DROP)}
    chain = []
    for line in plan.combined(small, DROP, found):
        chain.append(line)
        found |= {s: Faked(s, slower=slower) for s in plan.at_all_sizes(small, DROP, line)}
    assert {line.dtype for line in chain[:-1]} == {dtype}
    # the rule stands by itself, so that its own gain can be told
    assert chain[-1] == nominal(DROP).series._replace(controller="tuned_cfl")


def test_a_fluid_that_is_too_soft_is_neither_combined_nor_best():
    found = {setting: Faked(setting) for _, setting in plan.sweeps(SMALL, DROP)}
    for setting, run in found.items():
        run.knob = "sound" if setting.sound < 1 else "resolution"
        run.compression = 0.03 if setting.sound < 1 else 0.001
    chain = []
    for line in plan.combined(SMALL, DROP, found):
        chain.append(line)
        found |= {s: Faked(s) for s in plan.at_all_sizes(SMALL, DROP, line)}
    assert [(line.step, line.sound) for line in chain] == [(1.5, 1.0)]
    assert plan.alone(SMALL, DROP, found) == []
    points = [run for run in found.values() if run.setting.step == 1.0]
    assert analysis.best_value(points, "sound", "interactions") is None
    for run in points:
        run.compression = 0.001
    assert analysis.best_value(points, "sound", "interactions").gain == pytest.approx(2.0)


def test_erratic_scenes_are_swept_and_not_combined():
    erratic = replace(DROP, erratic=True)
    found = {setting: Faked(setting) for _, setting in plan.sweeps(plan.FULL, erratic)}
    assert len({s.across for s in found if s.step == 1.5}) == plan.FEWER
    assert list(plan.combined(SMALL, erratic, found)) == plan.alone(SMALL, erratic, found) == []


def gain(own, tried):
    return analysis.gain_of_series(own, tried, "interactions").gain


def test_a_gain_is_the_lower_median_of_all_resolutions():
    ladder = [Faked(nominal(DROP, n)) for n in (6, 8, 10)]
    faster = [Faked(run.setting._replace(sound=0.5)) for run in ladder]
    assert gain(ladder, faster) == pytest.approx(2.0)
    # an error that crosses zero at one resolution buys nothing
    faster[1].error = 1e-9
    assert gain(ladder, faster) == pytest.approx(2.0, rel=0.1)
    assert math.isnan(gain(ladder, faster[:1]))
    faster[0].good = False
    assert math.isnan(gain(ladder, faster))


def test_a_gain_compares_errors_at_common_resolutions():
    ladder = [Faked(nominal(DROP, n)) for n in (6, 8, 10, 14, 20)]
    # a late one that counts for all that are coarser
    ladder[-1].error = 1.0
    same = [Faked(run.setting._replace(sound=0.5)) for run in ladder[:3]]
    assert gain(ladder, same) == pytest.approx(2.0)


def test_what_a_value_buys_is_that_over_all_resolutions():
    start = [Faked(nominal(DROP, n), knob="resolution") for n in (6, 8, 10, 14, 20)]
    lucky = [Faked(run.setting._replace(kernel="spiky"), knob="kernel") for run in start]
    honest = [Faked(run.setting._replace(kernel="mueller"), knob="kernel") for run in start[:3]]
    for run in lucky:
        run.error = 0.1 / (10 + run.setting.across / 2)
    for run in lucky[3:]:
        run.knob = analysis.COMBINED
    points = [*start, *lucky, *honest]
    values = analysis.value_gains(points, "kernel", "interactions")
    by_value = {found.value: found for found in values}
    assert by_value["spiky"].gain > 2
    assert by_value["spiky"].sizes == 3
    found = analysis.best_value(points, "kernel", "interactions")
    assert (found.value, found.sizes) == ("spiky", 5)
    assert found.gain < by_value["spiky"].gain


def test_steps_beyond_the_longest_are_never_the_best():
    start = [Faked(nominal(DROP, n), knob="resolution") for n in (6, 8, 10)]
    turned = [
        Faked(run.setting._replace(step=step), knob="step") for run in start for step in (1.5, 2.0)
    ]
    for run in turned:
        run.error = 0.1 / run.setting.across
    assert analysis.best_value([*start, *turned], "step", "interactions").value == "1.5"


def test_agents_are_where_they_can_be():
    assert points.available("lookahead", "dam_break")
    assert not points.available("lookahead", "couette")
    assert points.available("tuned_cfl", "couette")
    assert points.available("ppo_warm-absolute", "dam_break")
    assert not points.available("ppo_warm-absolute", "couette")


def test_an_unknown_scene_is_answered_with_the_known_ones():
    with pytest.raises(ValueError, match="expected one of elliptical_drop"):
        refinement("lake")
