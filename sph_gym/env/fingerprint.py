"""Hashes of nested values: of the flow that a scene shows, and of the state of an environment."""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from sph_gym.solver.scene import Scene


def fingerprint(scene: Scene) -> str:
    """Return a hash of the flow that a scene shows, whatever its name and a machine's rounding."""
    return digest(replace(scene, name="scene"), digits=9)[:16]


def digest(value: Any, digits: int | None = None) -> str:
    """Return the SHA-256 of nested dataclasses, mappings, sequences, arrays, numbers and texts.

    digits: significant ones that count, None for all.
    """
    found = hashlib.sha256()
    _add(found, value, digits)
    return found.hexdigest()


def _add(found: Any, value: Any, digits: int | None) -> None:
    found.update(type(value).__name__.encode())
    if is_dataclass(value):
        for field in fields(value):
            part = getattr(value, field.name)
            # what is absent doesn't count: a new effect changes no hash of a scene without it
            if part is not None and part is not False:
                found.update(field.name.encode())
                _add(found, part, digits)
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _add(found, key, digits)
            _add(found, value[key], digits)
    elif isinstance(value, (tuple, list)):
        for part in value:
            _add(found, part, digits)
    elif isinstance(value, np.ndarray):
        if digits is not None:
            scale = float(np.abs(value).max(initial=0.0)) or 1.0
            _add(found, scale, digits)
            # no negative zeros
            value = np.round(value / scale, digits) + 0.0
        found.update(repr((value.dtype, value.shape)).encode() + value.tobytes())
    elif isinstance(value, float) and digits is not None:
        found.update(f"{value:.{digits}g}".encode())
    else:
        found.update(repr(value).encode())
