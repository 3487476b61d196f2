"""The honesty of references: runs that are as good or better must keep within tolerance of them.

A run of the same flow with half the spacing, and runs with a matched kernel and an epsilon, are
judged as an episode is. What they are charged for is no fault of theirs.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sph_gym.controllers.rules import from_numbers
from sph_gym.env import instances
from sph_gym.env.instances import Instance
from sph_gym.env.observations import measure
from sph_gym.env.reference import COURANT, n_frames, reference, truth
from sph_gym.env.rewards import Judge, Tolerances
from sph_gym.extras import progress
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

WITHIN = 95.0
EPSILONS = (0.3, 0.6)


class Rival(NamedTuple):
    """A run that ought to be within tolerance: its scene and epsilon."""

    scene: Scene
    xsph: float


def rivals(instance: Instance) -> dict[str, Rival]:
    """Return the runs that are as good as the reference of an instance, by name."""
    scene = instance.build()
    found = {"half the spacing": Rival(truth(_finer(instance)), 0.0)}
    for epsilon in EPSILONS:
        found[f"matched kernel, epsilon {epsilon:g}"] = Rival(truth(scene), epsilon)
    return found


def _finer(instance: Instance) -> Scene:
    """Return the flow of an instance with half the spacing."""
    _, arguments, context = instance.drawn
    assert context is not None
    # the viscosity is alpha c0 h / 8, and the fluid is the same
    drawn = instance.drawn._replace(
        arguments=dict(arguments) | {"dx": arguments["dx"] / 2},
        context=context._replace(alpha=2 * context.alpha),
    )
    finer = Instance(instance.id, drawn).build()
    # some scenes snap lengths to the spacing, and their frame follows
    return replace(finer, frame=instance.build().frame)


def share_within(instance: Instance, rival: Rival) -> float:
    """Return the share of the steps in which a run is within tolerance of the reference."""
    scene = instance.build()
    sim = Simulation(rival.scene)
    mass = sim.mass * sim.n_fluid
    judge = Judge(reference(scene, instance.id), scene, mass, Tolerances())
    sim.controls = from_numbers(sim, COURANT, rival.scene.fluid.c0, rival.xsph)
    n, good = n_frames(scene), 0
    for frame in range(1, n + 1):
        if sim.advance(scene.frame).diverged:
            break
        good += max(judge.errors(frame, measure(sim))) <= 1.0
    return good / n


def measure_references(names: list[str], n_instances: int, folder: Path) -> Iterator[Row]:
    """Yield the share of steps within tolerance, by scene and kind of run."""
    store = Results(folder / "honesty", "studies/honesty.py")
    for name in names:
        shares: dict[str, list[float]] = {}
        for number in progress(range(n_instances), f"{name}: references", "instance"):
            instance = instances.instance(name, "val", number)
            for kind, rival in rivals(instance).items():
                compute = partial(share_within, instance, rival)
                shares.setdefault(kind, []).append(store.get([instance.id, kind], compute, float))
        for kind, values in shares.items():
            bound = None if name in instances.DIAGNOSTIC else WITHIN
            quantity = f"within tolerance of the reference: {kind}"
            yield Row(
                quantity, name, 100 * float(np.mean(values)), "% of steps", bound, at_least=True
            )
