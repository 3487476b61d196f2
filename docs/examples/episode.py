"""
An episode with an environment
==============================

The environments put a running solver behind the interface of Gymnasium. One step is one frame of
physical time.
"""

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

import sph_gym  # noqa: F401  registers the environments
from sph_gym.controllers import TunedCfl

# %%
# An agent returns three numbers from -1 to 1: log dt, log stiffness, and epsilon. Two agents play
# the same flow. The first is the tuned rule; `action_toward` turns its controls into an action. The
# second always takes a long step in a soft fluid, which is cheap.

env = gym.make("sph_gym/DamBreak-v1", render_mode="rgb_array")
rule = TunedCfl()


def tuned(env):
    """Return the action that leads to the controls of the tuned rule."""
    return env.unwrapped.action_toward(rule(env.unwrapped.sim))


def careless(env):
    """Return the action of a long step in a soft fluid."""
    return np.array([0.0, -0.4, 0.0], np.float32)


def play(policy):
    """Return `info` of every step, and four pictures of an episode."""
    env.reset(seed=0, options={"instance": "dam_break/val/0"})
    infos, pictures, over = [], [], False
    while not over:
        _, _, terminated, truncated, info = env.step(policy(env))
        over = terminated or truncated
        infos.append(info)
        if len(infos) in (12, 26, 40, 60):
            pictures.append(env.render())
    return infos, pictures


# %%
# `render` returns a picture and needs no display. This is the flow under the tuned rule.

tuned_infos, pictures = play(tuned)
figure, axes = plt.subplots(2, 2, figsize=(8, 5.2), layout="constrained")
for axis, picture in zip(axes.flat, pictures, strict=True):
    axis.imshow(picture)
    axis.axis("off")

# %%
# The reward is the sum of six terms, which are in `info`. Within all tolerances only work counts:
# the less, the better. Beyond a tolerance the step is charged to the term that is worst.

TERMS = {
    "work": "#0072b2",
    "density": "#d55e00",
    "clumping": "#cc79a7",
    "noise": "#e69f00",
    "fidelity": "#009e73",
    "blowup": "#262c36",
}
careless_infos, _ = play(careless)
figure, axes = plt.subplots(2, figsize=(8, 5), sharex=True, sharey=True, layout="constrained")
for axis, infos, title in zip(
    axes, (tuned_infos, careless_infos), ("tuned rule", "careless"), strict=True
):
    times = [info["time"] for info in infos]
    for term, color in TERMS.items():
        values = [info[f"reward_{term}"] for info in infos]
        axis.bar(times, values, width=times[0], color=color, label=term)
    mean = sum(info[f"reward_{term}"] for info in infos for term in TERMS) / len(infos)
    axis.set(title=f"{title}: mean reward {mean:.2f}", ylabel="reward of a step")
    axis.axhline(0, color="#262c36", lw=0.8)
    axis.spines[["top", "right"]].set_visible(False)
axes[1].set_xlabel("time [s]")
axes[0].legend(frameon=False, ncols=6, fontsize="small", loc="lower center")
env.close()

# %%
# Softness pays at first and costs more later: :doc:`/reward`.
