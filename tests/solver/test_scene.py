"""Everything wrong is said at the door, in a ValueError that names the argument."""

import math

import numpy as np
import pytest
from scipy.spatial import KDTree

from sph_gym import (
    CentralGravity,
    Controls,
    Effects,
    Fluid,
    Gravity,
    Motion,
    RecordedGravity,
    RollingTank,
    Scene,
    ShakenGravity,
    Simulation,
    Walls,
    channel_particles,
    disc,
    lattice,
    plate_particles,
    scenes,
    sound_speed,
    tank_particles,
)
from tests.cases import WATER, scene, uncompiled

NO_NUMBER = ["fast", None, [1.0], math.nan, math.inf, 1j]
NOT_POSITIVE = [*NO_NUMBER, 0.0, -1.0]
NOT_FROM_ZERO = [*NO_NUMBER, -1e-9]


def table(*rows):
    """One test for each argument, with all its wrong values."""
    return pytest.mark.parametrize(
        ("argument", "values"), [pytest.param(*row, id=row[0]) for row in rows]
    )


def refuses(argument, make, **arguments):
    with pytest.raises(ValueError, match=rf"\b{argument}\b"):
        make(**arguments)


def refuses_each(argument, values, make, **others):
    for value in values:
        refuses(argument, make, **(others | {argument: value}))


@table(
    ("c0", [*NOT_POSITIVE, 1e-13, 1e13]),
    ("rho0", NOT_POSITIVE),
    ("gamma", [*NO_NUMBER, 0.99, -7.0]),
    ("kernel", ["gauss", "", None, 7, ["mueller"]]),
    ("eos", ["ideal", None, 1.0]),
    ("clamp", ["no", None, 2.0]),
)
def test_fluid(argument, values):
    refuses_each(argument, values, Fluid, c0=10.0)


STRENGTHS = [value for value in NOT_FROM_ZERO if value is not None]


@table(
    ("artificial_viscosity", STRENGTHS),
    ("quadratic_viscosity", STRENGTHS),
    ("laminar_viscosity", STRENGTHS),
    ("surface_tension", STRENGTHS),
    ("tensile_correction", STRENGTHS),
    ("density_diffusion", [*STRENGTHS, 0.1]),  # by sums, no density diffuses
    ("shifting", STRENGTHS),
    ("continuity", [1, None, "yes", 0.0]),
    ("gravity", [9.81, (9.81,), (0, 0, -9.81), (0, math.nan), (math.inf, 0), "down", ("a", "b")]),
    ("xsph", [0.3, 1, None, "yes"]),
)
def test_effects(argument, values):
    refuses_each(argument, values, Effects)


def test_diffusion_of_a_density_by_continuity():
    refuses_each("density_diffusion", STRENGTHS, Effects, continuity=True)


@table(("x", NO_NUMBER), ("y", NO_NUMBER), ("ramp", NOT_FROM_ZERO))
def test_gravity(argument, values):
    names = {"x": r"gravity\[0\]", "y": r"gravity\[1\]", "ramp": "gravity.ramp"}
    for value in values:
        with pytest.raises(ValueError, match=names[argument]):
            Gravity(**({"x": 0.0, "y": -9.81} | {argument: value}))


GRAVITIES = {
    CentralGravity: {"omega": 1.0},
    ShakenGravity: {"x": 0.0, "y": -9.81, "amplitude": (1.0, 0.0), "frequency": 1.0},
    RecordedGravity: {"vectors": [(0.0, 0.0), (0.0, 1.0)], "interval": 0.1},
    RollingTank: {"g": 9.81, "amplitude": 0.1, "frequency": 1.0},
}
NO_VECTOR = [1.0, (1.0,), (0, 0, 1), (0, math.nan), (math.inf, 0), "up", None, (1j, 0)]


@pytest.mark.parametrize(
    ("kind", "argument", "values"),
    [
        pytest.param(kind, argument, values, id=f"{kind.__name__}-{argument}")
        for kind, wrong in {
            CentralGravity: {"omega": NOT_POSITIVE, "x": NO_NUMBER, "y": NO_NUMBER},
            ShakenGravity: {
                "x": NO_NUMBER,
                "y": NO_NUMBER,
                "amplitude": NO_VECTOR,
                "frequency": NOT_POSITIVE,
            },
            RecordedGravity: {
                "vectors": [
                    *NO_VECTOR,
                    [(0.0, 1.0)],
                    [(0, 0, 0), (1, 1, 1)],
                    [(0, 0), (0, math.nan)],
                ],
                "interval": NOT_POSITIVE,
            },
            RollingTank: {
                "g": NOT_FROM_ZERO,
                "amplitude": [*NO_NUMBER, 3.2, -3.2],
                "frequency": NOT_POSITIVE,
                "pivot": NO_VECTOR,
            },
        }.items()
        for argument, values in wrong.items()
    ],
)
def test_gravities(kind, argument, values):
    for value in values:
        with pytest.raises(ValueError, match=rf"gravity\.{argument}"):
            kind(**(GRAVITIES[kind] | {argument: value}))
    assert Effects(gravity=kind(**GRAVITIES[kind])).field is not None


