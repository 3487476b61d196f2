"""The leaderboard of made-up runs, what its files keep, and the page that is made of them."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from agents import board, cards, entries, leaderboard, scores, zero_shot
from agents.entries import COLUMNS, GAMES, Agent, LeaderboardEntry
from agents.evaluate import CLOCK, run_episode
from agents.policies import Spec
from sph_gym import provenance
from sph_gym.controllers.network import SHIPPED
from sph_gym.controllers.shipped import names
from sph_gym.env.instances import ODD
from sph_gym.provenance import content_hash
from tests.networks import tiny

N = 8
ABOUT = {"version": "v1", "sources": "0" * 20, "policy_microseconds": 5.0, "networks": {}}


def entry(name, returns, split="test", n=N, trainings=1, trained_on=(), suffix="", **measures):
    """An entry with runs of all families; returns: (training, family, number) -> return."""
    rows = [
        {
            "training": training,
            "instance": f"{family}/{split}/{k}{suffix and suffix(family)}",
            "return": returns(training, family, k),
            **{"work": 1.0, "error": 0.5, "beyond": 0.0, "blowup": 0.0, "steps": 60, **measures},
        }
        for training in range(trainings)
        for family in GAMES
        for k in range(n)
    ]
    about = {**ABOUT, "agent": name, "trained_on": list(trained_on)}
    if trained_on:
        about["networks"] = {"network.npz": "1" * 20}
    return LeaderboardEntry(about, pd.DataFrame(rows)[list(COLUMNS)])


def joined(*parts):
    """An entry with the runs of several."""
    return LeaderboardEntry(
        parts[0].about, pd.concat([part.runs for part in parts], ignore_index=True)
    )


RULE = entry("tuned_cfl", lambda training, family, k: 0.4 + 0.01 * k)
ORACLE = entry("lookahead", lambda training, family, k: 0.8 + 0.01 * k, work=0.4)
HALF = entry("ppo", lambda training, family, k: 0.6 + 0.01 * k, trained_on=GAMES, work=0.5)


def interval_of(runs, agent):
    return scores.interval(scores.tables_by_family(runs[runs["agent"] == agent], "score"))


# --- Statistics -----------------------------------------------------------------------------


def test_the_rule_scores_0_and_the_oracle_1():
    runs = scores.runs_of([RULE, ORACLE, HALF])
    assert interval_of(runs, "tuned_cfl") == pytest.approx((0.0, 0.0, 0.0))
    assert interval_of(runs, "lookahead") == pytest.approx((1.0, 1.0, 1.0))
    assert interval_of(runs, "ppo") == pytest.approx((0.5, 0.5, 0.5))


def test_where_rule_and_oracle_are_close_there_is_no_score():
    close = entry("lookahead", lambda training, family, k: 0.8 if k else 0.4 + scores.GAP / 2)
    runs = scores.runs_of([RULE, close, HALF])
    without = runs["score"].isna()
    assert set(runs.loc[without, "instance"]) == {f"{family}/test/0" for family in GAMES}
    assert "7 of them" not in board.text([RULE, close, HALF], runs)
    assert f"on {7 * len(GAMES)} it earns" in board.text([RULE, close, HALF], runs)


def test_without_an_oracle_there_are_no_scores_but_all_else():
    runs = scores.runs_of([RULE, HALF])
    table = board.table([RULE, HALF], runs)
    assert list(table["score"]) == [board.DASH] * 2
    assert table["agent"][0] == "PPO"
    assert table["better than the rule [%]"][0] == "100 [100, 100]"


def test_the_interval_holds_the_spread_of_instances_and_of_trainings():
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 0.1, (len(GAMES), 32))
    alike = [np.repeat(row[None], 5, axis=0) for row in noise]
    value, low, high = scores.interval(alike, scores.mean)
    assert value == pytest.approx(noise.mean())
    # trainings that agree don't make instances more certain
    assert high - low == pytest.approx(2 * 1.96 * 0.1 / np.sqrt(noise.size), rel=0.25)
    shifted = [rows + 0.2 * np.arange(5)[:, None] for rows in alike]
    _, low_of_many, high_of_many = scores.interval(shifted, scores.mean)
    assert high_of_many - low_of_many > 5 * (high - low)
    assert scores.interval(alike, scores.mean) == (value, low, high)
    assert np.isnan(scores.interval([])).all()


def test_only_trainings_that_all_families_have_count():
    tables = [np.zeros((3, 6)), np.ones((1, 6))]
    value, low, high = scores.interval(tables, scores.mean)
    assert value == low == high == 0.5


def test_families_are_strata():
    # a family's mean isn't in doubt where its instances agree, however families differ
    tables = [np.full((1, 10), float(k)) for k in range(6)]
    assert scores.interval(tables, scores.mean) == (2.5, 2.5, 2.5)


def test_a_few_instances_are_no_certainty():
    alone = [np.array([[float(k)]]) for k in range(6)]
    value, low, high = scores.interval(alone, scores.mean)
    assert low < value - 0.5 < value + 0.5 < high
    assert board.ranged(scores.interval(alone[:1], scores.mean)) == "0.00"
    # those of one family don't widen what others tell
    many = [np.zeros((1, 50)), *alone]
    assert scores.interval(many, scores.mean)[2] < 0.6


def test_the_probability_of_improvement():
    mixed = entry(
        "sac",
        lambda training, family, k: 0.7 if (k + training) % 2 else 0.4 + 0.01 * k,
        trainings=2,
    )
    runs = scores.runs_of([RULE, ORACLE, mixed])

    def chance(agent, other):
        return scores.mean(scores.pooled(scores.chances(runs, agent, other)))

    assert chance("lookahead", "tuned_cfl") == 1.0
    assert chance("tuned_cfl", "tuned_cfl") == 0.5
    # half of the runs are better, and half are equal
    assert chance("sac", "tuned_cfl") == pytest.approx(0.75)
    assert chance("tuned_cfl", "sac") == pytest.approx(0.25)


def test_work_is_compared_on_the_same_flows():
    static = entry("hindsight", lambda *where: 0.7, n=2, work=0.8)
    uneven = entry("ppo", lambda *where: 0.6, n=2, trained_on=GAMES, work=0.4)
    longer = entry("ppo", lambda *where: 0.6, n=N, trained_on=GAMES, work=0.6)
    more = longer.runs[~longer.runs["instance"].isin(uneven.runs["instance"])]
    learner = LeaderboardEntry(uneven.about, pd.concat([uneven.runs, more], ignore_index=True))
    table = board.work([RULE, learner], scores.runs_of([RULE, static, learner]))
    assert list(table["agent"]) == ["PPO"]
    assert set(table[GAMES[0]]) == {"0.55 / 0.50"}


def test_the_hypervolume_is_the_share_of_trades_that_are_worse():
    work, error = np.array([0.0, 1.0, 0.5, 3.0]), np.array([0.0, 0.5, 2.0, 0.1])
    assert scores.hypervolume(work, error) == pytest.approx([1.0, 0.375, 0.0, 0.0])


# --- What transfers -------------------------------------------------------------------------


def test_gains_are_compared_shift_by_shift():
    shifts = list(ODD)
    places = entry("x", lambda *where: 0.0, split="ood", n=16).runs["instance"]
    assert {zero_shot.scores.instances.shift(id_) for id_ in places} == set(shifts) - {
        shift for shift in ODD if shift == "scene" and not places.str.contains("dam_break").any()
    }
    rule = joined(RULE, entry("tuned_cfl", lambda *where: 0.4, split="ood", n=16))
    odd = entry(
        "ppo",
        lambda training, family, k: 0.5 if k % 8 == 0 else 0.6,
        split="ood",
        n=16,
        trained_on=GAMES,
    )
    table = zero_shot.by_shift(scores.runs_of([rule, joined(HALF, odd)]))
    first = scores.instances.shift(f"{GAMES[0]}/ood/0")
    assert table[first][0] == "0.10 [0.10, 0.10], 50 %"
    assert table["kernel"][0].endswith("100 %")


def test_finer_flows_are_compared_with_the_same_flows():
    def finer(family):
        return "/finer=2"

    rule = joined(RULE, entry("tuned_cfl", lambda *where: 0.4, n=2, suffix=finer))
    twice = entry("ppo", lambda *where: 0.45, n=2, suffix=finer, trained_on=GAMES)
    # flows that were not played at dx/2 don't count at dx, nor do trainings
    varied = entry(
        "ppo",
        lambda training, family, k: 0.5 + 0.01 * k if k < 2 and not training else 0.0,
        trainings=2,
    )
    table = zero_shot.by_spacing(scores.runs_of([rule, joined(twice, varied)]))
    assert list(table.columns) == ["agent", "dx/2"]
    assert table["dx/2"][0] == "0.05 [0.05, 0.05], 50 %"


def test_families_that_a_learner_has_not_seen_have_a_star():
    found = [
        RULE,
        HALF,
        entry("ppo-held", lambda training, family, k: 0.5 + 0.01 * k, trained_on=GAMES[:5]),
    ]
    table = zero_shot.by_family(found, scores.runs_of(found))
    assert list(table["agent"]) == ["PPO", "PPO, held"]
    assert list(table[GAMES[5]]) == ["0.20 [0.20, 0.20]", "0.10 [0.10, 0.10] *"]
    assert list(table[GAMES[0]]) == ["0.20 [0.20, 0.20]", "0.10 [0.10, 0.10]"]
    assert zero_shot.by_family([RULE, HALF], scores.runs_of([RULE, HALF])).empty
    # it is no competitor of those that could train on all
    assert "PPO, held" not in board.text(found, scores.runs_of(found))


# --- Files ----------------------------------------------------------------------------------


def test_a_file_holds_what_was_written(tmp_path):
    path = entries.write(HALF, tmp_path)
    found = entries.read(path)
    assert found.about == HALF.about
    pd.testing.assert_frame_equal(found.runs, HALF.runs)
    again = path.read_bytes()
    entries.write(found, tmp_path)
    assert path.read_bytes() == again
    path.rename(tmp_path / "other.json")
    with pytest.raises(ValueError, match="no entry of the leaderboard"):
        entries.read_all(tmp_path)
    (tmp_path / "other.json").write_text("[]")
    with pytest.raises(ValueError, match="no entry of the leaderboard"):
        entries.read_all(tmp_path)
    with pytest.raises(ValueError, match="no entries in"):
        entries.read_all(tmp_path / "none")


@pytest.fixture
def played(monkeypatch):
    """The jobs that are played, without playing them: the seed is the return."""
    asked = []

    def run_episodes(jobs, folder, title, backend):
        asked.extend(jobs)
        row = {"work": 1 / 3, "error": 0.5, "beyond": 0.0, "blowup": 0.0, "steps": 60, CLOCK: 1e-5}
        return [{"return": job.seed / 7, **row} for job in jobs]

    monkeypatch.setattr(leaderboard, "run_episodes", run_episodes)
    return asked


def args(folder, **options):
    common = {"n_instances": 3, "families": GAMES[:2], "results": folder, "agents": ("cfl",)}
    return leaderboard.LeaderboardArgs(**(common | options))


def test_what_a_file_has_is_not_played_again(tmp_path, played):
    (path,) = leaderboard.play(args(tmp_path))
    assert [job.instance for job in played[:3]] == [
        f"{GAMES[0]}/test/0", f"{GAMES[1]}/test/0", f"{GAMES[0]}/test/1",
    ]  # fmt: skip
    first = path.read_text()
    played.clear()
    leaderboard.play(args(tmp_path))
    assert not played
    assert path.read_text() == first
    leaderboard.play(args(tmp_path, n_instances=4))
    assert [job.seed for job in played] == [3, 3]
    assert len(entries.read(path).runs) == 8
    played.clear()
    leaderboard.play(args(tmp_path, n_instances=1, finer=(2,)))
    assert [job.instance for job in played] == [f"{f}/test/0/finer=2" for f in GAMES[:2]]


def change(path, **facts):
    data = json.loads(path.read_text())
    path.write_text(json.dumps(data | facts))


def test_results_of_other_sources_are_kept_only_if_some_come_out_the_same(tmp_path, played, capsys):
    (path,) = leaderboard.play(args(tmp_path))
    first = path.read_text()
    change(path, sources="other")
    played.clear()
    leaderboard.play(args(tmp_path, verify=1))
    assert [job.seed for job in played] == [0, 0]
    assert path.read_text() == first
    change(path, sources="other")
    played.clear()
    leaderboard.play(args(tmp_path))
    assert len(played) == 6
    assert "other sources" in capsys.readouterr().out
    runs = json.loads(path.read_text())["runs"]
    runs[0][2] += 1e-6
    change(path, sources="other", runs=runs)
    played.clear()
    leaderboard.play(args(tmp_path, verify=1))
    assert len(played) == 2 + 6
    assert f"other results of {GAMES[0]}/test/0 than in" in capsys.readouterr().out
    runs[0][2] += 1e-6
    change(path, sources="other", vectors="none", runs=runs)
    leaderboard.play(args(tmp_path, verify=1))
    assert "and vectors " in capsys.readouterr().out


def test_runs_that_are_not_asked_for_are_not_lost_in_silence(tmp_path, played):
    (path,) = leaderboard.play(args(tmp_path))
    change(path, sources="other")
    first = path.read_text()
    played.clear()
    with pytest.raises(ValueError, match=r"drop: cfl: other sources than in .* and 4 of its runs"):
        leaderboard.play(args(tmp_path, n_instances=1))
    assert path.read_text() == first
    assert not played
    leaderboard.play(args(tmp_path, n_instances=1, drop=True))
    assert len(entries.read(path).runs) == 2


def test_a_file_that_is_no_table_of_settings_is_refused(tmp_path, played):
    table = tmp_path / "table.json"
    table.write_text("{")
    with pytest.raises(ValueError, match=r"table: .*table.json is no table of settings"):
        leaderboard.play(args(tmp_path, agents=("tpe",), table=table))


def test_other_networks_and_flows_make_other_results(tmp_path, played, capsys):
    network = tmp_path / "seed0" / "network.npz"
    network.parent.mkdir()
    tiny().save(network)
    mine = {"learner": "ppo-mine", "networks": (str(network),)}
    (path,) = leaderboard.play(args(tmp_path, **mine))
    assert list(entries.read(path).about["networks"]) == ["seed0/network.npz"]
    tiny(seed=1).save(network)
    played.clear()
    leaderboard.play(args(tmp_path, **mine))
    assert len(played) == 6
    change(path, manifests={})
    played.clear()
    leaderboard.play(args(tmp_path, **mine))
    assert len(played) == 6
    assert capsys.readouterr().out.count("other networks, settings or flows") == 2


def test_trainings_can_be_added_and_the_first_ones_are_enough_to_verify(tmp_path, played):
    paths = [tmp_path / f"seed{k}" / "network.npz" for k in range(3)]
    for k, path in enumerate(paths):
        path.parent.mkdir()
        tiny(seed=k).save(path)
    networks = tuple(map(str, paths))
    mine = {"learner": "ppo-mine", "n_instances": 1}
    (path,) = leaderboard.play(args(tmp_path, **mine, networks=networks[:2]))
    assert len(played) == 4
    played.clear()
    leaderboard.play(args(tmp_path, **mine, networks=networks))
    assert [job.spec.network for job in played] == [networks[2]] * 2
    before = entries.read(path)
    assert list(before.about["networks"]) == [f"seed{k}/network.npz" for k in range(3)]
    # the package has the first one only, and by another name
    shipped = tmp_path / "shipped.npz"
    paths[0].rename(shipped)
    change(path, sources="other", vectors="512 bits")
    played.clear()
    leaderboard.play(args(tmp_path, **mine, networks=(str(shipped),), verify=9))
    assert [job.spec.network for job in played] == [str(shipped)] * 2
    after = entries.read(path)
    assert after.about == before.about
    pd.testing.assert_frame_equal(after.runs, before.runs)
    leaderboard.play(args(tmp_path, learner="ppo-mine", n_instances=2, networks=(str(shipped),)))
    assert entries.read(path).about["networks"] == before.about["networks"]
    assert len(entries.read(path).runs) == 6 + 2
    change(path, vectors="64 bits")
    for n in (3, 4):
        more = args(tmp_path, learner="ppo-mine", n_instances=n, networks=(str(shipped),))
        leaderboard.play(more)
        assert entries.read(path).about["vectors"] == f"{before.about['vectors']} and 64 bits"


def test_a_network_of_every_learner_is_there_so_that_anybody_can_verify():
    kept = [*entries.FOLDER.glob("networks/*.npz"), *SHIPPED.glob("*.npz")]
    digests = set(map(content_hash, kept))
    learners = [e for e in entries.read_all(entries.FOLDER) if e.about["networks"]]
    assert learners
    assert all(digests.issuperset(e.about["networks"].values()) for e in learners)


def test_other_settings_make_other_results_of_a_static_agent(tmp_path, played):
    table = tmp_path / "settings.json"
    static = {"agents": ("hindsight",), "table": table, "n_instances": 1}
    for courant, again in ((0.5, False), (0.6, False), (0.6, True)):
        table.write_text(json.dumps({family: [courant, 0.5, 0.3] for family in GAMES}))
        played.clear()
        (path,) = leaderboard.play(args(tmp_path, **static))
        assert all(job.spec == Spec("hindsight", table=str(table)) for job in played)
        assert (not played) == again
        assert entries.read(path).about["table"] == content_hash(table)


def test_a_learner_has_a_network_of_each_training_and_may_have_one_of_each_family(tmp_path):
    for seed, family in enumerate(GAMES):
        tiny(seed=seed).save(tmp_path / f"{family}.npz")
    one = str(tmp_path / f"{GAMES[0]}.npz")
    many = entries.learner("sac-by-family", (str(tmp_path / "{family}.npz"), one), GAMES)
    assert many.specs[GAMES[1]] == (
        Spec("sac", network=str(tmp_path / f"{GAMES[1]}.npz")),
        Spec("sac", network=one),
    )
    assert len(many.networks) == len(GAMES)


def test_a_network_counts_as_one_training(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        tiny().save(tmp_path / name / "network.npz")
    one, other = (str(tmp_path / name / "network.npz") for name in ("a", "b"))
    for twice in ((one, one), (one, other)):
        with pytest.raises(ValueError, match="networks: expected another network for each"):
            entries.learner("ppo", twice, GAMES)


def test_the_page_is_made_of_the_projects_own_files(tmp_path):
    with pytest.raises(ValueError, match=r"results: expected .* beside --page"):
        leaderboard.main(args(tmp_path, page=True))


def test_networks_that_would_be_listed_by_the_same_name_are_refused(tmp_path):
    paths = [tmp_path / folder / "seed0" / "network.npz" for folder in ("first", "second")]
    for k, path in enumerate(paths):
        path.parent.mkdir(parents=True)
        tiny(seed=k).save(path)
    with pytest.raises(ValueError, match="networks: expected files that differ in their names"):
        entries.learner("ppo-mine", tuple(map(str, paths)), GAMES)


def test_what_is_asked_for_twice_is_played_once(tmp_path, played):
    twice = {"agents": ("cfl", "cfl"), "families": (GAMES[0], GAMES[0]), "splits": ("test", "test")}
    (path,) = leaderboard.play(args(tmp_path, **twice, n_instances=1))
    assert len(played) == len(entries.read(path).runs) == 1
    leaderboard.play(args(tmp_path, **twice, n_instances=1, finer=(2, 2)))
    assert len(played) == 2


def test_a_learner_has_seen_the_same_families_in_all_runs_of_its_file(tmp_path, played):
    tiny().save(tmp_path / "network.npz")
    mine = {"learner": "ppo-mine", "networks": (str(tmp_path / "network.npz"),)}
    (path,) = leaderboard.play(args(tmp_path, **mine, trained_on=GAMES[1:]))
    with pytest.raises(ValueError, match="drop: ppo-mine: other families in training"):
        leaderboard.play(args(tmp_path, **mine, n_instances=1))
    assert entries.read(path).about["trained_on"] == list(GAMES[1:])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"agents": ("nobody",)}, "agents: expected one of"),
        ({"agents": ("ppo",)}, "ppo needs networks"),
        ({"networks": ("x.npz",)}, "networks: expected none without --learner"),
        ({"agents": ("tpe",)}, "table: expected a file of settings for tpe, got None"),
        ({"table": Path("x.json")}, "table: expected none for cfl, got x.json"),
        ({"agents": ("tpe",), "table": Path("x.json")}, "table: there is no file x.json"),
        ({"learner": "nobody", "networks": ("x.npz",)}, "learner: expected one of"),
        ({"learner": "ppo-a/b", "networks": ("x.npz",)}, "learner: expected letters"),
        ({"learner": "ppo"}, "a file of each training of ppo, got none"),
        ({"learner": "ppo", "networks": ("x.npz",)}, "there is no file x.npz"),
        ({"learner": "ppo", "networks": ("{fam}.npz",)}, "there is no file {fam}.npz"),
        ({"learner": "ppo", "table": Path("x.json")}, "table: expected none beside --learner"),
        ({"families": ("relaxation",)}, "families: expected one of"),
        ({"splits": ("exam",)}, "splits: expected one of"),
        ({"finer": (1,)}, "finer"),
        ({"n_instances": 0}, "n_instances: expected 1 to"),
    ],
)
def test_wrong_arguments_are_refused(options, message, tmp_path, played):
    with pytest.raises(ValueError, match=message):
        leaderboard.play(args(tmp_path, **options))


def test_an_episode_has_all_that_is_kept():
    row = run_episode(Spec("tuned_cfl"), "dam_break", "dam_break/test/0", 0)
    agent = Agent("tuned_cfl", {"dam_break": (Spec("tuned_cfl"),)})
    runs = pd.DataFrame([{"training": 0, "instance": "dam_break/test/0"} | row])
    found = entries.make(agent, runs)
    assert found.runs["work"][0] == pytest.approx(1.0, abs=0.02)
    assert 0 < found.runs["error"][0] < 1
    assert found.about["policy_microseconds"] > 0


# --- The page -------------------------------------------------------------------------------


def test_pictures_are_drawn(tmp_path):
    found = [RULE, ORACLE, HALF]
    board.draw(found, scores.runs_of(found), tmp_path)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in board.PICTURES)


def test_a_page_without_marks_is_refused():
    with pytest.raises(ValueError, match="expected one <!-- leaderboard: begin -->"):
        leaderboard.filled("# Agents", {"leaderboard": "text"})


def test_the_page_agrees_with_the_files():
    page = leaderboard.PAGE.read_text()
    found = entries.read_all(entries.FOLDER)
    texts = leaderboard.texts(found, scores.runs_of(found))
    assert leaderboard.filled(page, texts) == page, "python -m agents.leaderboard --page"


def test_the_cards_of_shipped_networks_agree_with_the_files():
    found = entries.read_all(entries.FOLDER)
    renewed = cards.renewed(found, scores.runs_of(found))
    assert {path.stem for path in renewed} == set(names())
    for path, card in renewed.items():
        assert json.loads(path.read_text()) == card, "python -m agents.leaderboard --page"


def test_a_network_and_its_card_are_no_source_of_other_results(tmp_path, monkeypatch):
    networks = tmp_path / "controllers" / "networks"
    networks.mkdir(parents=True)
    (networks / "ppo.npz").write_bytes(b"numbers")
    card, flows = networks / "ppo.json", tmp_path / "controllers" / "flows.json"
    monkeypatch.setattr(provenance, "PACKAGE", tmp_path)
    found = []
    for changed in (card, flows, flows):
        changed.write_text(str(len(found)))
        found.append(provenance.source_hash.__wrapped__("controllers"))
    card.write_text("other figures")
    (networks / "ppo.npz").write_bytes(b"other numbers")
    assert provenance.source_hash.__wrapped__("controllers") == found[-1]
    assert len(set(found)) == 3


def test_a_network_that_has_not_played_has_no_figures(tmp_path):
    tiny().save(tmp_path / "new.npz")
    found = entries.read_all(entries.FOLDER)
    assert cards.figures(tmp_path / "new.npz", found, scores.runs_of(found)) is None


def test_the_files_are_of_the_present_flows():
    for found in entries.read_all(entries.FOLDER):
        assert found.about["manifests"] == entries.manifests(), found.agent
