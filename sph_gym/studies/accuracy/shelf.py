"""What lies in the folder of the study: records of points, their times, what agents did.

Each is written in one go; what is damaged counts as missing, with a warning, and is made anew.
"""

import hashlib
import json
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import sph_gym
from sph_gym.solver.jit import source_hash
from sph_gym.studies import machine, store
from sph_gym.studies.accuracy import policies
from sph_gym.studies.accuracy.problems import Problem
from sph_gym.studies.accuracy.running import Outcome
from sph_gym.studies.accuracy.settings import Setting

# Fields of an outcome that differ from run to run.
CLOCKS = ("wall", "own")
# What is known of each run of a point.
PER_RUN = (*CLOCKS, "rate")


# --- What a point depends on ----------------------------------------------------------------


@cache
def sources(agents: bool = False) -> str:
    """Hash of all of ours that an error depends on; agents: of one who learned or looks ahead."""
    root = Path(sph_gym.__file__).parent
    parts = ("solver", "scenes", "controllers", *(("env",) if agents else ()))
    paths = [path for part in parts for path in sorted((root / part).rglob("*.*"))]
    here = Path(__file__).parent
    paths += [here / f"{name}.py" for name in ("running", "settings", "policies")]
    digest = hashlib.sha256(f"{source_hash()} {np.__version__}".encode())
    for path in paths:
        if path.suffix in (".py", ".csv"):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def manifest(problem: Problem, setting: Setting, other: int) -> dict[str, Any]:
    """All that the error of a point depends on."""
    agents = policies.needs_schedule(setting.controller)
    network = policies.network(setting.controller, problem.scene)
    learned = setting.controller in policies.LEARNED and network.is_file()
    return {
        "scene": problem.scene,
        "arguments": problem.given(other),
        "length": problem.length,
        "measure": problem.measure,
        "joined": problem.joined,
        "setting": setting._asdict(),
        "sources": sources(agents),
        "network": hashlib.sha256(network.read_bytes()).hexdigest()[:16] if learned else "",
        "versions": machine.describe() | release(),
    }


def key_of(facts: dict[str, Any]) -> str:
    """Of a manifest: what its files are called; who runs it where doesn't count."""
    counted = {name: value for name, value in facts.items() if name != "versions"}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()[:20]


@cache
def release() -> dict[str, str]:
    """The package's version and, in a checkout, its commit, with -dirty if it was changed."""
    try:
        found = {"sph_gym": metadata.version("sph_gym")}
    except metadata.PackageNotFoundError:
        found = {}
    root = Path(sph_gym.__file__).parent.parent
    if (root / ".git").exists():
        command = ["git", "describe", "--always", "--dirty", "--exclude=*", "--abbrev=40"]
        try:
            done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=60)
        except (OSError, subprocess.TimeoutExpired):
            return found
        if done.returncode == 0:
            found["commit"] = done.stdout.strip()
    return found


# --- Files ----------------------------------------------------------------------------------


def record(folder: Path, key: str) -> tuple[Path, Any]:
    """Where the error and the work of a point lie, and what lies there, None for nothing."""
    path = folder / "points" / f"{key}.json"
    return path, store.content(path, lambda kept: kept.get("hash") == key and _is_record(kept))


def _is_record(kept: dict[str, Any]) -> bool:
    outcome = kept.get("outcome")
    kinds = {name: own for name, own in Outcome.__annotations__.items() if name not in CLOCKS}
    return isinstance(outcome, dict) and all(
        _is(outcome.get(name), (float, int) if own is float else (getattr(own, "__origin__", own),))
        for name, own in kinds.items()
    )


def _is(value: Any, kinds: tuple[Any, ...]) -> bool:
    return isinstance(value, kinds) and not isinstance(value, bool)


def times(folder: Path, key: str) -> tuple[Path, Any]:
    """Where the times of its runs lie, and what lies there, None for nothing."""
    path = folder / "times" / f"{key}.json"
    return path, store.content(path, _is_times)


def _is_times(kept: dict[str, Any]) -> bool:
    lists = [kept.get(name) for name in PER_RUN]
    return (
        all(isinstance(own, list) and all(_is(t, (float, int)) for t in own) for own in lists)
        and len({len(own or ()) for own in lists}) == 1
        and _is(kept.get("differing"), (int,))
    )


def schedule(folder: Path, key: str) -> tuple[Path, Any]:
    """Where the controls that an agent set lie, and what lies there, None for nothing."""
    path = folder / "schedules" / f"{key}.json"
    return path, store.content(path, _is_schedule)


def _is_schedule(kept: dict[str, Any]) -> bool:
    frames = kept.get("controls")
    return isinstance(frames, list) and all(
        isinstance(frame, list) and len(frame) == 3 and all(_is(c, (float, int)) for c in frame)
        for frame in frames
    )