@table(
    ("velocity", NO_VECTOR),
    ("amplitude", NO_VECTOR),
    ("frequency", NOT_FROM_ZERO),
    ("sides", ["left", ("left", "front"), None, 3, ("",), (1,)]),
    (
        "particles",
        [[], [1, 0], [0.0], [[True]], [True, None], "ab", [[True], [True, False]], [None]],
    ),
)
def test_motion(argument, values):
    for value in values:
        wrong = {"velocity": (1.0, 0.0)} | {argument: value}
        refuses(rf"motion\.{argument}", Motion, **wrong)


@pytest.mark.parametrize(
    "still", [{}, {"amplitude": (1.0, 0.0)}, {"frequency": 2.0}, {"velocity": (0.0, 0.0)}], ids=str
)
def test_a_motion_that_is_none(still):
    refuses("motion", Motion, **still)


SPOTS = [(0.0, 0.0), (1.0, 0.0)]
MOVES = Motion((1.0, 0.0))


WRONG_WALLS = [
    ("pressure", {"pressure": "adami"}),
    ("pressure", {"pressure": None}),
    ("slip", {"slip": "none"}),
    ("slip", {"slip": 0}),
    *[
        ("velocity", {"particles": SPOTS, "velocity": wrong})
        for wrong in (
            1.0,
            (1.0, 0.0, 0.0),
            [(0, 0)] * 3,
            (math.nan, 0.0),
            "fast",
            [(0, 0), (0,)],
        )
    ],
    ("velocity", {"velocity": (1.0, 0.0)}),
    ("velocity", {"velocity": (1.0, 0.0), "box": (0, 1, 0, 1)}),
    ("motion", {"particles": SPOTS, "motion": (1.0, 0.0)}),
    ("motion", {"motion": MOVES}),
    ("motion", {"motion": MOVES, "box": (0, 1, 0, 1)}),
    ("motion.sides", {"particles": SPOTS, "motion": Motion((1.0, 0.0), sides=("left",))}),
    ("motion.sides", {"motion": Motion((1.0, 0.0), sides=("left",))}),
    ("motion.particles", {"particles": SPOTS, "motion": Motion((1, 0), particles=[True])}),
    (
        "motion.particles",
        {"box": (0, 1, 0, 1), "motion": Motion((1, 0), particles=[True], sides=("top",))},
    ),
    *[
        ("plates", {"plates": wrong})
        for wrong in (
            [],
            [(0, 0, 1)],
            (0, 0, 1, 1),
            [(0, 0, 1, math.nan)],
            [(0, 0, 1, 1), (2, 2, 2, 2)],
            "wall",
            1.0,
            [(0, 0, 1, 1), (0, 0)],
        )
    ],
    *[
        (name, {name: wrong})
        for name in ("period_x", "period_y")
        for wrong in ((1.0, 0.0), (0.0, 0.0), (0.0,), 1.0, "x", (0, math.inf), (0, 1, 2))
    ],
    # what would do nothing
    ("pressure", {"pressure": "extrapolated"}),
    ("pressure", {"pressure": "extrapolated", "box": (0, 1, 0, 1)}),
    ("slip", {"slip": "free-slip", "plates": [(0, 0, 1, 1)]}),
    ("box", {"box": (0, math.inf, 0, 1), "period_x": (0, 2)}),
    ("box", {"box": (-math.inf, math.inf, -math.inf, 1), "period_y": (0, 2)}),
    # what would be nowhere
    ("particles", {"particles": SPOTS, "period_x": (0.0, 1.0)}),
    ("particles", {"particles": SPOTS, "period_x": (0.1, 2.0)}),
    ("particles", {"particles": SPOTS, "period_y": (-1.0, 0.0)}),
    ("plates", {"plates": [(0, 0, 1, 1), (0, 0, 1.1, 0.5)], "period_x": (0, 1)}),
    ("plates", {"plates": [(0, 0, 1, 1), (0, 0.5, 1, -0.1)], "period_y": (0, 1)}),
]


