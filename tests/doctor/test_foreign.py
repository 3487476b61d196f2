import importlib
import math
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest

from sph_gym.doctor import check_solver
from sph_gym.doctor.case import DX, case, lattice
from sph_gym.doctor.foreign.shared import (
    boundary,
    configure,
    in_plane,
    in_space,
    only_open_space,
    require,
)


def adapter(name, package):
    # not pytest.importorskip: the adapter has to come first, see splishsplash.py
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed")
    return importlib.import_module(f"sph_gym.doctor.foreign.{name}")


@pytest.fixture
def pysph():
    adapted = adapter("pysph", "pysph")
    for viscosity in (0.0, 0.1):
        # compiles, which may take longer than the doctor waits
        adapted.make(case(lattice(2, 2), viscosity=viscosity))
    return adapted


def test_pysph_is_healthy(pysph):
    pysph.make(case(lattice(2, 2), box=(-DX, DX, -DX, DX)))
    diagnosis = check_solver(pysph.make)
    assert diagnosis.ok, f"{diagnosis}"
    passed = {each.check for each in diagnosis.results if each.status == "pass"}
    assert {"equation_of_state", "momentum", "viscosity_strength", "xsph_epsilon"} <= passed
    assert {"free_fall", "standing", "dam_break"} <= passed


def test_pysph_with_summed_densities_lacks_the_clamp(pysph, monkeypatch):
    # its equation of state knows none: by continuity that does no harm at a free surface
    summing = partial(pysph.WCSPHScheme, summation_density=True)
    monkeypatch.setattr(pysph, "WCSPHScheme", summing)
    pysph.make(case(lattice(2, 2)))
    diagnosis = check_solver(in_open_space(pysph.make))
    assert (diagnosis.link, diagnosis.first.check) == ("pressure", "clamp")


def in_open_space(make):
    def without_walls(problem):
        if problem.box is not None:
            raise NotImplementedError("walls")
        return make(problem)

    return without_walls


def test_splishsplash_is_healthy():
    diagnosis = check_solver(adapter("splishsplash", "pysplishsplash").make)
    assert diagnosis.ok, f"{diagnosis}"
    passed = {each.check for each in diagnosis.results if each.status == "pass"}
    assert {"kernel", "equation_of_state", "force_kernel", "viscosity_strength"} <= passed
    assert all(each.status in ("skip", "inconclusive") for each in walls(diagnosis))


def walls(diagnosis):
    return [each for each in diagnosis.results if each.link == "walls"]


def test_open_space_has_no_walls():
    assert boundary(case(lattice(3, 3))).shape == (0, 2)


def test_layers_continue_the_lattice_of_the_fluid():
    x = lattice(4, 4)
    side = 2 * DX
    found = boundary(case(x, box=(-side, side, -side, side), h=3 * DX))
    # three layers around 4 x 4
    assert len(found) == 10 * 10 - 4 * 4
    assert np.abs(found).max(axis=1).min() == pytest.approx(side + DX / 2)
    steps = (found - x[0]) / DX
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_a_floor_reaches_beyond_the_fluid():
    x = lattice(4, 4)
    found = boundary(case(x, box=(-math.inf, math.inf, -2 * DX, math.inf)))
    assert (found[:, 1] < -2 * DX).all()
    assert found[:, 0].min() < x[:, 0].min() - 20 * DX
    assert found[:, 0].max() > x[:, 0].max() + 20 * DX
    assert np.unique(found[:, 1]).size == 3


def test_a_package_that_is_too_new_is_refused_and_says_why():
    require("numpy", (999,), "")
    with pytest.raises(ImportError, match=r"numpy: expected version 0\.1 at most, got .*: too new"):
        require("numpy", (0, 1), "too new")
    with pytest.raises(OSError, match="libnothing"):
        require("numpy", (999,), "", library="libnothing.so.7")


def test_cases_with_walls_are_left_out_where_there_are_none():
    only_open_space(case(lattice(2, 2)), "no walls")
    with pytest.raises(NotImplementedError, match="no walls"):
        only_open_space(case(lattice(2, 2), box=(-1, 1, -1, 1)), "no walls")


def test_planes_and_space():
    x = lattice(3, 2)
    assert in_space(x).shape == (6, 3)
    np.testing.assert_array_equal(in_plane(in_space(x)), x)
    np.testing.assert_array_equal(in_plane(np.arange(6.0)), np.arange(6.0))
    kept = np.zeros((6, 3))
    in_plane(kept)[2, 1] = 5.0
    assert kept[2, 1] == 5.0


class Parametric:
    FLAG, NUMBER, COUNT, VECTOR = range(4)

    def __init__(self):
        self.made = []

    def setValueBool(self, name, value):
        self.made.append(("bool", name, value))

    def setValueFloat(self, name, value):
        self.made.append(("float", name, value))

    def setVec3ValueReal(self, name, value):
        self.made.append(("vector", name, value))


def test_settings_are_made_in_their_order_by_the_setter_of_their_type():
    first, second = Parametric(), Parametric()
    configure(
        (first, {"NUMBER": 0.5, "FLAG": False, "COUNT": 7}), (second, {"VECTOR": [0, 1.0, 0.0]})
    )
    assert first.made == [("float", 1, 0.5), ("bool", 0, False), ("float", 2, 7)]
    assert second.made == [("vector", 3, [0, 1.0, 0.0])]
