"""One picture per tunable scene: its stability map."""

from pathlib import Path
from typing import Any

import numpy as np

from sph_gym.solver.simulation import Simulation
from sph_gym.studies.stability.maps import EXCESS, TOLERANCE, UNTOLD, Map

# Of M. Okabe and K. Ito, for colour-blind eyes.
CALM = {"density error within 1 %": "#56B4E9", "density error beyond 1 %": "#F0E442"}
# Causes of blow-ups: colour, and the letter that says the same where there is no colour.
CAUSES = {
    "cfl": ("#D55E00", "C"),
    "stiffness": ("#CC79A7", "S"),
    "clumping": ("#009E73", "P"),
    "tunnelling": ("#0072B2", "T"),
    "energy": ("#000000", "E"),
    "nan": ("#707070", "N"),
    UNTOLD: ("#FFFFFF", "x"),
}
COLOURS = [*CALM.values(), *(colour for colour, _ in CAUSES.values())]
LINES: dict[str, tuple[Any, str]] = {
    "CFL": ("-", "white"),
    "force": ("--", "white"),
    "viscous": (":", "white"),
}
EDGE = "#202020"


def draw(name: str, found: Map, path: Path) -> Path:
    """Outcome, density error and work over stiffness and dt, a column for every epsilon.

    Raises ImportError that names the extra to install.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ImportError('plots need more: pip install "sph_gym[studies]"') from None
    n = len(found.grid.xsph)
    figure = Figure(figsize=(3.6 * n + 2.6, 10.5), layout="constrained")
    frames = figure.subplots(3, n, squeeze=False, sharex=True, sharey=True)
    scale = _range(found)
    for i, xsph in enumerate(found.grid.xsph):
        _outcomes(frames[0, i], found, i)
        density = _numbers(frames[1, i], found, 100 * _values(found, i, "density"), _DENSITY)
        work = _numbers(frames[2, i], found, _work(found, i), scale)
        for axes in frames[:, i]:
            _limits(axes, found, i)
        frames[0, i].set_title(f"epsilon = {xsph:g}", fontsize=10)
        frames[2, i].set_xlabel("sound speed c / c0 [-]")
    for axes in frames[:, 0]:
        axes.set_ylabel("time step dt [s]")
    figure.colorbar(density, ax=frames[1], label="mean density error [%]", extend="both")
    ticks = [tick for tick in _TICKS if scale[0] <= tick <= scale[1]]
    bar = figure.colorbar(
        work, ax=frames[2], label="work: pairs / the scene's own [-]", ticks=ticks, format="%g"
    )
    bar.minorticks_off()
    figure.suptitle(
        f"{name.replace('_', ' ')}: runs with constant controls; stiffness = rho0 c² / gamma",
        fontsize=11,
    )
    _legend(figure, found)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130)
    return path


# Colour scale: from, to, map.
_DENSITY = (0.01, 10.0, "viridis")
# Of the work.
_TICKS = [digit * 10.0**k for k in range(-3, 4) for digit in (1, 2, 5)]


def _edges(centres: Any) -> Any:
    """Borders between cells on a log scale."""
    log = np.log(np.asarray(centres))
    middle = (log[1:] + log[:-1]) / 2
    return np.exp([2 * log[0] - middle[0], *middle, 2 * log[-1] - middle[-1]])


def _mesh(found: Map) -> tuple[Any, Any]:
    grid = found.grid
    steps = [found.dt(k) for k in range(len(grid.dt))]
    return _edges(grid.sound), _edges(steps)


def _values(found: Map, i: int, field: str) -> Any:
    """(n_dt, n_sound) of an epsilon; nan where the run blew up."""
    grid = found.grid
    return np.array(
        [
            [getattr(found.points[i, j, k], field) for j in range(len(grid.sound))]
            for k in range(len(grid.dt))
        ]
    )


def _work(found: Map, i: int) -> Any:
    """Pairs of particles in all substeps, in multiples of the scene's own; nan: it blew up."""
    causes, pairs = _values(found, i, "cause"), _values(found, i, "pairs")
    own = np.nan if found.own.cause else found.own.pairs
    return np.where(causes == "", pairs / own, np.nan)


def _range(found: Map) -> tuple[float, float, str]:
    """The colour scale of the work: what there is of it, at least from half to twice."""
    work = np.array([_work(found, i) for i in range(len(found.grid.xsph))])
    seen = work[np.isfinite(work)]
    return min([0.5, *seen]), max([2.0, *seen]), "plasma"


def _outcome(cause: str, density: float) -> int:
    """Number of its colour; ValueError for a cause that has none."""
    if not cause:
        return int(density > TOLERANCE)
    return len(CALM) + list(CAUSES).index(cause)