@pytest.mark.parametrize("argument", dict(WRONG_WALLS))
def test_walls_that_move_mirror_or_end_space(argument):
    for name, arguments in WRONG_WALLS:
        if name == argument:
            refuses(argument, Walls, **arguments)


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
def test_walls(argument, values):
    refuses_each(argument, values, Walls)


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
    ("dx", [*NOT_POSITIVE, 1e-60, 1e13]),
    ("h", [*NOT_POSITIVE, 0.099, 1e13]),
    ("fluid", [None, 10.0, {"c0": 10.0}, Fluid]),
    ("effects", [None, "xsph", {"xsph": True}]),
    ("walls", ["floor", (0.0, 1.0, 0.0, 1.0), 5]),
    ("integrator", ["euler", "", None, 2, ["kick_drift_kick"]]),
    ("duration", NOT_POSITIVE),
    ("frame", [*NOT_POSITIVE, 1.1]),
)
def test_scene(argument, values):
    refuses_each(argument, values, Scene, **GOOD)


@pytest.mark.parametrize(
    ("argument", "changes"),
    [
        (
            "walls.pressure",
            {"effects": Effects(continuity=True), "walls": Walls([(0.0, -0.1), (0.1, -0.1)])},
        ),
        ("h", {"h": 0.1, "effects": Effects(surface_tension=1.0)}),
        ("walls.period_x", {"walls": Walls(period_x=(0.0, 1.0))}),
        ("walls.period_y", {"walls": Walls(period_x=(0.0, 2.0), period_y=(0.0, 1.03))}),
        ("x", {"walls": Walls(period_x=(0.05, 2.0))}),
        ("x", {"walls": Walls(period_x=(-1.0, 0.1))}),
        ("x", {"walls": Walls(period_y=(0.05, 2.0))}),
    ],
    ids=str,
)
def test_what_does_not_go_together(argument, changes):
    refuses(argument, Scene, **(GOOD | changes))


def test_what_goes_together():
    for changes in (
        {
            "effects": Effects(continuity=True),
            "walls": Walls([(0.0, -0.1)], pressure="extrapolated"),
        },
        {"effects": Effects(continuity=True), "walls": Walls(box=(-1, 1, -1, 1))},
        {"h": 0.1001, "effects": Effects(surface_tension=1.0)},
        {"walls": Walls(period_x=(0.0, 1.04))},
        {"walls": Walls(period_x=(-1.0, 0.11), period_y=(-3, 3))},
        {"walls": Walls(box=(-math.inf, math.inf, 0, 1), period_x=(0.0, 2.0))},
        {
            "x": [(0.0, 0.1), (0.1, 0.1)],
            "walls": Walls(SPOTS, plates=[(0, 0, 2, 0)], period_x=(0.0, 2.0)),
        },
    ):
        assert Scene(**(GOOD | changes)).integrator == "symplectic_euler"


# --- Geometry -------------------------------------------------------------------------------


SHAPES = {
    lattice: {"x_min": 0.0, "x_max": 1.0, "y_min": 0.0, "y_max": 1.0},
    disc: {"x": 0.0, "y": 0.0, "radius": 0.5},
    tank_particles: {"width": 1.0, "height": 1.0, "layers": 3},
    channel_particles: {"length": 1.0, "height": 1.0, "layers": 3},
    plate_particles: {"start": (0.0, 0.0), "end": (1.0, 0.0), "layers": 2},
}
FIRST_AND_LAST = ("x_min", "x_max", "y_min", "y_max", "x", "y")


@pytest.mark.parametrize(
    ("shape", "argument", "values"),
    [
        pytest.param(shape, name, values, id=f"{shape.__name__}-{name}")
        for shape, arguments in SHAPES.items()
        for name in (*arguments, "dx")
        for values in [
            {
                "layers": [*NOT_POSITIVE, 1.5],
                "start": NO_VECTOR,
                "end": NO_VECTOR,
                "x_max": [*NO_NUMBER, 0.0, -1.0],
                "y_max": [*NO_NUMBER, 0.0, -1.0],
            }.get(name, NO_NUMBER if name in FIRST_AND_LAST else NOT_POSITIVE)
        ]
    ],
)
def test_arguments_of_shapes(shape, argument, values):
    assert len(shape(**SHAPES[shape], dx=0.1)) > 5
    refuses_each(argument, values, shape, **SHAPES[shape], dx=0.1)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.__name__)
def test_more_particles_than_fit_are_refused(shape):
    for dx in (1e-10, 1e-60, 1e-308):
        with pytest.raises(ValueError, match=r"at most 1e.08 particles.*larger dx"):
            shape(**SHAPES[shape], dx=dx)


@pytest.mark.parametrize("shape", [tank_particles, channel_particles, lattice])
def test_absurd_regions_are_refused(shape):
    longest = {"x_max", "width", "length"} & SHAPES[shape].keys()
    for length in (1e20, 1e300):
        with pytest.raises(ValueError, match="larger dx"):
            shape(**(SHAPES[shape] | dict.fromkeys(longest, length)), dx=0.1)


