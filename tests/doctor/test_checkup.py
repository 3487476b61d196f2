"""The examination itself: what a solver may do to it, and what it says then."""

import json
import time

import numpy as np
import pytest

from sph_gym.__main__ import main
from sph_gym.doctor import check_solver, compare, parametrize_with_checks, plain, subject
from sph_gym.doctor.checkup import Checkup
from sph_gym.doctor.diagnosis import LINKS, Diagnosis, Result
from sph_gym.doctor.registry import CHECKS, check

STATUSES = {"pass", "fail", "blocked", "skip", "inconclusive", "xfail", "error"}


class Drifting:
    """No fluid at all: particles that fly on."""

    def __init__(self, case):
        self.x, self.v = case.x, case.v

    def step(self, dt):
        self.x = self.x + dt * self.v


def broken(**methods):
    """Return a factory of drifting particles with some methods or attributes replaced."""

    def make(case):
        return type("Broken", (Drifting,), methods)(case)

    return make


def first(make, **others):
    """Return the first broken result of the checks of the setup, and all of them."""
    names = [name for name, each in CHECKS.items() if each.link != "setup"]
    diagnosis = check_solver(make, skip=names, **others)
    return diagnosis.first, diagnosis


def hang(self, dt):
    while True:
        time.sleep(0.01)


def crash(self, dt):
    raise ZeroDivisionError("a distance of zero")


def leave(self, dt):
    raise SystemExit(3)


def lose(self, dt):
    self.x, self.v = self.x[:-1], self.v[:-1]


def transpose(self, dt):
    self.x = self.x.T


def spoil(self, dt):
    self.x = self.x * np.nan


def words(self, dt):
    self.v = "fast"


@pytest.mark.parametrize(
    ("methods", "said"),
    [
        ({"step": crash}, "raised ZeroDivisionError: a distance of zero (test_checkup.py, line"),
        ({"step": leave}, "raised SystemExit"),
        ({"step": lose}, r"expected the shape (9, 2)"),
        ({"step": transpose}, "got (2, 9)"),
        ({"step": spoil}, "x not finite"),
        ({"step": words}, "v: expected numbers"),
        ({"step": None}, "no method step"),
        ({"neighbors": lambda self, i: "none"}, "expected indices"),
        ({"rho": np.ones(4)}, "rho: expected the shape (9,)"),
        ({"a": property(crash)}, "raised TypeError"),
    ],
)
def test_whatever_a_solver_does_ends_in_a_result(methods, said):
    result, diagnosis = first(broken(**methods))
    assert said in result.message
    assert diagnosis.link == result.link == ("force" if methods.get("step") is spoil else "setup")
    assert not diagnosis.ok
    assert result.remedy
    assert {each.status for each in diagnosis.results} <= STATUSES
    # what waits for the broken check is blocked, not failed
    assert [each.check for each in diagnosis.results if each.broken] == ["adapter"]
    assert CHECKS["order"].needs == ("adapter",)
    assert next(r for r in diagnosis.results if r.check == "order").status == "blocked"


def test_a_hang_ends_and_nothing_else_waits_for_it(monkeypatch):
    monkeypatch.setattr(subject, "CALL_LIMIT", 0.3)
    started = time.monotonic()
    result, diagnosis = first(broken(step=hang))
    assert "did not return" in result.message
    assert time.monotonic() - started < 10
    assert diagnosis.link == "setup"


def test_a_factory_that_returns_nothing():
    result, _ = first(lambda case: None)
    assert "returned None" in result.message


def test_a_solver_may_write_to_its_case():
    def make(case):
        case.x += 1.0
        return Drifting(case)

    result, _ = first(make)
    assert "x is not case.x before the first step" in result.message


def test_particles_in_another_order_are_the_adapters_fault():
    def reorder(self, dt):
        self.x = (self.x + dt * self.v)[::-1]
        self.v = self.v[::-1]

    result, _ = first(broken(step=reorder))
    assert (result.check, result.link) == ("order", "setup")


def test_positions_sorted_without_velocities_are_the_neighbour_searchs_fault():
    def sort(self, dt):
        moved = self.x + dt * self.v
        self.x = moved[np.argsort(moved[:, 0])]

    result, _ = first(broken(step=sort))
    assert (result.check, result.link) == ("order", "neighbours")
    assert "velocities" in result.remedy


def test_what_a_solver_does_not_support_is_skipped():
    def make(case):
        if case.n != 9:
            raise NotImplementedError("nine particles only")
        return Drifting(case)

    result, diagnosis = first(make)
    assert result is None
    message = next(r.message for r in diagnosis.results if r.check == "order")
    assert "does not support this case: make(case): nine particles only" in message


def as_method(self, name):
    value = object.__getattribute__(self, name)
    return (lambda: value) if name == "x" else value


def as_complex(self, name):
    value = object.__getattribute__(self, name)
    return value + 1j if name == "x" else value


def unsupported(self, dt):
    raise NotImplementedError


@pytest.mark.parametrize(
    "methods",
    [
        {"x": property(crash)},
        {"x": property(leave)},
        {"step": property(crash)},
        {"step": unsupported},
        {"__getattribute__": as_method},
        {"__getattribute__": as_complex},
        {"neighbors": lambda self, i: [True, False]},
        {"neighbors": lambda self, i: [1.5]},
    ],
)
def test_a_solver_that_shows_nothing_is_not_healthy(methods):
    diagnosis = check_solver(broken(**methods))
    assert (diagnosis.ok, diagnosis.link) == (False, "setup")
    assert diagnosis.first.check == "adapter"
    json.loads(diagnosis.to_json())


