"""The leaderboard: agents on fixed instances of all benchmark families, kept as one file an agent.

What is played is kept and not played again. `--page` makes the tables and pictures of the page, and
the figures on the cards of the shipped networks, from the files alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from agents import board, cards, entries, scores, zero_shot
from agents.arguments import BackendArgs, launch, option
from agents.entries import GAMES, Agent, LeaderboardEntry
from agents.evaluate import Job, instance_ids, run_episodes
from agents.policies import NAMES, build
from sph_gym.env.instances import FINER, SIZES
from sph_gym.env.instances import parse as parse_instance
from sph_gym.files import atomic_write
from sph_gym.solver import target
from sph_gym.solver.checks import known, whole

PAGE = Path(__file__).parents[1] / "docs" / "agents.md"
BEGIN, END = "<!-- {name}: begin -->", "<!-- {name}: end -->"
RULES = ("random", "default", "cfl", "tuned_cfl", "adaptive")
# Between the vectors of processors that have added to one file.
JOINED = " and "


@dataclass
class LeaderboardArgs(BackendArgs):
    """Arguments of the leaderboard: who plays, what is played, and where results are."""

    agents: tuple[str, ...] = option("agents without training; lookahead is the oracle", RULES)
    table: Path | None = option(
        "settings that a static agent plays, as static_search writes them", None
    )
    learner: str | None = option(
        "play a learner instead: a name that begins with its algorithm, as ppo or ppo-small", None
    )
    networks: tuple[str, ...] = option(
        "its networks, one a training; {family} in a name stands for each family", ()
    )
    trained_on: tuple[str, ...] = option("the families that it was trained on", GAMES)
    families: tuple[str, ...] = option("families that are played", GAMES)
    splits: tuple[str, ...] = option("sets that are played: val, test, ood", ("test",))
    n_instances: int | None = option("of each family and set; by default all", None)
    finer: tuple[int, ...] = option("play the same flows with dx divided by each of these", ())
    verify: int = option(
        "if sources have changed, replay so many runs a family and keep the rest if they agree", 0
    )
    drop: bool = option(
        "give up runs that were made with anything else and aren't asked for", False
    )
    results: Path = option("folder of the files", entries.FOLDER)
    output: Path = option("folder of finished episodes", Path("runs/leaderboard"))
    page: bool = option(
        "only write tables and pictures of docs/agents.md, and the figures of cards", False
    )


def agents_of(args: LeaderboardArgs) -> list[Agent]:
    """Return the agents that are to play. Raises ValueError for what can't."""
    if args.learner is not None:
        if args.table is not None:
            raise ValueError(f"table: expected none beside --learner, got {args.table}")
        found = [entries.learner(args.learner, args.networks, args.trained_on)]
    elif args.networks:
        raise ValueError("networks: expected none without --learner")
    else:
        names = [known("agents", name, NAMES) for name in args.agents]
        found = [entries.rule(name, args.table) for name in dict.fromkeys(names)]
    for agent in found:
        for spec in agent.specs[GAMES[0]]:
            build(spec, 0)
    return found


def ids_of(args: LeaderboardArgs) -> list[str]:
    """Return the instances, the first of every family and set before the second of any.

    What is asked for twice is there once. Raises ValueError for names that don't exist and numbers
    outside of a set.
    """
    whole("verify", args.verify)
    for family in args.families:
        known("families", family, GAMES)
    found = [
        id_
        for split in args.splits
        for family in args.families
        for id_ in instance_ids(family, known("splits", split, SIZES), _number(args, split))
    ]
    if args.finer:
        factors = [whole("finer", factor, at_least=2) for factor in args.finer]
        found = [f"{id_}/{FINER}{factor}" for factor in factors for id_ in found]
    return sorted(dict.fromkeys(found), key=lambda id_: parse_instance(id_).number)


def _number(args: LeaderboardArgs, split: str) -> int:
    return SIZES[split] if args.n_instances is None else min(args.n_instances, SIZES[split])


def play(args: LeaderboardArgs) -> list[Path]:
    """Play what is missing and write the files of the agents; return their paths."""
    agents, ids, backend = agents_of(args), ids_of(args), args.where()
    kept = [kept_runs(agent, args, ids) for agent in agents]
    known_runs = [_keys(entry) for entry in kept]
    jobs = [
        (place, training, Job(spec, id_.split("/")[0], id_, parse_instance(id_).number))
        for id_ in ids
        for place, agent in enumerate(agents)
        for training, spec in enumerate(agent.specs[id_.split("/")[0]])
        if (training, id_) not in known_runs[place]
    ]
    rows = run_episodes([job for _, _, job in jobs], args.output, "leaderboard", backend)
    played = pd.DataFrame(
        [
            {"place": place, "training": training, "instance": job.instance} | row
            for (place, training, job), row in zip(jobs, rows, strict=True)
        ],
        columns=None if jobs else ["place", *entries.COLUMNS, entries.CLOCK],
    )
    return [
        _write(agent, kept[place], played[played["place"] == place], args.results)
        for place, agent in enumerate(agents)
    ]


def _write(agent: Agent, kept: LeaderboardEntry | None, played: pd.DataFrame, folder: Path) -> Path:
    if kept is None:
        return entries.write(entries.make(agent, played), folder)
    if played.empty:
        return entries.write(kept, folder)
    made = entries.make(agent, pd.concat([kept.runs, played]))
    # of the runs that were there, too; the time is that of the first ones, with their machine
    networks = max(kept.about["networks"], agent.networks, key=len)
    vectors = {*kept.about.get("vectors", "").split(JOINED), made.about["vectors"]} - {""}
    clock = {name: kept.about[name] for name in ("policy_microseconds", "processor")}
    whole_file = clock | {"networks": networks, "vectors": JOINED.join(sorted(vectors))}
    return entries.write(made._replace(about=made.about | whole_file), folder)


