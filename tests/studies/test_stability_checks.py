"""Every check of the hard cases can fail, and measures what it says."""

import dataclasses
import math

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.solver.diagnostics import Totals
from sph_gym.solver.simulation import Report
from sph_gym.studies import stability
from sph_gym.studies.stability import checks, comparisons, limits, runs
from sph_gym.studies.stability.case import VARIANTS
from sph_gym.studies.stability.runs import CaseOutcome, CaseRun

CASES = {case.name: case for case in stability.cases()}
AS_IT_IS, OTHER_KERNELS, FLOAT32, _ = VARIANTS


def outcome(case, blowups=0, cause="", **values):
    """An outcome within all bounds, but for what is given."""
    good = dict.fromkeys(checks.BY_NAME, 0.0)
    good |= {"lowest": 1.0, "left": 1.0, "typical": 1.0, "happened": math.inf}
    good["step"] = case.bounds.get("step", 0.0)
    return CaseOutcome(1, blowups, cause, good | values)


def failing(case, **changes):
    """The rows that an outcome fails, in whichever of three variants it is."""
    found = []
    for bad in range(3):
        outcomes = [outcome(case, **changes) if k == bad else outcome(case) for k in range(3)]
        # alike, so that no row asks about some of them only
        rows = runs.rows(case, [(AS_IT_IS, each) for each in outcomes])
        found.append([row.quantity for row in rows if not row.holds])
    assert found[0] == found[1] == found[2]
    return found[0]


@pytest.mark.parametrize(
    ("changes", "quantity"),
    [
        ({"blowups": 1}, "reported blow-ups"),
        ({"silent": 1}, "frames that failed in silence"),
        ({"passed": 1}, "particles behind a wall"),
        ({"threads": 1}, "fields that differ on two threads"),
        ({"grid": 2e-12}, "grid against brute force, rho, p, a"),
        ({"observables": 1e-7}, "runs on grid and brute force"),
        ({"density": 0.03}, "mean compression, second half"),
        ({"gain": 0.11}, "mean compression beyond the start's"),
        ({"p99": 0.05}, "99th percentile of compression, second half"),
        ({"excess": 0.03}, "spurious energy"),
        ({"rise": 0.03}, "rise of spurious energy"),
        ({"happened": 0.5}, "mean change of velocity"),
        ({"drift": 1e-13}, "spurious momentum"),
        ({"lowest": 0.99}, "least density"),
        *(
            ({check.name: math.nan}, check.title)
            for check in checks.CHECKS
            if not check.optional and check.name not in ("happened", "held")
        ),
        ({"happened": math.nan}, "mean change of velocity"),
        ({"drift": math.nan}, "spurious momentum"),
    ],
)
def test_a_bound_that_is_missed_fails(changes, quantity):
    case = CASES["colliding patches"]
    assert failing(case) == []
    assert failing(case, **changes) == [quantity]


@pytest.mark.parametrize(
    ("name", "changes", "quantity"),
    [
        ("one particle", {"density": 1e-9}, "mean compression, second half"),
        ("film of one particle", {"density": 1e-9}, "mean compression, second half"),
        ("random places", {"burst": 0.05}, "mean compression after the first frame"),
        ("one particle", {"highest": 1.1}, "largest density"),
        ("water at rest for 60 s", {"kinetic": 2e-5}, "kinetic energy once at rest"),
        ("water at rest for 60 s", {"left": 0.8}, "least density of fluid that stays together"),
        ("epsilon = 1", {"clumped": 0.5}, "more than its twin closer than 0.6 dx"),
        (
            "Poiseuille flow, kick_drift_kick, summed",
            {"peak": 1.2},
            "largest density, second half",
        ),
        ("far from the origin", {"unlike": 0.1}, "end unlike that of its twin"),
        ("dt x 1", {"typical": 0.5}, "least median density"),
        ("dt x 3", {"step": 2.5}, "longest step"),
        ("stretched sheet", {"gain": 0.1}, "mean compression beyond the start's"),
        ("stretched sheet", {"p99": 0.3}, "99th percentile of compression, second half"),
        ("h/dx = 2", {"clumping": 0.2}, "closer than 0.6 dx, second half"),
        # above the stable step
        ("dt x 4", {"silent": 1}, "frames that failed in silence"),
        ("dt x 4", {"excess": 0.1}, "spurious energy"),
        ("dt x 4", {"density": 0.5}, "mean compression, second half"),
    ],
)
def test_what_is_asked_of_some_cases_only_fails(name, changes, quantity):
    assert failing(CASES[name]) == []
    assert failing(CASES[name], **changes) == [quantity]


def test_above_the_stable_step_a_run_that_blew_up_may_be_anything():
    assert failing(CASES["dt x 4"], blowups=1, cause="cfl", excess=3.0, density=0.5) == []


