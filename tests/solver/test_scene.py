"""Everything wrong is said at the door, in a ValueError that names the argument."""

import math

import numpy as np
import pytest

from sph_gym import (
    Controls,
    Effects,
    Fluid,
    Gravity,
    Scene,
    Simulation,
    Walls,
    scenes,
    sound_speed,
)
from tests.cases import WATER, scene

NO_NUMBER = ["fast", None, [1.0], math.nan, math.inf, 1j]
NOT_POSITIVE = [*NO_NUMBER, 0.0, -1.0]
NOT_FROM_ZERO = [*NO_NUMBER, -1e-9]


def table(*rows):
    """(argument, wrong values) as (argument, wrong value)."""
    return pytest.mark.parametrize(
        ("argument", "value"),
        [
            pytest.param(name, value, id=f"{name}={str(value)[:30]}".replace("\n", ""))
            for name, values in rows
            for value in values
        ],
    )


def refuses(argument, make, **arguments):
    with pytest.raises(ValueError, match=rf"\b{argument}\b"):
        make(**arguments)


@table(
    ("c0", NOT_POSITIVE),
    ("rho0", NOT_POSITIVE),
    ("gamma", [*NO_NUMBER, 0.99, -7.0]),
    ("kernel", ["gauss", "", None, 7, ["mueller"]]),
    ("eos", ["ideal", None, 1.0]),
    ("clamp", ["no", None, 2.0]),
)
def test_fluid(argument, value):
    refuses(argument, Fluid, **({"c0": 10.0} | {argument: value}))


@table(
    ("artificial_viscosity", [value for value in NOT_FROM_ZERO if value is not None]),
    ("laminar_viscosity", [value for value in NOT_FROM_ZERO if value is not None]),
    ("gravity", [9.81, (9.81,), (0, 0, -9.81), (0, math.nan), (math.inf, 0), "down", ("a", "b")]),
    ("xsph", [0.3, 1, None, "yes"]),
)
def test_effects(argument, value):
    refuses(argument, Effects, **{argument: value})


@table(("x", NO_NUMBER), ("y", NO_NUMBER), ("ramp", NOT_FROM_ZERO))
def test_gravity(argument, value):
    names = {"x": r"gravity\[0\]", "y": r"gravity\[1\]", "ramp": "gravity.ramp"}
    with pytest.raises(ValueError, match=names[argument]):
        Gravity(**({"x": 0.0, "y": -9.81} | {argument: value}))


@table(
    (
        "particles",
        [[], 1.0, [1.0, 2.0], [(1.0, 2.0, 3.0)], [(0.0, math.nan)], [(0, 0), (1,)], "walls"],
    ),
    (
        "box",
        [
            (0.0, 1.0, 0.0),
            (0.0, 1.0, 0.0, 1.0, 2.0),
            (1.0, 0.0, 0.0, 1.0),
            (0.0, 1.0, 1.0, 0.0),
            (0.0, 0.0, 0.0, 1.0),
            (0.0, math.nan, 0.0, 1.0),
            (0.0, 1.0, None, 1.0),
            "abcd",
            5.0,
        ],
    ),
    ("restitution", [*NO_NUMBER, -0.1, 1.1]),
)
def test_walls(argument, value):
    refuses(argument, Walls, **{argument: value})


GOOD = {"name": "two", "x": [(0.0, 0.0), (0.1, 0.0)], "dx": 0.1, "h": 0.26, "fluid": WATER}


@table(
    ("name", ["", None, 7]),
    (
        "x",
        [
            [],
            None,
            1.0,
            [1.0, 2.0],
            [(1.0, 2.0, 3.0)],
            [(0.0, 0.0), (0.0, math.nan)],
            [(0.0, 0.0), (-math.inf, 0.0)],
            [(0.0, 0.0), (1.0,)],
            [("a", "b")],
            np.zeros((0, 2)),
            np.zeros((2, 2), complex),
        ],
    ),
    ("v", [1.0, [(0.0, 0.0)], [(0.0, 0.0)] * 3, [(0.0, 0.0), (math.nan, 0.0)], "fast"]),
    ("dx", NOT_POSITIVE),
    ("h", [*NOT_POSITIVE, 0.099]),
    ("fluid", [None, 10.0, {"c0": 10.0}, Fluid]),
    ("effects", [None, "xsph", {"xsph": True}]),
    ("walls", ["floor", (0.0, 1.0, 0.0, 1.0), 5]),
    ("duration", NOT_POSITIVE),
    ("frame", [*NOT_POSITIVE, 1.1]),
)
def test_scene(argument, value):
    refuses(argument, Scene, **(GOOD | {argument: value}))


@table(
    ("dt", NOT_POSITIVE),
    ("stiffness", NOT_POSITIVE),
    ("xsph", NOT_FROM_ZERO),
)
def test_controls_of_a_scene(argument, value):
    controls = Controls(1e-4, 1e4, 0.3)._replace(**{argument: value})
    refuses(argument, Scene, **GOOD, controls=controls)


@pytest.mark.parametrize("controls", [5.0, (1e-4, 1e4), "abcd", {"dt": 1e-4}])
def test_controls_of_a_scene_are_three(controls):
    refuses("controls", Scene, **GOOD, controls=controls)


