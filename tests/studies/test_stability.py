"""The hard cases in their quick version, and that every check of theirs can fail."""

import itertools
import json
import math
from functools import partial

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.solver import simulation
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.simulation import Report
from sph_gym.studies import stability
from sph_gym.studies.stability import checks, memory, report, runs, streams, walls
from sph_gym.studies.stability.case import VARIANTS, held_by_box, overstepping
from sph_gym.studies.stability.runs import Outcome, worst

CASES = {case.name: case for case in stability.cases()}
AS_IT_IS = VARIANTS[0]


def test_the_quick_catalogue_holds(tmp_path):
    rows = list(stability.catalogue(True, tmp_path))
    assert [row for row in rows if not row.holds] == []
    totals = {row.quantity: row.value for row in rows if row.case == "all"}
    assert totals["cases"] == len(CASES) >= 30
    assert totals["variants of each, at least"] == 3
    assert len(list(tmp_path.glob("*.json"))) == 3 * len(CASES)


def test_boundary_particles_hold_what_they_are_meant_for():
    assert walls.passed(AS_IT_IS, walls.HELD) == (0, False)
    assert walls.passed(AS_IT_IS, 1.2) == (0, True)


def test_particles_that_pass_before_that_is_told_are_silent():
    outcomes = {0.2: walls.Strays(0, 0), 0.4: walls.Strays(3, 1), 0.6: walls.Strays(0, 1)}
    held, silent, told = walls._rows("shower", 1.0, outcomes)
    assert (held.value, held.holds) == (0.2, False)
    assert (silent.value, silent.holds) == (3.0, False)
    assert (told.value, told.unit, told.bound) == (1.0, "of 1", None)


def test_every_variant_changes_one_thing():
    kernels = {CASES["two particles"].scene(variant).fluid.kernel for variant in VARIANTS}
    spacings = {CASES["two particles"].scene(variant).dx for variant in VARIANTS}
    assert len(kernels) == len(spacings) == len({variant.dtype for variant in VARIANTS}) == 2


# --- A solver that does nothing -------------------------------------------------------------


def stand_still(sim, seconds):
    """An `advance` that only reports."""
    return Report(max(round(seconds / sim.controls.dt), 1), sim.controls.dt)


@pytest.mark.parametrize("name", CASES)
def test_a_solver_that_stands_still_fails_every_case(name, monkeypatch):
    monkeypatch.setattr(Simulation, "advance", stand_still)
    case = CASES[name]
    # nobody moves, however many there are
    short = case._replace(quick=2, sizes=case.sizes[:1], dx=max(case.dx, 0.01))
    outcome = runs.run(short, AS_IT_IS, quick=True)
    for quick in (False, True):
        rows = report.rows(case, [(AS_IT_IS, outcome)], quick)
        assert case.event.title in [row.quantity for row in rows if not row.holds]


def test_a_solver_whose_clock_alone_runs_fails_too(monkeypatch):
    def pass_time(sim, seconds):
        sim.time += seconds
        return stand_still(sim, seconds)

    monkeypatch.setattr(Simulation, "advance", pass_time)
    for name in ("one particle", "water at rest for 60 s", "dt x 1"):
        outcome = runs.run(CASES[name], AS_IT_IS, quick=True)
        rows = report.rows(CASES[name], [(AS_IT_IS, outcome)], True)
        assert CASES[name].event.title in [row.quantity for row in rows if not row.holds]


@pytest.mark.parametrize("name", ["far from the origin", "far from the origin, in a tank"])
def test_single_precision_that_counts_from_afar_is_seen(name, monkeypatch):
    case = CASES[name]
    assert {case.precision(variant) for variant in VARIANTS} == {"float32"}
    monkeypatch.setattr(simulation, "origin", lambda scene, dtype: np.zeros(2))
    outcome = runs.run(case, AS_IT_IS, quick=True)
    rows = report.rows(case, [(AS_IT_IS, outcome)], True)
    assert "end unlike that of its twin" in [row.quantity for row in rows if not row.holds]