def test_the_root_of_what_is_blocked_is_named():
    results = check_solver(broken(step=crash)).results
    waiting = [each.message for each in results if each.status == "blocked"]
    assert set(waiting) == {"waits for adapter, which failed"}


def test_expected_failures_and_skipped_checks():
    make = broken(step=crash)
    result, diagnosis = first(make, expected_failed_checks={"adapter": "a stub"})
    assert result is None
    assert diagnosis.ok
    assert diagnosis.results[0].status == "xfail"
    assert "a stub" in diagnosis.results[0].message
    assert next(r for r in diagnosis.results if r.check == "order").status == "blocked"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"make": "nothing"}, "module:factory"),
        ({"make": "math:nothing"}, "no function 'nothing'"),
        ({"make": "nowhere.py:make"}, "there is no file"),
        ({"make": 3}, "expected a function"),
        ({"make": Drifting, "skip": ["adaptor"]}, "adapter"),
        ({"make": Drifting, "expected_failed_checks": {"ordre": ""}}, "order"),
    ],
)
def test_wrong_arguments(arguments, said):
    with pytest.raises(ValueError, match=said):
        check_solver(**arguments)


def test_the_first_broken_link_is_the_first_of_the_chain():
    results = [Result("late", "walls", "fail"), Result("early", "density", "error")]
    diagnosis = Diagnosis(tuple(results))
    assert diagnosis.link == "density"
    assert diagnosis.verdict.startswith("broken: density (early)")
    assert json.loads(diagnosis.to_json())["link"] == "density"
    assert Diagnosis(()).ok


def test_results_come_in_the_order_of_the_chain_and_are_reported_at_once():
    seen = []
    diagnosis = check_solver(Drifting, callback=seen.append)
    assert sorted(each.check for each in seen) == sorted(CHECKS)
    links = [LINKS.index(each.link) for each in diagnosis.results]
    assert links == sorted(links)


def test_no_experiment_goes_astray():
    """A mistake in a check would read as inconclusive."""
    results = check_solver(plain.make).results
    assert [each.check for each in results if "could not be used" in each.message] == []
    assert {each.status for each in results} <= {"pass", "skip"}


def test_one_seed_one_diagnosis():
    def numbers(seed):
        skipped = [name for name, each in CHECKS.items() if each.last]
        results = check_solver(plain.make, skip=skipped, seed=seed).results
        return [(each.check, each.status, each.measured) for each in results]

    assert numbers(1) == numbers(1)


def test_a_check_waits_only_for_earlier_ones():
    with pytest.raises(ValueError, match="needs unknown"):
        check("density", needs=("not_there",))(lambda lab: None)
    with pytest.raises(ValueError, match="link: expected one of setup"):
        check("kernel")


@pytest.mark.parametrize("name", CHECKS)
def test_each_check_says_what_it_does(name):
    summary = CHECKS[name].summary
    assert summary
    assert summary[0].isupper()
    assert len(summary) < 120


def test_checks_as_tests_of_another_suite():
    mark = parametrize_with_checks([broken(step=crash)], expected_failed_checks={"order": "why"})
    parameters = {each.id: each.values for each in mark.mark.args[1]}
    assert len(parameters) == len(CHECKS)
    make, test = parameters["make-adapter"]
    with pytest.raises(AssertionError, match="ZeroDivisionError"):
        test(make)
    make, test = parameters["make-order"]
    with pytest.raises(pytest.skip.Exception, match="blocked: waits for adapter"):
        test(make)


def test_single_checks_bring_what_they_need():
    checkup = Checkup(Drifting)
    assert checkup.result("order").status == "pass"
    assert set(checkup.results) == {"adapter", "order"}


class Leaky(plain.Plain):
    def bounce(self):
        """Return without a look at the box."""


class Thick(plain.Plain):
    def viscosity(self):
        return 2 * super().viscosity()


class Late(plain.Plain):
    def advance(self, dt):
        self.x = self.x + dt * self.v
        self.v = self.v + dt * self.a


class Heavier(plain.Plain):
    def calibrated_mass(self):
        return 1.1 * super().calibrated_mass()


class Sinking(plain.Plain):
    def gravity(self):
        return 2 * super().gravity()


@pytest.mark.parametrize(
    ("other", "link"),
    [
        (plain.Plain, ""),
        (Heavier, "density"),
        (Sinking, "force"),
        (Thick, "viscosity"),
        (Late, "integration"),
        (Leaky, "walls"),
    ],
)
def test_two_solvers_part_at_a_link(other, link):
    assert compare(plain.make, other).link == link


def test_the_command_line(tmp_path, capsys, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "class S:\n"
        "    def __init__(self, case): self.x, self.v = case.x, case.v\n"
        "    def step(self, dt): raise KeyError('cells')\n"
    )
    monkeypatch.chdir(tmp_path)
    assert main(["doctor", "--solver", "mine:S", "--json", "d.json", "--html", "d.html"]) == 1
    out = capsys.readouterr().out.strip().split("\n")
    assert out[-1].startswith("broken: setup (adapter). ")
    assert json.loads((tmp_path / "d.json").read_text())["link"] == "setup"
    page = (tmp_path / "d.html").read_text()
    assert "KeyError" in page
    assert "<script" not in page
    assert main(["doctor", "--solver", "mine:T"]) == 2
    assert main(["doctor", "--solver", "mine:S", "--scene", "dam_break"]) == 2
    assert main(["doctor", "--solver", "nowhere:S"]) == 2
    assert main(["doctor", "compare", "grid"]) == 2
    assert main(["doctor", "--list"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in CHECKS)
