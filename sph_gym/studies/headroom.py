"""The headroom of each scene: work of the best static setting over that of the look-ahead oracle.

Equal error means that both keep within tolerance: at most 5 % of the steps of a run have an error
above 1, in multiples of its tolerance, which is the constraint of the reward. A static setting is
chosen in hindsight, for each instance by itself, as the cheapest that keeps within tolerance.
Instances where one of the two leaves its tolerance can't be compared: there, nothing counts as
gained.

The ablation freezes each control at the value of the best static setting and searches again. A
search that freezes nothing but tries other settings tells the noise floor of the search: how much
of a loss is luck. A control counts as needed where freezing it costs more by a margin. A control
may have to be there and yet need no steering; so XSPH is switched off as well, for the whole
episode.

A grid tells what the controls are worth as constants (`sph_gym.studies.controls`). Besides, the
tuned rule, which is the unit of work, must keep within tolerance on every validation instance, and
so must runs that are as good as the references (`sph_gym.studies.honesty`).
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.env import SCENES, instances
from sph_gym.env.oracle import COARSE, ControlSetting, Oracle, Search
from sph_gym.files import write_csv
from sph_gym.studies import controls, episodes, exploits, honesty
from sph_gym.studies.backends import LOCAL, Backend
from sph_gym.studies.controls import ControlGrid
from sph_gym.studies.episodes import Score, StaticGrid, best_static, run
from sph_gym.studies.exploits import tuned_cfl
from sph_gym.studies.jobs import run_jobs
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

# The headroom that is asked for.
HEADROOM = 1.5
# The number of scenes that are to have it.
ENOUGH = 5
# A control matters on a scene if freezing it costs more mean reward than the noise floor of the
# search, by this margin.
LOSS = 0.01
# The number of scenes on which each control is to matter.
LOSERS = {"Courant multiple": 5, "sound speed": 5, "xsph": 2}
CONTROLS = tuple(LOSERS)
# The loss of another search with all controls; and the coordinate of XSPH with no smoothing at all.
NOISE_FLOOR = "nothing: noise floor of the search"
XSPH_AXIS, XSPH_OFF = 2, -1.0
# Quantities of the rows that tell a scene's headroom.
GAIN, NONE = "headroom over the best static", "no headroom: both within tolerance nowhere"
# Players of every instance.
PLAYERS = RULE, STATIC, ORACLE = ("tuned CFL", "best static", "oracle")
# Further players, besides the oracles with a control frozen.
ELSEWHERE, UNSMOOTHED = "oracle, looking elsewhere", "oracle, epsilon 0"
# Player, instance, and what else decides a result: the key by which it is kept.
Key = list[Any]
COLUMNS = ("instance", "label", "player", *Score._fields, "within", "setting", "headroom")


class HeadroomPlan(NamedTuple):
    """Scenes, instances of each, instances of which the ablation is run, and how to search.

    second: as thorough as `search`, but with other settings; held: instances of each scene on which
    controls are held fixed, settings: what is tried beside them; honest: instances whose references
    are compared with runs that are as good.
    """

    scenes: tuple[str, ...] = SCENES
    n_instances: int = 4
    ablated: int = 4
    search: Search = Search()
    grid: StaticGrid = StaticGrid()
    second: Search = Search(near=0.3)
    held: int = 9
    settings: ControlGrid = ControlGrid()
    honest: int = 4

    @property
    def games(self) -> list[str]:
        """Scenes that are benchmarks."""
        return [scene for scene in self.scenes if scene not in instances.DIAGNOSTIC]


FULL = HeadroomPlan()
QUICK = HeadroomPlan(
    ("long_fall", "patch_impact"), 1, 0, COARSE, StaticGrid(xsph=(0.3,)),
    held=2, settings=ControlGrid((0.8,), (0.3, 0.5), (0.15, 0.45, 1.0)), honest=0,
)  # fmt: skip


class Contest(NamedTuple):
    """One instance: the scores of its players by name, and the coordinates of the static setting.

    There is neither score nor setting where no static setting keeps within tolerance. Further
    searches, besides PLAYERS, are `frozen` of each control, ELSEWHERE and UNSMOOTHED, where they
    were tried.
    """

    scores: Mapping[str, Score]
    setting: ControlSetting | None = None

    @property
    def headroom(self) -> float:
        """Work of the static setting / work of the oracle at equal error; else not a number."""
        if STATIC not in self.scores or not self.scores[ORACLE].within:
            return math.nan
        return self.scores[STATIC].substeps / self.scores[ORACLE].substeps

    def best_reward(self, *players: str) -> float:
        """Return the best mean reward of some players, and of the static setting if there is one.

        By default all but the rule: the best known.
        """
        chosen = (STATIC, *players) if players else self.scores.keys() - {RULE}
        return max(score.reward for name, score in self.scores.items() if name in chosen)


def frozen(control: str) -> str:
    """Return the name of the oracle that has a control frozen."""
    return f"oracle without {control}"


# --- Playing --------------------------------------------------------------------------------


def measure(quick: bool, folder: Path, backend: Backend = LOCAL) -> Iterator[Row]:
    """Yield rows of every scene, with a progress bar; quick: one instance of two scenes, coarsely.

    Finished runs are kept in the folder, and all scores written there.
    Raises ImportError that names the extra to install.
    """
    plan, store = QUICK if quick else FULL, episodes.results(folder)
    play_all(plan, store, backend)
    found = {
        scene: [contest(plan, scene, number, store) for number in range(plan.n_instances)]
        for scene in plan.scenes
    }
    write_instances(found, folder / _file("headroom_quick" if quick else "headroom"))
    for scene, contests in found.items():
        yield from rows(scene, contests)
    yield from summary(plan, found)
    yield from _rule_rows(plan, store)
    tables = {
        scene: [controls.table(_id(scene, k), plan.settings, store) for k in range(plan.held)]
        for scene in plan.games
    }
    yield from controls.rows(tables, plan.settings)
    yield from honesty.measure_references(plan.games, plan.honest, folder)


def _rule_rows(plan: HeadroomPlan, store: Results) -> Iterator[Row]:
    """Yield on how many validation instances of a scene the rule keeps within tolerance."""
    n = instances.SIZES["val"]
    for scene in plan.games:
        scores = [Score(*store.load(["rule", _id(scene, number)])) for number in range(n)]
        within = float(sum(score.within for score in scores))
        quantity = f"tuned CFL within tolerance, of {n} instances"
        yield Row(quantity, scene, within, "instances", n, at_least=True)
        most = 100 * max(score.beyond for score in scores)
        yield Row("tuned CFL, most beyond", scene, most, "% of steps")


def play_all(plan: HeadroomPlan, store: Results, backend: Backend) -> None:
    """Play all that the rows need, side by side on a backend."""

    def run_missing(keys: list[Key], title: str) -> None:
        run_jobs(play, [(key,) for key in keys], keys, store, title, backend)

    games = [(scene, number) for scene in plan.scenes for number in range(plan.n_instances)]
    rules = [(scene, number) for scene in plan.games for number in range(instances.SIZES["val"])]
    keys = [key for game in games for key in _first_keys(plan, *game).values()]
    keys += [key for game in rules if (key := ["rule", _id(*game)]) not in keys]
    run_missing(keys, "episodes")
    keys = [key for game in games for key in _frozen_keys(plan, *game, store).values()]
    run_missing(keys, "controls frozen")
    held = [_id(scene, number) for number in range(plan.held) for scene in plan.games]
    keys = [["controls", instance, plan.settings] for instance in held]
    run_missing(keys, "controls held fixed")


def play(key: Key) -> Any:
    """Return what a player does on an instance, as JSON can hold it.

    That is its score; of "static", the setting as well; of "controls", the rewards of a grid. None
    if there is no static setting.
    """
    player, instance, *settings = key
    scene = instance.split("/")[0]
    if player == "static":
        return best_static(scene, instance, *settings)
    if player == "controls":
        return controls.play_settings(instance, *settings)
    if player == "rule":
        return run(scene, instance, tuned_cfl)
    search, *fixed = settings
    return run(scene, instance, Oracle(search, {fixed[0]: fixed[1]} if fixed else None))


def _is_ablated(plan: HeadroomPlan, scene: str, number: int) -> bool:
    return number < plan.ablated and scene not in instances.DIAGNOSTIC


def _first_keys(plan: HeadroomPlan, scene: str, number: int) -> dict[str, Key]:
    """Return the keys of what can be played at once, by player."""
    instance = _id(scene, number)
    keys: dict[str, Key] = {
        RULE: ["rule", instance],
        STATIC: ["static", instance, plan.grid],
        ORACLE: ["oracle", instance, plan.search],
    }
    if _is_ablated(plan, scene, number):
        keys[ELSEWHERE] = ["oracle", instance, plan.second]
        keys[UNSMOOTHED] = ["frozen", instance, plan.search, XSPH_AXIS, XSPH_OFF]
    return keys


def _frozen_keys(plan: HeadroomPlan, scene: str, number: int, store: Results) -> dict[str, Key]:
    """Return the keys of the oracles with a control frozen at its best static value."""
    instance = _id(scene, number)
    best = store.load(["static", instance, plan.grid])
    if best is None or not _is_ablated(plan, scene, number):
        return {}
    return {
        frozen(control): ["frozen", instance, plan.search, axis, value]
        for axis, (control, value) in enumerate(zip(CONTROLS, best[0], strict=True))
    }


def contest(plan: HeadroomPlan, scene: str, number: int, store: Results) -> Contest:
    """Return what all players did on a validation instance."""
    first, ablation = _first_keys(plan, scene, number), _frozen_keys(plan, scene, number, store)
    players = (*PLAYERS, *ablation, *((ELSEWHERE, UNSMOOTHED) if ablation else ()))
    found = {player: store.load((first | ablation)[player]) for player in players}
    setting, found[STATIC] = found[STATIC] or (None, None)
    scores = {player: Score(*each) for player, each in found.items() if each is not None}
    return Contest(scores, setting and tuple(setting))


def write_instances(found: dict[str, list[Contest]], path: Path) -> None:
    """Write every score as CSV: player, instance, numbers, and the headroom of the instance."""
    table = []
    for scene, contests in found.items():
        for number, one in enumerate(contests):
            gain = one.headroom if math.isfinite(one.headroom) else ""
            for player, score in one.scores.items():
                setting = one.setting if player == STATIC else ""
                about = (_id(scene, number), label(scene, contests), player)
                table.append([*about, *score, score.within, setting, gain])
    write_csv(path, COLUMNS, table)


def finish(rows: list[Row], path: Path) -> None:
    """Write the labels of scenes, and print where what is; path: of a picture."""
    print(f"instances: {path.with_name(_file(path.stem))}")
    exploits.finish(rows, path)
    found = []
    for row in rows:
        scene, _, label = row.case.partition(", ")
        if scene in SCENES and row.quantity in (GAIN, NONE):
            is_known = row.quantity == GAIN and math.isfinite(row.value)
            found.append((scene, f"{row.value:.4g}" if is_known else "", label))
    if found:
        table = path.with_name(f"{path.stem}_labels.csv")
        write_csv(table, ("scene", "headroom", "label"), found)
        print(f"labels: {table}; the pages of environments show those of FAMILY in sph_gym/scenes")


def _file(stem: str) -> str:
    return f"{stem}_instances.csv"


def _id(scene: str, number: int) -> str:
    return f"{scene}/val/{number}"


# --- Rows -----------------------------------------------------------------------------------


def label(scene: str, contests: list[Contest]) -> str:
    """Return "diagnostic", or "benchmark" with a remark where the headroom is small or unknown."""
    given = instances.label(scene)
    if scene in instances.DIAGNOSTIC or least_headroom(contests) >= HEADROOM:
        return given
    return f"{given}, {'unknown' if math.isnan(headroom(contests)) else 'small'} headroom"


def rows(scene: str, contests: list[Contest]) -> Iterator[Row]:
    """Yield work, rewards and errors of a scene, means over instances, and its headroom."""
    case, of_all = f"{scene}, {label(scene, contests)}", f"of {len(contests)} instances"
    for title in PLAYERS:
        runs = [one.scores[title] for one in contests if title in one.scores]
        if runs:
            yield from _means(title, case, runs)
        within = float(sum(one.within for one in runs))
        yield Row(f"within tolerance, {title}", case, within, of_all)
    yield from _headrooms(scene, contests, case, of_all)
    for name, loss in losses(contests).items():
        yield Row(f"reward lost without {name}", case, loss, "")
    tried = [one for one in contests if UNSMOOTHED in one.scores]
    off = [one.best_reward() - one.scores[UNSMOOTHED].reward for one in tried]
    if off:
        yield Row("reward lost with an epsilon of 0", case, float(np.mean(off)), "")


def _means(title: str, case: str, runs: list[Score]) -> Iterator[Row]:
    means = Score(*np.mean(runs, axis=0).tolist())
    yield Row(f"work, {title}", case, means.substeps, "substeps")
    yield Row(f"reward, {title}", case, means.reward, "")
    yield Row(f"error, {title}", case, means.error, "tolerances")
    yield Row(f"beyond tolerance, {title}", case, 100 * means.beyond, "% of steps")


def _headrooms(scene: str, contests: list[Contest], case: str, of_all: str) -> Iterator[Row]:
    ratios = [one.headroom for one in contests]
    for number, ratio in enumerate(ratios):
        if math.isfinite(ratio):
            yield Row("headroom", _id(scene, number), ratio, "")
    n_compared = sum(map(math.isfinite, ratios))
    if not n_compared and scene in instances.DIAGNOSTIC:
        yield Row(NONE, case, 0.0, of_all)
        return
    yield Row("static and oracle within tolerance", case, float(n_compared), of_all)
    yield Row(GAIN, case, headroom(contests), "")
    if 0 < n_compared < len(ratios):
        yield Row("the same, if elsewhere nothing is gained", case, least_headroom(contests), "")


def headroom(contests: list[Contest]) -> float:
    """Return the geometric mean over the instances where both keep within tolerance."""
    return _geometric_mean([one.headroom for one in contests if math.isfinite(one.headroom)])


def least_headroom(contests: list[Contest]) -> float:
    """Return the geometric mean over all instances, with 1 for those that can't be compared."""
    gains = (one.headroom for one in contests)
    return _geometric_mean([gain if math.isfinite(gain) else 1.0 for gain in gains])