def test_only_kernels_that_are_no_pair_may_pair():
    case, cured = CASES["h/dx = 4"], CASES["pairing, cured by shifting"]
    assert failing(case, clumping=0.2) == []
    assert case.bound("clumping", AS_IT_IS) is None
    assert case.bound("clumping", OTHER_KERNELS) == cured.bound("clumping", AS_IT_IS) == 0.15


@pytest.mark.parametrize(("gap", "holds"), [(1e-5, True), (1e-4, False), (math.nan, False)])
def test_the_two_precisions_are_held_to_their_own_bounds(gap, holds):
    case = CASES["dt x 1"]
    rows = list(runs.rows(case, [(FLOAT32, outcome(case, grid=gap)), (AS_IT_IS, outcome(case))]))
    found = [row.holds for row in rows if row.quantity.startswith("grid")]
    assert found == [True, holds]


@pytest.mark.parametrize(("cause", "odd"), [("cfl", False), ("stiffness", False), ("nan", True)])
def test_a_blow_up_has_a_plausible_cause(cause, odd):
    case = CASES["stiffness x 100 at the old dt" if cause == "stiffness" else "dt x 4"]
    quantity = "blow-ups whose cause is not that of the case"
    assert (quantity in failing(case, blowups=1, cause=cause)) is odd


@pytest.mark.parametrize(
    ("value", "holds", "verdict"),
    [(0.14, True, "holds"), (0.17, True, "known limit"), (0.19, False, "[bold red]FAILS[/]")],
)
def test_a_known_limit_is_still_measured(value, holds, verdict):
    case, title = CASES["epsilon = 0.6, no other viscosity"], checks.BY_NAME["clumped"].title
    found = [(AS_IT_IS, outcome(case)), (OTHER_KERNELS, outcome(case, clumped=value))]
    rows = [row for row in runs.rows(case, found) if row.quantity == title]
    assert (rows[0].value, rows[0].holds, rows[0].verdict) == (value, holds, verdict)
    assert (limits.LABEL in rows[0].case) is (value > 0.15)
    # in another variant, and in the quick version, the bound is the usual one
    other = [(AS_IT_IS, outcome(case, clumped=0.16))]
    for quick, several in ((False, other), (True, found)):
        rows = [row for row in runs.rows(case, several, quick) if row.quantity == title]
        assert {row.bound for row in rows} == {0.15}


def test_what_was_not_compared_has_no_row_and_is_missed_in_the_end():
    case = CASES["colliding patches"]
    blank = CaseOutcome(1, 0, "", {"lowest": 1.0})
    assert not [row for row in runs.rows(case, [(AS_IT_IS, blank)]) if "brute" in row.quantity]
    totals = {row.quantity: row for row in runs.summary({"a": (case, [(AS_IT_IS, blank)])})}
    assert not totals["runs compared with brute force"].holds


def test_the_summary_counts_over_all_cases():
    case, risky = CASES["one particle"], CASES["dt x 4"]
    blown = [(variant, CaseOutcome(1, 1, "cfl", {"silent": 2.0})) for variant in VARIANTS]
    totals = {row.quantity: row for row in runs.summary({"a": (case, blown), "b": (risky, blown)})}
    assert totals["blow-ups at or below the stable step"].value == len(VARIANTS)
    assert totals["frames that failed in silence"].value == 4 * len(VARIANTS)
    assert not totals["cases"].holds


def test_values_of_two_runs_become_those_of_the_worse():
    one = {"silent": 1.0, "lowest": 0.2, "density": 0.3}
    other = {"silent": 2.0, "lowest": 0.1, "density": math.nan, "grid": 0.0}
    for both in (checks.fold(one, other), checks.fold(other, one)):
        assert (both["silent"], both["lowest"], both["grid"]) == (3.0, 0.1, 0.0)
        assert math.isnan(both["density"])


# --- Measures -------------------------------------------------------------------------------


def start(name="colliding patches"):
    return Simulation(CASES[name].scene(AS_IT_IS), threads=1)


def with_kinetic(sim, kinetic):
    """The simulation, whose books say that it has so much kinetic energy [J/m]."""
    snapshot = sim.snapshot()
    totals = Totals(*snapshot["totals"])._replace(kinetic=kinetic)
    sim.restore(snapshot | {"totals": tuple(totals)})


def test_friction_does_not_hide_spurious_energy():
    run = CaseRun(CASES["colliding patches"], AS_IT_IS, quick=True)
    sim, stake = run.sim, run.sim.energy_at_stake
    held = sim.diagnostics()["kinetic_energy"] - sim.energy_surplus
    for surplus, rise in ((0.0, 0.0), (-0.5, 0.0), (-0.3, 0.2), (-0.4, 0.1)):
        with_kinetic(sim, held + surplus * stake)
        run.look()
        assert run.energy_rise == pytest.approx(rise)


def test_looking_at_the_stable_step_costs_no_energy_at_stake():
    case = CASES["stiffness switched every frame"]
    run, sim = CaseRun(case, AS_IT_IS, quick=True), start("stiffness switched every frame")
    for frame in range(4):
        run.step(frame)
        sim.controls = case.steer(sim, frame)
        sim.advance(max(round(sim.scene.frame / sim.controls.dt), 1) * sim.controls.dt)
        assert run.sim.energy_at_stake == sim.energy_at_stake


