"""The elliptical drop and the dam break beside PySPH: same error, same machine, one thread."""

import math
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.provenance import content_hash
from sph_gym.recommend.series import group
from sph_gym.scenes.shared.free_bodies import ellipse
from sph_gym.scenes.shared.martin_moyce import SHIFTS, front_error
from sph_gym.studies import peers as racing
from sph_gym.studies.accuracy.analysis import Gain, chance, cost_at, count, nominal_series
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.peers import PeerError, Peers
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

SCRIPT = "pysph_accuracy.py"
NAME = "PySPH"
# Resolutions; of the drop, those for which the example's lattice has a particle in the middle.
SIZES = {"elliptical_drop": (20, 40), "dam_break": (10, 20)}
# Strain rate of the drop in the example [1/s], and gravity in the other [m/s^2].
RATE, GRAVITY = 100.0, 9.81
TARGET, FASTER = 0.01, 20.0
PATIENCE = 3600.0
# Seconds by the clock and of processor time, as the script prints them.
CLOCKS = ("seconds", "own")


class PeerRun(NamedTuple):
    """A run of the peer: error (a share), seconds by the clock and of processor time."""

    across: int
    error: float
    wall: float
    own: float


def rows(peers: Peers, points: Sequence[Point], folder: Path, again: bool = False) -> Iterator[Row]:
    """Yield errors and times of the peer, and how many times as fast ours is at equal error.

    again: run the peer anew. A script that fails is reported, and gives a row without a number,
    which doesn't hold.
    """
    for scene, sizes in SIZES.items():
        ours = [point for point in points if point.scene == scene]
        if not ours:
            continue
        try:
            theirs = [run(peers, scene, across, folder, again) for across in sizes]
        except PeerError as error:
            print(f"{peers.folder / SCRIPT}: {error}", file=sys.stderr)
            yield Row(f"error of {NAME}", scene, math.nan, "%")
            continue
        for found in theirs:
            case = f"{scene}, {found.across} across"
            yield Row(f"error of {NAME}", case, 100 * found.error, "%")
            yield Row(f"processor seconds of {NAME}", case, found.own, "s")
            yield Row(f"wall seconds of {NAME}", case, found.wall, "s")
        yield from _compare(scene, ours, theirs)


def _compare(scene: str, ours: Sequence[Point], theirs: Sequence[PeerRun]) -> Iterator[Row]:
    """Yield their time over ours at 1 % of error: of the scene's own settings, then of the best.

    Nothing where a scene's errors don't fall with dx: the time for an error is then chance.
    """
    if chance(ours):
        return
    converging, start = count(ours), nominal_series(ours)[0].setting.series
    own = [point for point in converging if point.setting.series == start]
    for mine, title in ((own, "its own settings"), (converging, "the best that converge")):
        for clock, what in (("own", ""), ("wall", ", by wall clock")):
            ratio = time_of_peer(theirs, TARGET, clock) / least_time(mine, TARGET, clock)
            bound = None if what else FASTER
            case = f"{scene}, {title}, {100 * TARGET:g} %"
            quantity = f"times as fast as {NAME} at equal error{what}"
            yield Row(quantity, case, ratio, "", bound, at_least=bound is not None)


def _cost(runs: Sequence[Point] | Sequence[PeerRun], target: float, clock: str) -> Gain:
    """Return the seconds for an error, between runs from coarse to fine, on logarithmic scales."""
    return cost_at([getattr(run, clock) for run in runs], [run.error for run in runs], target)


def least_time(points: Sequence[Point], target: float, clock: str) -> float:
    """Return the seconds that the cheapest of some series takes for an error; NaN if none has it.

    Where even its coarsest run has less, the time of that.
    """
    costs = [_cost(runs, target, clock) for runs in group(points).values()]
    return min((cost.gain for cost in costs if cost.bound != ">"), default=math.nan)


def time_of_peer(theirs: Sequence[PeerRun], target: float, clock: str) -> float:
    """Return the seconds that they take for an error; NaN if their coarsest run undercuts it.

    For an error that none of their runs has, the time of the finest, which isn't enough.
    """
    cost = _cost(sorted(theirs), target, clock)
    return math.nan if cost.bound == "<" else cost.gain


def run(peers: Peers, scene: str, across: int, folder: Path, again: bool = False) -> PeerRun:
    """Return a run of the script, kept in the folder unless `again`. Raises PeerError."""
    judge = {"elliptical_drop": tip_error, "dam_break": surge_error}[scene]

    def make(seen: Any) -> PeerRun:
        found = PeerRun(across, judge(seen), seen["seconds"], seen["own"])
        if not (found.error >= 0 and found.wall > 0 and found.own > 0):
            raise ValueError(f"expected an error and times, got {found}")
        return found

    results = Results(folder / "peer", common=())
    key = [scene, across, peers.python, content_hash((peers.folder / SCRIPT).resolve())]
    arguments = [scene, "--across", str(across)]
    compute = partial(racing.run, peers, SCRIPT, arguments, CLOCKS, PATIENCE)
    return results.get(key, compute, make, again)


def tip_error(seen: dict[str, Any]) -> float:
    """Return the error of the drop's tip.

    What the farthest particle lacks to the edge at the start is added to it. The edge is that of
    the circle with the area of all particles: for our drop, whose outermost ring lies half a
    spacing inside, that is half a spacing, and nothing for theirs.
    """
    radius = seen["dx"] * math.sqrt(seen["particles"] / math.pi)
    tip = seen["tip"] + radius - seen["radius"]
    exact = radius * float(ellipse(np.array([seen["time"]]), -RATE)[0, 1])
    return float(abs(tip / exact - 1))


def surge_error(seen: dict[str, Any]) -> float:
    """Return the RMS error of the front at the best time shift, against Martin & Moyce."""
    times, front = np.array(seen["history"]).T
    history = np.stack(
        [times * math.sqrt(2 * GRAVITY / seen["width"]), front / seen["width"]], axis=-1
    )
    return min(front_error(history, shift) for shift in SHIFTS)
