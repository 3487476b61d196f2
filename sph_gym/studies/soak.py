"""The promises of the environments, checked whatever an agent does.

Every id, every kind of action, observation and answer to a blow-up is stepped by policies that are
random, extreme, or out to break the solver. After every step a `ContractChecker` checks what the
documentation promises. A broken promise is a violation, and none is allowed.
"""

import itertools
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from sph_gym import scenes
from sph_gym.env import SCENES, actions, env_id, observations
from sph_gym.env.distributions import FAMILIES
from sph_gym.env.registration import GROUPS
from sph_gym.extras import progress_bar
from sph_gym.solver.failure import CAUSES
from sph_gym.solver.scene import Scene
from sph_gym.studies.contract import PROMISES, ContractChecker
from sph_gym.studies.policies import HOSTILE, Push
from sph_gym.studies.results import Results
from sph_gym.studies.table import Row

FULL, QUICK = 200_000, 2000
# Steps between two actions that are none.
WRONG_EVERY = 10
# Spacings that are tried, as multiples of the environment's own, or of one for those without.
COARSER, OTHER_DX = (1.0, 1.5, 2.0), 0.04

IDS = (*map(env_id, (*SCENES, *GROUPS, "custom")),)
VARIANTS = tuple(
    itertools.product(actions.MODES, ("terminate", "rollback"), tuple(observations.TYPES))
)


class Chunk(NamedTuple):
    """A part of the study: an environment, and how many steps it takes.

    n_envs: how many in a vector, 1: the single environment; seed: of instances and actions.
    """

    id: str
    arguments: dict[str, Any]
    coarser: float
    n_envs: int
    steps: int
    seed: int


