import math

import numpy as np
import pytest

from sph_gym.recommend import advice, trial_runs
from sph_gym.recommend.settings import nominal
from tests.recommend.made_up import DROP, offered, samples


def test_another_case_corrects_what_is_promised():
    [line] = offered(samples())
    better = trial_runs.corrected(line, {10: (3 * 0.02, 2 * 100.0 * 10**3)})
    # what was run has no doubt, all else a margin
    margin = trial_runs.MARGIN
    assert better.promised == pytest.approx(3 * margin * line.promised)
    assert better.at(10).promised == pytest.approx(3 * 0.02)
    assert better.at(11).promised == pytest.approx(3 * margin * 0.2 / 11)
    assert better.error == pytest.approx(3 * line.error)
    assert better.effort == pytest.approx(2 * line.effort)
    lucky = trial_runs.corrected(line, {10: (1e-4, line.effort[0])})
    assert lucky.promised == pytest.approx(margin * line.promised)
    both = {10: (3 * 0.02, 100.0 * 10**3), 40: (2 * 0.005, 100.0 * 40**3)}
    bent = trial_runs.corrected(line, both)
    assert bent.promised == pytest.approx(margin * np.array([0.06, 6**0.5 * 0.01, 0.01]))
    assert trial_runs.corrected(line, {}) is line


def test_where_nothing_promises_enough_the_finest_is_run():
    """Coarse runs are bad in this case, and the finest is as good as ever."""
    lines = offered(samples())

    def probe(setting):
        return 0.2 / setting.across * (1 + 4 * (setting.across == 10)), 100.0 * setting.across**3

    settled = trial_runs.settle(lines, lambda lines: advice.for_error(lines, 0.006), probe)
    assert settled.choice.setting.across == 40
    assert settled.error == pytest.approx(0.005)
    assert trial_runs.settle(
        lines, lambda lines: advice.for_error(lines, 0.004), probe
    ).choice is None  # fmt: skip


def test_the_choice_is_made_anew_until_it_is_corrected():
    lines = offered([*samples(), *samples(1 / 3, dtype="float32")])

    def probe(setting):
        factor = 10 if setting.dtype == "float32" else 1
        return factor * 0.2 / setting.across, 100.0 * setting.across**3

    def choose(lines):
        return advice.for_error(lines, 0.01)

    settled = trial_runs.settle(lines, choose, probe)
    assert settled.choice.setting == nominal(DROP, 25)
    assert settled.error == pytest.approx(0.008)
    blown = trial_runs.settle(lines, choose, lambda setting: (math.nan, 1.0))
    assert (blown.choice, blown.series) == (None, [])


def test_the_choice_itself_is_run_in_another_case_and_withdrawn_if_it_fails():
    """A harder case, in which the coarsest runs go well and what would be advised blows up."""
    lines = offered([*samples(), *samples(1 / 3, dtype="float32")])
    run = []

    def probe(setting):
        run.append(setting)
        bad = setting.dtype == "float32" and setting.across > 10
        pace = 1 / 3 if setting.dtype == "float32" else 1.0
        return math.nan if bad else 0.2 / setting.across, 100.0 * pace * setting.across**3

    def choose(lines):
        return advice.for_error(lines, 0.01)

    settled = trial_runs.settle(lines, choose, probe)
    assert settled.choice.setting == nominal(DROP, 25)
    [(first, blown), (second, error)] = settled.trials
    assert first.setting == run[1] == nominal(DROP, 25)._replace(dtype="float32")
    assert math.isnan(blown)
    assert (second.setting, error) == (nominal(DROP, 25), pytest.approx(0.008))
    # an error above the promise makes the choice finer
    worse = trial_runs.settle(
        lines[:1], choose, lambda s: (0.2 / s.across * (1 + (s.across >= 20)), 100.0 * s.across**3)
    )
    assert worse.choice.setting.across == 40
    # what would take too long is told as it is
    dear = trial_runs.settle(lines[:1], choose, probe, affordable=2e5)
    assert dear.choice.setting.across == 25
    assert math.isnan(dear.error)
