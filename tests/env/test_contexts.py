"""Contexts: their shares and ranges in every set, and what they make of a scene."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from sph_gym import scenes
from sph_gym.controllers import TunedCfl
from sph_gym.env import SCENES, contexts, instances
from sph_gym.env.contexts import BETWEEN, BEYOND_DAMPED, BEYOND_NOISY, DAMPED, KINDS, NOISY, Context
from sph_gym.env.distributions import FAMILIES, SHIFTS, draw
from sph_gym.env.fingerprint import fingerprint
from sph_gym.solver import target
from sph_gym.studies.episodes import run

# Sets whose contexts are drawn as usual.
USUAL_SETS = ("train", "val", "test")
NOISY_FLOW = Context(0.005, 2.4)


def drawn(split, scene="dam_break"):
    return [
        draw(scene, split, number, FAMILIES[scene].dx).context
        for number in range(instances.SIZES[split])
    ]


def inside(value, ends):
    return ends[0] <= value <= ends[1]


@pytest.mark.parametrize("split", USUAL_SETS)
def test_about_half_are_noisy_and_half_damped_in_every_set(split):
    kinds = [context.kind for context in drawn(split)]
    assert kinds == [KINDS[number % len(KINDS)] for number in range(len(kinds))]
    shares = Counter(kinds)
    assert abs(shares["noisy"] - shares["damped"]) <= 1
    assert 0 < shares["plain"] <= len(kinds) / 8 + 1


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("split", USUAL_SETS)
def test_numerics_are_in_the_ranges_of_their_kind(scene, split):
    for context in drawn(split, scene):
        assert context == context._replace(kernel="mueller", viscosity=0.0)
        assert context.integrator == "symplectic_euler"
        if context.kind == "noisy":
            assert inside(context.alpha, NOISY)
            assert inside(context.support, contexts.NARROW)
        elif context.kind == "damped":
            assert inside(context.alpha, DAMPED)
            assert inside(context.support, contexts.WIDE)
        else:
            assert context == Context()


def test_alphas_fill_their_ranges_at_equal_ratios():
    train = drawn("train")
    for kind, (low, high) in (("noisy", NOISY), ("damped", DAMPED)):
        found = np.array([context.alpha for context in train if context.kind == kind])
        place = np.log(found / low) / np.log(high / low)
        assert len(set(found)) == len(found)
        assert place.mean() == pytest.approx(0.5, abs=0.1)
        assert place.min() < 0.1
        assert place.max() > 0.9


def test_contexts_of_other_sets_and_environments_are_others():
    found = [context.alpha for split in USUAL_SETS for context in drawn(split)]
    found += [context.alpha for context in drawn("train", "drop_impact")]
    found = [alpha for alpha in found if alpha != Context().alpha]
    assert len(set(found)) == len(found)


def test_a_flow_is_the_same_however_its_context_is_drawn(monkeypatch):
    before = draw("dam_break", "val", 3, 0.04)
    monkeypatch.setattr(contexts, "draw", lambda rng, number: Context())
    after = draw("dam_break", "val", 3, 0.04)
    assert before.arguments == after.arguments
    assert before.context != after.context == Context()


# --- Out of distribution --------------------------------------------------------------------


@pytest.mark.parametrize("scene", SCENES)
def test_each_shift_of_the_numerics_is_in_no_other_set(scene):
    odd = drawn("ood", scene)
    shown = {shift: (odd[k], odd[k + len(SHIFTS)]) for k, shift in enumerate(SHIFTS)}
    assert all(inside(one.alpha, BETWEEN) for one in shown["between"])
    weak, strong = shown["beyond"]
    assert inside(weak.alpha, BEYOND_NOISY)
    assert inside(strong.alpha, BEYOND_DAMPED)
    assert tuple(one.kernel for one in shown["kernel"]) == contexts.MATCHED
    assert all(inside(one.viscosity, contexts.LAMINAR) for one in shown["viscosity"])
    assert tuple(one.integrator for one in shown["integrator"]) == contexts.INTEGRATORS
    for shift in ("resolution", "strength", "scene"):
        assert all(one == one._replace(kernel="mueller", viscosity=0.0) for one in shown[shift])
        assert all(one.integrator == "symplectic_euler" for one in shown[shift])
    # a shift of the numerics leaves the rest of a context as it is
    for shift in ("kernel", "viscosity", "integrator"):
        assert all(one.kind in KINDS for one in shown[shift])
        assert all(inside(one.alpha, NOISY) or inside(one.alpha, DAMPED) or one.alpha == 0.02
                   for one in shown[shift])  # fmt: skip


def test_the_ends_what_is_between_and_what_is_beyond_do_not_overlap():
    ranges = [BEYOND_NOISY, NOISY, (0.02, 0.02), BETWEEN, DAMPED, BEYOND_DAMPED]
    ends = [end for one in ranges for end in one]
    assert ends == sorted(ends)


@pytest.mark.parametrize(
    ("alpha", "kind"),
    [
        (BEYOND_NOISY[0], "noisy"), (NOISY[1], "noisy"), (0.02, "plain"), (DAMPED[0], "damped"),
        (BEYOND_DAMPED[1], "damped"), (0.0, "noisy"),
    ],
)  # fmt: skip
def test_kinds_go_by_alpha(alpha, kind):
    assert Context(alpha).kind == kind


# --- Scenes ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_a_context_changes_the_numerics_and_nothing_else(name):
    plain = scenes.make(FAMILIES[name].scene, dx=FAMILIES[name].dx)
    shown = NOISY_FLOW.apply(plain)
    assert shown.effects.artificial_viscosity == 0.005
    assert shown.h == pytest.approx(2.4 * plain.dx)
    # back again it is the same scene, but for what a context can't know
    usual = contexts.of(plain)
    assert fingerprint(usual.apply(plain)) == fingerprint(plain)
    assert fingerprint(usual.apply(shown)) == fingerprint(plain)
    for kept in ("x", "v", "dx", "duration", "frame", "walls"):
        assert getattr(shown, kept) is getattr(plain, kept) or np.array_equal(
            getattr(shown, kept), getattr(plain, kept)
        )
    assert shown.fluid.c0 == plain.fluid.c0
    assert shown.effects.gravity == plain.effects.gravity
    assert shown.effects.laminar_viscosity == plain.effects.laminar_viscosity
    assert shown.effects.surface_tension == plain.effects.surface_tension


@pytest.mark.parametrize(
    "context",
    [
        Context(), NOISY_FLOW, Context(0.15), Context(0.0), Context(kernel="cubic_spline"),
        Context(viscosity=0.005), Context(integrator="kick_drift_kick"),
    ],
    ids=str,
)  # fmt: skip
def test_what_is_put_into_a_scene_is_read_from_it(context):
    scene = context.apply(scenes.make("patch_impact", dx=0.1))
    found = contexts.of(scene)
    assert (found.kernel, found.integrator) == (context.kernel, context.integrator)
    assert found[:2] == pytest.approx(context[:2])
    assert found.viscosity == pytest.approx(context.viscosity)


@pytest.mark.parametrize("name", SCENES)
def test_the_nominal_instance_is_the_scene_itself(name):
    family = FAMILIES[name]
    nominal = instances.instance(name, "nominal", 0)
    assert nominal.drawn.context is None
    plain, built = scenes.make(family.scene, dx=family.dx), nominal.build()
    assert built.frame == pytest.approx(family.frames_per_step * plain.frame)
    assert fingerprint(replace(built, frame=plain.frame)) == fingerprint(plain)


@pytest.mark.parametrize("id_", ["dam_break/val/0", "dam_break/val/1", "relaxation/test/8"])
def test_an_instance_has_the_context_that_was_drawn(id_):
    flow = instances.parse(id_)
    found = contexts.of(flow.build())
    assert found.kind == flow.drawn.context.kind
    assert found[:2] == pytest.approx(flow.drawn.context[:2])


# --- What contexts ask for ------------------------------------------------------------------

GAMES = [scene for scene in SCENES if scene not in instances.DIAGNOSTIC]


def earned(id_, epsilon):
    """Reward of the tuned rule with an epsilon of its own."""

    def policy(env, observation):
        return env.action_toward(TunedCfl()(env.sim)._replace(xsph=epsilon))

    return run(id_.split("/")[0], id_, policy).reward


def rule(env, observation):
    return env.action_toward(TunedCfl()(env.sim))


# Flows on which the rule is beyond its tolerance in more than 5 % of the steps: some of the twelve
# of 96 that `study headroom` counts, with the bound that they miss.
BEYOND = {"dam_break/val/0", "shaken_tank/val/1"}
# One more, in 7 % of the steps, with vectors of 512 bits: they add in another order.
if target.BITS == 512:
    BEYOND |= {"drop_impact/val/8"}


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1, 8], ids=["noisy", "damped", "plain"])
@pytest.mark.parametrize("scene", GAMES)
def test_the_tuned_rule_keeps_within_tolerance_in_every_context(scene, number, request):
    if f"{scene}/val/{number}" in BEYOND:
        request.applymarker(pytest.mark.xfail(reason="known and published", strict=True))
    assert run(scene, f"{scene}/val/{number}", rule).within


def test_no_epsilon_is_right_in_every_context():
    noisy, damped = "dam_break/val/0", "patch_impact/val/1"
    assert earned(noisy, 0.6) > earned(noisy, 0.0) + 0.2
    assert earned(damped, 0.15) > earned(damped, 1.0) + 0.2
