"""The watch over a running simulation: what is odd about it becomes a `Warning`."""

import math
from typing import Any, NamedTuple

import numpy as np

from sph_gym.solver.container import lowest_fill
from sph_gym.solver.diagnostics import CLUMPED, Totals
from sph_gym.solver.engine import Engine
from sph_gym.solver.initial_checks import anomalies, is_narrow
from sph_gym.solver.jit import jit
from sph_gym.solver.kernels import MATCHED
from sph_gym.solver.neighbors import fluid_range, group_size, neighbor
from sph_gym.solver.scene import Scene
from sph_gym.solver.warnings import KINDS, Warning

# Less spurious energy than that of all the fluid at this share of c0 is no matter.
QUIET = 2e-3
# Slower than this share of c0, fluid is at rest; if its median density [rho0] is below the second
# number then, it has swollen.
REST, THIN = 5e-3, 0.93
# Share of dx by which a level is uncertain.
LEVEL = 0.25
# Density kernel and pressure gradient that aren't matched are unstable from this h / dx on.
UNSTABLE = 2.2
HEATED = (
    "kernel {0!r} is no matched pair, which heats a tank at rest: particles tremble and clump, and "
    "single pressures are off by a third; the default, wendland_c2, keeps it still"
)
# Advice on the volume where nothing else helps.
WIDER = "a support of h = {0:.3g} dx is too narrow to keep it, h = 2.6 dx or more does"
# Substeps between two looks at neighbours, and particle-steps before the first look at the level:
# each look takes less than 1/500 of that time.
LOOK_EVERY, LEVEL_AFTER = 500, 5_000_000


# Largest share of spurious energy.
ODD_ENERGY = 0.05
# Largest Mach number of a weakly compressible fluid, but for this share of the particles.
FAST, FEW = 0.3, 0.01


class Anomaly(NamedTuple):
    """Something that may happen to a simulation.

    kind: of its warning; limit: what is more is odd; text: of the message, with {0} for the
    measure.
    """

    kind: str
    limit: float
    text: str


ANOMALIES = {
    "energy": Anomaly(
        "energy",
        ODD_ENERGY,
        "{0:.0%} of the energy at stake is spurious; a matched kernel (wendland_c2), more "
        "viscosity or a shorter dt keep it down",
    ),
    "clumping": Anomaly(
        "clumping",
        0.6,
        "{0:.0%} of the particles are closer than 0.6 dx to another one, which makes densities "
        "wrong; a matched kernel (wendland_c2), clamp=True or tensile_correction keep them apart",
    ),
    "loss": Anomaly(
        "volume",
        0.05,
        "the fluid lost {0:.0%} of its level; boundary particles before the box, a matched kernel "
        "(wendland_c2) or a larger c0 keep its volume",
    ),
    "swelling": Anomaly(
        "volume",
        0.05,
        "the fluid at rest has swollen by {0:.0%}; a matched kernel (wendland_c2) keeps its "
        "volume, shifting at a free surface doesn't",
    ),
    "mach": Anomaly(
        "mach",
        FAST,
        "the fluid came to Mach {0:.2f}, beyond which the fluid isn't weakly "
        "compressible; c0 = sound_speed(v_max) or a larger stiffness keeps it at 0.1",
    ),
    "walls": Anomaly(
        "walls",
        0.0,
        "{0:.0f} x fluid got between boundary particles; walls of h / dx layers, a box or plates "
        "at their face, or a shorter dt hold it",
    ),
}
# Where walls move, their work counts as spurious energy.
DRIVEN = 0.5


class ClumpSearch(NamedTuple):
    """The numbers for a search of clumped particles.

    near2: squared distance below which two particles are clumped [m^2]; width_x, width_y: of a
    periodic domain, else infinite [m].
    """

    near2: float
    width_x: float
    width_y: float


