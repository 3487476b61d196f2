"""The machine of a measurement: without it, a number of seconds says nothing."""

import json
import os
import platform
from pathlib import Path

import numba
import numpy as np

from sph_gym.files import write_text
from sph_gym.solver import target
from sph_gym.solver.teams import most_threads


def describe() -> dict[str, str]:
    """Return processor, cores that may be used, vectors, operating system and versions."""
    return {
        "processor": _processor(),
        "cores": f"{most_threads()} usable of {os.cpu_count()}",
        "vectors": target.description(),
        "system": platform.platform(),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "numba": numba.__version__,
        "numpy": np.__version__,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model") and value.strip():
            return value.strip()
    return platform.processor() or platform.machine()


def write(path: Path) -> None:
    """Print the description and write it as JSON."""
    description = describe()
    for name, value in description.items():
        print(f"{name}: {value}")
    write_text(path, json.dumps(description, indent=2) + "\n")
