import pytest

from sph_gym.__main__ import main


def test_run_logs_densities_and_pressures(capsys):
    assert main(["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", "--log", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "rho/rho0 #0" in lines[0]
    assert len(lines) == 1 + 3


def test_run_tells_of_a_blowup(capsys):
    status = main(["run", "hydrostatic_tank", "--set", "dx=0.08", "--dt", "0.05"])
    assert status == 1
    assert "blew up: cause cfl" in capsys.readouterr().out


def test_brute_force_gives_the_same_log(capsys):
    logs = []
    for neighbors in ("grid", "brute"):
        main(
            ["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", "--neighbors", neighbors]
        )
        logs.append(capsys.readouterr().out)
    assert logs[0] == logs[1]


def test_a_video_is_written(tmp_path):
    path = tmp_path / "film.gif"
    assert (
        main(["run", "relaxation", "--set", "dx=0.08", "--seconds", "0.1", "--video", str(path)])
        == 0
    )
    assert path.stat().st_size > 1000


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "lake"],
        ["run", "relaxation", "--set", "dx"],
        ["run", "relaxation", "--set", "depth=1"],
        ["run", "relaxation", "--seconds", "-1"],
        ["run", "relaxation", "--dt", "0"],
        ["run", "relaxation", "--dtype", "float16"],
        ["study", "weather"],
    ],
    ids=" ".join,
)
def test_wrong_words_give_one_clear_line(arguments, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("sph_gym: ")
    assert "expected" in error
