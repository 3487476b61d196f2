"""The promises of environments about every step, checked from outside."""

import math
from collections import Counter
from typing import Any

import numpy as np
from gymnasium import spaces

from sph_gym.env import rewards
from sph_gym.env.episode import INFO
from sph_gym.env.tuning import TuningEnv
from sph_gym.solver.energy import Ledger
from sph_gym.solver.failure import CAUSES
from sph_gym.solver.integrators import TOP_SPEED

PROMISES = (
    "observation in its space",
    "reward is the sum of its terms",
    "info as documented",
    "state is finite",
    "blow-up told in its step",
    "rollback goes back",
    "wrong action refused",
)
OBSERVATION, REWARD, INFOS, STATE, BLOWUP, ROLLBACK, REFUSED = PROMISES
MOST_EXAMPLES = 5

# Actions that are none, of the continuous and of the discrete space.
_HUGE = 10**400
NO_VECTORS: tuple[Any, ...] = (
    [math.nan, 0, 0], [0, math.inf, 0], [0, 0, -math.inf], [1.001, 0, 0], [0, -1e30, 0], [0, 0],
    [0, 0, 0, 0], [[0, 0, 0]], 0.0, [], "fast", ["0", "0", "0"], b"abc", None, {}, {"dt": 1.0},
    [0, 1j, 0], [[0], 0, 0], [_HUGE, 0, 0], [None, 0, 0], object(), [True, False, True],
)  # fmt: skip
NO_NUMBERS: tuple[Any, ...] = (
    -1, 27, 10**9, _HUGE, -_HUGE, 3.0, math.nan, math.inf, "3", None, [3], [1, 1, 1], {}, object(),
    np.zeros(3), np.float32(3), np.array([3, 4]),
)  # fmt: skip


class ContractChecker:
    """Checks one environment step by step.

    violations: broken promises, counted; examples: the first of them, as text; blowups: by cause;
    rolled_back: how many rollbacks; refused: how many actions that were none.
    """

    def __init__(self, env: TuningEnv) -> None:
        self._env = env
        self.violations, self.blowups = Counter[str](), Counter[str]()
        self.rolled_back = self.refused = 0
        self.examples: list[str] = []
        self._time, self._in_a_row = 0.0, 0
        self._snapshot: dict[str, Any] | None = None

    def _demand(self, promise: str, holds: bool, evidence: Any = "") -> None:
        if holds:
            return
        self.violations[promise] += 1
        if len(self.examples) < MOST_EXAMPLES:
            where = f"{self._env.instance_id}, step {self._env.episode.step}"
            self.examples.append(f"{promise}: {where}: {evidence!r}")

    def began(self, observation: Any, info: dict[str, Any]) -> None:
        """Check what a reset returned."""
        self._in_a_row = 0
        self._check_observation_and_info(observation, info)
        self._demand(BLOWUP, info["blowup"] == 0.0 and info["time"] == 0.0, info)

    def before(self) -> None:
        """Remember the state that a step sets out from."""
        self._time = self._env.sim.time
        back = self._env.rules.rollbacks > 0
        self._snapshot = self._env.sim.snapshot() if back else None

    def after(
        self, observation: Any, reward: Any, terminated: Any, truncated: Any, info: dict[str, Any]
    ) -> None:
        """Check what a step returned."""
        self._check_observation_and_info(observation, info)
        self._check_reward(reward, info)
        blowup, most = info["blowup"] == 1.0, self._env.rules.rollbacks
        back = blowup and self._in_a_row < most
        self._in_a_row = self._in_a_row + 1 if back else 0
        self._demand(BLOWUP, bool(terminated) == (blowup and not back), info)
        self._demand(BLOWUP, not (terminated and truncated), info)
        self._demand(ROLLBACK, info["rollbacks"] == self._in_a_row, info)
        self._check_blowup(blowup, info)
        if back:
            self.rolled_back += 1
            self._demand(ROLLBACK, same(self._snapshot, self._env.sim.snapshot()), info)

    def _check_observation_and_info(self, observation: Any, info: dict[str, Any]) -> None:
        space = self._env.observation_space
        inside = space.contains(observation) and bool(np.isfinite(observation).all())
        self._demand(OBSERVATION, inside, observation)
        texts = {name for name, (unit, _) in INFO.items() if unit == "text"}
        right = info.keys() == INFO.keys() and all(
            type(value) is str if name in texts else type(value) is float and math.isfinite(value)
            for name, value in info.items()
        )
        self._demand(INFOS, right, info)
        sim = self._env.sim
        finite = all(bool(np.isfinite(column).all()) for column in (sim.x, sim.v, sim.rho, sim.p))
        self._demand(STATE, finite and math.isfinite(sim.time), sim.time)

    def _check_reward(self, reward: Any, info: dict[str, Any]) -> None:
        terms = [info[f"reward_{term}"] for term in rewards.TERMS]
        if np.ndim(reward):
            equal = np.array_equal(reward, np.array(terms, np.float32))
        else:
            equal = math.isclose(float(reward), math.fsum(terms), rel_tol=1e-12, abs_tol=1e-12)
        self._demand(REWARD, bool(np.isfinite(reward).all()) and equal, (reward, terms))

    def _check_blowup(self, blowup: bool, info: dict[str, Any]) -> None:
        sim, frame = self._env.sim, self._env.episode.scene.frame
        self._demand(BLOWUP, blowup == (info["blowup_cause"] in CAUSES), info)
        self._demand(BLOWUP, blowup == (info["time_to_failure"] >= 0), info)
        self._demand(BLOWUP, blowup == (info["blowup_substep"] >= 0), info)
        if blowup:
            self.blowups[info["blowup_cause"]] += 1
            late = info["time_to_failure"] - self._time
            self._demand(BLOWUP, 0 <= late <= (1 + 1e-6) * frame, info)
            return
        # a flow that is none any more must not pass for one
        numbers = sim.diagnostics()
        sane = numbers["max_speed"] <= TOP_SPEED and numbers["energy_excess"] <= Ledger.TOLERANCE
        self._demand(BLOWUP, sane and info["blowup_cause"] == "", numbers)
        self._demand(STATE, math.isclose(sim.time, self._time + frame), sim.time)

    def try_nonsense(self, k: int) -> None:
        """Check that an action that is none raises ValueError and leaves everything as it is."""
        env = self._env
        if env.episode.over:
            return
        nonsense = NO_NUMBERS if isinstance(env.action_space, spaces.Discrete) else NO_VECTORS
        action, before = nonsense[k % len(nonsense)], env.get_state()
        try:
            env.step(action)
        except ValueError:
            self.refused += 1
            self._demand(REFUSED, same(before, env.get_state()), action)
        except Exception as error:  # any other is a broken promise
            self._demand(REFUSED, False, (action, error))
        else:
            self._demand(REFUSED, False, action)


def same(one: Any, other: Any) -> bool:
    """Return whether nested dictionaries, sequences and arrays are equal to the last bit."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and one.tobytes() == other.tobytes()
    return type(one) is type(other) and bool(one == other)
