"""The elliptical drop and the dam break beside PySPH: same error, same machine, one thread."""

import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.scenes.shared.free_bodies import ellipse
from sph_gym.scenes.shared.martin_moyce import SHIFTS, front_error
from sph_gym.studies import store
from sph_gym.studies.accuracy import fronts
from sph_gym.studies.accuracy.luck import chance, sober
from sph_gym.studies.accuracy.plan import rungs
from sph_gym.studies.accuracy.points import Point
from sph_gym.studies.accuracy.settings import Setting
from sph_gym.studies.accuracy.trust import envelope
from sph_gym.studies.peers import PeerError, Peers
from sph_gym.studies.table import Row
from sph_gym.studies.timing import pinned

SCRIPT = "pysph_accuracy.py"
NAME = "PySPH"
# Of the drop, sizes for which the example's lattice has a particle in the middle.
SIZES = {"elliptical_drop": (20, 40), "dam_break": (10, 20)}
# Of the drop's strain rate in the example [1/s], and gravity in the other [m/s^2].
RATE, GRAVITY = 100.0, 9.81
TARGET, FASTER = 0.01, 20.0
PATIENCE = 3600.0
# Seconds on the wall and of its own, as the script tells them.
CLOCKS = ("seconds", "own")


class Found(NamedTuple):
    """A run of the peer: error (a share), seconds on the wall and of its own."""

    across: int
    error: float
    wall: float
    own: float

    @property
    def good(self) -> bool:
        """Whether it has an error."""
        return 0 < self.error < math.inf


def check(peers: Peers) -> None:
    """Raises ValueError if the folder has no script."""
    if not (peers.folder / SCRIPT).is_file():
        raise ValueError(f"--peers: no {peers.folder / SCRIPT}")


def rows(peers: Peers, points: Sequence[Point], folder: Path, again: bool = False) -> Iterator[Row]:
    """Errors and times of the peer, and how many times as fast ours is at equal error.

    again: run the peer anew. A script that fails is told of, and gives a row without a number,
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
        yield from compare(scene, ours, theirs)


def compare(scene: str, ours: Sequence[Point], theirs: Sequence[Found]) -> Iterator[Row]:
    """Their time over ours at 1 % of error: of the scene's own settings, then of the best line.

    Nothing where a scene's errors don't fall with dx: the time for an error is then chance.
    """
    if chance(ours):
        return
    own = [point for point in sober(ours) if point.setting.line == rungs(ours)[0].setting.line]
    for mine, who in ((own, "its own settings"), (sober(ours), "the best that converge")):
        for clock, what in (("own", ""), ("wall", ", by wall clock")):
            ratio = at_least(theirs, TARGET, clock) / least(mine, TARGET, clock)
            quantity = f"times as fast as {NAME} at equal error{what}"
            bound = None if what else FASTER
            case = f"{scene}, {who}, {100 * TARGET:g} %"
            yield Row(quantity, case, ratio, "", bound, at_least=bound is not None)


def least(points: Sequence[Point], target: float, clock: str) -> float:
    """Seconds that the cheapest of some lines takes for an error; NaN if none has it.

    Interpolated between its runs, on logarithmic scales.
    """
    lines: dict[Setting, list[Point]] = {}
    for found in sorted(points, key=lambda found: found.setting.across):
        lines.setdefault(found.setting.line, []).append(found)
    prices = [
        fronts.price([p.error for p in runs], [getattr(p, clock) for p in runs], target)
        for runs in lines.values()
    ]
    # where even the coarsest has less, its time is what it takes
    return min((price.gain for price in prices if price.bound != ">"), default=math.nan)


def at_least(theirs: Sequence[Found], target: float, clock: str) -> float:
    """Seconds that they take for an error, interpolated on logarithmic scales.

    For an error that none of their runs has, the time of the finest, which isn't enough; NaN for
    one that the coarsest undercuts already.
    """
    runs = sorted(theirs, key=lambda found: found.across)
    errors = envelope(np.array([found.error for found in runs]))
    if target > errors[0]:
        return math.nan
    times = np.log([getattr(found, clock) for found in runs])
    return math.exp(float(np.interp(-math.log(target), -np.log(errors), times)))


def run(peers: Peers, scene: str, across: int, folder: Path, again: bool = False) -> Found:
    """A run of the script, from the folder if it is there, unless `again`. Raises PeerError."""
    script = (peers.folder / SCRIPT).resolve()
    key = hashlib.sha256(script.read_bytes() + f"{scene} {across} {peers.python}".encode())
    path = folder / "peer" / f"{scene}-{across}-{key.hexdigest()[:16]}.json"
    judge = {"elliptical_drop": tip_error, "dam_break": surge_error}[scene]

    def fits(kept: dict[str, Any]) -> bool:
        try:
            return all(kept[name] > 0 for name in CLOCKS) and not math.isnan(judge(kept))
        except (KeyError, TypeError, ValueError, ArithmeticError):
            return False

    seen = None if again else store.content(path, fits)
    if seen is None:
        seen = _call(peers, script, scene, across)
        store.write(path, seen)
    return Found(across, judge(seen), seen["seconds"], seen["own"])


def _call(peers: Peers, script: Path, scene: str, across: int) -> dict[str, Any]:
    command = [peers.python, str(script), scene, "--across", str(across)]
    with tempfile.TemporaryDirectory() as scratch, pinned():
        try:
            done = subprocess.run(
                command, cwd=scratch, env=os.environ | {"PEERS": scratch, "OMP_NUM_THREADS": "1"},
                capture_output=True, text=True, timeout=PATIENCE,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            raise PeerError(str(error)) from None
    return parse(done.stdout, done.stderr)


def parse(output: str, errors: str = "") -> dict[str, Any]:
    """The numbers of the last line `RES {json}`; PeerError if there is none."""
    for line in reversed(output.splitlines()):
        if line.startswith("RES "):
            try:
                found: dict[str, Any] = json.loads(line[4:])
                return {**found, "seconds": found["seconds"], "own": found["own"]}
            except (ValueError, KeyError, TypeError) as error:
                raise PeerError(f"no result in {line!r}: {error!r}") from None
    last = (errors.strip() or output.strip() or "nothing was printed").splitlines()[-1]
    raise PeerError(f"no line RES: {last}")


def tip_error(seen: dict[str, Any]) -> float:
    """Of the drop's tip; to the farthest particle comes what it lacks to the edge at the start.

    The edge is that of the circle with the area of all particles: for our drop, whose outermost
    ring lies half a spacing inside, that is half a spacing, and nothing for theirs.
    """
    radius = seen["dx"] * math.sqrt(seen["particles"] / math.pi)
    tip = seen["tip"] + radius - seen["radius"]
    exact = radius * float(ellipse(np.array([seen["time"]]), -RATE)[0, 1])
    return float(abs(tip / exact - 1))


def surge_error(seen: dict[str, Any]) -> float:
    """RMS of the front at the best time shift, against Martin & Moyce."""
    times, front = np.array(seen["history"]).T
    history = np.stack(
        [times * math.sqrt(2 * GRAVITY / seen["width"]), front / seen["width"]], axis=-1
    )
    return min(front_error(history, shift) for shift in SHIFTS)
