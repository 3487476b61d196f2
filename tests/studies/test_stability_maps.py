"""Stability maps: limits are found where they are, runs are kept, pictures show them."""

import dataclasses
import math

import numpy as np
import pytest

from sph_gym import Simulation
from sph_gym.solver.failure import CAUSES
from sph_gym.studies import stability
from sph_gym.studies.backends import LOCAL
from sph_gym.studies.stability import figures, limits, maps
from sph_gym.studies.stability.maps import MapGrid, MapPoint
from sph_gym.studies.table import Row
from tests.studies.test_jobs import run_here

GRID = MapGrid((0.5, 1.0, 2.0, 4.0, 8.0), (0.5, 1.0), (0.0, 0.3))


def survey(folder, *look):
    return maps.survey("relaxation", GRID, stability._results(folder, "maps"), *look)


@pytest.fixture
def played(monkeypatch):
    """A solver that blows up beyond 0.9 h / c, stable for no step where epsilon is 0.3 and c0."""
    calls = []

    def play(scene, dt, sound, xsph, share):
        calls.append((dt, sound, xsph))
        bad = dt * sound * scene.fluid.c0 > 0.9 * scene.h or (xsph > 0 and sound == 1.0)
        return MapPoint("cfl" if bad else "", math.nan if bad else 0.002, 10, 5.0, 20 / dt)

    monkeypatch.setattr(maps, "run", play)
    return calls


def test_limits_are_found_to_a_tenth(tmp_path, played):
    found = survey(tmp_path)
    scene = found.scene
    for i, j in ((0, 0), (0, 1), (1, 0)):
        exact = 0.9 * scene.h / (GRID.sound[j] * scene.fluid.c0)
        assert 0.9 * exact < found.limits[i, j] <= exact
    assert math.isnan(found.limits[1, 1])
    rules = found.rules()
    assert rules["CFL"][1] == pytest.approx(0.4 * scene.h / scene.fluid.c0)
    assert rules["force"][1] == pytest.approx(0.25 * math.sqrt(scene.h / 5.0))
    assert np.isfinite(rules["viscous"]).all()
    assert len(played) <= maps.n_runs(GRID)


def test_a_scene_that_no_step_is_short_enough_for_fails(tmp_path, played):
    found = survey(tmp_path)
    rows = {(row.quantity, row.case): row for row in maps.rows("relaxation", found)}
    name = "limit / article's rule"
    assert rows[name, "relaxation, c = 0.5 c0, epsilon = 0"].holds
    assert not rows[name, "relaxation, c = 1 c0, epsilon = 0.3"].holds


def test_finished_runs_are_kept(tmp_path, played):
    first = survey(tmp_path)
    n, looks = len(played), []
    again = survey(tmp_path, lambda: looks.append(1))
    assert len(played) == n
    assert len(looks) >= n
    assert str(again.points) == str(first.points)


def test_a_grid_that_was_run_on_a_backend_is_not_run_again(tmp_path, played, monkeypatch):
    expected = survey(tmp_path / "here")
    played.clear()
    monkeypatch.setattr(stability, "cases", list)
    monkeypatch.setattr(stability, "run_jobs", run_here)
    monkeypatch.setattr(maps, "QUICK", GRID)
    stability.run_ahead(True, tmp_path / "there", LOCAL)
    assert len(set(played)) == len(played) == np.prod([len(values) for values in GRID[:3]])
    found = survey(tmp_path / "there")
    assert len(set(played)) == len(played)
    assert str(found.points) == str(expected.points)


def test_a_real_run_is_stable_below_the_rule_and_not_far_above():
    scene = maps.nominal("relaxation")
    step = maps.unit(scene)
    calm, wild = (maps.run(scene, k * step, 1.0, 0.3, 0.02) for k in (0.5, 16.0))
    assert calm.cause == ""
    assert 0 <= calm.density < maps.TOLERANCE
    assert calm.acceleration > 0
    assert wild.cause == "cfl"


def test_a_picture_shows_every_epsilon(tmp_path, played):
    found = survey(tmp_path)
    path = figures.draw("relaxation", found, tmp_path / "map.png")
    assert path.stat().st_size > 20_000


