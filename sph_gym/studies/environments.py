"""The speed of environments: many on threads against one, cost of Python and of a policy.

All play the actions of the tuned CFL rule, from the same state on, in turns.
"""

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from sph_gym.controllers import TunedCfl, shipped
from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver import stepping, teams
from sph_gym.solver.batch import advance_all
from sph_gym.studies.table import Row
from sph_gym.timing import clocked, in_turns, own_clock, pinned

# Bounds: env steps a second of a vector on two threads against those of one environment; the share
# of a step that isn't compiled, in %, with some 300 and some 600 particles; time of the policy in %
# of a step.
SPEED_UP, PYTHON, POLICY = 1.8, (14.0, 8.0), 1.0


class EnvironmentPlan(NamedTuple):
    """Spacings [m] by scene that make some 300 and 600 fluid particles, and how long to measure.

    n_envs: in a vector; skipped: steps before the first that is timed; steps: of a timed run.
    """

    spacings: tuple[tuple[str, float, float], ...] = (
        ("dam_break", 0.04, 0.029),
        ("drop_impact", 0.0265, 0.0185),
    )
    n_envs: int = 32
    skipped: int = 10
    steps: int = 20
    rounds: int = 15


class Track:
    """The actions of the tuned rule for some steps of an environment's episode.

    home: the state of the environment before them.
    """

    def __init__(self, scene: str, dx: float, plan: EnvironmentPlan) -> None:
        self.scene, self.dx = scene, dx
        self.env, rule = TuningEnv(scene, dx=dx), TunedCfl()
        self.env.reset(seed=0)
        for k in range(plan.skipped + plan.steps):
            if k == plan.skipped:
                self.home, self.actions = self.env.get_state(), list[Any]()
            action = self.env.action_toward(rule(self.env.sim))
            self.env.step(action)
            if k >= plan.skipped:
                self.actions.append(action)

    @property
    def case(self) -> str:
        """Scene and particles, as rows name them."""
        sim = self.env.sim
        return f"{self.scene}, {sim.n_fluid} + {sim.n_particles - sim.n_fluid} walls"

    def one(self, *clock: Callable[[], float]) -> float:
        """Return the time of a step of one environment [s]."""
        self.env.set_state(self.home)
        return self._time(self.env.step, self.actions, 1, *clock)

    def many(self, envs: TuningVectorEnv) -> float:
        """Return the time of a step of one environment [s] in a vector."""
        for env in envs.envs:
            env.set_state(self.home)
        envs.forget()
        actions = [np.stack([action] * envs.num_envs) for action in self.actions]
        return self._time(envs.step, actions, envs.num_envs)

    def solver(self, threads: int, n_envs: int) -> float:
        """Return the time of the solver's part of a step [s]: as many simulations, no more."""
        self.env.set_state(self.home)
        sims = [copy.deepcopy(self.env.sim) for _ in range(n_envs)]
        frame = self.env.episode.scene.frame
        return self._time(lambda _: advance_all(sims, frame, threads), self.actions, n_envs)

    def _time(self, step: Any, actions: list[Any], n_envs: int, *clock: Any) -> float:
        def run() -> None:
            for action in actions:
                step(action)

        return clocked(run, *clock) / (n_envs * len(actions))


def measure(plan: EnvironmentPlan, scene: str, coarse: float, fine: float) -> Iterator[Row]:
    """Yield all rows of a scene at two spacings [m]."""
    for dx, bound in zip((coarse, fine), PYTHON, strict=True):
        track = Track(scene, dx, plan)
        yield from python(track, plan, bound)
        yield policy(track, plan)
    yield from side_by_side(track, plan)


def side_by_side(track: Track, plan: EnvironmentPlan) -> Iterator[Row]:
    """Yield env steps a second of one environment, and of a vector on one thread and on two."""
    counts = [1, 2] if teams.most_threads() > 1 else [1]
    make: Any = partial(TuningVectorEnv, plan.n_envs, scene=track.scene, dx=track.dx)
    vectors = [make(threads=threads) for threads in counts]
    for envs in vectors:
        envs.reset(seed=0)
    runs: list[Callable[[], float]] = [track.one]
    runs += [partial(track.many, envs) for envs in vectors]
    runs += [partial(track.solver, threads, plan.n_envs) for threads in counts]
    in_turns(runs, 1)
    seconds, case = in_turns(runs, plan.rounds), track.case
    yield Row("env steps of one environment", case, 1 / float(np.median(seconds[:, 0])), "1/s")
    if len(counts) > 1:
        # the gain of two threads on this machine at this moment
        ceiling = float(np.median(seconds[:, -2] / seconds[:, -1]))
        yield Row("two threads against one, solver alone", case, ceiling, "")
    for threads, times in zip(counts, seconds.T[1:], strict=False):
        name = f"{case}, {plan.n_envs} on {threads} thread{'s' if threads > 1 else ''}"
        yield Row("env steps of a vector", name, 1 / float(np.median(times)), "1/s")
        bound = SPEED_UP if threads == 2 else None
        ratio = float(np.median(seconds[:, 0] / times))
        yield Row("vector against one environment", name, ratio, "", bound, at_least=True)


# --- Python ---------------------------------------------------------------------------------

# Functions of `sph_gym.solver.stepping`, in the order in which a step calls them.
COMPILED = ("advance", "examine")


@contextmanager
def spent(clock: Callable[[], float]) -> Iterator[dict[str, float]]:
    """Measure the seconds in each compiled function that a step calls, while this is entered."""
    seconds = dict.fromkeys(COMPILED, 0.0)

    def timed(name: str) -> Callable[..., Any]:
        function = getattr(stepping, name)

        def call(*arguments: Any) -> Any:
            began = clock()
            result = function(*arguments)
            seconds[name] += clock() - began
            return result

        return call

    replaced: Any = {name: timed(name) for name in COMPILED}
    with patch.multiple(stepping, **replaced):
        yield seconds


def python(track: Track, plan: EnvironmentPlan, bound: float) -> Iterator[Row]:
    """Yield the shares of a step's time outside of compiled code and outside of time steps."""
    clock, shares = own_clock(), list[tuple[float, float, float]]()
    for _ in range(plan.rounds + 1):
        with spent(clock) as seconds, pinned():
            step = track.one(clock)
        inside = {name: each / plan.steps for name, each in seconds.items()}
        outside = step - sum(inside.values())
        shares.append((outside / step, 1 - inside["advance"] / step, outside))
    around, all_but, cost = np.median(shares[1:], axis=0).tolist()
    yield Row("Python in an env step", track.case, 100 * around, "%", bound)
    yield Row("all but the time steps", track.case, 100 * all_but, "% of an env step")
    yield Row("Python in an env step", track.case, 1e6 * cost, "us")


def policy(track: Track, plan: EnvironmentPlan) -> Row:
    """Return the time that the network of the package takes for an action, against a step's."""
    clock, network, shares = own_clock(), shipped(track.scene, "stable"), list[float]()
    for _ in range(plan.rounds + 1):
        track.env.set_state(track.home)
        inside = 0.0
        with pinned():
            start = clock()
            for action in track.actions:
                observation, *_ = track.env.step(action)
                began = clock()
                network(observation)
                inside += clock() - began
            shares.append(inside / (clock() - start - inside))
    share = 100 * float(np.median(shares[1:]))
    return Row("the policy against an env step", track.case, share, "%", POLICY)
