"""The look-ahead oracle: it tries settings on snapshots of the episode and keeps the best.

It sees the reference and the future, which no agent may: a bound on what tuning can gain, not a
competitor.
"""

import itertools
from typing import Any, NamedTuple

import numpy as np

from sph_gym.controllers.lookahead import Outcome, beam_search
from sph_gym.env import actions, rewards
from sph_gym.env.tuning import TuningEnv

Point = tuple[float, float, float]


class Search(NamedTuple):
    """How thorough it is.

    width: branches that go on; hold: steps for which a setting is tried; horizon: moves that are
    looked ahead before the first one is made, None: to the end of the episode; courant, sound:
    pairs that are tried besides those around the present one, as multiples dt c / h and multiples
    of c0; xsph: epsilons that are tried; near: how far around the present one, in coordinates.
    """

    width: int = 4
    hold: int = 2
    horizon: int | None = None
    courant: tuple[float, ...] = (0.75, 1.0)
    sound: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8)
    xsph: tuple[float, ...] = (0.0, 0.1, 0.3, 0.6)
    near: float = 0.2


FULL = Search()
COARSE = Search(width=2, hold=4, courant=(0.9,), xsph=(0.1, 0.3))


class Moment(NamedTuple):
    """An episode at the start of a step, to go on from."""

    sim: dict[str, Any]
    past: list[Any]
    step: int
    coordinates: Any


def save(env: TuningEnv) -> Moment:
    """The present moment of an episode."""
    return Moment(env.sim.snapshot(), list(env._judge._past), env._step, env._coordinates.copy())


def load(env: TuningEnv, moment: Moment) -> None:
    """Go back to a moment, all but what is only observed."""
    env.sim.restore(moment.sim)
    env._judge._past = list(moment.past)
    env._step, env._coordinates = moment.step, moment.coordinates.copy()


class Step(NamedTuple):
    """A step of an episode: its reward, largest error in multiples of its tolerance, and cost."""

    reward: float
    error: float
    n_substeps: int
    over: bool
    blowup: bool


def play(env: TuningEnv, action: Any) -> Step:
    """What `env.step` does, without an observation."""
    scene = env.sim.scene
    env._coordinates = env.action_type.act(action, env._coordinates)
    env.sim.controls = actions.decode(scene, env._coordinates)
    report = env.sim.advance(scene.frame)
    env._step += 1
    errors = env._judge.errors(env._step, env.sim.diagnostics())
    if report.diverged:
        terms = rewards.blowup_terms(env.n_steps - env._step + 1)
    else:
        terms = rewards.terms(errors, report.n_substeps / env._reference.cfl_substeps)
    reward = sum(env.reward_weights[term] * value for term, value in terms.items())
    over = report.diverged or env._step >= env.n_steps
    return Step(reward, max(errors), report.n_substeps, over, report.diverged)


class Oracle:
    """Policy (env, observation) -> action that plays what beam search found.

    fixed: coordinates 0 to 2 that it may not touch, and the value that each keeps.
    """

    def __init__(self, search: Search = FULL, fixed: dict[int, float] | None = None) -> None:
        self.search, self.fixed = search, fixed or {}
        self._plan: list[Any] = []
        self._where: tuple[str, int] | None = None

    def __call__(self, env: Any, observation: Any = None) -> Any:
        """The next action; a new plan where the old one is over or the episode another one."""
        tuning: TuningEnv = env.unwrapped
        if not self._plan or self._where != (tuning.instance_id, tuning._step):
            self._plan = self.plan(tuning)
        self._where = (tuning.instance_id, tuning._step + 1)
        return self._plan.pop(0)

    def plan(self, env: TuningEnv) -> list[Any]:
        """The actions of the best branch, or of its first move if the horizon is limited."""
        search, start = self.search, save(env)
        depth = -(-(env.n_steps - env._step) // search.hold)
        branch = beam_search(
            start,
            self._settings,
            lambda moment, wanted: self._play(env, moment, wanted),
            depth if search.horizon is None else min(search.horizon, depth),
            search.width,
            lambda moment: (moment.sim["totals"], moment.coordinates.tobytes()),
        )
        load(env, start)
        moves = branch.moves if search.horizon is None else branch.moves[:1]
        return self._as_actions(env, start, moves)

    def _as_actions(self, env: TuningEnv, start: Moment, moves: Any) -> list[Any]:
        present, played = start.coordinates, []
        for wanted, _ in itertools.product(moves, range(self.search.hold)):
            played.append(env.action_type.toward(np.array(wanted), present))
            present = env.action_type.act(played[-1], present)
        return played[: env.n_steps - start.step]

    def _settings(self, moment: Moment) -> list[Point]:
        """Coordinates to try: as it is, a little to every side, and settings anywhere."""
        search, here = self.search, moment.coordinates
        tried = [here]
        for axis, way in itertools.product((0, 1), (-search.near, search.near)):
            tried.append(here + way * np.eye(3)[axis])
        for courant, sound in itertools.product(search.courant, search.sound):
            tried.append(np.append(actions.locate(courant, sound, 0.0)[:2], here[2]))
        for epsilon in search.xsph:
            tried.append(np.append(here[:2], actions.locate(1.0, 1.0, epsilon)[2]))
        points = np.clip(tried, -1.0, 1.0)
        for axis, value in self.fixed.items():
            points[:, axis] = value
        return list(dict.fromkeys(tuple(point) for point in points.tolist()))

    def _play(self, env: TuningEnv, moment: Moment, wanted: Point) -> Outcome[Moment]:
        load(env, moment)
        earned, over = 0.0, False
        for _ in range(self.search.hold):
            action = env.action_type.toward(np.array(wanted), env._coordinates)
            step = play(env, action)
            earned += step.reward
            over = step.over
            if over:
                break
        return Outcome(save(env), earned, over)
