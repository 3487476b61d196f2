"""Other solvers, as scripts that print their results, side by side with this one."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.studies.table import Row
from sph_gym.timing import Runner, own_clock, pinned

SCRIPT = "taichi_bench.py"
NAME = "Taichi"
FASTER = 2.5
# Seconds that a script may go on repeating itself on a disturbed machine, and until it is given up.
BUDGET = 4.0
PATIENCE = 600.0
# Particle-steps between two looks of a script at its clock.
WORK = 1_500_000
# Our calls in a round.
CALLS = 9
# Speeds that are compared: a name in the peer's result, and the end of its row's name.
SPEEDS = {"Mps_all": "", "Mps_fluid": ", fluid alone", "Mps_all_cpu": ", by processor time"}
NEEDED = ("Mps_all", "nbr")


class Peers(NamedTuple):
    """The folder of the scripts and the Python that runs them."""

    folder: Path
    python: str = sys.executable

    def check(self, script: str) -> None:
        """Raise ValueError if the folder has no such script."""
        if not (self.folder / script).is_file():
            raise ValueError(f"--peers: no {self.folder / script}")


class PeerError(RuntimeError):
    """A script that failed: what it said instead of a result."""


def run(
    peers: Peers,
    script: str,
    arguments: Sequence[str],
    needed: Sequence[str],
    patience: float = PATIENCE,
) -> dict[str, Any]:
    """Run a script on one core in an empty folder; return what it prints behind RES.

    needed: entries that the result must have; patience: seconds until it is given up. Raises
    PeerError.
    """
    command = [peers.python, str((peers.folder / script).resolve()), *arguments]
    with tempfile.TemporaryDirectory() as folder, pinned():
        scratch = {"PEERS": folder, "PEERS_RESULTS": str(Path(folder) / "results.jsonl")}
        limits = {"BUDGET": str(BUDGET), "OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                command, cwd=folder, env=os.environ | scratch | limits,
                capture_output=True, text=True, timeout=patience,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            raise PeerError(str(error)) from None
    return parse(done.stdout, done.stderr, needed)


def parse(output: str, errors: str = "", needed: Sequence[str] = NEEDED) -> dict[str, Any]:
    """Return the numbers of the last line `RES {json}`; PeerError if there is none."""
    for line in reversed(output.splitlines()):
        if line.startswith("RES "):
            try:
                found = json.loads(line[4:])
                return {**found, **{name: found[name] for name in needed}}
            except (ValueError, KeyError, TypeError) as error:
                raise PeerError(f"no result in {line!r}: {error!r}") from None
    last = (errors.strip() or output.strip() or "nothing was printed").splitlines()[-1]
    raise PeerError(f"no line RES: {last}")


def compare(
    peers: Peers, runner: Runner, case: str, n: int, dtype: str, rounds: int
) -> Iterator[Row]:
    """Yield rows of both speeds, measured in turns on the same core, for n fluid particles.

    A script that fails is reported, and gives a row without a number, which doesn't hold.
    """
    quantity = f"times as fast as {NAME}"
    arguments = ["--n", str(n), "--steps", str(max(WORK // n, 3))]
    arguments += ["--f64"] if dtype == "float64" else []
    try:
        found = [(own_speeds(runner), run(peers, SCRIPT, arguments, NEEDED)) for _ in range(rounds)]
    except PeerError as error:
        print(f"{peers.folder / SCRIPT}: {error}", file=sys.stderr)
        yield Row(quantity, case, float("nan"), "", FASTER, at_least=True)
        return
    speed, neighbors = (np.median([peer[key] for _, peer in found]) for key in NEEDED)
    yield Row(f"throughput of {NAME}", case, float(speed), "M particle-steps/s")
    yield Row(f"mean neighbours of {NAME}", case, float(neighbors), "")
    for key, what in SPEEDS.items():
        ratios = [ours[key] / float(peer[key]) for ours, peer in found if key in peer]
        if ratios:
            bound = FASTER if key == "Mps_all" else None
            ratio = float(np.median(ratios))
            yield Row(quantity + what, case, ratio, "", bound, at_least=bound is not None)


def own_speeds(runner: Runner) -> dict[str, float]:
    """Return our speeds by the peers' names [M particle-steps/s]: medians of some calls."""
    wall = np.median([runner.seconds() for _ in range(CALLS)])
    own = np.median([runner.seconds(own_clock()) for _ in range(CALLS)])
    n, n_fluid = runner.sim.n_particles, runner.sim.n_fluid
    speeds = {"Mps_all": n / wall, "Mps_fluid": n_fluid / wall, "Mps_all_cpu": n / own}
    return {key: float(speed) / 1e6 for key, speed in speeds.items()}
