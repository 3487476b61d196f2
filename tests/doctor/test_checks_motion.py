"""Checks of integration, walls and the whole: each finds its faults, none accuses the healthy."""

import numpy as np
import pytest

from sph_gym.doctor import faults, plain, throws
from sph_gym.doctor.checks import integration, scheme, walls, whole
from sph_gym.doctor.checkup import Checkup
from sph_gym.doctor.registry import CHECKS
from tests.doctor.motion_solvers import HEALTHY, OPTIONAL, WALLS, maker

MODULES = (integration, scheme, whole, walls)
MINE = [
    name
    for name, check in CHECKS.items()
    if check.function.__module__ in {module.__name__ for module in MODULES}
]


# What some checks find for others.
PREPARES = {"thrown_blocks": "thrown_alone", "tunnelling": "thrown_alone"}


def finding(make, name):
    """Return status, link and message of one check, without those that it waits for."""
    checkup = Checkup(make)
    for needed in ("adapter", PREPARES.get(name, "adapter"), name):
        check = CHECKS[needed]
        found = checkup._finding(check._replace(last=False, needs=()))
    return found.status, found.link or check.link, found.message


def findings(make):
    """Return the findings of all checks of these modules, by name."""
    return {name: finding(make, name) for name in MINE}


# Many particles in walls, or many pairs: these take some ten seconds each.
SLOW = ("continuity, leapfrog", "viscous", "quintic", "ghosts", "a spacing off", "two layers")


def some_slow(names):
    return [pytest.param(k, marks=[pytest.mark.slow] * (k in SLOW)) for k in names]


@pytest.mark.slow
@pytest.mark.parametrize("name", some_slow(HEALTHY))
def test_healthy_solvers_pass(name):
    make = maker(**HEALTHY[name])
    found = findings(make)
    assert not {k: v for k, v in found.items() if v[0] in ("fail", "error", "blocked")}
    for check in ("flight", "galilean", "free_fall", "ringing", "blob", "expansion", "suction"):
        assert found[check][0] == "pass", found[check]
    for check in ("thrown_alone", "standing", "dam_break", "reproducible"):
        assert found[check][0] == "pass", found[check]


@pytest.mark.every(3)
@pytest.mark.parametrize("name", some_slow(WALLS))
def test_healthy_walls_pass(name):
    for check in ("thrown_alone", "thrown_blocks", "tunnelling", "standing"):
        status, _, message = finding(maker(**WALLS[name]), check)
        assert status in ("pass", "inconclusive"), message
        assert "could not be used" not in message


SUMS = ({}, {"kernels": ("cubic",) * 2, "calibrated": False}, {"dtype": np.float32})
SCHEMES = ("euler", "drift_first", "kdk", "dkd", "half", "verlet", "midpoint", "heun", "substeps")


@pytest.mark.every(3)
@pytest.mark.parametrize("name", SCHEMES)
def test_healthy_schemes_pass(name):
    known = 0
    for style in SUMS:
        for hide in ((), OPTIONAL):
            status, _, message = finding(maker(scheme=name, hide=hide, **style), "scheme")
            assert status in ("pass", "inconclusive"), message
            known += status == "pass"
    assert known >= (3 if name != "substeps" else 0)


@pytest.mark.parametrize("hide", [(), OPTIONAL], ids=["shows all", "x and v"])
@pytest.mark.parametrize("style", SUMS, ids=["article", "cubic", "float32"])
@pytest.mark.parametrize("name", ["forward", "lagged"])
def test_schemes_that_gain_energy_are_named(name, style, hide):
    status, link, message = finding(maker(scheme=name, hide=hide, **style), "scheme")
    assert (status, link) == ("fail", "integration"), message


@pytest.mark.every(4)
@pytest.mark.parametrize("hide", [(), OPTIONAL], ids=["shows all", "x and v"])
@pytest.mark.parametrize("name", ["forward", "lagged", "old_density"])
def test_sound_grows_by_them_where_densities_have_a_memory(name, hide):
    make = maker(scheme=name, density="continuity", alpha=0.05, hide=hide)
    assert finding(make, "scheme")[0] == "inconclusive"
    assert finding(make, "ringing")[:2] == ("fail", "integration")


def test_half_a_velocity_verlet_is_left_open():
    status, _, message = finding(maker(scheme="taylor"), "scheme")
    assert status == "inconclusive"
    assert "half as fast" in message


