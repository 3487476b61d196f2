"""What is left of long rollouts: a hash, to be compared between processes.

`python -m tests.env.rollouts N` uses up to N threads, for small fluids too.
"""

import hashlib
import sys

import gymnasium as gym
import numpy as np

from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver import engine, simulation

N_STEPS = 500


def add(digest, value):
    """Every bit of nested results."""
    if isinstance(value, dict):
        for key in sorted(value):
            digest.update(key.encode())
            add(digest, value[key])
    elif isinstance(value, tuple):
        for part in value:
            add(digest, part)
    elif isinstance(value, np.ndarray) and value.dtype != object:
        digest.update(repr((value.dtype, value.shape)).encode() + value.tobytes())
    else:
        digest.update(repr(value).encode())


def single(**arguments):
    """N_STEPS steps of one environment, across resets."""
    env, digest = gym.make("sph_gym/Mixed-v1", **arguments).unwrapped, hashlib.sha256()
    add(digest, env.reset(seed=11))
    env.action_space.seed(12)
    for _ in range(N_STEPS):
        result = env.step(env.action_space.sample())
        add(digest, result)
        if result[2] or result[3]:
            add(digest, env.reset())
    return digest.hexdigest()


def vector(threads, **arguments):
    """The same of a vector."""
    envs, digest = TuningVectorEnv(4, threads=threads, **arguments), hashlib.sha256()
    add(digest, envs.reset(seed=11))
    envs.action_space.seed(12)
    for _ in range(N_STEPS // 4):
        add(digest, envs.step(envs.action_space.sample()))
    return digest.hexdigest()


def main():
    threads = int(sys.argv[1])
    # or environments as small as these would all use one
    simulation.DEFAULT_PER_THREAD = engine.PARTICLES_PER_THREAD = 20
    engine.WORTH_WAKING = 0
    print(single(dx=0.07))
    print(single(dx=0.08, action_mode="discrete", on_blowup="rollback", observation="field"))
    print(vector(threads, scene="mixed", dx=0.08))


if __name__ == "__main__":
    main()