def chunks(n_steps: int) -> list[Chunk]:
    """Return every id with every variant, at least n_steps steps together.

    Spacings, rewards, limits, and whether it is a vector, alternate from one to the next.
    """
    cells = list(itertools.product(IDS, VARIANTS))
    each = -(-n_steps // len(cells))
    return [_chunk(k, id_, variant, steps=each) for k, (id_, variant) in enumerate(cells)]


def _chunk(k: int, id_: str, variant: tuple[str, str, str], steps: int) -> Chunk:
    arguments: dict[str, Any] = dict(
        zip(("action_mode", "on_blowup", "observation"), variant, strict=True)
    )
    # an id has 24 variants: five and seven, which share no divisor with that, mix
    arguments["reward"] = "vector" if k % 5 == 1 else "scalar"
    arguments["rate_limit"] = 2.5 if k % 7 in (2, 5) else None
    if k % 5 == 3:
        arguments["reward_weights"] = {"work": 2.0, "clumping": 0.0, "blowup": 0.1}
    n_envs, coarser = (1, 8)[(k + k // len(VARIANTS)) % 2], COARSER[k // 2 % 3]
    if coarser == 1.0 and id_ != env_id("custom") and n_envs == 1:
        # whose references are there already, if they are shipped
        arguments["instances"] = "ood" if k % 5 == 2 else "train"
    return Chunk(id_, arguments, coarser, n_envs, steps, k)


def own_scene(dx: float) -> Scene:
    """Return a scene of a user's own, for the custom environment: two small patches collide."""
    drop = scenes.make("patch_impact", dx=dx, length=6 * dx, height=5 * dx, gap=3 * dx)
    return Scene(
        "own", dx=dx, x=drop.x, v=drop.v, h=drop.h, fluid=drop.fluid, effects=drop.effects,
        duration=0.4, frame=0.01,
    )  # fmt: skip


def make(chunk: Chunk) -> Any:
    """Return the environment of a chunk, single or vector."""
    spacings = {env_id(scene): family.dx for scene, family in FAMILIES.items()}
    dx = chunk.coarser * spacings.get(chunk.id, OTHER_DX)
    own: dict[str, Any] = {"scene": own_scene(dx)} if chunk.id == env_id("custom") else {"dx": dx}
    if chunk.coarser == 1.0 and chunk.id in map(env_id, GROUPS):
        # every scene at its own spacing
        own = {}
    if chunk.n_envs == 1:
        return gym.make(chunk.id, **chunk.arguments, **own).unwrapped
    return gym.make_vec(chunk.id, num_envs=chunk.n_envs, **chunk.arguments, **own).unwrapped


# --- Playing --------------------------------------------------------------------------------


class Player:
    """Source of the actions of one environment: another policy in every episode."""

    def __init__(self, space: Any, seed: int, first: int) -> None:
        self._discrete = isinstance(space, spaces.Discrete)
        self._rng = np.random.default_rng([seed, first])
        self._turn = first
        self.begin()

    def begin(self) -> None:
        """Take the next policy, for a new episode."""
        names = list(HOSTILE)
        self.name = names[self._turn % len(names)]
        self._pushes: Iterator[Push] = HOSTILE[self.name](self._rng)
        self._turn += 1

    def act(self) -> Any:
        """Return the next action."""
        push = next(self._pushes)
        if self._discrete:
            moves = np.rint(push).astype(np.int64) + 1
            return np.int64(np.ravel_multi_index(tuple(moves), (3, 3, 3)))
        return push.astype(np.float32)


def play(chunk: Chunk) -> dict[str, Any]:
    """Take the steps of a chunk, and return what came of them as plain numbers."""
    began, env = time.perf_counter(), make(chunk)
    envs = [env] if chunk.n_envs == 1 else env.envs
    players = [Player(envs[0].action_space, chunk.seed, k) for k in range(chunk.n_envs)]
    checkers = [ContractChecker(each) for each in envs]
    for checker, result in zip(checkers, _split(env.reset(seed=chunk.seed), envs), strict=True):
        checker.began(*result)
    by_policy, rounds = Counter[str](), 0
    while by_policy.total() < chunk.steps:
        rounds += 1
        if rounds % WRONG_EVERY == 0:
            number = chunk.seed + rounds // WRONG_EVERY
            checkers[number % chunk.n_envs].try_nonsense(number)
        over = [each.episode.over for each in envs]
        for checker in checkers:
            checker.before()
        results = _step(env, envs, [player.act() for player in players])
        for player, checker, result, is_reset in zip(players, checkers, results, over, strict=True):
            if is_reset:
                player.begin()
                checker.began(result[0], result[-1])
            else:
                checker.after(*result)
                by_policy[player.name] += 1
    env.close()
    seconds = time.perf_counter() - began
    return {"seconds": seconds, "policies": dict(by_policy), **_sum_up(checkers)}


def _step(env: Any, envs: list[Any], actions: list[Any]) -> list[tuple[Any, ...]]:
    """Return a step's results of every environment; where an episode is over, of a reset."""
    if len(envs) > 1:
        return _split(env.step(np.stack(actions)), envs)
    return [env.reset() if env.episode.over else env.step(actions[0])]


def _split(results: tuple[Any, ...], envs: list[Any]) -> list[tuple[Any, ...]]:
    """Return what a single environment or a vector returned as a tuple for each."""
    if len(envs) == 1:
        return [results]
    *columns, infos = results
    return [(*(column[k] for column in columns), _own(infos, k)) for k in range(len(envs))]


def _own(infos: dict[str, Any], k: int) -> dict[str, Any]:
    """Return one environment's info out of those of a vector."""
    return {
        name: column[k] if column.dtype == object else column[k].item()
        for name, column in infos.items()
        if not name.startswith("_") and infos[f"_{name}"][k]
    }


def _sum_up(checkers: list[ContractChecker]) -> dict[str, Any]:
    return {
        "violations": dict(sum((each.violations for each in checkers), Counter[str]())),
        "blowups": dict(sum((each.blowups for each in checkers), Counter[str]())),
        "rollbacks": sum(each.rolled_back for each in checkers),
        "refused": sum(each.refused for each in checkers),
        "examples": [text for each in checkers for text in each.examples],
    }


# --- The study ------------------------------------------------------------------------------


def measure(quick: bool, folder: Path) -> Iterator[Row]:
    """Yield rows of what was counted, with a progress bar that tells how long it will take.

    Finished chunks are kept in the folder. Raises ImportError that names the extra to install.
    """
    wanted = QUICK if quick else FULL
    plan, found = chunks(wanted), list[tuple[Chunk, dict[str, Any]]]()
    own = (f"studies/{name}.py" for name in ("soak", "policies", "contract"))
    results = Results(folder / "soak", *own)
    with progress_bar(sum(chunk.steps for chunk in plan), unit="step") as bar:
        for chunk in plan:
            bar.set_description(chunk.id.removeprefix("sph_gym/"))
            result: dict[str, Any] = results.get([*chunk], partial(play, chunk))
            found.append((chunk, result))
            for example in result["examples"]:
                bar.write(f"{chunk}: {example}")
            bar.update(chunk.steps)
    yield from rows(found, wanted)


def rows(found: list[tuple[Chunk, dict[str, Any]]], wanted: int) -> Iterator[Row]:
    """Yield steps, blow-ups and violations of all chunks."""

    def total(table: str, key: str) -> int:
        return sum(result[table].get(key, 0) for _, result in found)

    for id_ in IDS:
        steps = [sum(result["policies"].values()) for chunk, result in found if chunk.id == id_]
        yield Row("steps", id_, sum(steps), "")
    for policy in HOSTILE:
        yield Row("steps", f"policy: {policy}", total("policies", policy), "")
    for cause in CAUSES:
        yield Row("blow-ups", cause, total("blowups", cause), "")
    for title, quantity in (("rollbacks", "rollbacks"), ("wrong actions refused", "refused")):
        yield Row(title, "all", sum(result[quantity] for _, result in found), "")
    all_steps = sum(total("policies", policy) for policy in HOSTILE)
    yield Row("steps", "all", all_steps, "", wanted, at_least=True)
    for promise in PROMISES:
        yield Row("violations", promise, total("violations", promise), "", 0)
    yield Row("run time", "all", sum(result["seconds"] for _, result in found) / 60, "min")
