"""Tables, plots and page of made-up runs."""

import base64
import re
import struct

import numpy as np
import pandas as pd
import pytest

from agents import plots, report, styles
from agents.evaluate import MEASURES, summary_table
from agents.policies import NAMES
from sph_gym.env.rewards import TERMS

AGENTS = ("random", "tuned_cfl", "sac", "<b>")
PLOTS = {
    "returns.png": plots.plot_returns,
    "cost_against_error.png": plots.plot_cost_against_error,
    "reward_terms.png": plots.plot_reward_terms,
}
NOMINAL = 4e5
ERRORS = ("density_error", "clumping", "fidelity_error", "noise")


def made_up_runs():
    rng = np.random.default_rng(0)
    rows = []
    for k, agent in enumerate(AGENTS):
        for instance in range(4):
            blown = agent == "random" and instance < 2
            terms = dict.fromkeys((f"reward_{term}" for term in TERMS), 0.0)
            terms["reward_work"] = 0.2 * k + 0.02 * rng.normal()
            terms["reward_density"] = -0.05 * rng.random()
            terms["reward_blowup"] = -0.9 * blown
            errors = [size * rng.random() for size in (0.02, 0.2, 0.3, 0.02)]
            rows.append(
                {
                    "agent": agent,
                    "return": sum(terms.values()),
                    "work": 0.1 if agent == "random" else float(np.exp(rng.normal())),
                    **dict(zip(ERRORS, errors, strict=True)),
                    "blowup": float(blown),
                    **terms,
                }
            )
    return pd.DataFrame(rows)


def made_up_episode(agent):
    rng = np.random.default_rng(len(agent))
    n_steps = 5 if agent == "random" else 12
    return [
        {
            "time": 0.01 * (k + 1),
            "dt": 1e-3 * (1 + rng.random()),
            "stiffness": NOMINAL * (0.1 + rng.random()),
            "xsph": rng.random(),
            "n_substeps": float(rng.integers(1, 20)),
            "density_error": 0.01 * rng.random(),
            "fidelity_error": 2 * rng.random(),
            "blowup": float(agent == "random" and k == n_steps - 1),
        }
        for k in range(n_steps)
    ]


def context(runs):
    return {
        "scene": "dam_break",
        "summary": summary_table(runs),
        "instances": [f"dam_break/test/{k}" for k in range(4)],
        "recorded_instance": "dam_break/test/0",
        "command": "python -m agents.compare --scene 'dam_break' <&>",
        "versions": {"sph_gym": "0.1.0", "python": "3.11.2", "numpy": "2.2.0"},
        "notes": ["A note."],
        "cpu": "Abacus <1>",
        "date": "2026-01-31",
    }


def write_all(folder):
    runs = made_up_runs()
    for name, plot in PLOTS.items():
        plot(runs, folder / name)
    episodes = {agent: made_up_episode(agent) for agent in AGENTS}
    plots.plot_controls(episodes, folder / "controls.png", NOMINAL)
    report.write_tables(summary_table(runs), folder)
    (folder / "side_by_side.mp4").write_bytes(b"moving pictures")
    return report.write_report(folder, context(runs))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("report")
    assert write_all(path) == path / "report.html"
    return path


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_every_agent_has_a_style_of_its_own():
    assert tuple(styles.STYLES) == tuple(styles.SENTENCES) == NAMES
    known = [*map(styles.style_of, NAMES), styles.style_of("mine")]
    variants = [styles.style_of(f"{name}-small") for name in NAMES]
    assert known[:-1] == list(styles.STYLES.values())
    assert len({style.marker for style in known}) == len(known)
    for field in ("label", "colour"):
        found = {getattr(style, field) for style in [*known, *variants]}
        assert len(found) == len(known) + len(variants)
    # a variant looks like what it is one of
    assert [style.marker for style in variants] == [style.marker for style in known[:-1]]
    assert not {style.line for style in variants} & {style.line for style in known}
    assert styles.style_of("mine").label == "mine"
    assert styles.style_of("ppo-small").label == "PPO, small"


@pytest.mark.parametrize("name", report.PLOTS)
def test_plots_are_pictures_of_a_sensible_size(folder, name):
    data = (folder / name).read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", data[16:24])
    assert 1000 < width < 1700
    assert 400 < height < 1700


def test_the_same_runs_give_the_same_bytes(folder, tmp_path):
    write_all(tmp_path)
    names = [path.name for path in folder.iterdir()]
    assert {*report.PLOTS, "report.html", "table.csv", "table.md"} <= set(names)
    for name in names:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes(), name


def test_tables_have_numbers_with_intervals_and_text(folder):
    summary = summary_table(made_up_runs())
    pd.testing.assert_frame_equal(pd.read_csv(folder / "table.csv"), summary)
    lines = (folder / "table.md").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 2 + len(AGENTS)
    assert all(line.count("±") == len(MEASURES) for line in lines[2:])