# --- Every check can fail -------------------------------------------------------------------


def failing(case, **changes):
    """The rows that an outcome fails."""
    good = Outcome(
        substeps=1,
        step=case.pushed,
        excess=0.0,
        lowest=1.0,
        left=1.0,
        typical=1.0,
        grid=0.0,
        observables=0.0,
        unlike=0.0,
        clumped=0.0,
    )
    missed = []
    for bad in range(3):
        outcomes = [good._replace(**changes) if k == bad else good for k in range(3)]
        # alike, so that no row asks about some of them only
        rows = report.rows(case, [(AS_IT_IS, outcome) for outcome in outcomes])
        missed.append([row.quantity for row in rows if not row.holds])
    assert missed[0] == missed[1] == missed[2]
    return missed[0]


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
        ({"excess": 0.03}, "energy from nowhere"),
        ({"excess": math.nan}, "energy from nowhere"),
        ({"rise": 0.03}, "rise of energy from nowhere"),
        ({"rise": math.nan}, "rise of energy from nowhere"),
        ({"happened": 0.5}, "mean change of velocity"),
        ({"happened": math.nan}, "mean change of velocity"),
        ({"drift": 1e-13}, "momentum from nowhere"),
        ({"drift": math.nan}, "momentum from nowhere"),
        ({"grid": math.nan}, "grid against brute force, rho, p, a"),
        ({"observables": math.nan}, "runs on grid and brute force"),
        ({"density": math.nan}, "mean compression, second half"),
        ({"p99": math.nan}, "99th percentile of compression, second half"),
        ({"lowest": 0.99}, "least density"),
        ({"lowest": math.nan}, "least density"),
    ],
)
def test_a_demand_that_is_missed_fails(changes, quantity):
    case = CASES["colliding patches"]
    assert failing(case) == []
    assert failing(case, **changes) == [quantity]


@pytest.mark.parametrize("name", ["one particle", "film of one particle"])
def test_lonely_fluid_must_not_be_compressed_at_all(name):
    assert failing(CASES[name], density=1e-9) == ["mean compression, second half"]


def test_bursts_must_be_over_after_a_frame():
    case = CASES["random places"]
    assert failing(case, burst=0.05) == ["mean compression after the first frame"]


def test_what_is_asked_of_some_cases_only_fails():
    assert failing(CASES["one particle"], highest=1.1) == ["largest density"]
    assert failing(CASES["water at rest for 60 s"], kinetic=2e-5) == ["kinetic energy once at rest"]
    assert failing(CASES["epsilon = 1"], clumped=0.5) == ["more than its twin closer than 0.6 dx"]
    channel = CASES["Poiseuille flow, kick_drift_kick, summed"]
    assert failing(channel, peak=1.2) == ["largest density, second half"]
    afar = CASES["far from the origin"]._replace(dtype="float64")
    assert failing(afar, unlike=0.1) == ["end unlike that of its twin"]


def test_the_two_precisions_are_held_to_their_own_bounds():
    case, single = CASES["dt x 1"], VARIANTS[2]
    for gap, bad in ((1e-5, False), (1e-4, True), (math.nan, True)):
        rows = list(report.rows(case, [(single, Outcome(step=1.0, lowest=1.0, grid=gap))]))
        [row] = [row for row in rows if row.quantity.startswith("grid")]
        assert row.holds is not bad


@pytest.mark.parametrize(("cause", "odd"), [("cfl", False), ("stiffness", False), ("nan", True)])
def test_a_blow_up_has_a_plausible_cause(cause, odd):
    case = CASES["stiffness x 100 at the old dt" if cause == "stiffness" else "dt x 4"]
    quantity = "blow-ups whose cause is not that of the case"
    assert (quantity in failing(case, blowups=1, cause=cause)) is odd


