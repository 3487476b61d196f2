"""What there is to gain: work of the best static setting against that of the look-ahead oracle.

Equal error means that both keep within tolerance: at most 5 % of the steps of a run have an error
above 1, in multiples of its tolerance, which is the constraint of the reward. A static setting is
chosen in hindsight, for each instance by itself, as the cheapest that keeps within tolerance.
Instances where one of the two leaves its tolerance can't be compared: there, nothing counts as
gained.

The ablation freezes each control at the value of the best static setting and searches again. A
search that freezes nothing but looks in other places tells how much of a loss is its own luck: a
control counts as needed where freezing it costs more than that by a margin. A control may have to
be there and yet need no steering; so XSPH is switched off as well, for the whole episode.
"""

import csv
import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.env import SCENES, instances
from sph_gym.env.oracle import COARSE, Oracle, Search
from sph_gym.studies import labels
from sph_gym.studies.episodes import EPISODES, Episode, Grid, Point, best_static, kept, run
from sph_gym.studies.exploits import tuned_cfl
from sph_gym.studies.table import Row

FOLDER = Path("runs/studies")
# So much headroom, on so many scenes; and by so much must a loss of mean reward, where a control is
# frozen, exceed that of another search, on so many scenes.
HEADROOM, ENOUGH = 1.5, 5
LOSS, LOSERS = 0.01, 2
CONTROLS = ("Courant multiple", "sound speed", "xsph")
# What another search with all controls loses; and the coordinate of XSPH with no smoothing at all.
LUCK = "nothing: luck of the search"
XSPH_AXIS, XSPH_OFF = 2, -1.0
# Fields of a contest and what tables call them.
PLAYERS = {"rule": "tuned CFL", "static": "best static", "oracle": "oracle"}
COLUMNS = ("instance", "label", "player", *Episode._fields, "within", "setting", "headroom")


class Plan(NamedTuple):
    """Scenes, instances of each, instances of which the ablation is run, and how to search.

    elsewhere: as thorough as `search`, but in other places.
    """

    scenes: tuple[str, ...] = SCENES
    n_instances: int = 4
    ablated: int = 4
    search: Search = Search()
    grid: Grid = Grid()
    elsewhere: Search = Search(near=0.3)


FULL = Plan()
QUICK = Plan(("long_fall", "colliding_patches"), 1, 0, COARSE, Grid(xsph=(0.3,)))


class Contest(NamedTuple):
    """One instance: the rule, the best static setting and its coordinates, and the oracle.

    static, setting: None where no static setting keeps within tolerance. frozen: the oracle
    without each of the controls; second: another oracle with all of them; unsmoothed: the oracle
    with an epsilon of 0; all empty where that wasn't tried.
    """

    rule: Episode
    static: Episode | None
    setting: Point | None
    oracle: Episode
    frozen: tuple[Episode, ...]
    second: tuple[Episode, ...] = ()
    unsmoothed: tuple[Episode, ...] = ()

    @property
    def headroom(self) -> float:
        """Work of the static setting / work of the oracle at equal error; else not a number."""
        if self.static is None or not self.oracle.within:
            return math.nan
        return self.static.substeps / self.oracle.substeps


def measure(quick: bool, folder: Path = FOLDER) -> Iterator[Row]:
    """Rows of every scene, with a progress bar; quick: one instance of two scenes, coarsely.

    Finished runs are kept in the folder, and all episodes written there, instance by instance.
    Raises ImportError that names the extra to install.
    """
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError('studies need more: pip install "sph_gym[studies]"') from None
    plan = QUICK if quick else FULL
    found: dict[str, list[Contest]] = {}
    total = len(plan.scenes) * plan.n_instances
    with tqdm(total=total, unit="instance", file=sys.stderr) as bar:
        for scene in plan.scenes:
            bar.set_description(scene)
            found[scene] = []
            for number in range(plan.n_instances):
                found[scene].append(contest(plan, scene, number, folder / EPISODES))
                write_instances(found, folder / _file("headroom_quick" if quick else "headroom"))
                bar.update()
            yield from rows(scene, found[scene])
    yield from summary(plan, found)