def _keys(entry: LeaderboardEntry | None) -> set[tuple[int, str]]:
    if entry is None:
        return set()
    return set(zip(entry.runs["training"], entry.runs["instance"], strict=True))


# --- What is kept ---------------------------------------------------------------------------


def kept_runs(agent: Agent, args: LeaderboardArgs, ids: Sequence[str]) -> LeaderboardEntry | None:
    """Return what the file of an agent holds, None if it was made with anything else.

    With other sources it holds if some of its runs come out the same, digit by digit. Trainings may
    be added to it, and its first ones are enough to go on with it, under whatever names.
    ids: what is asked for. Raises ValueError if runs of other instances would be lost, unless
    `drop` says so.
    """
    path = entries.path_of(agent.name, args.results)
    if not path.exists():
        return None
    entry = entries.read(path)
    reason = changed(agent, entry, args)
    if reason is None:
        present = {"sources": entries.sources()}
        if entry.about["sources"] != present["sources"]:
            present["vectors"] = target.description()
        return LeaderboardEntry(entry.about | present, entry.runs)
    lost = int((~entry.runs["instance"].isin(ids)).sum())
    if lost and not args.drop:
        raise ValueError(
            f"drop: {agent.name}: {reason} than in {path}, and {lost} of its runs aren't asked "
            "for. --verify 1 keeps them all if only the sources have changed and the results are "
            "the same; --drop gives them up"
        )
    print(f"{agent.name}: {reason} than in {path}: its {len(entry.runs)} runs are dropped")
    return None


def changed(agent: Agent, entry: LeaderboardEntry, args: LeaderboardArgs) -> str | None:
    """Return what is otherwise than in an agent's file, None if its runs hold."""
    about, vectors = entry.about, target.description()
    given, made = list(agent.networks.values()), list(about["networks"].values())
    n = min(len(given), len(made)) or None
    if (made[:n], about.get("table"), about["manifests"]) != (
        given[:n],
        agent.table,
        entries.manifests(),
    ):
        return "other networks, settings or flows"
    if about["trained_on"] != list(agent.trained_on):
        return "other families in training"
    if about["sources"] == entries.sources():
        return None
    if not args.verify:
        return "other sources"
    differing = verify(agent, entry, args)
    if not differing:
        return None
    hint = "" if about.get("vectors") == vectors else f", and vectors {vectors} are others"
    return f"other results of {', '.join(differing)}{hint}"


def verify(agent: Agent, entry: LeaderboardEntry, args: LeaderboardArgs) -> list[str]:
    """Replay some runs of every family; return the instances whose numbers differ."""
    families = entry.runs["instance"].str.split("/").str[0]
    played = entry.runs["training"] < len(agent.specs[GAMES[0]])
    chosen = entry.runs[played].groupby(families).head(args.verify)
    jobs = []
    for row in chosen.itertuples():
        family, number = row.instance.split("/")[0], parse_instance(row.instance).number
        jobs.append(Job(agent.specs[family][row.training], family, row.instance, number))
    rows = run_episodes(jobs, args.output, f"verify {agent.name}", args.where())
    again = chosen.assign(**{name: [row[name] for row in rows] for name in entries.MEASURED})
    return [
        old.instance
        for old, new in zip(chosen.itertuples(), again.itertuples(), strict=True)
        if entries.shortened(old[1:]) != entries.shortened(new[1:])
    ]


# --- The page -------------------------------------------------------------------------------


def texts(found: Sequence[LeaderboardEntry], runs: pd.DataFrame) -> dict[str, str]:
    """Return what stands between the marks of the page, by their names."""
    return {"leaderboard": board.text(found, runs), "zero-shot": zero_shot.text(found, runs)}


def filled(page: str, blocks: dict[str, Any]) -> str:
    """Return a page with new texts between its marks. Raises ValueError for marks it hasn't."""
    for name, text in blocks.items():
        begin, end = BEGIN.format(name=name), END.format(name=name)
        if page.count(begin) != 1 or page.count(end) != 1:
            raise ValueError(f"page: expected one {begin} and one {end}")
        before, rest = page.split(begin)
        page = f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}"
    return page


def write_page(found: Sequence[LeaderboardEntry], runs: pd.DataFrame, page: Path = PAGE) -> None:
    """Write tables into the page, and the pictures beside it."""
    text = filled(page.read_text(encoding="utf-8"), texts(found, runs))
    board.draw(found, runs, page.parent / "pictures")
    with atomic_write(page) as draft:
        draft.write_text(text, encoding="utf-8")


def main(args: LeaderboardArgs) -> None:
    """Do what the arguments ask for."""
    if args.page:
        if args.results.resolve() != entries.FOLDER:
            raise ValueError(
                f"results: expected {entries.FOLDER} beside --page, whose files the page and the "
                f"cards show, got {args.results}"
            )
        found = entries.read_all(args.results)
        runs = scores.runs_of(found)
        write_page(found, runs)
        cards.write(found, runs)
        print(f"written: {PAGE} and the cards of the shipped networks")
        return
    for path in play(args):
        print(f"results: {path}")
    board.show(entries.read_all(args.results), args.splits)


if __name__ == "__main__":
    launch(main, LeaderboardArgs, __doc__)
