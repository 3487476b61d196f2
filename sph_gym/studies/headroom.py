"""What there is to gain: work of the best static setting against that of the look-ahead oracle.

Equal error means that both keep within tolerance: at most 5 % of the steps of a run have an error
above 1, in multiples of its tolerance, which is the constraint of the reward. A static setting is
chosen in hindsight, for each instance by itself, as the cheapest that keeps within tolerance.
"""

import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.env import SCENES, instances
from sph_gym.env.oracle import COARSE, Oracle, Search
from sph_gym.studies.episodes import Episode, Grid, Point, best_static, kept, run
from sph_gym.studies.exploits import tuned_cfl
from sph_gym.studies.table import Row

FOLDER = Path("runs/studies")
# So much headroom, on so many scenes; and so much of a loss of mean reward counts as one, on so
# many scenes, where a control is frozen.
HEADROOM, ENOUGH = 1.5, 5
LOSS, LOSERS = 0.01, 2
CONTROLS = ("Courant multiple", "sound speed", "xsph")


class Plan(NamedTuple):
    """Scenes, instances of each, instances of which the ablation is run, and how to search."""

    scenes: tuple[str, ...] = SCENES
    n_instances: int = 4
    ablated: int = 2
    search: Search = Search()
    grid: Grid = Grid()


FULL = Plan()
QUICK = Plan(("long_fall", "colliding_patches"), 1, 0, COARSE, Grid(xsph=(0.3,)))


class Contest(NamedTuple):
    """One instance: the rule, the best static setting and its coordinates, and the oracle.

    static, setting: None where no static setting keeps within tolerance. frozen: the oracle
    without each of the controls, empty where that wasn't tried.
    """

    rule: Episode
    static: Episode | None
    setting: Point | None
    oracle: Episode
    frozen: tuple[Episode, ...]

    @property
    def headroom(self) -> float:
        """Work of the static setting / work of the oracle at equal error; else not a number."""
        if self.static is None or not self.oracle.within:
            return math.nan
        return self.static.substeps / self.oracle.substeps


def measure(quick: bool, folder: Path = FOLDER) -> Iterator[Row]:
    """Rows of every scene, with a progress bar; quick: one instance of two scenes, coarsely.

    Finished runs are kept in the folder. Raises ImportError that names the extra to install.
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
                found[scene].append(contest(plan, scene, number, folder / "headroom"))
                bar.update()
            yield from rows(scene, found[scene])
    yield from summary(plan, found)


def contest(plan: Plan, scene: str, number: int, folder: Path) -> Contest:
    """Everybody on one validation instance."""
    instance, search = f"{scene}/val/{number}", plan.search

    def episode(name: str, *key: Any, run: Callable[[], Episode]) -> Episode:
        return Episode(*kept(folder, [name, instance, *key], run))

    rule = episode("rule", run=partial(run, scene, instance, tuned_cfl))
    best = kept(
        folder, ["static", instance, plan.grid], partial(best_static, scene, instance, plan.grid)
    )
    setting, static = (None, None) if best is None else (tuple(best[0]), Episode(*best[1]))
    oracle = episode("oracle", search, run=partial(run, scene, instance, Oracle(search)))
    frozen = []
    if setting is not None and number < plan.ablated and scene not in instances.DIAGNOSTIC:
        for axis, value in enumerate(setting):
            policy = Oracle(search, {axis: value})
            frozen.append(
                episode("frozen", search, axis, value, run=partial(run, scene, instance, policy))
            )
    return Contest(rule, static, setting, oracle, tuple(frozen))


def rows(scene: str, contests: list[Contest]) -> Iterator[Row]:
    """Work, rewards and headroom of a scene: means over instances."""
    label = "diagnostic" if scene in instances.DIAGNOSTIC else "benchmark"
    case = f"{scene}, {label}"
    for name in ("rule", "static", "oracle"):
        episodes = [getattr(one, name) for one in contests]
        runs = [one for one in episodes if one is not None]
        if not runs:
            continue
        title = {"rule": "tuned CFL", "static": "best static", "oracle": "oracle"}[name]
        work = float(np.mean([one.substeps for one in runs]))
        yield Row(f"work, {title}", case, work, "substeps")
        yield Row(f"reward, {title}", case, float(np.mean([one.reward for one in runs])), "")
        beyond = 100 * float(np.mean([one.beyond for one in runs]))
        yield Row(f"beyond tolerance, {title}", case, beyond, "% of steps")
    yield Row("headroom over the best static", case, headroom(contests), "")
    for name, loss in losses(contests).items():
        yield Row(f"reward lost without {name}", case, loss, "")


def headroom(contests: list[Contest]) -> float:
    """The geometric mean over the instances where both keep within tolerance."""
    ratios = [one.headroom for one in contests if math.isfinite(one.headroom)]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else math.nan


def losses(contests: list[Contest]) -> dict[str, float]:
    """What the best known mean reward loses if one of the controls may not be touched.

    A beam can miss what another one finds: whoever keeps a control as it should be kept, the
    static setting too, counts for those who may not touch it, and everybody for the best.
    """
    lost: dict[str, list[float]] = {name: [] for name in CONTROLS}
    for one in contests:
        static = -math.inf if one.static is None else one.static.reward
        best = max(static, one.oracle.reward, *(frozen.reward for frozen in one.frozen))
        for name, frozen in zip(CONTROLS, one.frozen, strict=False):
            lost[name].append(best - max(frozen.reward, static))
    return {name: float(np.mean(values)) for name, values in lost.items() if values}


def summary(plan: Plan, found: dict[str, list[Contest]]) -> Iterator[Row]:
    """How many scenes have headroom, and on how many each control matters."""
    games = {scene: one for scene, one in found.items() if scene not in instances.DIAGNOSTIC}
    many = sum(headroom(contests) >= HEADROOM for contests in games.values())
    bound = min(ENOUGH, len(plan.scenes))
    quantity = f"scenes with a headroom of at least {HEADROOM:g}"
    yield Row(quantity, "all", float(many), "", bound, at_least=True)
    for name in CONTROLS if plan.ablated else ():
        hurt = sum(losses(contests).get(name, 0.0) > LOSS for contests in games.values())
        yield Row(f"scenes that need {name}", "all", float(hurt), "", LOSERS, at_least=True)
