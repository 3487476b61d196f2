"""Pictures for the playbook: the same case under a sound solver and under one with a fault.

All runs are of `doctor.plain` and of its faults, small enough to look at every particle.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sph_gym.doctor import faults, plain
from sph_gym.doctor.case import C0, DX, Array, Case, case, cloud, lattice
from sph_gym.studies.picture import new_figure, save

COLORS = "viridis"
# Room around the particles [m].
MARGIN = 5 * DX


class Half(NamedTuple):
    """One side of a picture.

    title: what it shows; make: the solver; case: of its start; courant: dt c0 / h; seconds: of
    physical time, 0 for the start itself.
    """

    title: str
    make: Callable[[Case], Any]
    case: Case
    courant: float = 0.1
    seconds: float = 0.0

    def run(self) -> Any:
        """Return the solver at the end, evaluated there."""
        solver = self.make(self.case)
        dt = self.courant * self.case.h / C0
        with np.errstate(all="ignore"):
            for _ in range(round(self.seconds / dt)):
                solver.step(dt)
            solver.evaluate()
        return solver


class PictureSpec(NamedTuple):
    """Two solvers side by side; shown: of QUANTITIES, limits: the ends of its colours."""

    name: str
    sound: Half
    sick: Half
    shown: str
    limits: tuple[float, float]


def _nearest(solver: Any) -> Array:
    """Return the distances (n,) to the nearest neighbour, in spacings."""
    apart = np.linalg.norm(solver.x[:, None] - solver.x[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart.min(axis=1) / solver.case.dx)


# Quantities that colours can show, by label; each returns one number a particle of a solver.
QUANTITIES: dict[str, Callable[[Any], Any]] = {
    "speed [m/s]": lambda solver: np.linalg.norm(solver.v, axis=1),
    # with which particles are moved: XSPH included
    "speed of the motion [m/s]": lambda solver: np.linalg.norm(solver.v + solver.xsph(), axis=1),
    "density / rest density": lambda solver: solver.rho / solver.case.rho0,
    "neighbours": lambda solver: np.array(
        [len(solver.neighbors(i)) for i in range(len(solver.x))], dtype=float
    ),
    "nearest neighbour [dx]": _nearest,
}


def pictures() -> list[PictureSpec]:
    """Return all pictures, in the order of the playbook."""
    disorder = cloud(np.random.default_rng(1), 15, 15, DX, 0.1)
    blob = case(0.97 * disorder)
    # viscosity takes the noise away, so that what is left is the fault
    calm = case(disorder, viscosity=0.1)
    fine = Half("every pair is found", plain.make, case(disorder))
    squeezed = Half("settles", plain.make, blob, seconds=0.06)
    stays = Half("with max(0, p)", plain.make, calm, seconds=0.1)
    # a tank that is a tenth too full
    crowd, side = cloud(np.random.default_rng(2), 15, 15, 0.9 * DX, 0.25), 7.5 * 0.9 * DX
    full = case(crowd, box=(-side, side, -side, side), viscosity=0.05)
    parted = Half("spiky gradient", plain.make, full, 0.1, 0.15)
    column, tank = lattice(12, 20, center=(6 * DX, 10 * DX)), (0.0, 40 * DX, 0.0, 30 * DX)
    dam = case(column, gravity=(0.0, -9.81), box=tank, h=2.2 * DX)
    falls = Half("dt = 0.2 h/c0", plain.make, dam, 0.2, 0.25)
    smooth = Half("epsilon = 0.5", plain.make, _noisy(0.5))
    # at a wall with 0.3 of the speed of sound
    block = case(lattice(8, 8), (0.3 * C0, 0.0), box=(-10 * DX, 8 * DX, -8 * DX, 8 * DX))
    thrown = Half("reflected", plain.make, block, 0.2, 0.05)
    nearest, speed = "nearest neighbour [dx]", "speed [m/s]"
    return [
        PictureSpec("neighbours", fine, _ill(fine, "cells begin at 0", "negative_cells"),
                "neighbours", (0, 30)),
        PictureSpec("blob", squeezed, _ill(squeezed, "the gradient has the wrong sign", "attracts"),
                speed, (0, 2)),
        PictureSpec("density", fine._replace(title="with m W(0, h)"),
                _ill(fine, "without a particle's own share", "no_own_share"),
                "density / rest density", (0.5, 1.1)),
        PictureSpec("clamp", stays, _ill(stays, "suction at the surface", "no_clamp"),
                nearest, (0.2, 1.0)),
        PictureSpec("pairing", parted, _ill(parted, "poly6 gradient", "poly6_gradient"),
                nearest, (0.2, 1.0)),
        PictureSpec("time_step", falls, falls._replace(title="dt = 1.1 h/c0", courant=1.1),
                speed, (0, 4)),
        PictureSpec("xsph", smooth, smooth._replace(title="epsilon = 0", case=_noisy(0.0)),
                "speed of the motion [m/s]", (0, 1)),
        PictureSpec("walls", thrown, _ill(thrown, "too fast for thin walls", "thin_walls"),
                speed, (0, 6)),
        PictureSpec("jelly", falls._replace(title="no viscosity", seconds=0.35),
                _ill(falls._replace(seconds=0.35, courant=0.05), "damped twice and more", "jelly"),
                speed, (0, 3)),
    ]  # fmt: skip


def _ill(sound: Half, title: str, fault: str) -> Half:
    return sound._replace(title=title, make=faults.make(fault))


def _noisy(xsph: float) -> Case:
    """Return a blob of the rest spacing whose particles have velocities of their own."""
    v = np.random.default_rng(3).normal(0.0, 0.4, (225, 2))
    return case(lattice(15, 15), v, xsph=xsph)


def draw(folder: Path) -> list[Path]:
    """Draw all pictures as playbook_NAME.png, and the curves; return their paths.

    Raises ImportError that names the extra to install.
    """
    drawn = [_draw(picture, folder / f"playbook_{picture.name}.png") for picture in pictures()]
    return [*drawn, _draw_curves(folder / "playbook_curves.png")]


def _draw(picture: PictureSpec, path: Path) -> Path:
    figure = new_figure(8, 3.4)
    panels = figure.subplots(1, 2)
    for axes, half, kind in zip(
        panels, (picture.sound, picture.sick), ("healthy", "sick"), strict=True
    ):
        solver = half.run()
        finite = np.isfinite(solver.x).all(axis=1)
        x = solver.x[finite]
        low, high = picture.limits
        shown = QUANTITIES[picture.shown](solver)[finite]
        dots = axes.scatter(*x.T, c=shown, s=14, cmap=COLORS, vmin=low, vmax=high, linewidths=0)
        _frame(axes, half.case, x)
        lost = f", {int((~finite).sum())} particles are NaN" if not finite.all() else ""
        axes.set_title(f"{kind}: {half.title}{lost}", fontsize=10)
    figure.colorbar(dots, ax=panels, label=picture.shown, shrink=0.85)
    return save(figure, path, dpi=100)


def _frame(axes: Any, start: Case, x: Array) -> None:
    """Show the walls, and room around the start: what has flown off is out of the picture."""
    corners = start.x if start.box is None else np.reshape(start.box, (2, 2)).T
    low, high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
    if start.box is not None:
        x_min, x_max, y_min, y_max = start.box
        axes.plot([x_min, x_max, x_max, x_min, x_min], [y_min, y_min, y_max, y_max, y_min],
                  color="0.3", lw=1)  # fmt: skip
    out = int((~((x >= low) & (x <= high)).all(axis=1)).sum())
    text = f"x [m]; {out} particles are outside of the picture" if out else "x [m]"
    axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel=text)
    axes.set_ylabel("y [m]")


def _draw_curves(path: Path) -> Path:
    """Draw what pairs of particles tell: Tait or gas law, kernels of two or of three dimensions."""
    figure = new_figure(8, 3.4)
    left, right = figure.subplots(1, 2)
    for title, make, style in (
        ("Tait, gamma = 7", plain.make, "-"),
        ("gas law", faults.make("gas_law"), "--"),
    ):
        squeezed = [make(case(lattice(9, 9, s * DX))) for s in np.linspace(0.8, 1.05, 26)]
        middle = 40
        rho = [solver.rho[middle] / solver.case.rho0 for solver in squeezed]
        left.plot(rho, [solver.p[middle] / 1e3 for solver in squeezed], style, label=title)
    left.set(xlabel="density / rest density", ylabel="pressure [kPa]")
    left.set_title("The equation of state, measured", fontsize=10)
    r = np.linspace(0.01, 1.2, 60)
    for title, make, style in (
        ("4 / (pi h^8)", plain.make, "-"),
        ("315 / (64 pi h^9), of 3D", faults.make("poly6_of_3d"), "--"),
    ):
        alone = make(case([[0.0, 0.0]])).rho[0]
        share = [make(case([[0.0, 0.0], [s * 3 * DX, 0.0]])).rho[0] - alone for s in r]
        right.plot(r, share, style, label=title)
    right.set(xlabel="distance / support radius", ylabel="density from one neighbour [kg/m^3]")
    right.set_title("The density kernel, measured with pairs", fontsize=10)
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=9)
    return save(figure, path, dpi=100)