def test_friction_does_not_hide_energy_from_nowhere():
    run = runs._Run(CASES["colliding patches"], AS_IT_IS, None, quick=True)
    stake = run.sim.energy_at_stake
    for surplus, rise in ((0.0, 0.0), (-0.5, 0.0), (-0.3, 0.2), (-0.4, 0.1)):
        totals = run.sim._totals
        held = totals.kinetic + totals.internal - run.sim.energy_surplus
        moved = totals._replace(kinetic=held + surplus * stake - totals.internal)
        run.sim.restore(run.sim.snapshot() | {"totals": moved})
        assert run._look(Report(1, 0.1), 0).rise == pytest.approx(rise)


def test_looking_at_the_stable_step_costs_no_energy_at_stake():
    case = CASES["stiffness switched every frame"]
    run, plain = (runs._Run(case, AS_IT_IS, None, quick=True) for _ in range(2))
    for frame in range(4):
        run._frame(frame)
        sim = plain.sim
        sim.controls = case.steer(sim, frame)
        sim.advance(max(round(sim.scene.frame / sim.controls.dt), 1) * sim.controls.dt)
        assert run.sim.energy_at_stake == sim.energy_at_stake


def test_particles_on_the_box_are_counted():
    sim = start("dt x 1")
    assert held_by_box(sim) == 0
    sim.engine.fluid.x[:2] = 0.0
    assert held_by_box(sim) == 2


def test_a_box_that_moves_is_where_it_is_now():
    case, sim = CASES["swinging wall"], start("swinging wall")
    # a quarter of a period: the wall has moved in
    sim.time = 0.25 / sim.scene.walls.motion.frequency
    assert case.passed(sim) > 0
    assert case.passed(start("swinging wall")) == 0


def test_fluid_torn_apart_fails():
    assert failing(CASES["dt x 1"], typical=0.5) == ["least median density"]


def test_a_stretched_sheet_has_bounds():
    case = CASES["stretched sheet"]
    assert failing(case, gain=0.1) == ["mean compression beyond the start's"]
    assert failing(case, p99=0.3) == ["99th percentile of compression, second half"]


def test_all_integrators_and_densities_are_exercised():
    scenes = [case.scene(AS_IT_IS, case.sizes[0]) for case in CASES.values() if case.stable]
    seen = {(scene.integrator, scene.effects.continuity) for scene in scenes}
    assert seen == set(itertools.product(INTEGRATORS, (False, True)))
    confined = {scene.integrator for scene in scenes if scene.name == "poiseuille"}
    assert "predictor_corrector" in confined


def test_a_stretched_sheet_begins_as_a_lattice():
    x = np.asarray(CASES["stretched sheet"].scene(AS_IT_IS).x)
    assert np.ptp(x, axis=0) == pytest.approx(np.ptp(x, axis=0)[::-1], rel=0.02)


def test_falls_last_until_they_have_hit():
    column, slam = (CASES[name] for name in ("column 10:1", "100,000 particles"))
    scene = column.scene(AS_IT_IS)
    height = float(np.ptp(np.asarray(scene.x)[:, 1]))
    assert column.frames * scene.frame > 1.5 * math.sqrt(2 * height / 9.81)
    scene = slam.scene(AS_IT_IS)
    assert slam.frames * scene.frame * scene.fluid.c0 > 2 * 0.8
    assert len(scene.x) > 1e5
    assert np.asarray(scene.v)[:, 1].max() < -0.09 * scene.fluid.c0


def test_fluid_that_parts_or_pairs_fails():
    assert failing(CASES["water at rest for 60 s"], left=0.8) == [
        "least density of fluid that stays together"
    ]
    assert failing(CASES["h/dx = 2"], clumping=0.2) == ["closer than 0.6 dx, second half"]
    # the article's kernels do pair there
    assert failing(CASES["h/dx = 4"], clumping=0.2) == []


