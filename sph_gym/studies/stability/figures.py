"""One picture per tunable scene: its stability map."""

from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.solver.simulation import Simulation
from sph_gym.studies.picture import new_figure, save
from sph_gym.studies.stability.maps import EXCESS, TOLERANCE, UNREPORTED, StabilityMap

# Colours by M. Okabe and K. Ito, for colour-blind eyes.
CALM = {"density error within 1 %": "#56B4E9", "density error beyond 1 %": "#F0E442"}
# Causes of blow-ups: colour, and the letter that says the same where there is no colour.
CAUSES = {
    "cfl": ("#D55E00", "C"),
    "stiffness": ("#CC79A7", "S"),
    "clumping": ("#009E73", "P"),
    "tunnelling": ("#0072B2", "T"),
    "energy": ("#000000", "E"),
    "nan": ("#707070", "N"),
    UNREPORTED: ("#FFFFFF", "x"),
}
COLOURS = [*CALM.values(), *(colour for colour, _ in CAUSES.values())]
LABELS = [*CALM, *(f"{letter}: blow-up, {cause}" for cause, (_, letter) in CAUSES.items())]
LABELS[-1] = (
    f"{CAUSES[UNREPORTED][1]}: more than {EXCESS:g} of the energy at stake is spurious,\n"
    "    which the solver never reported"
)
# Styles of the article's limits.
LINES: dict[str, Any] = {"CFL": "-", "force": "--", "viscous": ":"}
EDGE = "#202020"
MARK: dict[str, Any] = {"color": "white", "markeredgecolor": EDGE, "linestyle": "none"}
HATCH: dict[str, Any] = {"hatch": "////", "edgecolor": "#BBBBBB"}


def draw(name: str, found: StabilityMap, path: Path) -> Path:
    """Draw outcome, density error and work over stiffness and dt, a column for every epsilon.

    Raises ImportError that names the extra to install.
    """
    n = len(found.grid.xsph)
    figure = new_figure(3.6 * n + 2.6, 10.5)
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import LogLocator

    frames = figure.subplots(3, n, squeeze=False, sharex=True, sharey=True)
    work, percent = _work(found), 100 * found.values("density")
    density_scale, work_scale = LogNorm(0.01, 10.0), LogNorm(*_range(work))
    for i, xsph in enumerate(found.grid.xsph):
        _draw_outcomes(frames[0, i], found, i)
        shown = _draw_numbers(frames[1, i], found, percent[i], density_scale, "viridis")
        worked = _draw_numbers(frames[2, i], found, work[i], work_scale, "plasma")
        for axes in frames[:, i]:
            _draw_limits(axes, found, i)
        frames[0, i].set_title(f"epsilon = {xsph:g}", fontsize=10)
        frames[2, i].set_xlabel("sound speed c / c0 [-]")
    for axes in frames[:, 0]:
        axes.set_ylabel("time step dt [s]")
    figure.colorbar(shown, ax=frames[1], label="mean density error [%]", extend="both")
    figure.colorbar(
        worked, ax=frames[2], label="work: pairs / the scene's own [-]", format="%g",
        ticks=LogLocator(subs=(1, 2, 5)),
    ).minorticks_off()  # fmt: skip
    title = "runs with constant controls; stiffness = rho0 c² / gamma"
    figure.suptitle(f"{name.replace('_', ' ')}: {title}", fontsize=11)
    figure.legend(
        handles=_handles(found), loc="outside lower center", ncols=3, fontsize=8, frameon=False
    )
    return save(figure, path, dpi=130)


def _edges(centres: Any) -> Any:
    """Return the borders between cells on a log scale."""
    log = np.log(np.asarray(centres))
    middle = (log[1:] + log[:-1]) / 2
    return np.exp([2 * log[0] - middle[0], *middle, 2 * log[-1] - middle[-1]])


def _mesh(found: StabilityMap) -> tuple[Any, Any]:
    return _edges(found.grid.sound), _edges(found.steps)


def _work(found: StabilityMap) -> Any:
    """Return the pairs of particles in all substeps, in multiples of the scene's own, or nan."""
    own = np.nan if found.own.cause else found.own.pairs
    return np.where(found.values("cause") == "", found.values("pairs") / own, np.nan)


