"""The worth of each control: rewards of static settings on a grid, with one control held fixed.

Every instance is played with every setting of the grid, and with every pair of Courant multiple and
sound speed beside an epsilon that follows the noise in the observation. A control that is held at a
value earns what the best setting of the other two earns beside it, in hindsight; the loss is what
the best setting of the whole grid earns more.

A single value for many instances is chosen on the others: an instance never has a say in the choice
that it is judged by, so that no loss is the luck of a choice.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.controllers.adaptive import smoothing
from sph_gym.env import actions, instances
from sph_gym.env.observations import FEATURES, unsquash
from sph_gym.env.policies import Policy
from sph_gym.env.tuning import TuningEnv
from sph_gym.studies.averages import bootstrap_interval
from sph_gym.studies.episodes import constant, follow
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

CONTROLS = ("Courant multiple", "sound speed", "epsilon")
EPSILON = 2
# The epsilon at its worst value costs so much on so many families; one epsilon for all instances
# costs so much more than one for each context, of which the observation gives back such a share.
WORST, MANY = 0.2, 4
BY_CONTEXT, GIVEN_BACK = 0.03, 60.0
NOISE_SHARE = [feature.name for feature in FEATURES].index("noise_share")

Rewards = NDArray[np.float64]


class ControlGrid(NamedTuple):
    """Settings that are tried: Courant multiples, sound speeds [c0] and epsilons."""

    courant: tuple[float, ...] = (0.6, 0.8, 1.0)
    sound: tuple[float, ...] = (0.2, 0.3, 0.42, 0.6, 0.85)
    xsph: tuple[float, ...] = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 1.0)


class Table(NamedTuple):
    """Mean rewards of an instance: (courant, sound, xsph) of static settings, and (courant, sound)
    with an epsilon that follows the noise; kind: of its context.
    """

    static: Rewards
    following: Rewards
    kind: str

    @property
    def best(self) -> float:
        """Reward of the best static setting."""
        return float(self.static.max())

    def held(self, axis: int) -> Rewards:
        """Return the rewards with a control held at each of its values, the others at their best.

        axis: of the control.
        """
        others = tuple(other for other in range(3) if other != axis)
        return np.asarray(self.static.max(axis=others))


def follow_noise(env: Any, observation: Any, place: NDArray[Any]) -> NDArray[np.float32]:
    """Return an action with the epsilon that the observed noise asks for.

    place: coordinates of the other two controls.
    """
    seen = float(env.episode.observe()[NOISE_SHARE])
    epsilon = smoothing(0.01 * unsquash(seen))
    coordinates = actions.locate(1.0, 1.0, epsilon)
    coordinates[:EPSILON] = place[:EPSILON]
    return coordinates.astype(np.float32)


def table(instance: str, grid: ControlGrid, store: Results) -> Table:
    """Return what `play_settings` found, from the store."""
    static, following, kind = store.load(["controls", instance, grid])
    return Table(np.array(static), np.array(following), kind)


def play_settings(instance: str, grid: ControlGrid) -> tuple[Rewards, Rewards, str]:
    """Play an instance with every setting; return the rewards and the kind of its context."""
    env = TuningEnv(instance.split("/")[0])
    env.reset(seed=0, options={"instance": instance})
    begin, sizes = env.episode.state(), tuple(map(len, grid))
    static, following = np.empty(sizes), np.empty(sizes[:EPSILON])

    def reward(policy: Policy) -> float:
        env.episode.restore(begin)
        score = follow(env, policy)
        assert score is not None
        return score.reward

    for i, j in np.ndindex(*sizes[:EPSILON]):
        place = actions.locate(grid.courant[i], grid.sound[j], 0.0)
        following[i, j] = reward(partial(follow_noise, place=place))
        for k, epsilon in enumerate(grid.xsph):
            place = actions.locate(grid.courant[i], grid.sound[j], epsilon)
            static[i, j, k] = reward(constant(*place))
    return static, following, env.episode.context.kind


def rows(found: Mapping[str, list[Table]], grid: ControlGrid) -> Iterator[Row]:
    """Yield losses by control and family, and what one epsilon for all costs.

    found: tables by scene.
    """
    games = [scene for scene in found if scene not in instances.DIAGNOSTIC]
    every = [table for scene in games for table in found[scene]]
    if len(every) < 2:
        return
    for axis, control in enumerate(CONTROLS):
        values = grid[axis]
        rewards = np.array([table.held(axis) for table in every])
        losses = np.array([table.best for table in every]) - _chosen_elsewhere(rewards)
        worst = {scene: _worst(found[scene], axis) for scene in games}
        for scene, (loss, k) in worst.items():
            yield Row(f"{control} at its worst, {values[k]:g}: reward lost", scene, loss, "")
        yield Row(f"one {control} for all: reward lost", "all", float(losses.mean()), "")
        if axis == EPSILON:
            many = sum(loss >= WORST for loss, _ in worst.values())
            quantity = f"families where the worst epsilon costs at least {WORST:g}"
            least = min(MANY, len(games))
            yield Row(quantity, "all", float(many), "", least, at_least=True)
            yield from _contexts(every, rewards, grid)


def _worst(tables: list[Table], axis: int) -> tuple[float, int]:
    """Return the largest mean loss with a control at one value, and the place of that value."""
    losses = np.mean([table.best - table.held(axis) for table in tables], axis=0)
    k = int(np.argmax(losses))
    return float(losses[k]), k


def _contexts(tables: list[Table], rewards: Rewards, grid: ControlGrid) -> Iterator[Row]:
    kinds = np.array([table.kind for table in tables])
    for kind in dict.fromkeys(kinds.tolist()):
        means = rewards[kinds == kind].mean(axis=0)
        for epsilon, mean in zip(grid.xsph, means.tolist(), strict=True):
            yield Row(f"reward with an epsilon of {epsilon:g}", kind, mean, "")
    single, by_context = _chosen_elsewhere(rewards), np.empty(len(tables))
    for kind in dict.fromkeys(kinds.tolist()):
        by_context[kinds == kind] = _chosen_elsewhere(rewards[kinds == kind])
    following = np.array([float(table.following.max()) for table in tables])
    lost, low, high = bootstrap_interval(by_context - single)
    quantity = "lost by one epsilon for all, against one for each context"
    yield Row(quantity, "all", lost, "", BY_CONTEXT, at_least=True)
    yield Row(f"{quantity}: 95 % interval from", "all", low, "")
    yield Row(f"{quantity}: 95 % interval to", "all", high, "")
    back = 100 * float(np.mean(following - single)) / lost if lost > 0 else float("nan")
    quantity = "given back by an epsilon that follows the observed noise"
    yield Row(quantity, "all", back, "%", GIVEN_BACK, at_least=True)


def _chosen_elsewhere(rewards: Rewards) -> Rewards:
    """Return for each row the entry in the column that is best on all other rows.

    A single row has no others: the column in the middle is taken.
    """
    if len(rewards) == 1:
        return np.asarray(rewards[:, rewards.shape[1] // 2])
    others = rewards.sum(axis=0) - rewards
    return np.asarray(rewards[np.arange(len(rewards)), others.argmax(axis=1)])