def test_only_kernels_that_are_no_pair_may_pair():
    case, other = CASES["h/dx = 4"], VARIANTS[1]
    assert case.allowed_clumping(case.scene(AS_IT_IS)) == math.inf
    assert case.allowed_clumping(case.scene(other)) == case.clumping
    cured = CASES["pairing, cured by shifting"]
    assert cured.allowed_clumping(cured.scene(AS_IT_IS)) == cured.clumping


def test_a_step_that_was_cut_fails():
    assert failing(CASES["dt x 3"]._replace(stable=True), step=3.0) == []
    row = next(
        row for row in report.rows(CASES["dt x 3"], [(AS_IT_IS, Outcome(step=2.5))])
        if row.quantity == "longest step"
    )  # fmt: skip
    assert not row.holds


def test_what_was_not_compared_has_no_row_and_is_missed_in_the_end():
    case, blank = CASES["colliding patches"], Outcome(lowest=1.0)
    assert not [row for row in report.rows(case, [(AS_IT_IS, blank)]) if "brute" in row.quantity]
    totals = {row.quantity: row for row in report.summary({"a": (case, [(AS_IT_IS, blank)])})}
    assert not totals["runs compared with brute force"].holds


def test_only_named_cases_may_make_energy_of_their_own():
    wide = {
        name
        for name, case in CASES.items()
        if case.allowed_excess(case.scene(AS_IT_IS, case.sizes[0])) > 0.15
    }
    assert wide == {
        "random places",
        "density jump of 10",
        "stiffness switched every frame",
        "h/dx = 4",
    }


@pytest.mark.parametrize("place", range(3))
def test_a_gap_that_is_no_number_is_the_greatest(place):
    values = [0.0, 1.0, 2.0]
    values[place] = math.nan
    assert math.isnan(checks.greatest(values))


def test_above_the_stable_step_a_blow_up_may_be_but_no_silence():
    case = CASES["dt x 4"]
    assert failing(case, blowups=1, cause="cfl", excess=3.0, density=0.5) == []
    assert failing(case, silent=1) == ["frames that failed in silence"]
    assert failing(case, excess=0.1) == ["energy from nowhere"]
    assert failing(case, density=0.5) == ["mean compression, second half"]


def test_the_promises_count_over_all_cases():
    case, risky = CASES["one particle"], CASES["dt x 4"]
    blown = [(variant, Outcome(blowups=1, silent=2)) for variant in VARIANTS]
    totals = {
        row.quantity: row for row in report.summary({"a": (case, blown), "b": (risky, blown)})
    }
    assert totals["blow-ups at or below the stable step"].value == len(VARIANTS)
    assert totals["frames that failed in silence"].value == 4 * len(VARIANTS)
    assert not totals["cases"].holds


def test_the_worse_of_two_outcomes():
    one = Outcome(substeps=1, silent=1, lowest=0.2, density=0.3, cause="cfl")
    other = Outcome(substeps=2, lowest=0.1, density=math.nan, cause="nan")
    both = worst(one, other)
    assert (both.substeps, both.silent, both.lowest, both.cause) == (3, 1, 0.1, "cfl")
    assert math.isnan(both.density)
    assert math.isnan(worst(other, one).density)


def test_a_run_that_is_driven_too_far_is_a_reported_blow_up():
    # ten times the stable step, which is a frame
    case = CASES["dt x 4"]._replace(steer=overstepping(10.0))
    found = runs.run(case, AS_IT_IS, quick=True)
    assert found.blowups == 1
    assert found.cause == "cfl"
    assert found.silent == 0


def start(name="colliding patches"):
    return Simulation(CASES[name].scene(AS_IT_IS), threads=1)


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


def test_energy_from_nowhere_that_nobody_reports_is_silence():
    sim = start()
    sim.restore(sim.snapshot() | {"totals": sim._totals._replace(kinetic=1e9)})
    assert checks.is_silent(sim, Report(1, 0.1))


