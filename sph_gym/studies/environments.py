"""How fast the environments are: many on threads against one, and what Python costs in a step.

All play what the tuned CFL rule plays, from the same state on, in turns.
"""

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sph_gym.controllers import TunedCfl
from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver import stepping, teams
from sph_gym.solver.batch import advance_all
from sph_gym.studies.table import Row
from sph_gym.studies.timing import clocked, in_turns, own_clock, pinned

# Bounds: env steps a second of a vector on two threads against those of one environment; what
# isn't compiled in a step, in %.
SPEED_UP, PYTHON = 1.8, 10.0


class Plan(NamedTuple):
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
    """What the tuned rule plays for some steps of an environment's episode.

    home: the state of the environment before them.
    """

    def __init__(self, scene: str, dx: float, plan: Plan) -> None:
        self.scene, self.dx = scene, dx
        self.env, rule = TuningEnv(scene, dx=dx), TunedCfl()
        self.env.reset(seed=0)
        self.actions: list[Any] = []
        self.home: dict[str, Any] = {}
        for k in range(plan.skipped + plan.steps):
            if k == plan.skipped:
                self.home = self.env.get_state()
            action = self.env.action_toward(rule(self.env.sim))
            if k >= plan.skipped:
                self.actions.append(action)
            self.env.step(action)

    def one(self, clock: Callable[[], float] | None = None) -> float:
        """Time of a step of one environment [s]."""
        self.env.set_state(self.home)
        return self._time(self.env.step, self.actions, 1, clock)

    def many(self, envs: TuningVectorEnv) -> float:
        """Time of a step of one environment [s] in a vector."""
        for env in envs.envs:
            env.set_state(self.home)
        envs.forget()
        actions = [np.stack([action] * envs.num_envs) for action in self.actions]
        return self._time(envs.step, actions, envs.num_envs)

    def alone(self, threads: int, n_envs: int) -> float:
        """Time of the solver's part of a step [s]: as many simulations, and nothing else."""
        self.env.set_state(self.home)
        sims = [copy.deepcopy(self.env.sim) for _ in range(n_envs)]
        frame = self.env.episode.scene.frame

        def run() -> None:
            for _ in self.actions:
                advance_all(sims, frame, threads)

        return clocked(run) / (n_envs * len(self.actions))

    def _time(self, step: Any, actions: list[Any], n_envs: int, clock: Any = None) -> float:
        def run() -> None:
            for action in actions:
                step(action)

        return clocked(run, *([clock] if clock else [])) / (n_envs * len(actions))


def measure(plan: Plan, scene: str, coarse: float, fine: float) -> Iterator[Row]:
    """All rows of a scene at two spacings [m]; the finer one has bounds."""
    yield from python(Track(scene, coarse, plan), plan, None)
    track = Track(scene, fine, plan)
    yield from python(track, plan, PYTHON)
    yield from side_by_side(track, plan)


def _case(track: Track) -> str:
    sim = track.env.sim
    return f"{track.scene}, {sim.n_fluid} + {sim.n_particles - sim.n_fluid} walls"


def side_by_side(track: Track, plan: Plan) -> Iterator[Row]:
    """Env steps a second of one environment, and of a vector on one thread and on two."""
    counts = [1, 2] if teams.most_threads() > 1 else [1]
    arguments: dict[str, Any] = {"scene": track.scene, "dx": track.dx}
    vectors = [TuningVectorEnv(plan.n_envs, threads, **arguments) for threads in counts]
    for envs in vectors:
        envs.reset(seed=0)
    runs: list[Callable[[], float]] = [track.one]
    runs += [partial(track.many, envs) for envs in vectors]
    runs += [partial(track.alone, threads, plan.n_envs) for threads in counts]
    in_turns(runs, 1)
    seconds, case = in_turns(runs, plan.rounds), _case(track)
    yield Row("env steps of one environment", case, 1 / float(np.median(seconds[:, 0])), "1/s")
    if len(counts) > 1:
        # what the processors make of two threads at all, just now
        ceiling = float(np.median(seconds[:, -2] / seconds[:, -1]))
        yield Row("two threads against one, solver alone", case, ceiling, "")
    for threads, times in zip(counts, seconds.T[1:], strict=False):
        name = f"{case}, {plan.n_envs} on {threads} thread{'s' if threads > 1 else ''}"
        yield Row("env steps of a vector", name, 1 / float(np.median(times)), "1/s")
        bound = SPEED_UP if threads == 2 else None
        ratio = float(np.median(seconds[:, 0] / times))
        yield Row("vector against one environment", name, ratio, "", bound, at_least=True)


# --- Python ---------------------------------------------------------------------------------

# Of `sph_gym.solver.stepping`, in the order in which a step calls them.
COMPILED = ("renew_pressures", "advance", "examine")


@contextmanager
def spent(clock: Callable[[], float]) -> Iterator[dict[str, float]]:
    """Seconds in each compiled function that a step calls, while this is entered."""
    seconds = dict.fromkeys(COMPILED, 0.0)

    def timed(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            began = clock()
            result = function(*arguments)
            seconds[name] += clock() - began
            return result

        return call

    usual = {name: getattr(stepping, name) for name in COMPILED}
    for name, function in usual.items():
        setattr(stepping, name, timed(name, function))
    try:
        yield seconds
    finally:
        for name, function in usual.items():
            setattr(stepping, name, function)


def python(track: Track, plan: Plan, bound: float | None) -> Iterator[Row]:
    """How much of a step's time passes outside of compiled code, and outside of the time steps."""
    clock, shares = own_clock(), list[tuple[float, float, float]]()
    for _ in range(plan.rounds + 1):
        with spent(clock) as seconds, pinned():
            step = track.one(clock)
        inside = {name: each / plan.steps for name, each in seconds.items()}
        outside = step - sum(inside.values())
        shares.append((outside / step, 1 - inside["advance"] / step, outside))
    around, all_but, cost = np.median(shares[1:], axis=0).tolist()
    yield Row("Python in an env step", _case(track), 100 * around, "%", bound)
    yield Row("all but the time steps", _case(track), 100 * all_but, "% of an env step")
    yield Row("Python in an env step", _case(track), 1e6 * cost, "us")
