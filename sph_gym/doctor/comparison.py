"""Compare two solvers on the same cases: the first link at which they part."""

from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import C0, DX, Array, Case, case, cloud, lattice
from sph_gym.doctor.checkup import resolve
from sph_gym.doctor.diagnosis import COLUMNS, Diagnosis, Result
from sph_gym.doctor.subject import Crash, Factory, Hang, Misfit, SolverUnderTest, Unsupported

# Relative differences below these are rounding: of solvers in double precision that sum in another
# order, and where one of the two keeps single precision.
DOUBLE, SINGLE = 1e-9, 1e-3
# A flow of so many steps may spread a rounding error by this factor.
SPREAD = 1e3
N_STEPS = 20


class _Setting(NamedTuple):
    """A case, and the link that it is about: "" where all act."""

    name: str
    case: Case
    link: str = ""


def compare(a: Factory | str, b: Factory | str, seed: int = 0) -> Diagnosis:
    """Return at which link two solvers part on the same cases, as a diagnosis of b against a.

    Grid against brute force, single against double precision, a new version against an old one:
    `measured` is the largest difference relative to the largest value of a, or to what is natural
    for a fluid (c0, dx) where all values are near zero; `expected` is the bound.
    Only what both show is compared. Viscosity, XSPH, gravity and walls are compared only if the
    two agree without them. Raises ValueError and ImportError as `check_solver` does.
    """
    (name_a, make_a), (name_b, make_b) = resolve(a), resolve(b)
    results: list[Result] = []
    for setting in _settings(np.random.default_rng(seed)):
        if setting.link and any(each.broken for each in results):
            text = "waits for the cases without it, in which the two differ"
            results.append(Result(setting.name, setting.link, "blocked", message=text))
            continue
        try:
            results += _parting(
                setting,
                SolverUnderTest(make_a, setting.case),
                SolverUnderTest(make_b, setting.case),
            )
        except (Misfit, Crash, Hang) as error:
            text, remedy = str(error), "Run the doctor on each of the two by itself first."
            results.append(Result(setting.name, "setup", "error", message=text, remedy=remedy))
        except Unsupported as error:
            results.append(Result(setting.name, "setup", "skip", message=str(error)))
    return Diagnosis(tuple(results), f"{name_b} against {name_a}")


def _settings(rng: np.random.Generator) -> list[_Setting]:
    squeezed = cloud(rng, 8, 8, 0.9 * DX, 0.2)
    lively = rng.uniform(-0.5, 0.5, squeezed.shape)
    block, box = lattice(6, 6), (-4 * DX, 4 * DX, -4 * DX, 4 * DX)
    return [
        _Setting("lattice", case(lattice(8, 8))),
        _Setting("squeezed", case(squeezed)),
        _Setting("elsewhere", case(squeezed - 37.3 * DX)),
        _Setting("moving", case(squeezed, lively)),
        _Setting("gravity", case(lattice(8, 8), gravity=(3.0, -9.81)), "force"),
        _Setting("viscous", case(squeezed, lively, viscosity=0.01), "viscosity"),
        _Setting("xsph", case(squeezed, lively, xsph=0.3), "xsph"),
        # fast enough to reach both sides
        _Setting("box", case(block, (0.3 * C0, -0.3 * C0), box=box), "walls"),
    ]


def _parting(setting: _Setting, a: SolverUnderTest, b: SolverUnderTest) -> list[Result]:
    rounding = SINGLE if a.is_single or b.is_single else DOUBLE

    def differ(what: str, link: str, bound: float = rounding) -> Result:
        name = what.split(" ")[0]
        values = (
            (getattr(a, name), getattr(b, name)) if name in "xv" else (a.get(name), b.get(name))
        )
        return _difference(setting, what, setting.link or link, values, bound)

    def both(name: str) -> bool:
        return a.shows(name) and b.shows(name)

    results = []
    if both("evaluate"):
        a.evaluate()
        b.evaluate()
        if both("neighbors"):
            results.append(_lists(setting, a, b))
        results += [differ(name, link) for name, link in COLUMNS.items() if both(name)]
    for n_steps in (1, N_STEPS):
        for each in (a, b):
            each.step(setting.case.dt, n_steps - each.n_steps)
        bound = rounding if n_steps == 1 else SPREAD * rounding
        title = "after a step" if n_steps == 1 else f"after {n_steps} steps"
        results += [differ(f"{name} {title}", "integration", bound) for name in "vx"]
    return results


def _difference(
    setting: _Setting, what: str, link: str, values: tuple[Array, Array], bound: float
) -> Result:
    a, b = values
    start, name = setting.case, what.split(" ")[0]
    # what a number is measured by where all are near zero; positions always by the spacing
    natural = {
        "rho": start.rho0,
        "p": start.rho0 * start.c0**2,
        "a": start.c0**2 / start.h,
        "v": 0.01 * start.c0,
        "x": start.dx,
    }[name]
    scale = natural if name == "x" else max(float(np.abs(a).max()), natural)
    apart = np.abs(a - b) / scale
    worst = float(apart.max()) if np.isfinite(apart).all() else float("inf")
    i = int(np.argmax(np.where(np.isfinite(apart), apart, np.inf).reshape(len(a), -1).max(axis=1)))
    return Result(
        f"{setting.name}: {what}",
        link,
        "pass" if worst <= bound else "fail",
        worst,
        f"<= {bound:g}",
        message=f"they differ most at particle {i}: {np.round(a[i], 9)} and {np.round(b[i], 9)}",
        remedy="Start at this link of b: everything before it agrees.",
        tolerance="relative to the largest value, or to c0 and dx",
    )


def _lists(setting: _Setting, a: SolverUnderTest, b: SolverUnderTest) -> Result:
    """Compare lists of neighbours within the support; what lies beyond is no one's business."""
    wrong = 0
    for i in range(setting.case.n):
        near = (
            np.linalg.norm(setting.case.x - setting.case.x[i], axis=1) < setting.case.h * 0.999999
        )
        lists = [set(each.neighbors(i).tolist()) - {i} for each in (a, b)]
        close = set(np.flatnonzero(near).tolist())
        wrong += len((lists[0] ^ lists[1]) & close)
    return Result(
        f"{setting.name}: neighbours",
        "neighbours",
        "fail" if wrong else "pass",
        wrong,
        0,
        "pairs that only one of them lists",
        message=f"{wrong} pairs closer than the support are listed by only one of the two",
        remedy="Compare both lists of one such particle with a loop over all pairs.",
    )
