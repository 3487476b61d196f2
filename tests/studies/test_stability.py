"""The hard cases in their quick version, one test each, and solvers that fail them."""

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.solver import simulation
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.simulation import Report
from sph_gym.studies import stability
from sph_gym.studies.backends import Backend
from sph_gym.studies.stability import jets, limits, memory, runs
from sph_gym.studies.stability.case import VARIANTS, Variant, stable_step
from sph_gym.studies.stability.checks import n_passed
from sph_gym.studies.table import write

CASES = {case.name: case for case in stability.cases()}
AS_IT_IS = VARIANTS[0]
# Pairs of kernels, precision, resolution and integrator; two of them share a compiled version
# with cases as they are, and "finer" always does. The kept runs are of the kind of the first one.
PAIRS = [
    ("dt x 1", Variant("other kernels", True)),
    ("far from the origin, in a tank", Variant("finer", finer=1.5)),
    ("thin jet on a plate", Variant("finer", finer=1.5)),
    ("colliding patches", Variant("other kernels, float32", True, "float32")),
    ("dam break, kick_drift_kick, summed", Variant("other kernels, finer", True, finer=1.5)),
    (
        "colliding patches, predictor_corrector, summed",
        Variant("float32, finer", dtype="float32", finer=1.5),
    ),
]


def missed(name, variant):
    """The rows that a quick run of a case misses."""
    outcome = runs.run(CASES[name], variant, quick=True)
    rows = runs.rows(CASES[name], [(variant, outcome)], quick=True)
    return [row for row in rows if not row.holds]


@pytest.mark.parametrize("name", CASES)
def test_each_case_holds_as_it_is(name):
    assert missed(name, AS_IT_IS) == []


# each pair is a compiled version of its own
@pytest.mark.slow
@pytest.mark.parametrize(("name", "variant"), PAIRS)
def test_some_cases_hold_with_pairs_of_changes(name, variant):
    assert missed(name, variant) == []


# The finer resolution needs the time of the full version for its events to come about.
@pytest.mark.slow
@pytest.mark.parametrize("variant", stability.QUICK_VARIANTS[1:], ids=lambda variant: variant.name)
@pytest.mark.parametrize("name", CASES)
def test_each_case_holds_in_every_variant(name, variant):
    assert missed(name, variant) == []


# --- The catalogue --------------------------------------------------------------------------


def test_every_variant_changes_one_thing():
    scenes = [CASES["two particles"].scene(variant) for variant in VARIANTS]
    assert len({scene.fluid.kernel for scene in scenes}) == 2
    assert len({scene.dx for scene in scenes}) == 2
    assert len({variant.dtype for variant in VARIANTS}) == 2


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


def test_only_named_cases_may_make_energy_of_their_own():
    wide = {name for name, case in CASES.items() if case.bound("excess", AS_IT_IS) > 0.15}
    assert wide == {
        "random places",
        "density jump of 10",
        "stiffness switched every frame",
        "h/dx = 4",
    }


def test_known_limits_are_those_of_checks_that_cases_have():
    for limit in limits.KNOWN_LIMITS:
        [variant] = [variant for variant in VARIANTS if variant.name == limit.variant]
        usual = CASES[limit.case].bound(limit.check, variant)
        at_least = stability.checks.BY_NAME[limit.check].at_least
        assert (limit.value < usual) if at_least else (limit.value > usual)
        assert 0 < limit.margin <= 0.15 * limit.value
        assert limit.reason


def test_the_docs_list_the_known_limits():
    text = (Path(__file__).parents[2] / "docs" / "stability.md").read_text()
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    expected = []
    for limit in limits.KNOWN_LIMITS:
        check = stability.checks.BY_NAME[limit.check]
        [variant] = [variant for variant in VARIANTS if variant.name == limit.variant]
        usual = f"at {'least' if check.at_least else 'most'}"
        usual += f" {CASES[limit.case].bound(limit.check, variant):g}"
        expected.append(
            f"| `{limit.case}` | {limit.variant} | {check.title} | {usual} | {limit.value:g} "
            f"| {limit.bound:g} |"
        )
    for limit in limits.MAP_LIMITS:
        expected.append(
            f"| `{limit.case}` | {limit.variant} | limit / article's rule | at least 1 "
            f"| {limit.value:g} | {limit.bound:g} |"
        )
    assert rows == expected


# --- A solver that does nothing -------------------------------------------------------------


def stand_still(sim, seconds):
    """An `advance` that only reports."""
    return Report(max(round(seconds / sim.controls.dt), 1), sim.controls.dt)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", CASES)
def test_a_solver_that_stands_still_fails_every_case(name, monkeypatch):
    monkeypatch.setattr(Simulation, "advance", stand_still)
    case = CASES[name]
    # nothing moves, however many particles there are
    short = case._replace(quick=2, sizes=case.sizes[:1], dx=max(case.dx, 0.01))
    outcome = runs.run(short, AS_IT_IS, quick=True)
    for quick in (False, True):
        rows = runs.rows(case, [(AS_IT_IS, outcome)], quick)
        assert case.event.title in [row.quantity for row in rows if not row.holds]


@pytest.mark.parametrize("name", ["one particle", "water at rest for 60 s", "dt x 1"])
def test_a_solver_whose_clock_alone_runs_fails_too(name, monkeypatch):
    def pass_time(sim, seconds):
        sim.time += seconds
        return stand_still(sim, seconds)

    monkeypatch.setattr(Simulation, "advance", pass_time)
    assert CASES[name].event.title in [row.quantity for row in missed(name, AS_IT_IS)]


