"""Each fault is found, and at the link that it breaks."""

import pytest

from sph_gym.doctor import subject
from sph_gym.doctor.checkup import Checkup, resolve
from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.faults import FAULTS, make
from sph_gym.doctor.matrix import BARE, DiagnosisOutcome, examine, show, summary
from sph_gym.doctor.registry import CHECKS

# Positions and velocities alone don't tell whether forces have too much gravity, or steps.
ALIKE = {"gravity_again": "force"}


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    """Let a call that hangs be given up soon."""
    monkeypatch.setattr(subject, "CALL_LIMIT", 3.0)


@pytest.mark.every(8)
@pytest.mark.parametrize("name", FAULTS)
def test_is_found_at_its_link(name):
    """Do checks until one speaks against this link, or against one before it."""
    fault = FAULTS[name]
    checkup = Checkup(fault.make)
    for check in CHECKS:
        result = checkup.result(check)
        if result.broken and LINKS.index(result.link) <= LINKS.index(fault.link):
            assert result.link == fault.link, f"{result.check}: {result.message}"
            assert result.message
            assert result.remedy
            return
    pytest.fail(f"not found: {fault.what}")


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_the_whole_diagnosis_begins_with_its_link(name):
    outcome = examine(name, FAULTS[name].link, lambda: make(name))
    assert outcome.is_right, outcome


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_with_x_and_v_alone_no_earlier_link_is_blamed(name):
    outcome = examine(name, FAULTS[name].link, lambda: make(name), BARE)
    assert outcome.found in ("", outcome.link, ALIKE.get(name)), outcome


def test_every_link_has_several():
    assert len(FAULTS) >= 36
    for link in LINKS:
        assert sum(fault.link == link for fault in FAULTS.values()) >= 3


def test_by_name():
    assert resolve("sph_gym.doctor.faults:attracts")[1] is FAULTS["attracts"].make
    assert FAULTS["attracts"].what.startswith("The gradient has the wrong sign")
    with pytest.raises(ValueError, match=r"fault.*attracts"):
        make("atracts")
    with pytest.raises(ValueError, match="no function"):
        resolve("sph_gym.doctor.faults:atracts")


def test_the_matrix_counts(capsys):
    outcomes = [
        DiagnosisOutcome("attracts", "force", "force", "push_apart"),
        DiagnosisOutcome("no_clamp", "pressure", "density", "kernel"),
        DiagnosisOutcome("jelly", "viscosity", "", ""),
    ]
    assert show(iter(outcomes)) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["force", "attracts", "force", "push_apart"]
    assert lines[1].split()[-1] == "WRONG"
    pressure = next(line for line in lines if line.startswith("pressure ") and "." in line)
    assert pressure.split()[1:].index("1") == LINKS.index("density")
    assert summary(outcomes) == "2 of 3 faults found, 1 at the right link"
    assert show(outcomes[:1]) == 0