def test_page_loads_nothing_from_elsewhere(page):
    loads = re.findall(r"(?:src|href)\s*=\s*[\"']?([^\"'>]{0,30})", page)
    assert len(loads) == len(report.PLOTS) + 1
    assert all(load.startswith("data:") for load in loads)
    assert "http://" not in page
    assert "https://" not in page
    assert not re.search(r"url\(|@import|<script|<link", page)


def test_page_embeds_plots_and_animation(folder, page):
    for name in (*report.PLOTS, "side_by_side.mp4"):
        assert base64.b64encode((folder / name).read_bytes()).decode() in page
    assert page.count("<img") == len(re.findall(r'<img[^>]* alt="[^"]+"', page))


def test_page_names_everything_and_escapes_it(page):
    for agent in ("random", "tuned CFL", "SAC", "&lt;b&gt;"):
        assert page.count(agent) >= 2
    assert "<b><b>" not in page
    assert "Abacus &lt;1&gt;" in page
    assert "--scene &#39;dam_break&#39; &lt;&amp;&gt;" in page
    for text in ("2026-01-31", "python 3.11.2 and numpy 2.2.0", "dam_break/test/3", "(0 to 3)"):
        assert text in page


def test_blow_ups_are_flagged_and_never_cheapest(page):
    body = page[page.index("<tbody>") : page.index("</tbody>")]
    rows = {re.sub(r"<.*?>", "", row).split()[0]: row for row in body.split("</tr>")[:-1]}
    assert "blew up" in rows["random"]
    assert sum("blew up" in row for row in rows.values()) == 1
    assert "<td>0.10" in rows["random"]
    assert sum(row.count("<b>") for row in rows.values()) >= 6


def test_a_single_run_of_one_agent_is_enough(tmp_path):
    runs = made_up_runs()[-1:]
    for name, plot in PLOTS.items():
        plot(runs, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 0
    text = report.headline(summary_table(runs))
    assert "did best" in text
    assert "So few runs say little" in text
    many = pd.concat([runs.assign(instance=k) for k in range(report.FEW)])
    assert "few runs" not in report.headline(summary_table(many))


def test_headline_tells_of_overlaps_and_blow_ups():
    runs = made_up_runs()
    assert "overlaps" not in report.headline(summary_table(runs[runs["agent"] != "<b>"]))
    twins = pd.concat([runs, runs[runs["agent"] == "<b>"].assign(agent="ppo")])
    assert "overlaps with that of" in report.headline(summary_table(twins))
    worst = summary_table(runs[runs["agent"] == "random"])
    assert "It blew up in 50\N{NO-BREAK SPACE}% of its runs." in report.headline(worst)


def test_headline_tells_the_lead_and_takes_the_oracle_as_a_bound():
    runs = made_up_runs()
    best, rule = (runs[runs["agent"] == name]["return"].mean() for name in ("<b>", "tuned_cfl"))
    text = report.headline(summary_table(runs))
    assert text.startswith("<b> did best")
    assert f"That is {best - rule:.2f} more than the tuned CFL rule earns." in text
    assert "Blow-ups: random in 50\N{NO-BREAK SPACE}% of its runs." in text
    oracle = runs[runs["agent"] == "<b>"].assign(agent="lookahead")
    oracle["return"] += 1
    text = report.headline(summary_table(pd.concat([runs, oracle])))
    assert text.startswith("<b> did best")
    assert "a bound, no competitor" in text
    assert report.headline(summary_table(oracle)).startswith("look-ahead did best")


def test_the_answer_comes_first_and_the_page_knows_the_dark(page):
    assert page.index("did best") < page.index("sph_gym simulates") < page.index("<table")
    assert "prefers-color-scheme: dark" in page
    # colours outside of the variables are those of print, pictures and marks
    style = page[page.index("* { box-sizing") : page.index("</style>")]
    assert set(re.findall(r"#[0-9a-f]{3,6}\b", style)) <= {"#fff"}


def test_what_is_missing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="runs: expected at least one"):
        plots.plot_returns(made_up_runs()[:0], tmp_path / "x.png")
    with pytest.raises(ValueError, match="episodes: expected at least one"):
        plots.plot_controls({}, tmp_path / "x.png", NOMINAL)
    with pytest.raises(FileNotFoundError):
        report.write_report(tmp_path, context(made_up_runs()))
    incomplete = context(made_up_runs())
    del incomplete["cpu"]
    with pytest.raises(KeyError, match="cpu"):
        report.write_report(tmp_path, incomplete)


@pytest.mark.parametrize("name", [*styles.STYLES, "mine"])
def test_every_marker_has_an_area_that_the_page_can_draw(name):
    assert report._shape(styles.style_of(name).marker).startswith("M")
