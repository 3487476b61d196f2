"""The list of checks: what each is called, which link it speaks of, what it builds on."""

from collections.abc import Callable
from typing import NamedTuple

from sph_gym.doctor.diagnosis import LINKS, Result
from sph_gym.doctor.lab import Lab

CheckFunction = Callable[[Lab], Result]


class Check(NamedTuple):
    """One experiment.

    name: that of its function; link: the link of the chain that it speaks of; step: the step of
    the playbook, 0 for none; needs: names of earlier checks without which it would tell nothing:
    where one of them failed, this one is blocked; shows: optional attributes that the solver must
    have; last: it shows that something is wrong, not where, and is done only if nothing before it
    failed; may_refuse: a solver that raises an error on purpose, as some do in states that are far
    from a fluid's, makes it inconclusive.
    """

    name: str
    link: str
    step: int
    needs: tuple[str, ...]
    shows: tuple[str, ...]
    last: bool
    may_refuse: bool
    function: CheckFunction

    @property
    def summary(self) -> str:
        """Return what the check does: the first line of its function's docstring."""
        return (self.function.__doc__ or "").strip().split("\n")[0]


CHECKS: dict[str, Check] = {}


def check(
    link: str,
    step: int = 0,
    needs: tuple[str, ...] = ("adapter",),
    shows: tuple[str, ...] = (),
    last: bool = False,
    may_refuse: bool = False,
) -> Callable[[CheckFunction], CheckFunction]:
    """Add the decorated function to the checks; see `Check` for the arguments.

    The checks are done in the order in which they were added.
    """
    if link not in LINKS:
        raise ValueError(f"link: expected one of {', '.join(LINKS)}, got {link!r}")

    def add(function: CheckFunction) -> CheckFunction:
        name = function.__name__
        missing = [each for each in needs if each not in CHECKS]
        if name in CHECKS or missing:
            raise ValueError(f"check {name}: there already, or needs unknown {missing}")
        CHECKS[name] = Check(name, link, step, needs, shows, last, may_refuse, function)
        return function

    return add