def test_a_complaint_says_where_it_is_wrong():
    x = np.zeros((5, 2))
    x[3, 1] = np.nan
    with pytest.raises(ValueError, match=r"x: .*index 3"):
        Scene(**(GOOD | {"x": x}))


@pytest.mark.parametrize("v_max", NOT_POSITIVE, ids=str)
def test_sound_speed(v_max):
    refuses("v_max", sound_speed, v_max=v_max)


def test_sound_speed_is_ten_times_the_largest_speed():
    assert sound_speed(2.5) == 25.0


# --- What is legal --------------------------------------------------------------------------

NUMBERS = [10, np.float32(10.0), np.int64(10), "10"]


@pytest.mark.parametrize("ten", NUMBERS, ids=lambda ten: type(ten).__name__)
def test_what_passes_the_door_also_runs(ten):
    """Anything that means a number is either refused or as good as the number."""

    def run(ten):
        built = Scene(
            name="two",
            x=GOOD["x"],
            dx=ten,
            h=ten,
            duration=ten,
            fluid=Fluid(c0=ten, rho0=ten, gamma=ten),
            effects=Effects(
                gravity=Gravity(ten, ten, ramp=ten),
                xsph=True,
                artificial_viscosity=ten,
                laminar_viscosity=ten,
            ),
        )
        return Simulation(built).advance(1e-9).diverged

    try:
        diverged = run(ten)
    except ValueError:
        return
    assert not diverged


@pytest.mark.parametrize(
    "x",
    [
        [(0.0, 0.0)],
        ((0, 0), (1, 0)),
        np.zeros((4, 2), np.int32),
        np.asfortranarray(np.random.default_rng(0).random((5, 2))),
        np.random.default_rng(0).random((10, 4))[::2, ::2],
    ],
    ids=["one", "tuples", "coincident integers", "columns", "strided"],
)
def test_any_sequence_of_positions_is_legal(x):
    for dtype in ("float64", "float32"):
        sim = Simulation(Scene(**(GOOD | {"x": x})), dtype)
        assert (sim.x == np.asarray(x, dtype)).all()
        assert not sim.advance(1e-6).diverged


def test_a_scene_keeps_copies_that_cannot_be_changed():
    x = np.zeros((2, 2))
    built = Scene(**(GOOD | {"x": x}))
    x[:] = 5.0
    assert not built.x.any()
    with pytest.raises(ValueError, match="read-only"):
        built.x[0] = 1.0


def test_support_as_wide_as_the_spacing_is_legal():
    assert Scene(**(GOOD | {"h": 0.1})).h == 0.1


def test_rest_is_the_default():
    built = Scene(**GOOD)
    assert built.v.shape == (2, 2)
    assert not built.v.any()
    assert built.effects == Effects()
    assert built.walls is None


# --- Scenes by name -------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*scenes.names()])
def test_every_scene_works_without_arguments_and_takes_dx(name):
    assert "dx" in scenes.parameters(name)
    default = scenes.make(name)
    assert default.name == name
    assert default.dx == scenes.parameters(name)["dx"]
    assert len(scenes.make(name, dx=default.dx / 2).x) > 3 * len(default.x)


@pytest.mark.parametrize("name", ["tsunami", "", None, 3, ["dam_break"]], ids=str)
def test_unknown_scenes_are_refused_with_a_list(name):
    with pytest.raises(ValueError, match=r"name.*dam_break.*relaxation"):
        scenes.make(name)


@pytest.mark.parametrize("name", scenes.names())
def test_unknown_arguments_are_refused_with_a_list(name):
    with pytest.raises(ValueError, match=r"colour.*dx"):
        scenes.make(name, colour="blue")


@pytest.mark.parametrize(
    ("name", "argument"),
    [(name, argument) for name in scenes.names() for argument in scenes.parameters(name)],
)
@pytest.mark.parametrize("value", ["wide", None, math.nan, math.inf, -1.0], ids=str)
def test_wrong_arguments_are_named(name, argument, value):
    refuses(argument, lambda: scenes.make(name, **{argument: value}))


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        (name, argument)
        for name in scenes.names()
        for argument in scenes.parameters(name)
        if argument not in ("jitter", "seed", "ramp")
    ],
)
def test_sizes_of_zero_are_named(name, argument):
    refuses(argument, lambda: scenes.make(name, **{argument: 0.0}))


@pytest.mark.parametrize("name", scenes.names())
def test_fluid_and_walls_start_apart(name):
    built = scenes.make(name)
    everybody = np.asarray(built.x)
    if built.walls is not None:
        everybody = np.concatenate([everybody, built.walls.particles])
        low_x, high_x, low_y, high_y = built.walls.box
        assert (np.asarray(built.x) > (low_x, low_y)).all()
        assert (np.asarray(built.x) < (high_x, high_y)).all()
    offset = everybody[:, None] - everybody[None]
    distance = np.hypot(offset[..., 0], offset[..., 1]) + np.eye(len(everybody))
    assert distance.min() > 0.6 * built.dx


def test_a_scene_of_the_cases_is_a_scene():
    assert isinstance(scene("everything"), Scene)
