"""Study of the doctor: it must find every fault that it knows, and accuse no sound solver.

Faults are looked at twice: in solvers that show all that the protocol knows, and in the same ones
behind a wall that lets through nothing but positions and velocities. The sound solvers are the
article's, in plain numpy, and this package's in all its kinds; its kernels that are wrong on
purpose are faults.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from sph_gym.doctor.checkup import resolve
from sph_gym.doctor.diagnosis import LINKS
from sph_gym.doctor.faults import FAULTS
from sph_gym.doctor.here import DENSITIES, WALLS, here
from sph_gym.doctor.matrix import ALL, BARE, NOTHING, DiagnosisOutcome, examine_all
from sph_gym.doctor.matrix import measure as of_faults
from sph_gym.doctor.subject import Factory
from sph_gym.extras import progress_bar
from sph_gym.solver.integrators import INTEGRATORS
from sph_gym.solver.kernels import KERNELS, WRONG_KERNELS
from sph_gym.solver.simulation import DTYPES, NEIGHBORS
from sph_gym.studies import playbook
from sph_gym.studies.picture import new_figure, save
from sph_gym.studies.table import Row

# The least shares [%] of faults that are found, and of those found at the right link.
FOUND, RIGHT = 100.0, 95.0
# The links that the wrong kernels break.
WRONG_LINKS = dict.fromkeys(WRONG_KERNELS, "force") | {"wrong_3d_constants": "density"}
COLORS = {"right": "#0072B2", "wrong": "#D55E00"}
SOUND = "sound"

Solver = tuple[str, str, partial[Any]]


def measure(quick: bool) -> Iterator[Row]:
    """Yield all rows, with a progress bar; quick: one fault a link, one sound solver.

    Raises ImportError that names the extra to install.
    """
    names = _one_a_link() if quick else list(FAULTS)
    sound = sound_solvers()[: 1 if quick else None]
    tiers = [ALL] if quick else [ALL, BARE]
    with progress_bar(len(names) * len(tiers) + len(sound), unit="solver") as bar:
        for tier in tiers:
            outcomes = []
            for one in of_faults(names, tier):
                outcomes.append(one)
                yield _row(one, tier)
                bar.update()
            yield from shares(outcomes, tier)
        for one in examine_all(sound):
            if one.link:
                yield _row(one, ALL)
            else:
                unit = f"alarms: {one.found} ({one.check})" if one.found else "alarms"
                yield Row(SOUND, one.name, float(bool(one.found)), unit, 0.0)
            bar.update()


def sound_solvers() -> list[Solver]:
    """Return names, broken links ("" for sound ones) and what makes the factories.

    The article's solver, and this one with each value of each setting beside the usual ones.
    """
    kinds: list[dict[str, str]] = [{"kernel": name} for name in KERNELS]
    kinds += [{"density": DENSITIES[1], "kernel": name} for name in KERNELS]
    kinds += [{"walls": walls} for walls in WALLS[1:]]
    kinds += [{"density": DENSITIES[1], "walls": WALLS[2]}]
    kinds += [{"integrator": name} for name in list(INTEGRATORS)[1:]]
    kinds += [{"dtype": name} for name in list(DTYPES)[1:]]
    kinds += [{"neighbors": name} for name in NEIGHBORS[1:]]
    chosen: list[Solver] = [("plain", "", partial(_plain))]
    chosen += [(", ".join(kind.values()), "", partial(here, **kind)) for kind in kinds]
    return chosen + [(name, link, partial(here, kernel=name)) for name, link in WRONG_LINKS.items()]


def _plain() -> Factory:
    return resolve("sph_gym.doctor.plain:make")[1]


def _one_a_link() -> list[str]:
    first = {one.link: name for name, one in reversed(FAULTS.items())}
    return [first[link] for link in LINKS]


def _row(one: DiagnosisOutcome, tier: str) -> Row:
    """Return whether the right link was found; its unit says which one was."""
    unit = f"{one.found or NOTHING} {f'({one.check})' if one.found else ''}".strip()
    return Row(f"{one.name}, shows {tier}", one.link, float(one.is_right), unit)


def shares(outcomes: Sequence[DiagnosisOutcome], tier: str) -> Iterator[Row]:
    """Yield the shares of faults that are found; bounds are for solvers that show all."""
    n, case = len(outcomes), f"{len(outcomes)} faults, shows {tier}"
    found = 100 * sum(bool(one.found) for one in outcomes) / n
    right = 100 * sum(one.is_right for one in outcomes) / n
    bounds = (FOUND, RIGHT) if tier == ALL else (None, None)
    yield Row("faults found", case, found, "%", bounds[0], at_least=True)
    yield Row("right link first", case, right, "%", bounds[1], at_least=True)


def finish(rows: list[Row], path: Path) -> None:
    """Draw which link was found for each fault, and the pictures of docs/playbook.md."""
    for drawn in (draw(rows, path), *playbook.draw(path.parent)):
        print(f"picture: {drawn}")


def draw(rows: Sequence[Row], path: Path) -> Path:
    """Draw the outcomes of faults; return the path of the PNG file.

    Raises ImportError that names the extra to install.
    """
    tiers = [tier for tier in (ALL, BARE) if _outcomes(rows, tier)]
    links = {name: link for tier in tiers for name, link, _ in _outcomes(rows, tier)}
    names = sorted(links, key=lambda name: LINKS.index(links[name]))
    figure = new_figure(2 + 3.5 * max(len(tiers), 1), 1.8 + 0.16 * max(len(names), 1))
    panels = figure.subplots(1, max(len(tiers), 1), sharey=True, squeeze=False)[0]
    for axes, tier in zip(panels, tiers, strict=False):
        _panel(axes, _outcomes(rows, tier), tier, names)
    figure.suptitle("The link that is found for each fault")
    return save(figure, path)


def _outcomes(rows: Sequence[Row], tier: str) -> list[tuple[str, str, str]]:
    """Return name, broken link and the link found of each fault of the rows, by link."""
    ending = f", shows {tier}"
    found = [
        (row.quantity.removesuffix(ending), row.case, row.unit.split(" ")[0])
        for row in rows
        if row.quantity.endswith(ending) and row.case in LINKS
    ]
    return sorted(found, key=lambda one: LINKS.index(one[1]))


def _panel(axes: Any, outcomes: list[tuple[str, str, str]], tier: str, names: list[str]) -> None:
    """Draw a row a fault: a frame at the broken link, a mark at the one that was found."""
    across = [*LINKS, NOTHING]
    for name, link, found in outcomes:
        row = names.index(name)
        axes.plot(LINKS.index(link), row, "s", ms=8, mfc="none", mec="0.5")
        kind = "right" if found == link else "wrong"
        marker = "o" if kind == "right" else "X"
        axes.plot(across.index(found), row, marker, ms=5, color=COLORS[kind])
    axes.set_xticks(range(len(across)), across, rotation=90)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.set(xlim=(-0.6, len(across) - 0.4), ylim=(len(names) - 0.4, -0.6))
    axes.xaxis.tick_top()
    right = sum(link == found for _, link, found in outcomes)
    axes.set_title(f"shows {tier}: {right} of {len(outcomes)} right")
    axes.grid(alpha=0.3)
