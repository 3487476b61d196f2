"""Solvers with a mistake each, by name: what the doctor has to find.

In each, another function stands for a method or two of `plain.Plain`, and says what it does
instead. As a factory of the protocol: `make(name)`, or the text "sph_gym.doctor.faults:NAME".
"""

from typing import Any

from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.faults import (  # noqa: F401  (fill the registry)
    forces,
    neighborhoods,
    protocol,
    registry,
    states,
    velocities,
)
from sph_gym.doctor.faults.registry import Fault
from sph_gym.doctor.subject import Factory
from sph_gym.solver.checks import known

__all__ = ["FAULTS", "Fault", "make"]

# In the order of the chain.
FAULTS = dict(sorted(registry.FAULTS.items(), key=lambda item: LINKS.index(item[1].link)))


def make(name: str) -> Factory:
    """Return the factory of a fault. Raises ValueError that lists the known ones."""
    return FAULTS[known("fault", name, FAULTS)].make


def __getattr__(name: str) -> Any:
    if name in FAULTS:
        return FAULTS[name].make
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
