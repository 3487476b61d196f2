"""
A dam break and its picture
===========================

A column of water stands at the left wall of a tank. At time 0 it is released.
"""

import matplotlib.pyplot as plt

from sph_gym import Simulation, scenes
from sph_gym.view import Painter

# %%
# `scenes.make` builds a scene by its name; lengths are in metres. `Simulation` makes it move.

scene = scenes.make("dam_break", dx=0.02, tank=4.0)
sim = Simulation(scene)
print(f"{sim.n_fluid} particles of water, {sim.n_particles - sim.n_fluid} of the walls")

# %%
# `advance` takes physical seconds and chooses a whole number of time steps that fits. A `Painter`
# returns pictures as arrays and needs no display; yellow is fast.

painter = Painter(scene, size=600)
figure, axes = plt.subplots(2, 2, figsize=(8, 6.6), layout="constrained")
for axis, until in zip(axes.flat, (0.1, 0.3, 0.6, 1.0), strict=True):
    report = sim.advance(until - sim.time)
    axis.imshow(painter.paint(sim))
    axis.axis("off")
    print(f"until {until} s: {report.n_substeps} steps, diverged: {report.diverged}")

# %%
# Numbers about the flow come from `diagnostics`, fields of all particles from `sim.x`, `sim.v`,
# `sim.rho` and `sim.p`.

numbers = sim.diagnostics()
print(f"fastest particle: {numbers['max_speed']:.2f} m/s, Mach {numbers['mach']:.2f}")
print(f"mean compression: {100 * numbers['density_error']:.2f} %")