def test_work_is_measured_and_its_scale_is_that_of_the_map(tmp_path, played):
    found = survey(tmp_path)
    assert np.isnan(figures._work(found)[0]).all()
    found = found._replace(own=found.own._replace(cause=""))
    usual = Simulation(found.scene).controls.dt
    work = figures._work(found)[0]
    assert work[0, 1] == pytest.approx(usual / found.steps[1])
    assert np.isnan(work[-1, -1])
    low, high = figures._range(work)
    assert (low, high) == (min(0.5, np.nanmin(work)), max(2.0, np.nanmax(work)))


def test_a_run_counts_its_pairs_and_tells_what_the_solver_did_not(monkeypatch):
    scene = maps.nominal("relaxation")
    fine = maps.run(scene, 0.5 * maps.unit(scene), 1.0, 0.3, 0.02)
    coarse = maps.run(scene, maps.unit(scene), 1.0, 0.3, 0.02)
    assert fine.substeps == pytest.approx(2 * coarse.substeps, rel=0.1)
    assert 6 < fine.pairs / fine.substeps < 40
    monkeypatch.setattr(maps, "EXCESS", -math.inf)
    untold = maps.run(scene, maps.unit(scene), 1.0, 0.3, 0.02)
    assert untold.cause == maps.UNREPORTED
    # it was followed beyond the end
    assert untold.substeps > coarse.substeps


def test_a_run_that_is_reported_later_was_not_silent(monkeypatch):
    scene = maps.nominal("relaxation")
    monkeypatch.setattr(maps, "EXCESS", -math.inf)
    assert maps.run(scene, 8.0 * maps.unit(scene), 1.0, 0.3, 0.05).cause == "cfl"


def test_silence_fails(tmp_path, monkeypatch):
    for cause, silent in (("cfl", 0), (maps.UNREPORTED, 20)):
        monkeypatch.setattr(
            maps, "run", lambda *_, told=cause: MapPoint(told, math.nan, 1, 1.0, 1.0)
        )
        found = survey(tmp_path / cause)
        [row] = [row for row in maps.rows("relaxation", found) if row.quantity == maps.SILENT]
        assert (row.value, row.holds) == (silent, not silent)


def test_a_legend_lists_what_is_there(tmp_path, played):
    found = survey(tmp_path)
    texts = [handle.get_label() for handle in figures._handles(found)]
    assert "C: blow-up, cfl" in texts
    assert not any("stiffness" in text or "beyond" in text for text in texts)
    assert "viscous limit of the article" in texts
    effects = dataclasses.replace(found.scene.effects, laminar_viscosity=None)
    points = [[[p._replace(cause="") for p in row] for row in one] for one in found.points]
    calm = found._replace(scene=dataclasses.replace(found.scene, effects=effects), points=points)
    texts = [handle.get_label() for handle in figures._handles(calm)]
    assert not any("viscous" in text or "blew" in text for text in texts)


def test_outcomes_have_their_own_colours():
    assert figures._outcome("", 0.001) == 0
    assert figures._outcome("", 0.1) == 1
    causes = (*CAUSES, maps.UNREPORTED)
    assert {figures._outcome(cause, math.nan) for cause in causes} == set(range(2, 9))
    assert len(set(figures.COLOURS)) == len(figures.LABELS) == 9
    assert len({letter for _, letter in figures.CAUSES.values()}) == 7
    edges = figures._edges([1.0, 2.0, 4.0])
    assert edges == pytest.approx(np.sqrt([0.5, 2.0, 8.0, 32.0]))


def test_a_known_limit_of_a_map_must_not_get_shorter():
    limit = limits.known_limit("hydrostatic_tank", "0.16", limits.STEP)
    row = Row("limit / article's rule", "soft", 0.48, "", 1.0, at_least=True)
    assert limits.as_limit(row, limit).verdict == limits.LABEL
    assert not limits.as_limit(row._replace(value=0.4), limit).holds
    assert limits.known_limit("dam_break", "0.16", limits.STEP) is None
    assert limits.known_limit("hydrostatic_tank", "0.4", limits.STEP) is None