def _outcomes(axes: Any, found: Map, i: int) -> None:
    from matplotlib.colors import ListedColormap

    causes, density = _values(found, i, "cause"), _values(found, i, "density")
    index = np.vectorize(_outcome, otypes=[int])(causes, density)
    axes.pcolormesh(
        *_mesh(found), index, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=len(COLOURS) - 0.5,
        edgecolors="white", linewidth=0.3,
    )  # fmt: skip
    for k, j in np.argwhere(causes != ""):
        colour, letter = CAUSES[causes[k, j]]
        # black on white, else white, at the left of the cell since limits run through its middle
        axes.text(
            found.grid.sound[j] * 0.87, found.dt(k), letter, fontsize=7, ha="center", va="center",
            color=EDGE if colour == "#FFFFFF" else "white", clip_on=True,
        )  # fmt: skip


def _numbers(axes: Any, found: Map, values: Any, scale: tuple[float, float, str]) -> Any:
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    low, high, name = scale
    # hatched, since no grey is in no colour map
    axes.set_facecolor("white")
    axes.patch.set(hatch="////", edgecolor="#BBBBBB", linewidth=0.0)
    colours = colormaps[name]
    shown = np.ma.masked_invalid(np.maximum(values, 1e-6))
    return axes.pcolormesh(*_mesh(found), shown, norm=LogNorm(low, high), cmap=colours)


def _limits(axes: Any, found: Map, i: int) -> None:
    """The article's limits, the measured one, and the nominal point."""
    from matplotlib.patheffects import Normal, Stroke

    sound = np.array(found.grid.sound)
    rules = [found.rule(j) for j in range(len(sound))]
    outline = [Stroke(linewidth=3.2, foreground=EDGE), Normal()]
    for name, (style, colour) in LINES.items():
        limit = np.array([rule[name] for rule in rules])
        if np.isfinite(limit).all():
            axes.plot(sound, limit, style, color=colour, linewidth=1.6, path_effects=outline)
    axes.plot(
        sound, found.limits[i], "o", color="white", markeredgecolor=EDGE, markersize=5, zorder=4
    )
    sim = Simulation(found.scene, threads=1)
    axes.plot(
        sim.sound_speed / found.scene.fluid.c0, sim.controls.dt, "*", color="white",
        markeredgecolor=EDGE, markersize=14, zorder=5,
    )  # fmt: skip
    x, y = _mesh(found)
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.set_xticks([0.1, 0.2, 0.4, 0.8, 1.6], labels=["0.1", "0.2", "0.4", "0.8", "1.6"])
    axes.tick_params(axis="x", which="minor", labelbottom=False)


def _legend(figure: Any, found: Map) -> None:
    """Of what there is in this map."""
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import Normal, Stroke

    outline = [Stroke(linewidth=3.2, foreground=EDGE), Normal()]
    rules = [found.rule(j) for j in range(len(found.grid.sound))]
    lines = [
        Line2D(
            [], [], color=colour, linestyle=style, linewidth=1.6, path_effects=outline,
            label=f"{name} limit of the article",
        )
        for name, (style, colour) in LINES.items()
        if all(np.isfinite(rule[name]) for rule in rules)
    ]  # fmt: skip
    marks = [
        Line2D([], [], marker=mark, color="none", markeredgecolor=EDGE, markersize=size, label=text)
        for mark, size, text in (("o", 5, "measured limit"), ("*", 12, "the scene as it comes"))
    ]
    figure.legend(
        handles=[*_patches(found), *lines, *marks], loc="outside lower center", ncols=3,
        fontsize=8, frameon=False,
    )  # fmt: skip


def _patches(found: Map) -> list[Any]:
    """Outcomes in this map and, if any run blew up, what stands for no value."""
    from matplotlib.patches import Patch

    seen = {_outcome(point.cause, point.density) for point in found.points.values()}
    patches = [
        Patch(facecolor=COLOURS[k], edgecolor=EDGE, linewidth=0.4, label=label)
        for k, label in enumerate(labels())
        if k in seen
    ]
    if max(seen) >= len(CALM):
        hatched: dict[str, Any] = {"hatch": "////", "edgecolor": "#BBBBBB"}
        patches.append(Patch(facecolor="white", label="no value: blew up", **hatched))
    return patches


def labels() -> list[str]:
    """What the colours of outcomes mean, in their order."""
    told = [f"{letter}: blow-up, {cause}" for cause, (_, letter) in CAUSES.items()][:-1]
    untold = (
        f"{CAUSES[UNTOLD][1]}: more than {EXCESS:g} of the energy at stake from nowhere,\n"
        "    which the solver never reported"
    )
    return [*CALM, *told, untold]