def _geometric_mean(ratios: list[float]) -> float:
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else math.nan


def losses(contests: list[Contest]) -> dict[str, float]:
    """Return the loss of best known mean reward without each of the controls, and NOISE_FLOOR.

    A beam can miss what another one finds: the static setting, too, counts for a search without a
    control, and every search for the best. The loss of the second search by the same measure,
    with nothing frozen, is the noise floor of the search.
    """
    players = {**{name: frozen(name) for name in CONTROLS}, NOISE_FLOOR: ELSEWHERE}
    lost = {}
    for name, player in players.items():
        tried = [one for one in contests if player in one.scores]
        if tried:
            lost[name] = float(
                np.mean([one.best_reward() - one.best_reward(player) for one in tried])
            )
    return lost


def needed(contests: list[Contest]) -> list[str]:
    """Return the controls without which more is lost than the noise floor of the search."""
    lost = losses(contests)
    floor = lost.pop(NOISE_FLOOR, 0.0)
    return [name for name, loss in lost.items() if loss > floor + LOSS]


def summary(plan: HeadroomPlan, found: dict[str, list[Contest]]) -> Iterator[Row]:
    """Yield how many scenes have headroom, and on how many each control matters."""
    games = {scene: one for scene, one in found.items() if scene not in instances.DIAGNOSTIC}
    many = sum(least_headroom(contests) >= HEADROOM for contests in games.values())
    bound = min(ENOUGH, len(plan.scenes))
    quantity = f"scenes with a headroom of at least {HEADROOM:g}"
    yield Row(quantity, "all", float(many), "", bound, at_least=True)
    for name in CONTROLS if plan.ablated else ():
        hurt = sum(name in needed(contests) for contests in games.values())
        least = min(LOSERS[name], len(games))
        yield Row(f"scenes that need {name}", "all", float(hurt), "", least, at_least=True)
