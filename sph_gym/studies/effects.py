"""The cost of every effect in every scene when present, and the proof that it is free when absent.

The proof: on a scene that does not name an effect, a step has as many machine instructions as one
in which the effect's terms are functions that only return what they are given. Counts do not depend
on how busy the machine is.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from sph_gym import scenes
from sph_gym.solver.teams import most_threads
from sph_gym.studies import absence, variants
from sph_gym.studies.absence import EVERY, TERMS, Build, Count
from sph_gym.studies.table import Part, Row, measure_parts
from sph_gym.timing import Runner, in_turns, own_clock, same_home

# Spacing [m] that gives each scene some 3000 particles of fluid.
SPACINGS = {
    "dam_break": 0.0125,
    "drop_impact": 0.008,
    "relaxation": 0.008,
    "hydrostatic_tank": 0.01,
}
# Repetitions, whole and quick, and particle-steps of a timed call.
ROUNDS, QUICK_ROUNDS, WORK = 61, 31, 200_000


def measure(quick: bool) -> Iterator[Row]:
    """Yield all rows, as they are measured, with a progress bar; quick: the dam break alone.

    Raises ImportError that names the extra to install.
    """
    parts: list[Part] = []
    for scene, dx in [*SPACINGS.items()][: 1 if quick else None]:
        for effect in variants.EFFECTS:
            rounds = QUICK_ROUNDS if quick else ROUNDS
            parts.append((f"{scene}, {effect}", partial(present, scene, dx, effect, rounds)))
        for build, effects in comparisons(scene, dx):
            title = f"{scene} without {build.left_out or 'all others'}"
            parts.append((title, partial(absent, build, effects)))
    return measure_parts(parts)


def present(scene: str, dx: float, effect: str, rounds: int, work: int = WORK) -> Iterator[Row]:
    """Yield the cost of an effect that the scene names, or that is added to it.

    Both sides begin in the same state in every call: the work is compared, not the flow.
    """
    whole = scenes.make(scene, dx=dx)
    try:
        named = variants.added(whole, effect)
    except ValueError:
        # open space has no walls that could be added
        return
    pair = named, variants.left_out(named, effect)
    runners = [Runner(one, work=work) for one in pair]
    same_home(runners)
    clock = own_clock()
    times = in_turns([partial(runner.seconds, clock) for runner in runners], rounds)
    n_fluid = runners[0].sim.n_fluid
    share = 100 * (1 - float(np.median(times[:, 1] / times[:, 0])))
    cost = float(np.median(times[:, 0] - times[:, 1])) / n_fluid * 1e9
    case = f"{effect}, {scene}" + ("" if variants.names(whole, effect) else " (added)")
    memory = (runners[0].bytes() - runners[1].bytes()) / n_fluid
    yield Row("cost when present", case, share, "% of a step")
    yield Row("cost when present", case, cost, "ns/fluid particle")
    yield Row("memory when present", case, memory, "bytes/fluid particle")


def comparisons(scene: str, dx: float) -> list[tuple[Build, tuple[str, ...]]]:
    """Return builds, and what is absent there: each effect of the scene, and all others at once."""
    whole = scenes.make(scene, dx=dx)
    named = [effect for effect in variants.EFFECTS if variants.names(whole, effect)]
    others = [part for part in (*TERMS, EVERY) if part not in named]
    found = [(Build(scene, dx, effect), (effect,)) for effect in named]
    return [*found, (Build(scene, dx), tuple(others))]


def absent(build: Build, effects: tuple[str, ...]) -> Iterator[Row]:
    """Yield what a step has more than one in which the terms of absent effects are replaced."""
    # walls have no terms of their own: others are given None where they would be
    terms = tuple(effect if effect in TERMS else EVERY for effect in effects)
    with ThreadPoolExecutor(min(2, most_threads())) as pool:
        counts = list(pool.map(absence.count, (build, build._replace(identity=terms))))
    if len(effects) > 1 and counts[0] != counts[1]:
        # one by one, to see where it is
        for effect in effects:
            yield from absent(build, (effect,))
        return
    for effect in effects:
        yield from compared(f"{effect}, {build.scene}", *counts)


def compared(case: str, normal: Count | None, identity: Count | None) -> Iterator[Row]:
    """Yield the difference of two counts; nothing where they could not be taken."""
    if normal is None or identity is None:
        return
    for quantity, own, other in zip(("a step", "the pair loop"), normal, identity, strict=True):
        unit = f"more than {other}"
        yield Row(f"absent: instructions of {quantity}", case, float(own - other), unit, 0.0)
