"""Checks of neighbours, viscosity and XSPH: sound solvers of many styles, and broken ones."""

import numpy as np
import pytest

from sph_gym.doctor import check_solver
from sph_gym.doctor.case import case, lattice
from sph_gym.doctor.checks.neighbours import DISTANCES, pair_weights
from sph_gym.doctor.faults.registry import FAULTS
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import CHECKS
from tests.doctor.solvers.pairs_loops import Loops
from tests.doctor.solvers.pairs_searches import BROKEN, SOUND
from tests.doctor.solvers.pairs_zoo import HEALTHY, SHOWN, Zoo, zoo
from tests.doctor.solvers.shared import showing

NEIGHBOURS = (
    "neighbor_lists",
    "same_everywhere",
    "same_when_shifted",
    "any_order",
    "pair_sums",
    "pair_reach",
    "newcomers",
)
VISCOSITY = tuple(name for name, each in CHECKS.items() if each.link == "viscosity")
XSPH = tuple(name for name, each in CHECKS.items() if each.link == "xsph")
# Faults that only forces of pairs show, which are other checks' matter, if densities are hidden.
NOT_BY_X_AND_V = {"pairs_counted_twice"}


def examined(make, *names):
    """Return the diagnosis by some checks, and by those that they need."""
    wanted, found = set(), {"adapter", "order", *names}
    while found - wanted:
        wanted |= found
        found = {need for name in wanted for need in CHECKS[name].needs}
    return check_solver(make, skip=[name for name in CHECKS if name not in wanted])


def results(make, *names):
    """Return results by name."""
    return {each.check: each for each in examined(make, *names).results}


def unjust(diagnosis):
    """Return what speaks against the solver."""
    return [(each.check, each.message) for each in diagnosis.results if each.broken]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "shows"),
    [(name, shows) for name in HEALTHY for shows in ("all", "nothing")]
    + [(name, shows) for name in ("article", "continuity") for shows in ("rho", "a")],
)
def test_no_false_alarm(name, shows):
    make = zoo(**HEALTHY[name], shows=SHOWN[shows])
    assert unjust(examined(make, *NEIGHBOURS, *VISCOSITY, *XSPH)) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["article", "continuity_predictor", "single", "cubic_kdk_mu"])
@pytest.mark.parametrize("search", SOUND)
def test_no_false_alarm_on_sound_searches(search, name):
    for shows in ("all", "nothing"):
        make = zoo(**HEALTHY[name], pairs=SOUND[search], shows=SHOWN[shows])
        assert unjust(examined(make, *NEIGHBOURS)) == []


def test_loops_of_plain_python_pass():
    diagnosis = examined(Loops, *NEIGHBOURS, *VISCOSITY, *XSPH)
    assert unjust(diagnosis) == []
    passed = {each.check for each in diagnosis.results if each.status == "pass"}
    assert passed >= {"same_everywhere", "any_order", "newcomers", "xsph_smooths"}


@pytest.mark.every(3)
@pytest.mark.parametrize("search", BROKEN)
def test_lists_show_what_is_missing(search):
    diagnosis = examined(zoo(**HEALTHY["article"], pairs=BROKEN[search]), *NEIGHBOURS)
    assert diagnosis.link == "neighbours", unjust(diagnosis)


@pytest.mark.every(7)
@pytest.mark.parametrize("shows", ["rho", "nothing"])
@pytest.mark.parametrize("search", BROKEN)
def test_missing_pairs_are_found_without_lists(search, shows):
    make = zoo(**HEALTHY["article"], pairs=BROKEN[search], shows=SHOWN[shows])
    diagnosis = examined(make, *NEIGHBOURS)
    assert diagnosis.link == "neighbours", diagnosis


@pytest.mark.every(3)
@pytest.mark.parametrize("search", ["hashed_twice", "first_20", "domain", "one_row", "one_side"])
def test_densities_by_continuity_hide_nothing(search):
    make = zoo(**HEALTHY["continuity_predictor"], pairs=BROKEN[search], shows=())
    assert examined(make, *NEIGHBOURS).link == "neighbours"


def test_lists_of_the_start_are_found_with_densities_by_continuity():
    make = zoo(**HEALTHY["continuity"], pairs=BROKEN["anew_every_500"], shows=())
    result = results(make, "newcomers")["newcomers"]
    assert result.status == "fail"
    assert "fly through each other" in result.message


