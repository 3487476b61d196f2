"""
When a run blows up
===================

If the time step is too long, particles fly everywhere or become NaN. The solver reports this
blow-up in the same call in which it happens, and says where it began.
"""

import matplotlib.pyplot as plt

from sph_gym import Simulation, scenes
from sph_gym.view import Painter

# %%
# `stable_dt` is the article's stable step for the present state. It is safe: the run goes on
# without harm.

scene = scenes.make("dam_break", dx=0.04, tank=4.0)
sim = Simulation(scene)
sim.controls = sim.controls._replace(dt=sim.stable_dt())
print("diverged:", sim.advance(0.3).diverged)

# %%
# A snapshot keeps the present state. From there, the step is doubled until the run breaks. After
# each try the snapshot takes the simulation back, bit for bit.

kept, dt = sim.snapshot(), sim.controls.dt
for factor in (1, 2, 4, 8):
    sim.restore(kept)
    sim.controls = sim.controls._replace(dt=factor * dt)
    report = sim.advance(0.2)
    print(f"{factor} x dt: diverged: {report.diverged} {report.cause} {report.link}".rstrip())
    if report.diverged:
        break

# %%
# The report names the cause, the step of the computation in which it first showed, and the
# particle. The state is the last one that is finite, so that it can be looked at.

i = report.bad_particle
print(f"particle {i} at {sim.x[i].round(3)} m, {sim.rho[i]:.0f} kg/m^3, {sim.v[i].round(1)} m/s")

painter = Painter(scene, size=(960, 400), color="density")
figure, axis = plt.subplots(figsize=(8, 3.4), layout="constrained")
axis.imshow(painter.paint(sim, title=f"{factor} times the stable step"))
axis.axis("off")

# %%
# In the window, `python -m sph_gym run dam_break --window` stops at that particle and shows the
# last 100 steps. :doc:`/pitfalls` lists what else commonly goes wrong.
