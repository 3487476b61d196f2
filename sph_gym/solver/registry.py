"""The description of an effect, from which checks, model, studies and docs are derived."""

import inspect
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from sph_gym.solver.checks import in_range


class Given(NamedTuple):
    """The parts of a scene that strengths depend on.

    effects: all that the scene names; kernel: in double precision; h: support radius [m]; dx:
    spacing [m]; c0: nominal sound speed [m/s]; rho0: rest density [kg/m^3]; mass: of a particle
    [kg/m].
    """

    effects: Any
    kernel: Any
    h: float
    dx: float
    c0: float
    rho0: float
    mass: float


class Effect(NamedTuple):
    """One effect.

    name: of its field in `Effects`; strength: (value of that field, `Given`) -> the numbers that
    the term takes; typical: scene -> a value for trying the effect; at_walls: whether it acts
    between fluid and boundary particles, "always", "no-slip" (where walls are) or "never"; flag:
    whether its value is True or False; needs: another effect that it needs, and why.
    """

    name: str
    strength: Callable[[Any, Given], Any]
    typical: Callable[[Any], Any]
    at_walls: str
    flag: bool
    needs: tuple[str, str] | None

    @property
    def meaning(self) -> str:
        """The meaning of the parameter, and what the effect does."""
        return " ".join((inspect.getdoc(self.strength) or "").split("Source:")[0].split())

    @property
    def source(self) -> str:
        """The citation, empty if there is none."""
        found = re.search(r"Source: (.*)", " ".join((inspect.getdoc(self.strength) or "").split()))
        return found[1].rstrip(".") if found else ""

    def check(self, effects: Any) -> None:
        """Make the value a finite float of at least 0, or leave a flag as it is.

        Raises ValueError for anything else, and if the effect that it needs is absent.
        """
        value = getattr(effects, self.name)
        if self.flag:
            if not isinstance(value, bool):
                hint = " (its strength is Controls.xsph)" if self.name == "xsph" else ""
                raise ValueError(
                    f"effects.{self.name}: expected True or False{hint}, got {value!r}"
                )
        elif value is not None:
            value = in_range(f"effects.{self.name}", value, 0.0)
            object.__setattr__(effects, self.name, value)
            if self.needs is not None and not getattr(effects, self.needs[0]):
                raise ValueError(
                    f"effects.{self.name}: expected {self.needs[0]}=True with it, since "
                    f"{self.needs[1]}, got {value:g}"
                )


# In the order of the sections.
EFFECTS: list[Effect] = []


def effect(
    typical: Callable[[Any], Any] = lambda scene: True,
    at_walls: str = "always",
    flag: bool = False,
    needs: tuple[str, str] | None = None,
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that registers a strength as the `Effect` of the same name."""

    def register(strength: Callable[..., Any]) -> Callable[..., Any]:
        EFFECTS.append(Effect(strength.__name__, strength, typical, at_walls, flag, needs))
        return strength

    return register
