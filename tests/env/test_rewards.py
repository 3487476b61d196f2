import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sph_gym import scenes
from sph_gym.env import rewards
from sph_gym.env.reference import WINDOW, Observables, ReferenceRun, recent, spread
from sph_gym.env.rewards import Errors, Judge, Tolerances

SCENE = scenes.make("relaxation", dx=0.05)
N = 20
ERROR = st.floats(0, 1e12)
CALM = Errors(0.5, 0.5, 0.5, 0.5)


def run(com=0.0, kinetic=1.0):
    flat = np.zeros(N + 1)
    return Observables(
        np.full((N + 1, 2), com), np.zeros((N + 1, 2)), np.full(N + 1, kinetic), flat, flat
    )


def judge(*twins, own=None):
    widths = spread(run(), twins or (run(),), own or run())
    return Judge(ReferenceRun(run(), widths, 5.0), SCENE, 1e-9, Tolerances())


def numbers(**changes):
    places = ("com_x", "com_y", "extent_x", "extent_y")
    others = ("density_error", "density_error_p99", "clumping", "velocity_noise")
    calm = dict.fromkeys((*places, *others), 0.0)
    return calm | {"kinetic_energy": 1.0} | changes


@given(st.tuples(ERROR, ERROR, ERROR, ERROR), st.floats(1e-3, 1e3))
def test_terms_are_bounded_and_only_one_speaks(errors, work):
    terms = rewards.terms(Errors(*errors), work)
    assert set(terms) == set(rewards.TERMS)
    assert sum(value != 0 for value in terms.values()) <= 1
    assert -rewards.WORST <= sum(terms.values()) <= 1.0
    assert (terms["work"] != 0) <= (max(errors) <= 1)


def test_work_pays_by_its_ratio_to_the_rule():
    paid = [rewards.terms(CALM, work)["work"] for work in (0.0, 1.0, 2.0, 4.0, 1e9)]
    assert paid == pytest.approx([1.0, 0.5, 0.0, -1.0, -1.0])


@given(st.lists(st.floats(1e-3, rewards.MOST_WORK), min_size=1, max_size=30))
def test_uneven_work_earns_no_more_than_even_work(spent):
    even = len(spent) * rewards.terms(CALM, float(np.mean(spent)))["work"]
    assert sum(rewards.terms(CALM, work)["work"] for work in spent) == pytest.approx(even)


@given(ERROR.filter(lambda error: error > 1), st.floats(1e-3, 1e9))
def test_no_infidelity_is_cheaper_than_any_work(error, work):
    unfaithful = sum(rewards.terms(Errors(0.0, 0.0, 0.0, error), work).values())
    assert unfaithful <= rewards.terms(CALM, rewards.MOST_WORK)["work"]


def test_the_penalty_is_booked_to_the_worst_error():
    for k, name in enumerate(Errors._fields):
        errors = [2.0, 3.0, 1.5, 4.0]
        errors[k] = 5.0
        terms = rewards.terms(Errors(*errors), 1.0)
        assert terms[name] == pytest.approx(-(1.0 + np.log10(5.0)))


def test_no_early_death_pays():
    worst_alive = rewards.terms(Errors(1e9, 0, 0, 0), 1.0)["density"]
    for left in (1, 10, 100):
        assert rewards.blowup_terms(left)["blowup"] <= left * worst_alive


def test_one_bad_frame_is_forgiven_after_the_window():
    watch = judge()
    off = numbers(com_x=3 * SCENE.dx)
    errors = [watch.errors(frame, off).fidelity for frame in range(1, N)]
    assert errors[0] == pytest.approx(3.0)
    assert errors[WINDOW] == pytest.approx(0.0)


# One drift of each kind that is judged.
DRIFTS = {"com": {"com_x": 5 * SCENE.dx}, "extent": {"extent_x": 5 * SCENE.dx}}