@pytest.mark.parametrize(
    "name", ["thin jet on a plate", "corner jet, boundary particles", "dt x 1"]
)
def test_a_particle_behind_a_wall_is_seen(name):
    case, sim = CASES[name], start(name)
    assert case.passed(sim) == 0
    sim.engine.fluid.y[0] = -3 * sim.scene.dx
    sim.engine.fluid.x[0] = 0.01
    assert case.passed(sim) == 1


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

    assert checks.threads_differ(twin, advance, 2) == 0
    assert checks.threads_differ(twin, by_threads, 2) >= 3
    assert checks.run_gap(twin, advance, 2) < report.ALIKE
    assert checks.run_gap(twin, by_search, 2) > report.ALIKE


def test_runs_are_compared_where_they_have_come_to():
    run = runs._Run(CASES["colliding patches"], AS_IT_IS, None, quick=True)
    for _ in range(3):
        run.advance(run.sim)
    run._begin = 3, run.sim.snapshot()
    twin = run._twin()
    assert twin.time == run.sim.time > 0
    assert run.advance(twin) == run.advance(run.sim)
    assert np.array_equal(twin.x, run.sim.x)


def test_a_list_that_misses_neighbours_is_seen():
    sim = start("dt x 1")
    sim.advance(sim.scene.frame)
    assert checks.grid_gap(sim) < report.SAME["float64"]
    assert 0 < checks.sample_gap(sim) < report.SAME["float64"]
    sim.engine.fluid.rho[5] *= 1 + 1e-9
    assert checks.grid_gap(sim) > report.SAME["float64"]


# --- The rest -------------------------------------------------------------------------------


def test_finished_runs_are_kept(tmp_path, monkeypatch):
    chosen = [CASES["one particle"], CASES["two particles"]]
    first = list(stability.catalogue(True, tmp_path, chosen))
    monkeypatch.setattr(stability, "run", lambda *arguments: pytest.fail("run twice"))
    again = list(stability.catalogue(True, tmp_path, chosen))
    assert again == first


@pytest.mark.parametrize("result", [[], [7], 5, None, ["1"] * len(Outcome._fields)])
def test_a_damaged_run_is_never_perfect(tmp_path, result):
    chosen = [CASES["one particle"]]
    first = list(stability.catalogue(True, tmp_path, chosen))
    damaged = sorted(tmp_path.glob("*.json"))[0]
    stored = json.loads(damaged.read_text())
    damaged.write_text(json.dumps(stored | {"result": result}))
    with pytest.warns(UserWarning, match="made anew"):
        assert list(stability.catalogue(True, tmp_path, chosen)) == first


def test_memory_is_looked_at(monkeypatch, tmp_path):
    looks = []
    rows = list(memory.rows(True, tmp_path, partial(looks.append, 1)))
    assert rows == list(memory.rows(True, tmp_path, lambda: pytest.fail("run twice")))
    assert len(looks) == memory.N_LOOKS
    assert [row for row in rows if not row.holds] == []
    assert len(rows) == len(memory.WAYS) == 3
    grown = itertools.count(100.0, 2 * memory.bound(memory.QUICK_STEPS))
    monkeypatch.setattr(memory, "resident", lambda: next(grown))
    monkeypatch.setattr(memory, "WAYS", {"nothing": lambda: itertools.repeat(1000)})
    [row] = memory.rows(True, tmp_path / "anew", lambda: None)
    assert not row.holds


def test_plates_let_nobody_out():
    room = CASES["strays at 100 m/s and plates"]
    sim = Simulation(room.scene(AS_IT_IS))
    assert np.hypot(*sim.v[: sim.n_fluid].T) == pytest.approx(100.0)
    start = sim.x[: sim.n_fluid]
    for frame in range(80):
        sim.controls = room.steer(sim, frame)
        assert not sim.advance(sim.scene.frame).diverged
        assert room.passed(sim) == 0
    # without plates, 0.7 m on
    assert streams.outside_room(
        start + 80 * sim.scene.frame * 100 * (start - (0, 0.4)) / 0.1, 0.02
    ).all()