@pytest.mark.parametrize("place", range(3))
def test_a_gap_that_is_no_number_is_the_greatest(place):
    values = [0.0, 1.0, 2.0]
    values[place] = math.nan
    assert math.isnan(comparisons.greatest(values))


@pytest.mark.parametrize("field", ["x", "u", "rho"])
def test_planted_nonsense_is_seen(field):
    sim = start()
    assert not checks.is_silent(sim, Report(1, 0.1))
    getattr(sim.engine.fluid, field)[3] = np.nan
    assert checks.is_silent(sim, Report(1, 0.1))


@pytest.mark.parametrize(
    "story", [("", "force", 0), ("cfl", "", 0), ("cfl", "force", -1), ("cfl", "force", 10**6)]
)
def test_a_blow_up_without_its_story_is_silence(story):
    sim = start()
    assert checks.is_silent(sim, Report(1, 0.1, True, *story))
    assert not checks.is_silent(sim, Report(1, 0.1, True, "cfl", "force", 0))


def test_spurious_energy_that_is_not_reported_is_silence():
    sim = start()
    with_kinetic(sim, 1e9)
    assert checks.is_silent(sim, Report(1, 0.1))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("thin jet on a plate", marks=pytest.mark.slow),
        "corner jet, boundary particles",
        "dt x 1",
    ],
)
def test_a_particle_behind_a_wall_is_seen(name):
    behind, sim = CASES[name].behind, start(name)
    assert checks.n_passed(sim, behind) == 0
    sim.engine.fluid.y[0] = -3 * sim.scene.dx
    sim.engine.fluid.x[0] = 0.01
    assert checks.n_passed(sim, behind) == 1


def test_particles_on_the_box_are_counted():
    sim = start("dt x 1")
    assert checks.n_held_by_box(sim) == 0
    sim.engine.fluid.x[:2] = 0.0
    assert checks.n_held_by_box(sim) == 2


@pytest.mark.slow
def test_a_box_that_moves_is_where_it_is_now():
    sim = start("swinging wall")
    assert checks.n_passed(sim) == 0
    # a quarter of a period: the wall has moved in
    sim.time = 0.25 / sim.scene.walls.motion.frequency
    assert checks.n_passed(sim) > 0


# --- Comparisons ----------------------------------------------------------------------------


def test_runs_that_depend_on_threads_or_search_are_seen():
    scene = CASES["colliding patches"].scene(AS_IT_IS)

    def advance(sim, by=0):
        sim.controls = sim.controls._replace(xsph=0.3 + by * 0.01)
        return sim.advance(scene.frame)

    def by_threads(sim):
        return advance(sim, len(sim.engine.world.status))

    def by_search(sim):
        return advance(sim, sim.neighbors == "brute")

    def twin(neighbors="grid", threads=1):
        return Simulation(scene, neighbors=neighbors, threads=threads)

    assert comparisons.threads_differ(twin, advance, 2) == 0
    assert comparisons.threads_differ(twin, by_threads, 2) >= 3
    assert comparisons.run_gap(twin, advance, 2) < checks.ALIKE
    assert comparisons.run_gap(twin, by_search, 2) > checks.ALIKE


def test_runs_are_compared_where_they_have_come_to():
    run = CaseRun(CASES["colliding patches"], AS_IT_IS, quick=True)
    for frame in range(3):
        run.step(frame)
    run.branch(3)
    copy = run.copy()
    assert copy.time == run.sim.time > 0
    assert run.advance(copy) == run.advance(run.sim)
    assert np.array_equal(copy.x, run.sim.x)


@pytest.mark.slow
def test_a_list_that_misses_neighbours_is_seen():
    sim = start("dt x 1")
    sim.advance(sim.scene.frame)
    assert comparisons.grid_gap(sim) < checks.SAME["float64"]
    assert 0 < comparisons.sample_gap(sim) < checks.SAME["float64"]
    sim.engine.fluid.rho[5] *= 1 + 1e-9
    assert comparisons.grid_gap(sim) > checks.SAME["float64"]


@pytest.mark.parametrize("name", ["colliding patches", "far from the origin, in a tank"])
def test_a_sample_is_compared_in_single_precision_too(name):
    # as far from its origin as a large flow is in multiples of its spacing, or farther
    scene = CASES[name].scene(AS_IT_IS)
    if name == "colliding patches":
        scene = dataclasses.replace(scene, x=np.add(scene.x, 1e3))
    else:
        # a kind of scene that other tests compile too
        effects = dataclasses.replace(scene.effects, laminar_viscosity=0.02)
        scene = dataclasses.replace(scene, effects=effects)
    sim = Simulation(scene, "float32", threads=1)
    assert 0 < comparisons.sample_gap(sim) < checks.SAME["float32"]
