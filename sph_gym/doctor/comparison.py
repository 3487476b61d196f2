"""Compare two solvers on the same cases: the first link at which they part."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sph_gym.doctor.case import DX, Array, Case, case, cloud, lattice
from sph_gym.doctor.checkup import resolve
from sph_gym.doctor.diagnosis import LINKS, Diagnosis, Result
from sph_gym.doctor.subject import Crash, Factory, Hang, Misfit, Subject, Unsupported

# Relative differences below these are rounding: of solvers in double precision that sum in another
# order, and where one of the two keeps single precision.
DOUBLE, SINGLE = 1e-9, 1e-3
# A flow of so many steps may spread a rounding error by this factor.
SPREAD = 1e3
N_STEPS = 20


class _Setting(NamedTuple):
    name: str
    case: Case


def compare(a: Factory | str, b: Factory | str, seed: int = 0) -> Diagnosis:
    """Return at which link two solvers part on the same cases, as a diagnosis of b against a.

    Grid against brute force, single against double precision, a new version against an old one:
    `measured` is the largest difference relative to the largest value of a, or to what is natural
    for a fluid (c0, dx) where all values are near zero; `expected` is the bound.
    Only what both show is compared. Raises ValueError and ImportError as `check_solver` does.
    """
    (name_a, make_a), (name_b, make_b) = resolve(a), resolve(b)
    results: list[Result] = []
    for setting in _settings(np.random.default_rng(seed)):
        try:
            results += _parting(
                setting, Subject(make_a, setting.case), Subject(make_b, setting.case)
            )
        except (Misfit, Crash, Hang) as error:
            results.append(Result(setting.name, "setup", "error", message=str(error)))
        except Unsupported as error:
            results.append(Result(setting.name, "setup", "skip", message=str(error)))
    results.sort(key=lambda each: LINKS.index(each.link))
    return Diagnosis(tuple(results), f"{name_b} against {name_a}")


def _settings(rng: np.random.Generator) -> list[_Setting]:
    squeezed = cloud(rng, 8, 8, 0.9 * DX, 0.2)
    lively = rng.uniform(-0.5, 0.5, squeezed.shape)
    box = (-6 * DX, 6 * DX, -6 * DX, 6 * DX)
    return [
        _Setting("lattice", case(lattice(8, 8))),
        _Setting("squeezed", case(squeezed)),
        _Setting("elsewhere", case(squeezed - 37.3 * DX)),
        _Setting("moving", case(squeezed, lively)),
        _Setting("viscous", case(squeezed, lively, viscosity=0.01)),
        _Setting("xsph", case(squeezed, lively, xsph=0.3)),
        _Setting("box", case(lattice(8, 8) - 1.5 * DX, gravity=(0.0, -9.81), box=box)),
    ]


def _parting(setting: _Setting, a: Subject, b: Subject) -> list[Result]:
    results = []
    both: Callable[[str], bool] = lambda name: a.shows(name) and b.shows(name)  # noqa: E731
    rounding = SINGLE if any(_is_single(each) for each in (a, b)) else DOUBLE
    if both("evaluate"):
        a.evaluate()
        b.evaluate()
        if both("neighbors"):
            results.append(_lists(setting, a, b))
        for name, link in (("rho", "density"), ("p", "pressure"), ("a", "force")):
            if both(name):
                results.append(
                    _difference(setting, name, link, (a.get(name), b.get(name)), rounding)
                )
    dt = setting.case.dt
    acting = {"viscous": "viscosity", "xsph": "xsph", "box": "walls"}
    link = acting.get(setting.name, "integration")
    a.step(dt), b.step(dt)
    for name in ("v", "x"):
        values = getattr(a, name), getattr(b, name)
        results.append(_difference(setting, f"{name} after a step", link, values, rounding))
    a.step(dt, N_STEPS - 1), b.step(dt, N_STEPS - 1)
    title = f"x after {N_STEPS} steps"
    results.append(_difference(setting, title, link, (a.x, b.x), SPREAD * rounding))
    return results


def _is_single(subject: Subject) -> bool:
    return getattr(getattr(subject.solver, "x", None), "dtype", None) == np.float32


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


def _lists(setting: _Setting, a: Subject, b: Subject) -> Result:
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
