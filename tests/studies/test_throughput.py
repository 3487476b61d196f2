import os
from pathlib import Path

import numpy as np
import pytest

from sph_gym.studies import peer_solvers, startup, throughput
from sph_gym.studies.peers import SCRIPT as SCRIPT_NAME
from sph_gym.studies.peers import PeerError, Peers, compare, parse
from sph_gym.studies.table import Row
from sph_gym.timing import Runner, in_turns, pinned, same_home

PLAN = throughput.ThroughputPlan(
    sizes=(200, 300), rounds=1, peer_rounds=1, batch=3, batch_size=100, reference=300, work=3000
)

SCRIPT = """
import json, os, sys
assert os.environ["BUDGET"] and os.path.isdir(os.environ["PEERS"])
open(os.environ["PEERS_RESULTS"], "a").write("noise")
print("some words")
speed = 1.0 if "--f64" in sys.argv else 2.0
print("RES", json.dumps({"Mps_all": speed, "Mps_fluid": speed / 2, "nbr": 20.5}))
"""


def names(rows):
    return {row.quantity for row in rows}


def test_throughput_by_threads():
    rows = list(throughput.by_threads(PLAN, 300, "float64"))
    assert names(rows) >= {
        "throughput", "cost per particle", "cost per fluid particle, walls included",
        "mean neighbours", "memory",
    }  # fmt: skip
    assert all(np.isfinite(row.value) and row.value > 0 for row in rows)
    [neighbors] = [row for row in rows if row.quantity == "mean neighbours"]
    assert 12 < neighbors.value < 24
    points = throughput.curve(rows, "throughput", ", float64, 1 thread")
    assert points == [(300, rows[0].value)]


def test_sizes_and_phases():
    rows = list(throughput.by_size(PLAN, "float64"))
    assert {row.case for row in rows} == {"200 against 300, float64"}
    assert {row.bound for row in rows} == {throughput.SMALL, None}
    rows = list(throughput.by_phase(PLAN, 300, "float64"))
    assert names(rows) == {f"phase: {name}" for name in throughput.PHASES}
    assert all(row.value > 0 for row in rows)


def test_many_small_fluids():
    rows = list(throughput.many(PLAN, "float64"))
    assert names(rows) == {"many small fluids", "many small fluids, fluid alone"}


def test_pictures_and_frames_of_the_window():
    plan = PLAN._replace(sizes=(100, 200), reference=200, pictures=3)
    rows = list(throughput.pictures(plan))
    assert len(names(rows)) == len(rows) == 4
    assert all(np.isfinite(row.value) and row.value > 0 for row in rows)
    bounds = {None, throughput.PICTURES, throughput.FRAMES, throughput.WAIT}
    assert {row.bound for row in rows} == bounds


def test_every_part_has_a_title():
    peers = Peers(None)
    titles = [title for title, _ in throughput.parts(throughput.FULL, peers)]
    assert len(set(titles)) == len(titles)
    assert "100000, float32, 1 thread" in titles


def test_a_plot_is_drawn(tmp_path, monkeypatch):
    rows = [
        Row("throughput", throughput.case(n, dtype, threads), n / 1000.0, "")
        for n in (1000, 5000)
        for dtype in ("float64", "float32")
        for threads in (1, 2)
    ]
    rows.append(Row("throughput of Taichi", throughput.case(5000, "float64"), 2.0, ""))
    drawn = []
    save = throughput.save
    monkeypatch.setattr(
        throughput, "save", lambda figure, path: drawn.append(figure) or save(figure, path)
    )
    throughput.finish(rows, tmp_path / "throughput.png")
    lines = drawn[0].axes[0].lines
    assert {line.get_label() for line in lines} == {
        *(f"{dtype}, {n}" for dtype in throughput.STYLES for n in ("1 thread", "2 threads")),
        "float64, Taichi, 1 thread",
    }
    assert len(lines) == 5
    assert (tmp_path / "throughput.png").stat().st_size > 10_000


def test_the_package_has_a_peer_of_its_own():
    path = Path(peer_solvers.__file__).with_name(SCRIPT_NAME)
    assert "RES" in path.read_text()
    assert len(throughput.parts(throughput.QUICK, Peers(path.parent))) > len(
        throughput.parts(throughput.QUICK)
    )


def test_a_peer_is_raced(tmp_path):
    (tmp_path / "taichi_bench.py").write_text(SCRIPT)
    peers, runner = Peers(tmp_path), Runner(throughput.dam_break(300), work=3000)
    for dtype, speed in (("float64", 1.0), ("float32", 2.0)):
        rows = {row.quantity: row for row in compare(peers, runner, "a", 300, dtype, 2)}
        assert rows["throughput of Taichi"].value == speed
        assert rows["mean neighbours of Taichi"].value == 20.5
        assert rows["times as fast as Taichi"].at_least
        assert rows["times as fast as Taichi"].value > 0
    assert os.listdir(tmp_path) == ["taichi_bench.py"]


def test_a_peer_that_fails_is_told_of(tmp_path, capsys):
    (tmp_path / "taichi_bench.py").write_text("import a_package_that_is_not_there")
    runner = Runner(throughput.dam_break(300), work=3000)
    [row] = compare(Peers(tmp_path), runner, "a", 300, "float64", 3)
    assert not row.holds
    assert "a_package_that_is_not_there" in capsys.readouterr().err
    [row] = compare(Peers(tmp_path, "no-such-python"), runner, "a", 300, "float64", 3)
    assert not row.holds


@pytest.mark.parametrize("line", ["", "RES", "RES {", 'RES {"Mps_all": 1.0}', "RES 3"])
def test_what_is_no_result(line):
    with pytest.raises(PeerError):
        parse(line)


def test_calls_set_out_from_home():
    runners = [Runner(throughput.dam_break(100), work=1000) for _ in range(2)]
    runners[1].seconds()
    same_home(runners)
    for runner in runners:
        runner.seconds()
    assert np.array_equal(runners[0].sim.x, runners[1].sim.x)


def test_turns_go_to_and_fro():
    calls = []
    runs = [lambda: calls.append("a") or 1.0, lambda: calls.append("b") or 2.0]
    assert in_turns(runs, 2).tolist() == [[1.0, 2.0], [1.0, 2.0]]
    assert calls == ["a", "b", "b", "a"]


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="cores can't be chosen here")
def test_pinning_is_undone():
    before = os.sched_getaffinity(0)
    with pinned(2):
        assert os.sched_getaffinity(0) == before
    for here in (False, True):
        with pinned(here=here):
            assert len(os.sched_getaffinity(0)) == 1
        assert os.sched_getaffinity(0) == before


def test_compiling_is_measured(monkeypatch):
    found = {"import": 1.0, "advance": 2.0, "compiled": {"advance": 1.5}}
    monkeypatch.setattr(startup, "_first_advance", lambda cache: found)
    rows = [(row.quantity, row.case, row.value) for row in startup.compiling()]
    assert ("compile", "advance, float64", 1.5) in rows
    assert ("import, warm", "dam_break, float64", 1.0) in rows