def finish(rows: list[Row], path: Path) -> None:
    """Tell where the instances are, and why some scenes are no benchmarks; path: of a picture."""
    print(f"instances: {path.with_name(_file(path.stem))}")
    labels.explain(rows, path)


def _file(stem: str) -> str:
    return f"{stem}_instances.csv"


def contest(plan: Plan, scene: str, number: int, folder: Path) -> Contest:
    """Everybody on one validation instance."""
    instance, search = _id(scene, number), plan.search

    def episode(name: str, *key: Any, run: Callable[[], Episode]) -> Episode:
        return Episode(*kept(folder, [name, instance, *key], run))

    rule = episode("rule", run=partial(run, scene, instance, tuned_cfl))
    best = kept(
        folder, ["static", instance, plan.grid], partial(best_static, scene, instance, plan.grid)
    )
    setting, static = (None, None) if best is None else (tuple(best[0]), Episode(*best[1]))

    def look_ahead(search: Search) -> Episode:
        return episode("oracle", search, run=partial(run, scene, instance, Oracle(search)))

    def freeze(axis: int, value: float) -> Episode:
        policy = Oracle(search, {axis: value})
        return episode("frozen", search, axis, value, run=partial(run, scene, instance, policy))

    found = Contest(rule, static, setting, look_ahead(search), ())
    if setting is None or number >= plan.ablated or scene in instances.DIAGNOSTIC:
        return found
    return found._replace(
        frozen=tuple(freeze(axis, value) for axis, value in enumerate(setting)),
        second=(look_ahead(plan.elsewhere),),
        unsmoothed=(freeze(XSPH_AXIS, XSPH_OFF),),
    )


def write_instances(found: dict[str, list[Contest]], path: Path) -> None:
    """Write every episode as CSV: who did what on which instance, and the headroom there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for scene, contests in found.items():
            for number, one in enumerate(contests):
                gain = one.headroom if math.isfinite(one.headroom) else ""
                for player, episode, setting in _players(one):
                    about = (_id(scene, number), label(scene, contests), player)
                    writer.writerow([*about, *episode, episode.within, setting, gain])


def _players(one: Contest) -> Iterator[tuple[str, Episode, Point | str]]:
    """Everybody's name, episode and, of who has one, setting."""
    for name, title in PLAYERS.items():
        episode = getattr(one, name)
        if episode is not None:
            yield title, episode, (one.setting or "") if name == "static" else ""
    for control, episode in zip(CONTROLS, one.frozen, strict=False):
        yield f"oracle without {control}", episode, ""
    for episode in one.second:
        yield "oracle, looking elsewhere", episode, ""
    for episode in one.unsmoothed:
        yield "oracle, epsilon 0", episode, ""


def _id(scene: str, number: int) -> str:
    return f"{scene}/val/{number}"


def label(scene: str, contests: list[Contest]) -> str:
    """Of a scene: "diagnostic", or "benchmark" and what there is to say of its headroom."""
    given, gain = instances.label(scene), headroom(contests)
    if scene in instances.DIAGNOSTIC or poorest(contests) >= HEADROOM:
        return given
    return f"{given}, {'unknown' if math.isnan(gain) else 'small'} headroom"


def rows(scene: str, contests: list[Contest]) -> Iterator[Row]:
    """Work, rewards and errors of a scene, means over instances, and its headroom."""
    case, all_of_them = f"{scene}, {label(scene, contests)}", f"of {len(contests)} instances"
    for name, title in PLAYERS.items():
        runs = [one for one in (getattr(each, name) for each in contests) if one is not None]
        if runs:
            yield from _means(title, case, runs)
        within = float(sum(one.within for one in runs))
        yield Row(f"within tolerance, {title}", case, within, all_of_them)
    yield from _headrooms(scene, contests, case, all_of_them)
    for name, loss in losses(contests).items():
        yield Row(f"reward lost without {name}", case, loss, "")
    off = [_best(one) - each.reward for one in contests for each in one.unsmoothed]
    if off:
        yield Row("reward lost with an epsilon of 0", case, float(np.mean(off)), "")