@pytest.mark.parametrize("kind", DRIFTS)
@pytest.mark.parametrize("role", ["twin", "own"])
def test_what_equally_good_runs_drift_widens_the_tolerance_of_drifts(kind, role):
    drifting = run()._replace(**{kind: np.linspace(0, 1, N + 1)[:, None] * [1.0, 0.0]})
    widened = judge(drifting) if role == "twin" else judge(own=drifting)
    off = numbers(**DRIFTS[kind])
    assert widened.errors(5, off).fidelity < judge().errors(5, off).fidelity


@pytest.mark.parametrize("name", ["clumping", "noise"])
def test_the_own_run_widens_no_tolerance_but_those_of_drifts(name):
    high = run()._replace(**{name: np.linspace(0, 1, N + 1)})
    alone, own, twin = (
        spread(run(), twins, last)
        for twins, last in (((run(),), run()), ((run(),), high), ((high,), run()))
    )
    assert np.array_equal(own, alone)
    assert (twin[1:, 3 + (name == "noise")] > 0).all()


def reference(**series):
    """A reference whose twins are the same as its fine run."""
    fine = run()._replace(**{name: np.asarray(values) for name, values in series.items()})
    return ReferenceRun(fine, spread(fine, (fine,), fine), 5.0)


def test_clumping_counts_only_beyond_the_reference():
    lumpy = reference(clumping=np.full(N + 1, 0.3))
    watch = Judge(lumpy, SCENE, 1e-9, Tolerances())
    assert watch.errors(1, numbers(clumping=0.3)).clumping == 0.0
    more = 0.3 + Tolerances().clumping
    assert watch.errors(2, numbers(clumping=more)).clumping == pytest.approx(1.0)


def test_the_noise_of_some_steps_counts_beyond_that_of_the_reference():
    unit = (SCENE.fluid.c0 / 10) ** 2
    usual, much = 0.02 * unit, 0.05 * unit
    watch = Judge(reference(noise=np.full(N + 1, usual)), SCENE, 1e-9, Tolerances())
    errors = [watch.errors(1, numbers(velocity_noise=usual)).noise]
    errors += [watch.errors(k, numbers(velocity_noise=much)).noise for k in range(2, N)]
    # the mean of the start, which is the reference's, one usual step and one of much noise
    expected = (2 * usual + much) / 3 - usual
    assert errors[:2] == pytest.approx([0.0, expected / (Tolerances().noise * unit)])
    assert errors[-1] == pytest.approx((much - usual) / (Tolerances().noise * unit))
    assert np.diff(errors).min() > -1e-9


def test_less_noise_and_less_clumping_than_the_reference_are_no_error():
    noisy = reference(noise=np.ones(N + 1), clumping=np.full(N + 1, 0.5))
    found = Judge(noisy, SCENE, 1e-9, Tolerances()).errors(1, numbers())
    assert (found.noise, found.clumping) == (0.0, 0.0)


def test_recent_values_are_means_of_the_window():
    values = np.random.default_rng(0).random(N + 1)
    naive = [values[max(k + 1 - WINDOW, 0) : k + 1].mean() for k in range(N + 1)]
    assert recent(values) == pytest.approx(naive)


def test_a_fluid_that_spreads_is_not_faithful():
    watch = judge()
    assert watch.errors(1, numbers(extent_y=2 * SCENE.dx)).fidelity == pytest.approx(2.0)


def test_given_tolerances_replace_the_usual_ones():
    assert rewards.check_tolerances({"com_drift": 3}) == Tolerances(com_drift=3.0)
    assert rewards.check_tolerances(None) == Tolerances()


@pytest.mark.parametrize(
    "weights",
    [{"speed": 1.0}, {"work": float("nan")}, {"work": "much"}, {"work": 1e308}, {"density": -1e7}],
)
def test_wrong_weights_are_refused(weights):
    with pytest.raises(ValueError, match="reward_weights"):
        rewards.check_weights(weights)


def test_the_heaviest_weights_leave_rewards_finite():
    weights = rewards.check_weights(dict.fromkeys(rewards.TERMS, rewards.HEAVIEST))
    worst = weights["blowup"] * rewards.blowup_terms(10**9)["blowup"]
    assert np.isfinite(np.float32(worst))
