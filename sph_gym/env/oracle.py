"""The look-ahead oracle: it tries settings on snapshots of the episode and keeps the best.

It sees the reference and the future, which no agent may: a bound on what tuning can gain, not a
competitor.
"""

import itertools
from typing import Any, NamedTuple

import numpy as np

from sph_gym.controllers.lookahead import Transition, beam_search
from sph_gym.env import actions
from sph_gym.env.episode import Episode

# Multiple of the stable step, sound speed and epsilon, as coordinates in [-1, 1].
ControlSetting = tuple[float, float, float]
EpisodeState = dict[str, Any]


class Search(NamedTuple):
    """Thoroughness of the search.

    width: branches that go on; hold: steps for which a setting is tried; courant, sound: pairs
    that are tried besides those around the present one, as multiples dt c / h and multiples of c0;
    xsph: epsilons that are tried; near: distance of those around the present one, in coordinates;
    depth: settings one after the other, None for as many as the episode has room for; keep: steps
    of a plan that are played before the next one, None for all; displaced: standard deviation of
    what particles are moved by before a plan is made [dx], so that it can't rely on rounding.
    """

    width: int = 8
    hold: int = 2
    courant: tuple[float, ...] = (0.75, 1.0)
    sound: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8)
    xsph: tuple[float, ...] = (0.1, 0.3, 0.5, 0.7)
    near: float = 0.2
    depth: int | None = None
    keep: int | None = None
    displaced: float = 0.0


FULL = Search()
COARSE = Search(width=2, hold=4, courant=(0.9,), xsph=(0.2, 0.5))
# What a policy could gain that knows the present state, but not its last digits.
SHORT = Search(
    width=1, hold=8, courant=(0.6, 0.75, 1.0), sound=(0.2, 0.3, 0.4, 0.55, 0.75, 1.0),
    depth=1, keep=2, displaced=1e-3,
)  # fmt: skip


class Step(NamedTuple):
    """A step of an episode: reward, largest error in multiples of its tolerance, substeps, end."""

    reward: float
    error: float
    n_substeps: int
    over: bool
    blowup: bool


def play(episode: Episode, action: Any) -> Step:
    """Play a step of an episode outside of its environment."""
    episode.act(action)
    outcome = episode.conclude(episode.sim.advance(episode.scene.frame))
    info = outcome.info
    return Step(
        sum(outcome.reward),
        info["error"],
        int(info["n_substeps"]),
        outcome.terminated or outcome.truncated,
        bool(info["blowup"]),
    )


class Oracle:
    """Policy (env, observation) -> action that plays what beam search found.

    fixed: coordinates 0 to 2 that it may not touch, and the value that each keeps.
    """

    def __init__(self, search: Search = FULL, fixed: dict[int, float] | None = None) -> None:
        self.search, self.fixed = search, fixed or {}
        self._plan: list[Any] = []
        self._where: tuple[str, int] | None = None

    def __call__(self, env: Any, observation: Any = None) -> Any:
        """Return the next action; plan anew where the plan is over or the episode another one."""
        episode: Episode = env.unwrapped.episode
        if not self._plan or self._where != (episode.instance_id, episode.step):
            self._plan = self.plan(episode)
        self._where = (episode.instance_id, episode.step + 1)
        return self._plan.pop(0)

    def plan(self, episode: Episode) -> list[Any]:
        """Return the actions of the best branch."""
        search, start = self.search, episode.state()
        most = -(-(episode.n_steps - episode.step) // search.hold)
        depth = most if search.depth is None else min(search.depth, most)
        branch = beam_search(
            displaced(start, search.displaced * episode.scene.dx),
            self._settings,
            lambda state, wanted: self._play(episode, state, wanted),
            depth,
            search.width,
            lambda state: (state["simulation"]["totals"], state["coordinates"].tobytes()),
        )
        episode.restore(start)
        return self._as_actions(episode, start, branch.moves)[: search.keep]

    def _as_actions(self, episode: Episode, start: EpisodeState, moves: Any) -> list[Any]:
        present, played, rules = start["coordinates"], [], episode.rules
        for wanted, _ in itertools.product(moves, range(self.search.hold)):
            played.append(rules.actions.toward(np.array(wanted), present, episode.scene))
            present = rules.actions.act(played[-1], present, episode.scene, rules.rate_limit)
        return played[: episode.n_steps - start["step"]]

    def _settings(self, state: EpisodeState) -> list[ControlSetting]:
        """Return coordinates to try: the present ones, their neighbours, and settings anywhere."""
        search, here = self.search, state["coordinates"]
        tried = [here]
        for axis, way in itertools.product((0, 1, 2), (-search.near, search.near)):
            tried.append(here + way * np.eye(3)[axis])
        for courant, sound in itertools.product(search.courant, search.sound):
            tried.append(np.append(actions.locate(courant, sound, 0.0)[:2], here[2]))
        for epsilon in search.xsph:
            tried.append(np.append(here[:2], actions.locate(1.0, 1.0, epsilon)[2]))
        points = np.clip(tried, -1.0, 1.0)
        for axis, value in self.fixed.items():
            points[:, axis] = value
        return list(dict.fromkeys(tuple(point) for point in points.tolist()))

    def _play(
        self, episode: Episode, state: EpisodeState, wanted: ControlSetting
    ) -> Transition[EpisodeState]:
        episode.restore(state)
        earned, over = 0.0, False
        for _ in range(self.search.hold):
            action = episode.rules.actions.toward(
                np.array(wanted), episode.coordinates, episode.scene
            )
            step = play(episode, action)
            earned += step.reward
            over = step.over
            if over:
                break
        return Transition(episode.state(), earned, over)


def displaced(state: EpisodeState, distance: float) -> EpisodeState:
    """Return the state of an episode with its particles moved at random, by so much [m].

    The same state is always changed in the same way.
    """
    if distance == 0.0:
        return state
    rng = np.random.default_rng(state["step"])
    fluid = dict(state["simulation"]["fluid"])
    for axis in ("x", "y"):
        place = fluid[axis]
        fluid[axis] = place + rng.normal(0.0, distance, len(place)).astype(place.dtype)
    return state | {"simulation": state["simulation"] | {"fluid": fluid}}