@pytest.mark.parametrize("name", ["far from the origin", "far from the origin, in a tank"])
def test_single_precision_that_counts_from_afar_is_seen(name, monkeypatch):
    assert {CASES[name].precision(variant) for variant in VARIANTS} == {"float32"}
    monkeypatch.setattr(simulation, "origin", lambda scene, dtype: np.zeros(2))
    quantities = [row.quantity for row in missed(name, AS_IT_IS)]
    assert "end unlike that of its twin" in quantities


def test_a_run_that_is_driven_too_far_is_a_reported_blow_up():
    # ten times the stable step, which is a frame
    def steer(sim, frame):
        return stable_step(sim, frame, times=10.0)

    found = runs.run(CASES["dt x 4"]._replace(steer=steer), AS_IT_IS, quick=True)
    assert (found.blowups, found.cause, found.values["silent"]) == (1, "cfl", 0)


# --- Kept runs ------------------------------------------------------------------------------


def test_finished_runs_are_kept(tmp_path, monkeypatch):
    chosen = [CASES["stray particle at 100 m/s"], CASES["drop impact at Mach 0.5"]]
    first = list(stability.catalogue(True, tmp_path, chosen))
    totals = {row.quantity: row.value for row in first if row.case == "all"}
    assert totals["cases"] == 2
    assert totals["variants of each, at least"] == 3
    assert len(list(tmp_path.glob("*.json"))) == 3 * 2
    monkeypatch.setattr(runs, "run", lambda *arguments: pytest.fail("run twice"))
    assert list(stability.catalogue(True, tmp_path, chosen)) == first


def check_backend(backend, folder, monkeypatch):
    """Two cases give the same table from a backend as from this process."""
    few = [CASES[name] for name in ("one particle", "two particles")]
    monkeypatch.setattr(stability, "cases", lambda: few)
    monkeypatch.setattr(stability, "QUICK_VARIANTS", VARIANTS[:1])
    monkeypatch.setattr(stability, "QUICK_SCENES", ())
    write(list(stability.catalogue(True, folder / "here")), folder / "here.csv")
    stability.run_ahead(True, folder / "there", backend)
    monkeypatch.setattr(runs, "run", lambda *arguments: pytest.fail("run twice"))
    write(list(stability.catalogue(True, folder / "there")), folder / "there.csv")
    assert (folder / "there.csv").read_bytes() == (folder / "here.csv").read_bytes()


def test_cases_give_the_same_table_from_workers(tmp_path, monkeypatch):
    check_backend(Backend(workers=1), tmp_path, monkeypatch)


@pytest.mark.parametrize("result", [[], [7], 5, None, [1, 0, "", {}], [1, 0, "", {"silent": "0"}]])
def test_a_damaged_run_is_never_perfect(tmp_path, result):
    chosen = [CASES["stray particle at 100 m/s"]]
    first = list(stability.catalogue(True, tmp_path, chosen))
    damaged = sorted(tmp_path.glob("*.json"))[0]
    stored = json.loads(damaged.read_text())
    damaged.write_text(json.dumps(stored | {"result": result}))
    with pytest.warns(UserWarning, match="computed again"):
        assert list(stability.catalogue(True, tmp_path, chosen)) == first


# --- Boundary particles, plates and memory --------------------------------------------------


def test_boundary_particles_hold_what_they_are_meant_for():
    assert jets.passed(AS_IT_IS, jets.HELD) == (0, 0)
    assert jets.passed(AS_IT_IS, 1.2) == (0, 1)


def test_particles_that_pass_before_a_report_are_silent():
    outcomes = {0.2: jets.Strays(0, 0), 0.4: jets.Strays(3, 1), 0.6: jets.Strays(0, 1)}
    held, silent, reported = jets._rows("shower", 1.0, outcomes)
    assert (held.value, held.holds) == (0.2, False)
    assert (silent.value, silent.holds) == (3.0, False)
    assert (reported.value, reported.unit, reported.bound) == (1.0, "of 1", None)


@pytest.mark.slow
def test_plates_let_no_particle_out():
    room = CASES["strays at 100 m/s and plates"]
    sim = Simulation(room.scene(AS_IT_IS))
    assert np.hypot(*sim.v[: sim.n_fluid].T) == pytest.approx(100.0)
    start = sim.x[: sim.n_fluid]
    for frame in range(80):
        sim.controls = room.steer(sim, frame)
        assert not sim.advance(sim.scene.frame).diverged
        assert n_passed(sim, room.behind) == 0
    # without plates, 0.7 m on
    path = 80 * sim.scene.frame * 100 * (start - (0, 0.4)) / 0.1
    assert jets.outside_room(start + path, 0.02).all()


@pytest.mark.slow
def test_memory_is_looked_at(monkeypatch, tmp_path):
    results = stability._results(tmp_path, "memory")
    rows = list(memory.rows(True, results))
    with monkeypatch.context() as patch:
        patch.setattr(memory, "growth", lambda *_: pytest.fail("run twice"))
        assert rows == list(memory.rows(True, results))
    assert [row for row in rows if not row.holds] == []
    assert len(rows) == len(memory.WAYS) == 3
    grown = itertools.count(100.0, 2 * memory.bound(memory.QUICK_STEPS))
    monkeypatch.setattr(memory, "resident", lambda: next(grown))
    monkeypatch.setattr(memory, "WAYS", {"nothing": lambda: itertools.repeat(1000)})
    [row] = memory.rows(True, results)
    assert not row.holds
