"""The list of faults: what each is called, which link it breaks, and how its solver is made."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.plain import Plain
from sph_gym.doctor.subject import Factory


class Fault(NamedTuple):
    """A solver that is broken in one place.

    link: the broken link; what: the mistake, in a sentence; step: the step of the playbook that
    speaks of it, 0 for none; make: a factory of the protocol.
    """

    link: str
    what: str
    step: int
    make: Factory


FAULTS: dict[str, Fault] = {}
Made = TypeVar("Made", bound=Callable[..., Any])


def fault(name: str, link: str, step: int = 0) -> Callable[[Made], Made]:
    """Add the decorated class of solvers to the faults; the first line of its text is `what`."""
    if link not in LINKS:
        raise ValueError(f"link: expected one of {', '.join(LINKS)}, got {link!r}")

    def add(made: Made) -> Made:
        if name in FAULTS:
            raise ValueError(f"fault {name}: there already")
        what = (made.__doc__ or "").strip().split("\n")[0]
        FAULTS[name] = Fault(link, what, step, made)
        return made

    return add


def replaces(method: str, link: str, step: int = 0) -> Callable[[Made], Made]:
    """Add the article's solver with the decorated function in place of one of its methods.

    The fault has the name of the function.
    """

    def add(function: Made) -> Made:
        name = function.__name__
        title = "".join(word.capitalize() for word in name.split("_"))
        members = {method: function, "__doc__": function.__doc__, "__module__": function.__module__}
        fault(name, link, step)(type(title, (Plain,), members))
        return function

    return add
