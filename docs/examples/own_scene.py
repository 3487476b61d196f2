"""
A scene of your own
===================

A scene is plain data: where the water is, what acts on it, and which walls hold it.
"""

import matplotlib.pyplot as plt
import numpy as np

from sph_gym import Effects, Fluid, Gauge, Scene, Simulation, Walls, disc, lattice, sound_speed
from sph_gym.view import Painter

# %%
# Two drops fall into a basin. The particles are the points of a lattice and of two discs, with a
# spacing of `dx`. The speed of sound has to be about ten times the largest speed of the flow, for
# which `sound_speed` asks. An effect that the scene doesn't name is compiled away.

dx = 0.02
basin = lattice(0.0, 1.2, 0.0, 0.2, dx)
drops = [disc(0.3, 0.5, 0.12, dx), disc(0.8, 0.7, 0.16, dx)]
scene = Scene(
    name="two drops",
    x=np.concatenate([basin, *drops]),
    dx=dx,
    h=3 * dx,  # the support radius: W = 0 beyond it
    fluid=Fluid(c0=sound_speed(v_max=4.0)),
    effects=Effects(gravity=(0.0, -9.81), xsph=True, artificial_viscosity=0.02),
    walls=Walls(box=(0.0, 1.2, 0.0, float("inf"))),  # left, right, floor, no lid
    duration=1.5,
    frame=0.02,
)

# %%
# `warnings` lists what may be wrong with a scene: it is empty here. Wrong input raises a
# `ValueError`.

sim = Simulation(scene)
print("warnings:", sim.warnings)

# %%
# A gauge measures one quantity at one place. This one reads the level of the water in the middle.

level = Gauge.parse("level:0.6")
times, levels, pictures = [], [], []
painter = Painter(scene, size=480)
while sim.time < scene.duration:
    if len(times) in (5, 14, 24, 60):
        pictures.append(painter.paint(sim))
    sim.advance(scene.frame)
    times.append(sim.time)
    levels.append(level.read(sim)[0])

figure, axes = plt.subplots(2, 2, figsize=(8, 6.2), layout="constrained")
for axis, picture in zip(axes.flat, pictures, strict=True):
    axis.imshow(picture)
    axis.axis("off")

# %%
# The waves of the two drops pass the gauge one after the other.

figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
axis.plot(times, levels)
axis.set(xlabel="time [s]", ylabel="level in the middle [m]")
axis.spines[["top", "right"]].set_visible(False)