@pytest.mark.every(4)
@pytest.mark.parametrize("link", ["neighbours", "viscosity", "xsph"])
@pytest.mark.parametrize("shows", ["all", "nothing"])
def test_faults_of_the_plain_solver(link, shows):
    names = {"neighbours": NEIGHBOURS, "viscosity": VISCOSITY, "xsph": XSPH}[link]
    for name, fault in FAULTS.items():
        if fault.link != link or (shows == "nothing" and name in NOT_BY_X_AND_V):
            continue
        diagnosis = examined(showing(fault.make, *SHOWN[shows]), *names)
        assert diagnosis.link == link, (name, unjust(diagnosis))


@pytest.mark.slow
@pytest.mark.parametrize("shows", ["all", "nothing"])
def test_other_links_are_not_taken_for_neighbours(shows):
    for name, fault in FAULTS.items():
        if fault.link in ("setup", "neighbours"):
            continue
        make = showing(fault.make, *SHOWN[shows])
        found = [
            each
            for each in examined(make, *NEIGHBOURS).results
            if each.broken and each.link == "neighbours" and each.check in NEIGHBOURS
        ]
        assert found == [], name


class HalfKernel(Zoo):
    """Takes case.h for twice the smoothing length twice: kernel and lists end at h / 2."""

    def __init__(self, case, style):
        super().__init__(case, style)
        self.h = case.h / 2
        self.m = self.mass()
        self.evaluate()


def test_a_short_kernel_is_no_matter_of_neighbours():
    result = results(zoo(HalfKernel), "neighbor_lists")["neighbor_lists"]
    assert (result.status, result.link) == ("fail", "density")
    assert result.measured == pytest.approx(0.5, abs=0.02)


class Walled(Zoo):
    """Has walls at x = 0.3 m although nobody asked for a box."""

    def step(self, dt):
        super().step(dt)
        self.x[:, 0] = np.minimum(self.x[:, 0], 0.3)


def test_walls_that_nobody_asked_for():
    result = results(zoo(Walled, shows=()), "same_everywhere")["same_everywhere"]
    assert (result.status, result.link) == ("fail", "walls")


class Twice(Zoo):
    """Brakes velocities once more, beside the acceleration that it shows."""

    def step(self, dt):
        self.evaluate()
        self.v = self.v + dt * self.thickness()
        super().step(dt)


def test_viscosity_that_acts_on_velocities_too():
    result = results(zoo(Twice), "viscosity_strength")["viscosity_strength"]
    assert result.status == "fail"
    assert "what `a` says" in result.message


@pytest.mark.parametrize("style", ["nu", "mu", "article", "morris", "monaghan_nu"])
def test_strength_of_a_viscosity(style):
    result = results(zoo(viscosity=style), "viscosity_strength")["viscosity_strength"]
    assert result.status == "pass"
    assert 0.84 < result.measured < 1.07


@pytest.mark.parametrize(("style", "alpha"), [("alpha", 1 / 32), ("alpha_support", 1 / 16)])
def test_strength_of_artificial_viscosity(style, alpha):
    result = results(zoo(viscosity=style), "viscosity_strength")["viscosity_strength"]
    assert result.status == "pass"
    assert result.measured == pytest.approx(alpha, rel=0.25)


class PerStep(Zoo):
    """Adds the XSPH correction itself to positions, not its product with dt."""

    def smoothing(self):
        return super().smoothing() / 1e-4


class Fixed(Zoo):
    """Has an epsilon of its own as soon as any is asked for."""

    def smoothing(self):
        return super().smoothing() * 0.3 / max(self.case.xsph, 1e-9)


class OneSided(Zoo):
    """Gives only one of each pair its share of XSPH."""

    def smoothing(self):
        self.w = np.triu(self.w)
        return super().smoothing()


@pytest.mark.parametrize(
    ("make", "name"),
    [(PerStep, "xsph_smooths"), (Fixed, "xsph_epsilon"), (OneSided, "xsph_momentum")],
)
def test_faults_of_xsph(make, name):
    found = results(zoo(make), *XSPH)
    assert found[name].status == "fail"
    assert found[name].link == "xsph"


def test_weights_are_the_kernel():
    make = zoo(kernel="wendland")
    lab = Lab(make)
    lab.shown = frozenset(("rho",))
    weights = pair_weights(lab)
    solver = make(case(lattice(1, 1), h=weights.h))._solver
    expected = solver.m * solver.kernel(weights.h * DISTANCES)[0]
    np.testing.assert_allclose(weights.added, expected, atol=1e-6 * expected.max())
    assert weights.once
    assert not weights.one_sided


def test_every_finding_says_what_was_measured():
    make = zoo(**HEALTHY["article"], pairs=BROKEN["one_row"])
    for each in examined(make, *NEIGHBOURS).results:
        if each.broken:
            assert each.measured != ""
            assert each.remedy
            assert each.step == 2
