"""
Settings for an error
=====================

Which settings reach one percent of error for least time? The package contains tables of measured
runs, from which it recommends settings.
"""

import matplotlib.pyplot as plt
import numpy as np

from sph_gym.recommend import advise, describe, program
from sph_gym.recommend.tables import read

# %%
# A drop that is stretched into an ellipse has an exact solution. These are the settings with which
# its major semi-axis is wrong by one percent at most. Without `speed`, a short benchmark measures
# how fast this machine is.

advice = advise("elliptical_drop", error=0.01, speed=1.5e7)
for name, value in describe(advice):
    print(f"{name:<16}{value}")

# %%
# Print the recommendation as a program:

print(program(advice))

# %%
# The measured runs behind it: each mark is a run, error over cost. Effort is the cost in
# particle-steps of a benchmark, which is the same on any machine.

runs = [run for run in read("elliptical_drop") if run.good]
efforts = np.array([run.effort for run in runs])
errors = 100 * np.array([run.error for run in runs])
own = np.array([run.setting.series == advice.choice.setting.series for run in runs])

figure, axis = plt.subplots(figsize=(8, 4.4), layout="constrained")
axis.loglog(efforts[~own], errors[~own], "o", ms=4, color="#8a8f98", alpha=0.5, label="other runs")
order = np.argsort(efforts[own])
axis.loglog(efforts[own][order], errors[own][order], "o-", color="#0072b2", label="recommended")
axis.axhline(1.0, color="#d55e00", lw=1, ls="--", label="what was asked for")
axis.set(xlabel="effort [particle-steps]", ylabel="error of the semi-axis [%]")
axis.spines[["top", "right"]].set_visible(False)
axis.legend(frameon=False)

# %%
# A mark below the recommended line may be luck: an error that crosses zero at one resolution is
# small there and nowhere else. :doc:`/accuracy` says what counts.
