"""Clocks and timed steps of `sph_gym.timing`, under the name that studies import."""

from sph_gym.timing import (
    WARM_UP,
    WORK,
    Runner,
    clocked,
    in_turns,
    nanoseconds,
    own_clock,
    pinned,
    same_home,
)

__all__ = [
    "WARM_UP",
    "WORK",
    "Runner",
    "clocked",
    "in_turns",
    "nanoseconds",
    "own_clock",
    "pinned",
    "same_home",
]
