from dataclasses import replace

import numpy as np
import pytest

from sph_gym import Simulation, scenes
from sph_gym.env import SCENES
from sph_gym.scenes.shared import refinement
from sph_gym.scenes.shared.reference import read

FAMILIES = [family for family in map(scenes.family, scenes.names()) if family is not None]


@pytest.mark.parametrize("name", scenes.names())
def test_every_scene_starts_at_rest_density(name):
    sim = Simulation(scenes.make(name))
    rho = sim.rho[: sim.n_fluid] / sim.scene.fluid.rho0
    assert rho.max() < 1.2
    # waves and tanks begin with the pressure that their depth needs
    compressed = name in ("standing_wave", "sloshing", "hydrostatic_tank")
    if name != "relaxation":
        assert np.isclose(np.median(rho), 1.0, atol=0.01 if compressed else 1e-3)


@pytest.mark.parametrize("name", scenes.names())
def test_every_scene_takes_dx(name):
    dx = scenes.parameters(name)["dx"]
    coarse, fine = (scenes.make(name, dx=factor * dx) for factor in (1.6, 0.8))
    ratio = len(np.asarray(fine.x)) / len(np.asarray(coarse.x))
    # a periodic channel is as many spacings long as it must be
    assert 1.5 < ratio < 6


@pytest.mark.parametrize("dx", [0.02, 0.023, 0.031, 0.05])
def test_lattices_and_walls_stay_in_step_at_any_spacing(dx):
    sim = Simulation(scenes.make("hydrostatic_tank", dx=dx))
    below_surface = sim.x[: sim.n_fluid, 1] < 0.3
    rho = sim.rho[: sim.n_fluid][below_surface]
    assert np.allclose(rho, sim.scene.fluid.rho0, rtol=1e-9)


def test_only_what_a_scene_names_is_there():
    relaxation = scenes.make("relaxation")
    assert relaxation.effects.gravity is None
    assert relaxation.walls is None
    assert not relaxation.effects.xsph


def test_the_measured_front_is_shipped_whole():
    table = read("martin_moyce_1952_front_n2_2.csv")
    assert table.shape == (15, 2)
    assert np.all(np.diff(table, axis=0) > 0)
    assert tuple(table[0]) == (0.41, 1.11)


def test_unknown_names_and_arguments_are_listed():
    with pytest.raises(ValueError, match="dam_break, drop_impact"):
        scenes.make("lake")
    with pytest.raises(ValueError, match="dx, width, height"):
        scenes.make("dam_break", depth=1.0)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("dam_break", {"dx": 0.0}),
        ("dam_break", {"dx": np.nan}),
        ("dam_break", {"width": 0.01}),
        ("dam_break", {"gravity": -9.81}),
        ("dam_break", {"tank": 0.5}),
        ("drop_impact", {"diameter": 2.0}),
        ("drop_impact", {"pool_depth": 0.0}),
        ("hydrostatic_tank", {"ramp": -1.0}),
        ("relaxation", {"jitter": -0.1}),
        ("relaxation", {"jitter": 5}),
        ("drop_sequence", {"drops": 10**6}),
        ("relaxation", {"diameter": 0.0}),
    ],
)
def test_wrong_values_are_named(name, arguments):
    (argument,) = arguments
    with pytest.raises(ValueError, match=f"{argument}: expected"):
        scenes.make(name, **arguments)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("drop_impact", {"dx": 0.1}),
        ("drop_impact", {"dx": 0.1, "width": 0.9}),
        ("drop_sequence", {"dx": 0.1}),
        ("long_fall", {"dx": 0.1}),
        ("dam_break", {"dx": 0.1, "width": 0.3}),
        ("dam_break", {"dx": 0.2, "width": 0.6}),
        ("sloshing", {"dx": 0.1, "fill": 0.2, "height": 0.3}),
        ("elliptical_drop", {"dx": 0.1, "radius": 0.3}),
    ],
)
def test_a_length_of_just_enough_spacings_is_taken(name, arguments):
    assert len(scenes.make(name, **arguments).x) > 0


def test_a_length_of_too_few_spacings_tells_the_lengths_and_the_dx_that_would_do():
    told = r"width: expected at least 3 dx = 300 m, got 0.5 m; .* dx of at most 0.1667 m"
    with pytest.raises(ValueError, match=told):
        scenes.make("dam_break", dx=100)
    scenes.make("dam_break", dx=0.1666)
    with pytest.raises(ValueError, match=r"diameter: expected at least 3 dx = 0.3 m, got 0.29 m"):
        scenes.make("drop_impact", dx=0.1, diameter=0.29)


def test_a_module_is_a_scene_without_being_listed(tmp_path, monkeypatch):
    text = "def wet_puddle(dx: float = 0.1):\n    return dx\n"
    (tmp_path / "wet_puddle.py").write_text(text)
    monkeypatch.setattr(scenes, "__path__", [*scenes.__path__, str(tmp_path)])
    before = scenes.names()
    scenes._found.cache_clear()
    try:
        assert scenes.names() == [*before, "wet_puddle"]
        assert scenes.make("wet_puddle", dx=0.2) == 0.2
        assert scenes.family("wet_puddle") is scenes.reference("wet_puddle") is None
    finally:
        monkeypatch.undo()
        scenes._found.cache_clear()
    assert scenes.names() == before


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.scene)
def test_a_family_draws_arguments_of_its_scene(family):
    assert scenes.family(family.scene) is family
    arguments = family.draw(np.random.default_rng(0), family.dx)
    assert {*arguments, family.odd[0]} <= set(scenes.parameters(family.scene)) - {"dx"}
    made = scenes.make(family.scene, dx=family.dx, **arguments)
    assert 100 < len(np.asarray(made.x)) < 1000


def test_families_are_those_of_the_environments_and_draw_by_their_own_seeds():
    assert [family.scene for family in FAMILIES] == list(SCENES)
    assert len({family.seed for family in FAMILIES}) == len(FAMILIES)


@pytest.mark.parametrize(
    ("change", "label", "gain"),
    [
        ({"headroom": 2.345}, "benchmark", "2.35 times less work"),
        ({"headroom": np.nan, "remark": "unknown headroom"}, "benchmark, unknown headroom",
         "unknown: nowhere are both within tolerance"),
        ({"headroom": None, "diagnostic": "at rest"}, "diagnostic", "not measured"),
    ],
)  # fmt: skip
def test_a_family_tells_its_label_and_its_headroom(change, label, gain):
    family = replace(scenes.family("drop_impact"), **change)
    assert (family.label, family.gain) == (label, gain)


@pytest.mark.parametrize("name", refinement.names())
def test_a_refinement_series_is_of_the_module_and_of_its_reference(name):
    series = refinement.refinement(name)
    assert series.scene == name
    assert series.length in scenes.parameters(name)
    assert scenes.reference(name) is not None


def test_scenes_without_a_refinement_series_are_refused():
    with pytest.raises(ValueError, match="elliptical_drop, dam_break"):
        refinement.refinement("relaxation")