def _range(work: Any) -> tuple[float, float]:
    """Return the range of the work that there is, at least from half to twice the scene's own."""
    seen = work[np.isfinite(work)]
    return min([0.5, *seen]), max([2.0, *seen])


def _outcome(cause: str, density: float) -> int:
    """Return the number of its colour; ValueError for a cause that has none."""
    return len(CALM) + list(CAUSES).index(cause) if cause else int(density > TOLERANCE)


def _draw_outcomes(axes: Any, found: StabilityMap, i: int) -> None:
    from matplotlib.colors import ListedColormap

    causes, density = found.values("cause")[i], found.values("density")[i]
    index = np.vectorize(_outcome, otypes=[int])(causes, density)
    axes.pcolormesh(
        *_mesh(found), index.T, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=len(COLOURS) - 0.5,
        edgecolors="white", linewidth=0.3,
    )  # fmt: skip
    for j, k in np.argwhere(causes != ""):
        colour, letter = CAUSES[causes[j, k]]
        # black on white, else white, at the left of the cell since limits run through its middle
        axes.text(
            found.grid.sound[j] * 0.87, found.steps[k], letter, fontsize=7, ha="center",
            va="center", color=EDGE if colour == "#FFFFFF" else "white", clip_on=True,
        )  # fmt: skip


def _draw_numbers(axes: Any, found: StabilityMap, values: Any, scale: Any, colours: str) -> Any:
    # hatched, since no grey is in no colour map
    axes.set_facecolor("white")
    axes.patch.set(**HATCH, linewidth=0.0)
    shown = np.ma.masked_invalid(np.maximum(values.T, 1e-6))
    return axes.pcolormesh(*_mesh(found), shown, norm=scale, cmap=colours)


def _line(name: str) -> dict[str, Any]:
    """Return the style of one of the article's limits: white, with an outline."""
    from matplotlib.patheffects import Normal, Stroke

    outline = [Stroke(linewidth=3.2, foreground=EDGE), Normal()]
    return {"linestyle": LINES[name], "color": "white", "linewidth": 1.6, "path_effects": outline}


def _rules(found: StabilityMap) -> dict[str, Any]:
    """Return those limits of the article that exist everywhere."""
    return {name: limit for name, limit in found.rules().items() if np.isfinite(limit).all()}


def _draw_limits(axes: Any, found: StabilityMap, i: int) -> None:
    """Draw the article's limits, the measured one, and the nominal point."""
    from matplotlib.ticker import FixedLocator, FormatStrFormatter, NullFormatter

    sound = np.array(found.grid.sound)
    for name, limit in _rules(found).items():
        axes.plot(sound, limit, **_line(name))
    axes.plot(sound, found.limits[i], marker="o", markersize=5, zorder=4, **MARK)
    sim = Simulation(found.scene, threads=1)
    own = sim.sound_speed / found.scene.fluid.c0, sim.controls.dt
    axes.plot(*own, marker="*", markersize=14, zorder=5, **MARK)
    x, y = _mesh(found)
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.xaxis.set_major_locator(FixedLocator([0.1, 0.2, 0.4, 0.8, 1.6]))
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _handles(found: StabilityMap) -> list[Any]:
    """Return what the legend explains: only what is in this map."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    pairs = (found.values(name).ravel() for name in ("cause", "density"))
    seen = {_outcome(*pair) for pair in zip(*pairs, strict=True)}
    handles: list[Any] = [
        Patch(facecolor=COLOURS[k], edgecolor=EDGE, linewidth=0.4, label=LABELS[k])
        for k in sorted(seen)
    ]
    if max(seen) >= len(CALM):
        handles.append(Patch(facecolor="white", label="no value: blew up", **HATCH))
    for name in _rules(found):
        handles.append(Line2D([], [], label=f"{name} limit of the article", **_line(name)))
    for mark, size, text in (("o", 5, "measured limit"), ("*", 12, "the scene as it comes")):
        handles.append(Line2D([], [], marker=mark, markersize=size, label=text, **MARK))
    return handles
