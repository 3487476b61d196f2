import inspect
import math
from types import SimpleNamespace

import pytest

from sph_gym import scenes
from sph_gym.solver import confinement
from sph_gym.solver import effects as solver_effects
from sph_gym.studies import absence, effects, variants
from sph_gym.studies.absence import EVERY, TERMS, Build, count_in

DX = 0.05


# --- Variants -------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", variants.EFFECTS)
def test_variants(effect):
    scene = scenes.make("dam_break", dx=0.1)
    without = variants.left_out(scene, effect)
    assert not variants.names(without, effect)
    assert variants.left_out(without, effect) is without
    for other in variants.EFFECTS:
        if other != effect:
            assert variants.names(without, other) == variants.names(scene, other)
    if effect == "walls":
        with pytest.raises(ValueError, match="no boundary particles"):
            variants.added(without, effect)
    else:
        assert variants.names(variants.added(without, effect), effect)


@pytest.mark.parametrize("name", scenes.names())
def test_any_effect_can_be_left_out_of_any_scene(name):
    scene = scenes.make(name)
    ends = () if scene.walls is None else (scene.walls.period_x, scene.walls.period_y)
    for effect in variants.EFFECTS:
        without = variants.left_out(scene, effect)
        assert not variants.names(without, effect)
        if effect == "walls" or (effect == "box" and ends and None not in ends):
            with pytest.raises(ValueError, match="can be added"):
                variants.added(without, effect)
        else:
            assert variants.names(variants.added(without, effect), effect)


# --- Counting -------------------------------------------------------------------------------

LISTING = """
	.type	main,@function
main:
	.cfi_startproc
	movabsq	$helper, %rax
	callq	*%rax
.LBB0_1:
	nop
.LBB0_2:
	vsqrtpd	%ymm0, %ymm1
	vdivpd	%ymm0, %ymm1, %ymm2
	jne	.LBB0_2
	jne	.LBB0_1
	retq
	.size	main, .Lfunc_end0-main
	.type	cpython.main,@function
cpython.main:
	nop
	.size	cpython.main, .Lfunc_end1-cpython.main
	.type	helper,@function
helper:
	retq
	.size	helper, .Lfunc_end2-helper
	.type	unused,@function
unused:
	nop
	.size	unused, .Lfunc_end3-unused
"""


def test_instructions_are_counted():
    assert count_in(LISTING) == (9, 3)
    with pytest.raises(ValueError, match="no functions"):
        count_in("main:\n\tnop\n")


def test_a_reciprocal_root_in_one_command_marks_a_pair_loop():
    listing = LISTING.replace("vsqrtpd", "vrsqrt14pd").replace("vdivpd", "vmulpd")
    assert count_in(listing) == (9, 3)
    with pytest.raises(ValueError, match="no loop over pairs"):
        count_in(listing.replace("vrsqrt14pd", "vmulpd"))


# --- Replacing ------------------------------------------------------------------------------


def test_an_identity_returns_what_the_function_does_without_its_part():
    found = absence.identity(confinement.confine, "box")
    assert found(None, 1, 2, "x", "y", "u", "v") == ("x", "y", "u", "v")
    assert found("a box", 1, 2, "x", "y", "u", "v") == ("x", "y", "u", "v")
    with pytest.raises(ValueError, match="expected an argument or a constant"):
        absence.identity(lambda part, x: [x], "part")


def test_every_term_can_be_replaced():
    known = {function.__name__: function for function in absence.solver_functions()}
    for name in {name for names in absence.TERMS.values() for name in names}:
        first = next(iter(inspect.signature(known[name]).parameters))
        assert absence.identity(known[name], first).__name__ == name
    sums = SimpleNamespace(cx=1, cy=2, ox=3, oy=4)
    assert absence.identity(known["add_crowding"], "effect")(None, None, sums) == (1, 2, 3, 4)


def test_guards_are_found_by_themselves():
    found = {function.__name__: function for function in absence.solver_functions()}
    guards = absence.guards(found["add_xsph"])
    assert list(guards) == [0]
    assert guards[0](None, "pair", "sx", "sy") == ("sx", "sy")
    assert absence.guards(found["add_pressure"]) == {}
    assert sum(bool(absence.guards(function)) for function in found.values()) > 30


def test_every_term_of_an_effect_is_replaced():
    terms = {name for name in vars(solver_effects) if name.startswith("add_")} - {"add_pressure"}
    assert terms <= {name for names in TERMS.values() for name in names}
    known = {function.__name__ for function in absence.solver_functions()}
    assert {name for names in TERMS.values() for name in names} <= known
    assert {*variants.EFFECTS} - {*TERMS} == {"walls"}


def test_rows_of_a_comparison():
    normal, identity = absence.Count(100, 11), absence.Count(100, 10)
    rows = list(effects.compared("xsph, a", normal, identity))
    assert [(row.value, row.holds) for row in rows] == [(0.0, True), (1.0, False)]
    assert list(effects.compared("xsph, a", None, None)) == []


def test_a_process_that_fails_is_reported():
    with pytest.raises(OSError, match=r"ended early and said: .*no_such_scene"):
        absence.count(Build("no_such_scene", DX))


def test_presence_is_timed():
    rows = list(effects.present("relaxation", 0.05, "laminar_viscosity", 1, 1000))
    assert [row.unit for row in rows] == [
        "% of a step", "ns/fluid particle", "bytes/fluid particle"
    ]  # fmt: skip
    assert {row.case for row in rows} == {"laminar_viscosity, relaxation"}
    assert all(math.isfinite(row.value) for row in rows)
    assert list(effects.present("relaxation", 0.05, "walls", 1, 1000)) == []


def named(scene, dx):
    made = scenes.make(scene, dx=dx)
    return [effect for effect in variants.EFFECTS if variants.names(made, effect)]


def test_all_effects_are_compared_in_every_scene():
    for scene, dx in effects.SPACINGS.items():
        found = [name for _, names in effects.comparisons(scene, dx) for name in names]
        assert sorted(found) == sorted({*TERMS, EVERY, *named(scene, dx)})


def test_a_difference_is_traced_to_its_effect(monkeypatch):
    def count(build):
        return absence.Count(99 if "shifting" in build.identity else 100, 10)

    monkeypatch.setattr(absence, "count", count)
    rows = effects.absent(Build("dam_break", DX), ("plates", "shifting", "motion"))
    failed = [row for row in rows if not row.holds]
    assert [(row.case, row.value) for row in failed] == [("shifting, dam_break", 1.0)]


@pytest.mark.slow
@pytest.mark.parametrize(("build", "names"), effects.comparisons("dam_break", DX))
def test_an_absent_effect_costs_no_instruction(build, names):
    rows = list(effects.absent(build, names))
    assert [row.value for row in rows] == [0.0, 0.0] * len(names)


@pytest.mark.slow
def test_a_term_that_does_something_is_found_by_its_instructions():
    normal, identity = (absence.count(Build("dam_break", DX, "", n)) for n in ((), ("xsph",)))
    # around the loop, other instructions than before may be a few more
    assert identity.whole != normal.whole
    assert identity.loop < normal.loop
