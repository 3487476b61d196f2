"""
Tune a run with a rule
======================

Constants that are safe for the worst moment of a flow waste work in all others. A rule looks at
the flow and sets the controls again in every frame.
"""

import matplotlib.pyplot as plt

from sph_gym import Simulation, scenes
from sph_gym.controllers import TunedCfl, nominal

# %%
# A controller is a function from the running simulation to `Controls`: the time step, the
# stiffness and the XSPH epsilon. `nominal` returns the constants of the scene. `TunedCfl` is a CFL
# rule as a practitioner would tune it: its speed of sound follows the flow, and its time step
# follows the speed of sound.


def play(controller):
    """Return time [s], substeps, sound speed [m/s] and compression [%] of every frame."""
    sim = Simulation(scenes.make("dam_break", dx=0.04, tank=4.0))
    rows = []
    while sim.time < 1.5:
        sim.controls = controller(sim)
        report = sim.advance(sim.scene.frame)
        compression = 100 * sim.diagnostics()["density_error"]
        rows.append((sim.time, report.n_substeps, sim.sound_speed, compression))
    return rows


runs = {"constants": play(nominal), "tuned rule": play(TunedCfl())}

# %%
# Both runs cover the same time. The rule needs fewer steps, since slow water may be soft: its
# speed of sound is lower, which allows a longer step.

figure, axes = plt.subplots(3, sharex=True, figsize=(8, 6.5), layout="constrained")
for (label, rows), color in zip(runs.items(), ("#8a8f98", "#0072b2"), strict=True):
    times, *columns = zip(*rows, strict=True)
    for axis, values in zip(axes, columns, strict=True):
        axis.plot(times, values, label=label, color=color)
    print(f"{label}: {sum(columns[0])} steps")
for axis, title in zip(
    axes, ("steps a frame", "sound speed [m/s]", "compression [%]"), strict=True
):
    axis.set(ylabel=title, ylim=(0, None))
    axis.spines[["top", "right"]].set_visible(False)
axes[0].legend(frameon=False)
axes[-1].set_xlabel("time [s]")

# %%
# The price is a fluid that is compressed more. How much of that is acceptable is what the reward
# of the environments says; see :doc:`/reward`.
