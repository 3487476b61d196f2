import pytest

from agents.arguments import make_parser
from agents.evaluate import EvaluationArgs
from agents.record import RecordingArgs, main
from sph_gym.env.instances import SIZES

minari = pytest.importorskip("minari")


def test_an_agent_leaves_a_dataset(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    main(RecordingArgs("relaxation/tuned-v1", scene="relaxation", episodes=1, instances="nominal"))
    assert capsys.readouterr().out.startswith("1 episodes")
    dataset = minari.load_dataset("relaxation/tuned-v1")
    assert dataset.storage.metadata["algorithm_name"] == "tuned_cfl"
    assert dataset[0].infos["instance_id"][0] == b"relaxation/nominal/0"


@pytest.mark.parametrize("kind", [RecordingArgs, EvaluationArgs])
def test_the_help_names_all_sets_of_instances(kind, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        make_parser(kind, "").parse_args(["--help"])
    assert f"{', '.join(list(SIZES)[:-1])} or {list(SIZES)[-1]}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"episodes": 0}, "episodes: "),
        ({"agent": "nobody"}, "agent: "),
        ({"seed": -1}, "seed: "),
        ({"agent": "tpe"}, "settings: expected three numbers for tpe, got None"),
        ({"settings": (0.5, 0.5, 0.3)}, "settings: expected none for tuned_cfl"),
    ],
)
def test_wrong_arguments_are_named(wrong, message):
    with pytest.raises(ValueError, match=message):
        RecordingArgs("relaxation/x-v1", scene="relaxation", **wrong)
