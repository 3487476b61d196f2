import pytest

from sph_gym import studies
from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.faults import FAULTS
from sph_gym.doctor.matrix import ALL, BARE, DiagnosisOutcome
from sph_gym.solver.kernels import ALL_KERNELS
from sph_gym.studies import doctor

OUTCOMES = [
    DiagnosisOutcome("attracts", "force", "force", "push_apart"),
    DiagnosisOutcome("no_clamp", "pressure", "density", "kernel"),
    DiagnosisOutcome("jelly", "viscosity", "", ""),
    DiagnosisOutcome("no_walls", "walls", "walls", "sides"),
]


def test_shares_have_bounds_where_all_is_shown():
    found, right = doctor.shares(OUTCOMES, ALL)
    assert (found.value, right.value) == (75.0, 50.0)
    assert not found.holds
    assert not right.holds
    assert all(row.bound is None for row in doctor.shares(OUTCOMES, BARE))


def test_rows_and_picture(tmp_path):
    rows = [doctor._row(one, tier) for tier in (ALL, BARE) for one in OUTCOMES]
    assert rows[0].value == 1.0
    assert rows[1].value == 0.0
    assert rows[1].unit == "density (kernel)"
    assert rows[2].unit == "nothing"
    assert doctor._outcomes(rows, ALL)[0] == ("no_clamp", "pressure", "density")
    assert doctor.draw(rows, tmp_path / "doctor.png").stat().st_size > 10_000
    assert doctor.draw([], tmp_path / "empty.png").exists()


def test_what_is_examined():
    assert [FAULTS[name].link for name in doctor._one_a_link()] == [*LINKS]
    solvers = {name: link for name, link, _ in doctor.sound_solvers()}
    assert set(ALL_KERNELS) <= set(solvers)
    assert {name for name, link in solvers.items() if link} == set(doctor.WRONG_LINKS)


@pytest.mark.slow
def test_the_quick_study_finds_a_fault_at_each_link(tmp_path):
    assert studies.run_study("doctor", quick=True, folder=tmp_path) == 0
    assert (tmp_path / "doctor_quick.png").exists()