class Watch:
    """The warnings of one simulation.

    They are found at the end of chunks and by rare looks at the particles; what was odd at the
    door is looked for on demand. Nothing here changes the simulation.
    """

    def __init__(self, scene: Scene, mass: float, ratio: Any) -> None:
        """Begin with the densities of the start.

        mass: of a particle [kg/m]; ratio: (n,) densities as shares of those of rest.
        """
        self._scene, self._ratio = scene, np.array(ratio, np.float64)
        walls, fluid_mass = scene.walls, mass * len(self._ratio)
        driven = walls is not None and walls.top_speed > 0
        self._energy = DRIVEN if driven else ANOMALIES["energy"].limit
        self._quiet, self._rest = (
            0.5 * fluid_mass * (share * scene.fluid.c0) ** 2 for share in (QUIET, REST)
        )
        widths = (math.inf if ends is None else ends[1] - ends[0] for ends in scene.periods)
        self._search = ClumpSearch((CLUMPED * scene.dx) ** 2, *widths)
        self._container: Any = ()
        self._start: Any = ()
        # measure at its worst, and the time [s] of the first
        self._found: dict[str, tuple[float, float]] = {}

    def warnings(self) -> tuple[Warning, ...]:
        """Return the warnings so far, in the order of `KINDS`, at most one of a kind."""
        if self._start == ():
            self._start = self._at_the_door()
        worst = {"start": self._start}
        for name, (value, since) in self._found.items():
            kind, limit, text = ANOMALIES[name]
            limit = self._energy if kind == "energy" else limit
            held = worst.get(kind)
            if held is None or value > held.value:
                worst[kind] = Warning(kind, value, limit, since, self._message(kind, text, value))
        return tuple(worst[kind] for kind in KINDS if worst.get(kind) is not None)

    def _message(self, kind: str, text: str, value: float) -> str:
        message = text.format(value)
        if kind == "volume" and is_narrow(self._scene):
            seen, *_ = message.split("; ")
            return f"{seen}; {WIDER.format(self._scene.h / self._scene.dx)}"
        return message

    def _at_the_door(self) -> Warning | None:
        odd = [*anomalies(self._scene, self._ratio), *self._tank_at_rest()]
        text = "; ".join(sentence for *_, sentence in odd)
        return Warning("start", *odd[0][:2], 0.0, text) if odd else None

    def _tank_at_rest(self) -> list[tuple[float, float, str]]:
        """Return what is odd about kernels that heat a fluid which lies still from the start."""
        scene = self._scene
        x, width = np.asarray(scene.x), scene.h / scene.dx
        # by continuity, densities follow the gradient
        paired = scene.fluid.kernel in MATCHED or scene.effects.continuity
        if paired or width < UNSTABLE or np.any(scene.v):
            return []
        container = self._lowest_fill()
        if container is None or x[:, 1].mean() > container[0] + LEVEL * scene.dx:
            return []
        return [(width, UNSTABLE, HEATED.format(scene.fluid.kernel))]

    def _lowest_fill(self) -> Any:
        # takes as long as many steps, so once and on demand
        if self._container == ():
            self._container = lowest_fill(self._scene)
        return self._container

    def _note(self, name: str, value: float, time: float) -> None:
        worst, since = self._found.get(name, (value, time))
        self._found[name] = max(worst, float(value)), since

    def look_at_energy(self, surplus: float, stake: float, time: float) -> None:
        """Look at the spurious energy and at stake [J/m], at a time [s]."""
        if surplus > self._energy * stake and surplus > self._quiet:
            self._note("energy", surplus / stake, time)

    def look_at_speeds(self, engine: Engine, c: float, time: float) -> None:
        """Look at the speed that few particles exceed, where any is fast; c: sound speed [m/s]."""
        n = engine.n
        speed = np.hypot(engine.fluid.u[:n], engine.fluid.v[:n])
        place = n - 1 - int(FEW * n)
        mach = float(np.partition(speed, place)[place]) / c
        if mach > FAST:
            self._note("mach", mach, time)

    def count_passed(self, number: int, time: float) -> None:
        """Enter fluid particles that are within walls or passed them."""
        self._note("walls", number + self._found.get("walls", (0.0, 0.0))[0], time)

    def look_at_neighbors(self, engine: Engine, time: float) -> None:
        """Look at the share of clumped particles."""
        fluid, lists = engine.fluid, engine.world.cells.lists
        share = count_near(fluid.x, fluid.y, lists, engine.n, self._search) / engine.n
        if share > ANOMALIES["clumping"].limit:
            self._note("clumping", share, time)

    def look_at_level(self, engine: Engine, totals: Totals, shift: Any, time: float) -> None:
        """Compare the height of the centre of mass with the lowest that there can be.

        shift: (2,) of the scene's positions against the engine's [m].
        """
        container = self._lowest_fill()
        if container is None or not self._is_inside(engine, shift):
            return
        lowest, floor, _, _ = container
        height = totals.com_y + shift[1]
        change = (height - lowest) / (lowest - floor)
        # a map of cells is off by one beside plates
        plates = self._scene.walls is not None and self._scene.walls.plates is not None
        slack = (LEVEL + plates) * self._scene.dx / (lowest - floor)
        if -change - slack > ANOMALIES["loss"].limit:
            self._note("loss", -change, time)
        elif change - slack > ANOMALIES["swelling"].limit and totals.kinetic < self._rest:
            rho = np.median(engine.fluid.rho[: engine.n])
            if rho < THIN * self._scene.fluid.rho0:
                self._note("swelling", change, time)

    def _is_inside(self, engine: Engine, shift: Any) -> bool:
        """Return whether all fluid is still in its container."""
        x, slack = engine.fluid.x[: engine.n], self._scene.dx
        low, high = float(x.min()) + shift[0], float(x.max()) + shift[0]
        _, floor, left, right = self._container
        lowest = float(engine.fluid.y[: engine.n].min()) + shift[1]
        return left - slack < low and high < right + slack and lowest > floor - slack

    def state(self) -> list[float]:
        """Return measure and time [s] of all that was found, for a snapshot; -1 where nothing."""
        return [each for name in ANOMALIES for each in self._found.get(name, (-1.0, -1.0))]

    def set_state(self, numbers: list[float]) -> None:
        """Take back the numbers that `state` gave."""
        pairs = zip(ANOMALIES, numbers[::2], numbers[1::2], strict=True)
        self._found = {name: (value, since) for name, value, since in pairs if value >= 0}


@jit
def count_near(x, y, lists, n, search):
    """Return how many of n fluid particles have another one nearer than the search asks for."""
    number, i = 0, 0
    while i < n:
        size = group_size(lists, i)
        begin, end = fluid_range(lists, i)
        for own in range(i, i + size):
            for k in range(begin, end):
                j = neighbor(lists, k)
                dx, dy = abs(float(x[own]) - float(x[j])), abs(float(y[own]) - float(y[j]))
                dx, dy = min(dx, search.width_x - dx), min(dy, search.width_y - dy)
                if dx * dx + dy * dy < search.near2 and j != own:
                    number += 1
                    break
        i += size
    return number
