"""Refinement series: which scenes are run at which resolutions, and which error counts."""

from dataclasses import dataclass, field, replace
from typing import Any

from sph_gym import scenes
from sph_gym.solver.checks import known
from sph_gym.solver.scene import Scene

# An error that is taken over all frames instead of being judged in the end.
RMS = "RMS over the run"


@dataclass(frozen=True)
class Refinement:
    """A scene with one error and one length that is resolved.

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
        """The length that is resolved [m]."""
        return float((scenes.parameters(self.scene) | self.given(other))[self.length])

    def given(self, other: int = 0) -> dict[str, Any]:
        """The arguments but for dx; other: which of the others, 1 for the first, 0 for none."""
        return self.arguments | (self.others[other - 1] if other else {})

    def build(self, across: int, other: int = 0) -> Scene:
        """The scene with so many particles along its length, and its own settings."""
        scene = scenes.make(self.scene, dx=self.metres(other) / across, **self.given(other))
        return replace(scene, frame=self.joined * scene.frame)


_REFINEMENTS = (
    Refinement(
        "elliptical_drop", "radius", (14, 20, 28, 40, 57, 80), 40,
        "error of the major semi-axis", "of the exact semi-axis",
        "First order in dx: the tip is a free surface, where the sums lack half of their "
        "neighbours. With h = 2.38 dx or density by continuity errors cross zero while coarse and "
        "then grow again, to 0.73 and 0.28 % at 80 across.",
        order=0.9, joined=4, single="radius and rate only change the units",
    ),
    Refinement(
        "dam_break", "width", (10, 14, 20, 28, 40), 20,
        "front, RMS at the best time shift", "of the measured front",
        "Hardly: between four and three percent at all resolutions, since the reference is an "
        "experiment, with a gate, a floor that rubs and readings of its own.",
        arguments={"tank": 5.0}, widest=3.0,
        single="its measurements are of columns twice as high as wide",
    ),
    Refinement(
        "taylor_green", "size", (25, 35, 50, 71, 100), 50,
        "L1 error of the speed / L1 of it", "of its L1 norm",
        "About first order, a little less when fine: disorder costs the sums their second order, "
        "and shifting gives only some of it back.",
        order=0.74, others=({"reynolds": 50.0, "seed": 1}, {"reynolds": 400.0}), joined=5,
    ),
    Refinement(
        "couette", "height", (10, 14, 20, 28, 40, 57), 28,
        "largest velocity error at the tabulated times", "of U",
        "Better than second order while coarse (1.6 % at 10 across), slower from 28 on (0.06, 0.04 "
        "and 0.03 %), where the late times are left, which converge with first order. Single "
        "precision takes longer: with h = 3 dx, what the kernel gives to neighbours three spacings "
        "away is probably below the normal numbers of float32.",
        order=2.5, until=28, others=({"reynolds": 6.0}, {"reynolds": 30.0}), widest=3.0, joined=2,
    ),
    Refinement(
        "poiseuille", "height", (10, 14, 20, 28, 40, 57), 28,
        "largest velocity error at the tabulated times", "of Umax",
        "Between first and second order, slower when fine, where the late times are left, which "
        "converge with first order. Single precision takes longer, as in the Couette flow.",
        order=1.35, others=({"reynolds": 6.0}, {"reynolds": 30.0}), widest=3.0, joined=2,
    ),
    Refinement(
        "oscillating_drop", "radius", (10, 14, 20, 28, 40), 20,
        "RMS error of the semi-axis", "of R",
        "A little better than first order: the free surface, and the amplitude that is lost to "
        "heat.",
        order=1.0, arguments={"periods": 2.0},
        others=({"rate": 0.4, "radius": 0.7}, {"rate": 0.7}),
    ),
    Refinement(
        "standing_wave", "depth", (8, 10, 14, 20, 28), 14, RMS, "of the initial amplitude",
        "Between first and second order, since amplitude is lost at the free surface; hardly any "
        "is lost where the density is continuous, not summed.",
        order=1.3, arguments={"periods": 4}, widest=3.0,
        others=({"depth": 0.4, "amplitude": 0.02}, {"amplitude": 0.04}),
    ),
    Refinement(
        "hydrostatic_tank", "depth", (7, 10, 14, 20, 28), 14,
        "pressure profile, mean error", "of rho0 g H",
        "Not steadily: 9.5 % with seven rows, then half a percent and less, but 0.7 % with 28 "
        "after these four seconds. What is measured is a moment of a water that never quite comes "
        "to rest, and less so with long steps. Nothing is recommended for it.",
        arguments={"seconds": 4.0}, widest=3.0, erratic=True,
    ),
    Refinement(
        "lid_driven_cavity", "size", (12, 16, 20, 28, 40), 20,
        "largest error of the mean profiles", "of U",
        "Between first and second order, until the tables' own digits are left.",
        order=1.4, widest=4.0,
        single="its tables are read at one Reynolds number; speed and size only change the units",
    ),
    Refinement(
        "colliding_patches", "height", (10, 14, 20, 28, 40), 20,
        "energy lost, against the impact", "of the energy",
        "About first order: the impact sends its energy into sound of the wavelength of h.",
        order=0.7, others=({"height": 0.8}, {"length": 0.6}), joined=5,
    ),
    Refinement(
        "rotating_square", "side", (14, 20, 28, 40), 28,
        "change of kinetic energy", "of the energy",
        "About first order: what the tensile correction and the artificial viscosity take, at "
        "corners that become ever thinner.",
        order=0.72, joined=10, single="side and omega only change the units",
    ),
    Refinement(
        "water_jet", "width", (7, 10, 14, 20), 10, "RMS error of the mean pressure",
        "of rho U^2 / 2",
        "Falls with dx, but down to the noise of a mean over a few passages of the jet: at a "
        "resolution between two others it can be several times theirs. Nothing is recommended.",
        order=1.6, widest=3.0, joined=4, erratic=True,
    ),
    Refinement(
        "droplet", "side", (10, 14, 20, 28, 40), 20,
        "error of the pressure jump", "of sigma / R",
        "Not steadily: the layer in which the surface pulls is as thick as h and never quite at "
        "rest, so that the mean pressure keeps an error of chance. Nothing is recommended.",
        joined=3, erratic=True,
    ),
    Refinement(
        "sloshing", "fill", (5, 7, 10), 7, "centre of mass, RMS", "of the RMS of linear theory",
        "About first order with five to ten rows of water; theory is linear.",
        arguments={"degrees": 1.0, "period_ratio": 2.0, "periods": 1.5},
        order=0.8, others=({"degrees": 0.8}, {"degrees": 2.0}), widest=3.0,
    ),
)  # fmt: skip


def names() -> list[str]:
    """The scenes of the study."""
    return [each.scene for each in _REFINEMENTS]


def refinement(scene: str) -> Refinement:
    """That of a scene. Raises ValueError, which lists them, if there is none."""
    known("scene", scene, names())
    return next(each for each in _REFINEMENTS if each.scene == scene)


def share(value: float, unit: str) -> float:
    """A value of a `Measure` as a share: percents are hundredths."""
    return value / 100 if unit.startswith("%") else value
