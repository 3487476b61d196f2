import pytest

from agents.record import Args, main

minari = pytest.importorskip("minari")


def test_an_agent_leaves_a_dataset(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    main(Args("relaxation/tuned-v0", scene="relaxation", episodes=1, instances="nominal"))
    assert capsys.readouterr().out.startswith("1 episodes")
    dataset = minari.load_dataset("relaxation/tuned-v0")
    assert dataset.storage.metadata["algorithm_name"] == "tuned_cfl"
    assert dataset[0].infos["instance_id"][0] == b"relaxation/nominal/0"