# fault of motion_solvers: check that finds it, link, words of its message or remedy
MOTION = {
    "dt ignored": ("flight", "integration", "displacement over v t"),
    "dt squared": ("flight", "integration", "displacement over v t"),
    "half drift": ("flight", "integration", "0.5"),
    "decay": ("flight", "integration", "multiplied by 0.99 a step"),
    "speed limit": ("flight", "integration", "slowed down to one speed"),
    "hidden gravity": ("flight", "force", "gravity is 0"),
    "drag": ("galilean", "viscosity", "one velocity"),
    "gravity twice": ("free_fall", "force", "(0, -80)"),
    "gravity sign": ("free_fall", "force", "(0, 40)"),
    "one axis": ("free_fall", "force", "(30, 0)"),
    "gravity in the loop": ("free_fall", "force", "center of a block"),
    "half kick": ("free_fall", "integration", "(0, -20)"),
    "walls of nan": ("thrown_alone", "walls", "finite until"),
    "position only": ("thrown_alone", "walls", "velocity goes on"),
    "wrong sign": ("thrown_alone", "walls", "velocity goes on"),
    "restitution": ("thrown_alone", "walls", "1.5 of their speed"),
    "all on the wall": ("thrown_alone", "walls", "far more than v dt"),
    "periodic": ("thrown_alone", "walls", "far more than v dt"),
    "no right wall": ("thrown_alone", "walls", "right"),
    "floor only": ("thrown_alone", "walls", "left, right, ceiling"),
    "no walls": ("thrown_blocks", "walls", "there are no walls"),
    "first ten only": ("thrown_blocks", "walls", "with 0.1 c0"),
    "leaks when fast": ("thrown_blocks", "walls", "they tunnel"),
    "leaks at c0": ("tunnelling", "walls", "some pass"),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", MOTION)
def test_faults_are_found_at_their_link(name):
    check, link, words = MOTION[name]
    status, found, message = finding(maker(fault=name), check)
    assert (status, found) == ("fail", link), message
    assert words in message


@pytest.mark.every(5)
@pytest.mark.parametrize("name", [name for name in MOTION if name != "half kick"])
def test_faults_are_found_by_x_and_v_alone(name):
    check, link, _ = MOTION[name]
    status, found, message = finding(maker(fault=name, hide=OPTIONAL), check)
    assert (status, found) == ("fail", link), message


@pytest.mark.parametrize("kind", ["layers", "penalty", "lj"])
def test_a_missing_side_is_found_in_walls_of_every_kind(kind):
    make = maker(walls=kind, fault="no right wall", kernels=("wendland",) * 2)
    status, link, message = finding(make, "thrown_blocks")
    assert (status, link) == ("fail", "walls")
    assert "nothing stops them at right" in message


def test_walls_that_need_gravity_are_left_open():
    status, _, message = finding(maker(walls="lj by gravity"), "thrown_blocks")
    assert status == "inconclusive"
    assert "with gravity they don't" in message


def test_a_factor_between_a_and_the_change_of_v():
    status, link, message = finding(maker(fault="half kick"), "step_uses_acceleration")
    assert (status, link) == ("fail", "integration")
    assert "0.5" in message


def test_forces_shown_as_accelerations_are_a_matter_of_setup():
    status, link, message = finding(maker(fault="shows forces"), "step_uses_acceleration")
    assert (status, link) == ("fail", "setup"), message


@pytest.mark.parametrize("name", [*HEALTHY])
def test_sound_solvers_keep_their_momentum_in_motion(name):
    status, _, message = finding(maker(**HEALTHY[name]), "momentum_in_motion")
    assert status == "pass", message


def test_a_loop_that_does_all_for_one_particle_after_the_other_is_found():
    class InTheLoop(plain.Plain):
        def advance(self, dt):
            for i in range(self.n):
                self.evaluate()
                self.v[i] += dt * self.a[i]
                self.x[i] += dt * self.v[i]

    for make in (faults.make("one_loop"), InTheLoop):
        status, link, message = finding(make, "momentum_in_motion")
        assert (status, link) == ("fail", "force"), message
        assert "at rest add up to 0" in message


def test_walls_that_turn_a_velocity_in_every_step_are_found():
    status, link, message = finding(faults.make("trembles"), "thrown_alone")
    assert (status, link) == ("fail", "walls")
    assert "turned again" in message


def test_a_step_that_makes_nan_is_told_from_a_density_of_zero():
    class Adaptive(plain.Plain):
        n_steps = 0

        def advance(self, dt):
            super().advance(dt)
            self.n_steps += 1
            if self.n_steps > 3:
                self.v = self.v * np.nan

    assert finding(Adaptive, "isolated")[:2] == ("fail", "integration")
    assert finding(faults.make("no_own_share"), "isolated")[1] == "density"


def test_suction_is_found():
    for hide in ((), OPTIONAL):
        make = maker(clamp=False, hide=hide)
        assert finding(make, "suction")[:2] == ("fail", "pressure")


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("name", "check", "link"),
    [
        ("attracts", "blob", "force"),
        ("twice_the_mass", "blob", "force"),
        ("missing_column", "blob", "force"),
        ("no_gamma_in_b", "expansion", "pressure"),
        ("jelly", "dam_break", "viscosity"),
        ("mass_of_one", "dam_break", "pressure"),
        ("coincident_nan", "dam_break", ""),
    ],
)
def test_the_whole_shows_what_slipped_through(name, check, link):
    status, found, message = finding(faults.make(name), check)
    assert status == "fail", message
    assert found == link or not link


def test_a_step_that_is_too_long_is_told_from_a_force():
    class Stiff(plain.Plain):
        def __init__(self, case):
            super().__init__(case)
            self.stiffness *= 100

    status, _, message = finding(Stiff, "blob")
    assert status in ("pass", "fail")
    assert finding(Stiff, "expansion")[0] == "fail", message


def test_left_over_state_is_found():
    count = iter(range(1000))

    def make(case):
        solver = plain.make(case)
        solver.x = solver.x + 1e-4 * next(count)
        return solver

    assert finding(make, "reproducible")[:2] == ("fail", "setup")


@pytest.mark.every(3)
@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0])
def test_senseless_numbers_end_in_a_finding(bad):
    class Bad(plain.Plain):
        def step(self, dt):
            super().step(dt)
            self.x, self.v, self.a = (bad * each for each in (self.x, self.v, self.a))

    with np.errstate(all="ignore"):
        for name, (status, _, message) in findings(Bad).items():
            assert status in ("pass", "fail", "blocked", "inconclusive", "skip"), (name, message)


def test_a_throw_knows_what_is_outside():
    checkup = Checkup(maker(fault="no walls"))
    checkup._lab.start("throw", 60.0)
    run = throws.alone(checkup._lab, 0.3, 0.2)
    assert run.lost.all()
    assert run.untouched.all()
    assert run.energy == pytest.approx(1.0)
    blocks = throws.blocks(checkup._lab, 0.3, 0.2)
    assert [blocks.lost_share(k) for k in range(4)] == [1.0] * 4
    assert (np.bincount(blocks.side) == 25).all()
