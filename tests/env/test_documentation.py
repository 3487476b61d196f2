import inspect
import re
from functools import cache
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import sph_gym
from sph_gym.__main__ import main
from sph_gym.env import (
    actions,
    contexts,
    documentation,
    instances,
    observations,
    registration,
    rewards,
)
from sph_gym.env.distributions import FAMILIES, SHIFTS
from sph_gym.env.documentation.markdown import listed, table
from sph_gym.env.episode import INFO
from sph_gym.env.identity import Identity
from sph_gym.env.rules import Rules
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.studies.exploits import TRICKS

IDS = documentation.ids()
SECTIONS = [
    "Description", "Action Space", "What the agent may and may not change", "Observation Space",
    "Rewards", "Starting State", "Episode End", "Information", "Arguments",
    "Vectorized environment", "Version History",
]  # fmt: skip
each_page = pytest.mark.parametrize("id_", IDS)


@cache
def page_of(id_):
    return documentation.page(id_)


def section(id_, title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", page_of(id_), re.M | re.S)[1]


def rows(text):
    """The cells of all rows of all tables, headings left out."""
    lines = re.findall(r"(?<!\\)\| (.*) \|$", text, re.M)
    cells = [re.split(r" (?<!\\)\| ", line) for line in lines]
    rules = [k for k, row in enumerate(cells) if set(row) == {"---"}]
    return [row for k, row in enumerate(cells) if k not in rules and k + 1 not in rules]


def under(text, heading):
    """The rows of the table whose first column has that heading."""
    found = re.search(rf"^\| {heading} \|.*\n\|.*\n((?:\|.*\n?)*)", text, re.M)
    return rows(found[1]) if found else []


def arguments(*kinds):
    found = [one for kind in kinds for one in inspect.signature(kind).parameters.values()]
    return {one.name for one in found if one.kind is not one.VAR_KEYWORD}


def test_every_registered_id_has_a_page():
    assert set(IDS) == {id_ for id_ in gym.registry if id_.startswith("sph_gym/")}
    assert all(f"`{id_}`" in documentation.index() for id_ in IDS)
    assert all(re.findall("^## (.*)$", page, re.M) == SECTIONS for page in map(page_of, IDS))
    assert all(len(section(id_, title)) > 10 for id_ in IDS for title in SECTIONS)
    assert not any("$" in page or "\n\n\n" in page for page in map(page_of, IDS))


@each_page
def test_the_tables_have_the_rows_of_the_spaces(id_):
    given = {"scene": sph_gym.scenes.make("drop_impact", dx=0.06)} if "Custom" in id_ else {}
    env = gym.make(id_, on_blowup="rollback", **given).unwrapped
    acts = under(section(id_, "Action Space"), "Num")
    sees = under(section(id_, "Observation Space"), "Num")
    assert [int(row[0]) for row in acts] == list(range(env.action_space.shape[0]))
    assert [row[1] for row in acts] == list(actions.NAMES)
    bounds = np.array([row[3:5] for row in sees], float).T
    assert np.array_equal(bounds, [env.observation_space.low, env.observation_space.high])


@each_page
def test_choices_and_channels_are_those_of_the_variants(id_):
    given = {"scene": sph_gym.scenes.make("drop_impact", dx=0.06)} if "Custom" in id_ else {}
    env = gym.make(id_, action_mode="discrete", observation="field", **given).unwrapped
    act = env.rules.actions.act
    told = [[float(cell) for cell in row] for row in
            under(section(id_, "Action Space"), "Discrete action")]  # fmt: skip
    assert told == [[k, *act(k, np.zeros(3), None)] for k in range(env.action_space.n)]
    channels = under(section(id_, "Observation Space"), "Channel")
    assert [int(row[0]) for row in channels] == list(range(env.observation_space.shape[0]))
    low, high = env.observation_space.low, env.observation_space.high
    assert {(int(row[3]), int(row[4])) for row in channels} == {(low.min(), high.max())}


def test_the_index_is_one_table_with_a_row_an_id():
    lines = documentation.index().splitlines()
    assert len(lines) == len(IDS) + 2
    assert all(line.startswith("| ") and line.endswith(" |") for line in lines)
    assert all(len(row) == 3 for row in rows(documentation.index()))
    assert table(["a"], [["one\n\ntwo"]]).splitlines()[2] == "| one two |"


@each_page
def test_labels_are_told_with_their_reasons(id_):
    told = {row[0].strip("`"): row[1:] for row in under(section(id_, "Description"), "Scene")}
    assert set(told) == set(documentation.subject(id_).scenes)
    for scene, (label, reason, headroom) in told.items():
        game = scene not in instances.DIAGNOSTIC
        assert label.split(",")[0] == ("benchmark" if game else "diagnostic")
        assert label == FAMILIES[scene].label
        assert reason == (instances.BENCHMARK if game else instances.DIAGNOSTIC[scene])
        assert headroom == FAMILIES[scene].gain
    assert all(f"- *{kind}*:" in page_of(id_) for kind in ("benchmark", "diagnostic")) == bool(told)


def test_a_reason_names_the_benchmarks_on_which_a_trick_pays_in_the_mean():
    guide = (Path(__file__).parents[2] / "docs" / "environments.md").read_text()
    [names] = re.findall(r"^\|  \| (dam_break .*) \|$", guide, re.M)
    names = names.split(" | ")
    [rule] = re.findall(r"^\| \*\*tuned CFL\*\* \| (.*) \|$", guide, re.M)
    limits = np.array(rule.replace("*", "").split(" | "), float)
    tricks = re.findall(r"^\| [a-z ]+ \| (-?\d\.\d\d \(.*) \|$", guide, re.M)
    means = np.array([[cell.split(" ")[0] for cell in row.split(" | ")] for row in tricks], float)
    assert len(means) == len(TRICKS)
    paying = {name for name, pays in zip(names, (means > limits).any(axis=0), strict=True) if pays}
    named = set(re.findall("`(\\w+)`", instances.BENCHMARK))
    assert named == paying == {"patch_impact"}
    assert "on single flows some win" in instances.BENCHMARK


def test_the_readme_has_the_labels_of_the_pages():
    text = (Path(__file__).parents[2] / "README.md").read_text()
    # of a scene of one's own nothing is known
    told = {row[0].strip("`"): row[2] if row[2:] else "" for row in under(text, "id")}
    assert set(told) == set(IDS)
    for id_, label in told.items():
        assert label.split(":")[0] == documentation.subject(id_).label.split(",")[0]
    assert told["sph_gym/Relaxation-v1"].startswith("diagnostic")


def test_the_pages_say_what_ood_shows_and_what_identifies_a_flow():
    page = page_of("sph_gym/DamBreak-v1")
    shifts = {row[0]: row[1] for row in under(page, f"NUMBER % {len(SHIFTS)}")}
    for number in range(2 * len(SHIFTS)):
        shown = instances.shift(f"dam_break/ood/{number}")
        assert shifts[str(number % len(SHIFTS))] == f'`"{shown}"`'
    fields = [row[0].strip("`") for row in under(page, "Field")]
    assert fields == list(Identity._fields)


@each_page
def test_vector_rewards_are_made_without_a_warning(id_):
    (line,) = re.findall(
        r"`(gymnasium\.make\([^`]*\))`", section(id_, "Rewards").replace("\n", " ")
    )
    scene = sph_gym.scenes.make("drop_impact", dx=0.08)
    env = eval(line, {"gymnasium": gym, "scene": scene})
    assert env.spec.kwargs["reward"] == "vector"
    if id_ == "sph_gym/DamBreak-v1":
        env.reset(seed=0)
        assert env.step(env.action_space.sample())[1].shape == (len(rewards.TERMS),)
    assert env.spec.disable_env_checker


@each_page
def test_the_arguments_are_those_of_the_constructors(id_):
    shown = {row[0].strip("`"): row for row in rows(section(id_, "Arguments"))}
    assert set(shown) == arguments(sph_gym.TuningEnv, Rules)
    assert shown["scene"][1] == f"`{gym.spec(id_).kwargs.get('scene')!r}`"
    assert all(f'"{split}"' in shown["instances"][2] for split in instances.SIZES)
    vector = {row[0].strip("`") for row in rows(section(id_, "Vectorized environment"))}
    assert vector == arguments(TuningVectorEnv)


def test_every_entry_of_info_is_explained():
    env = gym.make("sph_gym/DropImpact-v1", dx=0.08)
    for info in (env.reset(seed=0)[1], env.step(np.zeros(3, np.float32))[4]):
        assert set(info) == set(INFO)
        assert {key for key in info if isinstance(info[key], str)} == {
            key for key, (unit, _) in INFO.items() if unit == "text"
        }
    assert {row[0].strip("`") for row in rows(section(IDS[0], "Information"))} == set(INFO)


def test_values_in_the_text_are_those_of_the_code():
    assert set(listed(rewards.Tolerances.__doc__)) == set(rewards.Tolerances._fields)
    assert set(rewards.MEANINGS) == set(rewards.TERMS)
    assert set(instances.PURPOSES) == set(instances.SIZES)
    assert registration.VERSION in registration.HISTORY
    text = section(IDS[0], "Rewards")
    assert all(f"`{name}` | {value:.4g} |" in text
               for name, value in rewards.Tolerances()._asdict().items())  # fmt: skip
    paid = {tuple(row[:2]): float(row[2]) for row in rows(text) if row[0] == "0.5"}
    assert paid["0.5", "0.125"] == 1.0 - 0.125 / 2
    assert paid["0.5", "1"] == 0.5


def test_contexts_and_layouts_are_told_with_their_versions():
    page = page_of("sph_gym/DamBreak-v1")
    kinds = {row[0]: row[1:] for row in under(page, r'`info\["context"\]`')}
    assert set(kinds) == {f'`"{kind}"`' for kind in contexts.KINDS}
    assert kinds['`"noisy"`'][1] == "{:.4g} to {:.4g}".format(*contexts.NOISY)
    guide = (Path(__file__).parents[2] / "docs" / "environments.md").read_text()
    assert {row[0]: row[1:] for row in under(guide, r'`info\["context"\]`')} == kinds
    assert f"Version {observations.VERSION} of the entries" in page
    assert f"Version {actions.VERSION} of what actions mean" in page
    env = gym.make("sph_gym/DropImpact-v1", dx=0.08, observation="features+context").unwrapped
    told = under(section("sph_gym/DamBreak-v1", "Observation Space"), "Of the context")
    low, high = env.observation_space.low, env.observation_space.high
    assert f"{len(low)} entries" in page
    bounds = [[float(cell) for cell in row[2:]] for row in told]
    assert np.array_equal(np.transpose(bounds), [low[-len(told) :], high[-len(told) :]])


def test_a_page_tells_of_the_scene_that_shows_the_environment():
    assert "`shaken_tank`: A tank that is shaken" in section("sph_gym/ShakenTank-v1", "Description")


def test_ranges_are_those_of_the_instances():
    shown = {row[0]: row for row in rows(section("sph_gym/DamBreak-v1", "Starting State"))}
    drawn = [instances.instance("dam_break", "test", k).arguments["gravity"] for k in range(32)]
    column = 1 + list(instances.SIZES).index("test")
    assert shown["gravity"][column] == f"{min(drawn):.4g} to {max(drawn):.4g}"
    assert shown["gravity"][1] == "9.81"
    ends = rows(section("sph_gym/DamBreak-v1", "Action Space"))
    sound = next(row for row in ends if row[1] == "sound speed")
    c0 = instances.instance("dam_break", "nominal", 0).build().fluid.c0
    assert [float(x) for x in sound[3:]] == pytest.approx(np.multiply(actions.SOUND, c0), rel=1e-3)


def test_tables_and_lists():
    assert table(["a", "b"], [(0.123456, "|x|")]).splitlines()[2] == r"| 0.1235 | \|x\| |"
    docstring = """What.

    - `one`: first
      and more
    - `two`: second

    End.
    """
    assert listed(docstring) == {"one": "first and more", "two": "second"}
    assert listed(None) == {}


def test_the_command_lists_prints_and_writes(tmp_path, capsys):
    assert main(["docs"]) == 0
    assert all(id_ in capsys.readouterr().out for id_ in IDS[:1])
    assert main(["docs", IDS[0]]) == 0
    assert capsys.readouterr().out.startswith(f"# {IDS[0]}")
    assert main(["docs", "--output", str(tmp_path / "docs")]) == 0
    written = {path.name: path.read_text() for path in (tmp_path / "docs").iterdir()}
    assert set(written) == {f"{id_[8:]}.md" for id_ in IDS} | {"README.md"}
    assert all(f"({name})" in written["README.md"] for name in written if name != "README.md")
    assert main(["docs", "sph_gym/Lake-v1"]) == 2
    assert "DamBreak" in capsys.readouterr().err