def test_a_channel_continues_the_lattice_of_what_it_holds():
    walls = channel_particles(0.6, 0.4, 0.1, layers=2)
    assert len(walls) == 2 * 2 * 6
    rows = np.unique(walls[:, 1].round(9))
    assert rows == pytest.approx([-0.15, -0.05, 0.45, 0.55])
    assert (walls[: len(walls) // 2, 1] < 0).all()
    for layers in (0, -1, 1.5):
        with pytest.raises(ValueError, match="layers"):
            channel_particles(0.6, 0.4, 0.1, layers=layers)


def test_a_plate_of_particles_lies_along_its_line():
    for layers in (1, 2, 3):
        x = plate_particles((1.0, 1.0), (1.3, 1.4), 0.1, layers)
        along, normal = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
        assert len(x) == 5 * layers
        assert np.unique(((x - 1.0) @ along).round(9)) == pytest.approx(
            [0.05, 0.15, 0.25, 0.35, 0.45]
        )
        depths = np.unique(((x - 1.0) @ normal).round(9))
        assert depths == pytest.approx((np.arange(layers) - (layers - 1) / 2) * 0.1)
    with pytest.raises(ValueError, match="length of the plate"):
        plate_particles((1.0, 1.0), (1.0, 1.0), 0.1)


def test_a_disc_is_round_and_has_its_area():
    x = disc(2.0, -1.0, 0.5, 0.02)
    assert x.mean(axis=0) == pytest.approx([2.0, -1.0])
    assert np.hypot(*(x - (2.0, -1.0)).T).max() <= 0.5
    assert len(x) * 0.02**2 == pytest.approx(np.pi * 0.25, rel=0.02)


@table(
    ("dt", NOT_POSITIVE),
    ("stiffness", NOT_POSITIVE),
    ("xsph", NOT_FROM_ZERO),
)
def test_controls_of_a_scene(argument, values):
    for value in values:
        controls = Controls(1e-4, 1e4, 0.3)._replace(**{argument: value})
        refuses(argument, Scene, **GOOD, controls=controls)


def test_controls_of_a_scene_are_three():
    refuses_each("controls", [5.0, (1e-4, 1e4), "abcd", {"dt": 1e-4}], Scene, **GOOD)


def test_a_complaint_says_where_it_is_wrong():
    x = np.zeros((5, 2))
    x[3, 1] = np.nan
    with pytest.raises(ValueError, match=r"x: .*index 3"):
        Scene(**(GOOD | {"x": x}))


def test_sound_speed_is_ten_times_the_largest_speed():
    assert sound_speed(2.5) == 25.0
    refuses_each("v_max", NOT_POSITIVE, sound_speed)


# --- What is legal --------------------------------------------------------------------------

NUMBERS = [10, np.float32(10.0), np.int64(10), "10"]


@uncompiled
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
    # a periodic channel is as many spacings long as it must be
    assert len(scenes.make(name, dx=default.dx / 2).x) > 1.9 * len(default.x)


def test_unknown_scenes_are_refused_with_a_list():
    for name in ("tsunami", "", None, 3, ["dam_break"]):
        with pytest.raises(ValueError, match=r"name.*dam_break.*relaxation"):
            scenes.make(name)


# arguments that may be zero even if they usually are not
FROM_ZERO = ("jitter", "seed", "ramp", "noise", "degrees", "ohnesorge")


@pytest.mark.parametrize("name", scenes.names())
def test_wrong_arguments_of_a_scene_are_named(name):
    with pytest.raises(ValueError, match=r"expected one of dx.*got 'colour'"):
        scenes.make(name, colour="blue")
    for argument, usual in scenes.parameters(name).items():
        wrong = ["wide", None, math.nan, math.inf, -1.0]
        if argument not in FROM_ZERO and usual != 0:
            wrong.append(0.0)
        for value in wrong:
            refuses(argument, scenes.make, **{"name": name, argument: value})


@pytest.mark.parametrize("name", scenes.names())
def test_fluid_and_walls_start_apart(name):
    built = scenes.make(name)
    everybody = np.asarray(built.x)
    if built.walls is not None and built.walls.particles is not None:
        everybody = np.concatenate([everybody, built.walls.particles])
    if built.walls is not None and built.walls.box is not None:
        low_x, high_x, low_y, high_y = built.walls.box
        assert (np.asarray(built.x) > (low_x, low_y)).all()
        assert (np.asarray(built.x) < (high_x, high_y)).all()
    distances, _ = KDTree(everybody).query(everybody, k=2)
    assert distances[:, 1].min() > 0.6 * built.dx


def test_a_scene_of_the_cases_is_a_scene():
    assert isinstance(scene("everything"), Scene)
