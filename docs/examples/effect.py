"""
What an effect does, and what it costs
======================================

A scene names the effects that act in it. One that it doesn't name is compiled away: no instruction
of it is left in the step. So its cost is the difference of two scenes.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from sph_gym import Simulation, scenes
from sph_gym.timing import Runner, in_turns, own_clock, same_home
from sph_gym.view import Painter

# %%
# The dam break has a weak artificial viscosity. The second scene has none.

damped = scenes.make("dam_break", dx=0.03, tank=4.0)
bare = replace(damped, effects=replace(damped.effects, artificial_viscosity=None))

# %%
# Effect on the flow: the kernels of the article heat a fluid that nothing damps. Without viscosity,
# velocities differ from one particle to the next, as in a gas.

figure, axes = plt.subplots(2, figsize=(8, 6.8), layout="constrained")
for scene, title, axis in zip((damped, bare), ("alpha = 0.02", "no viscosity"), axes, strict=True):
    sim = Simulation(scene)
    sim.controls = sim.controls._replace(xsph=0.0)
    sim.advance(1.0)
    axis.imshow(Painter(scene, size=(960, 400)).paint(sim, title=title))
    axis.axis("off")
    noise = sim.diagnostics()["velocity_noise"]
    print(f"{title}: mean square of the velocity noise {noise:.4f} m^2/s^2")

# %%
# Cost: both scenes set out from the same state again and again, in turns, so that other work of the
# machine disturbs both alike.

runners = [Runner(scene, work=100_000) for scene in (damped, bare)]
same_home(runners)
clock = own_clock()
times = in_turns([lambda runner=runner: runner.seconds(clock) for runner in runners], 15)
with_it, without = np.median(times, axis=0)
print(f"a step takes {100 * (1 - without / with_it):.0f} % less time without the viscosity")

# %%
# :doc:`/effects` has the costs of all effects, and the proof that an absent one is free.