def _means(title: str, case: str, runs: list[Episode]) -> Iterator[Row]:
    def mean(field: str) -> float:
        return float(np.mean([getattr(one, field) for one in runs]))

    yield Row(f"work, {title}", case, mean("substeps"), "substeps")
    yield Row(f"reward, {title}", case, mean("reward"), "")
    yield Row(f"error, {title}", case, mean("error"), "tolerances")
    yield Row(f"beyond tolerance, {title}", case, 100 * mean("beyond"), "% of steps")


def _headrooms(scene: str, contests: list[Contest], case: str, all_of_them: str) -> Iterator[Row]:
    ratios = [one.headroom for one in contests]
    for number, ratio in enumerate(ratios):
        if math.isfinite(ratio):
            yield Row("headroom", _id(scene, number), ratio, "")
    n_compared = sum(map(math.isfinite, ratios))
    if not n_compared and scene in instances.DIAGNOSTIC:
        yield Row("no headroom: both within tolerance nowhere", case, 0.0, all_of_them)
        return
    yield Row("static and oracle within tolerance", case, float(n_compared), all_of_them)
    yield Row("headroom over the best static", case, headroom(contests), "")
    if 0 < n_compared < len(ratios):
        yield Row("the same, if elsewhere nothing is gained", case, poorest(contests), "")


def headroom(contests: list[Contest]) -> float:
    """The geometric mean over the instances where both keep within tolerance."""
    ratios = [one.headroom for one in contests if math.isfinite(one.headroom)]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else math.nan


def poorest(contests: list[Contest]) -> float:
    """The same over all instances, as if nothing were gained where they can't be compared."""
    gains = [one.headroom if math.isfinite(one.headroom) else 1.0 for one in contests]
    return float(np.exp(np.mean(np.log(gains))))


def losses(contests: list[Contest]) -> dict[str, float]:
    """What the best known mean reward loses if one of the controls may not be touched, and LUCK.

    A beam can miss what another one finds: whoever keeps a control as it should be kept, the
    static setting too, counts for those who may not touch it, and everybody for the best. What
    the second search loses by the same measure, with nothing frozen, is luck.
    """
    lost: dict[str, list[float]] = {name: [] for name in (*CONTROLS, LUCK)}
    for one in contests:
        static, best = _of_static(one), _best(one)
        for name, each in zip(lost, (*one.frozen, *one.second), strict=False):
            lost[name].append(best - max(each.reward, static))
    return {name: float(np.mean(values)) for name, values in lost.items() if values}


def _of_static(one: Contest) -> float:
    return -math.inf if one.static is None else one.static.reward


def _best(one: Contest) -> float:
    """The best known mean reward of an instance."""
    searches = (one.oracle, *one.frozen, *one.second, *one.unsmoothed)
    return max(_of_static(one), *(each.reward for each in searches))


def needed(contests: list[Contest]) -> list[str]:
    """The controls without which more is lost than by the luck of a search."""
    lost = losses(contests)
    luck = lost.pop(LUCK, 0.0)
    return [name for name, loss in lost.items() if loss > luck + LOSS]


def summary(plan: Plan, found: dict[str, list[Contest]]) -> Iterator[Row]:
    """How many scenes have headroom, and on how many each control matters."""
    games = {scene: one for scene, one in found.items() if scene not in instances.DIAGNOSTIC}
    many = sum(poorest(contests) >= HEADROOM for contests in games.values())
    bound = min(ENOUGH, len(plan.scenes))
    quantity = f"scenes with a headroom of at least {HEADROOM:g}"
    yield Row(quantity, "all", float(many), "", bound, at_least=True)
    for name in CONTROLS if plan.ablated else ():
        hurt = sum(name in needed(contests) for contests in games.values())
        yield Row(f"scenes that need {name}", "all", float(hurt), "", LOSERS, at_least=True)
