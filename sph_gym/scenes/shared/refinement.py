"""Refinement series: the resolutions at which a scene is run, and the error that counts."""

from dataclasses import dataclass, field, replace
from typing import Any

from sph_gym import scenes
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene

# An error that is taken over all frames instead of being judged in the end.
RMS = "RMS over the run"


@dataclass(frozen=True)
class Refinement:
    """One error of a scene and one length that is resolved; `REFINEMENT` of a scene's module.

    length: the argument of the scene that is divided by dx; sizes: into how many particles,
    coarse first; nominal: the one of them at which the other knobs are turned. arguments: of the
    scene. measure: the quantity of `Reference.judge` that is the error, or RMS of
    `Reference.error` over all frames; of: what it is a share of. note: how it converges, and why.
    order: the least order of convergence in dx that the note promises, None for none, over all
    sizes up to `until`, about four fifths of what was measured there.
    joined: frames of the scene that make one of the study: dt is snapped down until a whole number
    of steps fits into a frame, which should change it little.
    others: arguments of cases that no recommendation is fitted to, in each of which a dimensionless
    number differs, the last one harder; single: why there is none. widest: h / dx that the layers
    of the walls can serve. erratic: whether neighbouring resolutions differ by so much that nothing
    can be promised between them; such a scene is measured, and not recommended for.
    """

    scene: str
    length: str
    sizes: tuple[int, ...]
    nominal: int
    measure: str
    of: str
    note: str
    order: float | None = None
    until: int | None = None
    arguments: dict[str, Any] = field(default_factory=dict)
    others: tuple[dict[str, Any], ...] = ()
    single: str = ""
    widest: float = 8.0
    joined: int = 1
    erratic: bool = False

    def metres(self, other: int = 0) -> float:
        """Return the length that is resolved [m]."""
        return float((scenes.parameters(self.scene) | self.given(other))[self.length])

    def given(self, other: int = 0) -> dict[str, Any]:
        """Return the arguments except dx; other: number in `others` from 1, 0 for none."""
        return self.arguments | (self.others[other - 1] if other else {})

    def build(self, across: int, other: int = 0) -> Scene:
        """Return the scene with `across` particles along the length, at its own settings."""
        scene = scenes.make(self.scene, dx=self.metres(other) / across, **self.given(other))
        return replace(scene, frame=self.joined * scene.frame)


# The order of the study's tables and pictures; other scenes follow.
_ORDER = (
    "elliptical_drop", "dam_break", "taylor_green", "couette", "poiseuille", "oscillating_drop",
    "standing_wave", "hydrostatic_tank", "lid_driven_cavity", "colliding_patches",
    "rotating_square", "water_jet", "droplet", "sloshing",
)  # fmt: skip


def names() -> list[str]:
    """Return the names of the scenes that have a refinement series."""
    found = [name for name in scenes.names() if scenes.refinement(name) is not None]
    return sorted(found, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))


def refinement(scene: str) -> Refinement:
    """Return the refinement series of a scene. Raises ValueError that lists those that have one."""
    found = scenes.refinement(known("scene", scene, names()))
    assert found is not None
    return found


def share(value: float, unit: str) -> float:
    """Return a value of a `Measure` as a share: percents are hundredths."""
    return value / 100 if unit.startswith("%") else value
