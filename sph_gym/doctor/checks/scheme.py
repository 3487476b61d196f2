"""Which time integration does the solver use, and does it gain energy by it?"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from sph_gym.doctor.case import C0, DX, RHO0, Array, Case, all_finite, case, cloud, lattice
from sph_gym.doctor.checks.integration import LONG, MOVE, duration, factor
from sph_gym.doctor.diagnosis import Measured, Result, failed, inconclusive, need, passed
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import check

# The first steps are left out: some solvers start with a step of another kind.
_COUNTED = range(2, 5)


@dataclass
class ShortRun:
    """A run of a few steps: x, v (steps + 1, n, 2) before each and after the last."""

    lab: Lab
    start: Case
    dt: float
    x: Array
    v: Array
    _known: dict[str, Array] = field(default_factory=dict)

    def a(self, k: int) -> Array:
        """Return the accelerations (n, 2) at the state k, by a new solver."""
        return self.apart(f"{k}", self.x[k], self.v[k])

    def apart(self, name: str, x: Array, v: Array) -> Array:
        """Return the accelerations (n, 2) at any state, by a new solver; name: for keeping them."""
        if name not in self._known:
            self._known[name] = self.lab.acceleration(replace(self.start, x=x, v=v))
        return self._known[name]

    def ahead(self, k: int, part: float) -> Array:
        """Return the accelerations where v_k alone would have led after a part of the step."""
        x = self.x[k] + part * self.dt * self.v[k]
        return self.apart(f"{k}+{part}", x, self.v[k])


Models = dict[str, Callable[[ShortRun, int], Array]]
# A model, and what it leaves.
Fit = tuple[str, float]
# Models of the change of v in step k, the cheap ones first.
KICKS: Models = {
    "a(k)": lambda t, k: t.a(k),
    "a(k+1)": lambda t, k: t.a(k + 1),
    "a(k-1)": lambda t, k: t.a(k - 1),
    "mean of a(k) and a(k+1)": lambda t, k: (t.a(k) + t.a(k + 1)) / 2,
    "mean of a(k-1) and a(k)": lambda t, k: (t.a(k - 1) + t.a(k)) / 2,
    "a half a step ahead": lambda t, k: t.ahead(k, 0.5),
    "mean of a(k) and a a step ahead": lambda t, k: (t.a(k) + t.ahead(k, 1.0)) / 2,
}
DRIFTS: Models = {
    "v(k)": lambda t, k: t.v[k],
    "v(k+1)": lambda t, k: t.v[k + 1],
    "mean of v(k) and v(k+1)": lambda t, k: (t.v[k] + t.v[k + 1]) / 2,
}
# A model holds when it leaves less than this of what the accelerations change in a step.
HOLDS = 0.1


def best_kick(track: ShortRun) -> Fit:
    """Return the model of v(k+1) - v(k) that leaves least, in changes of the accelerations."""
    unit = _size([track.a(k + 1) - track.a(k) for k in _COUNTED])
    return _best(track, KICKS, track.v, unit, enough=HOLDS)


def best_drift(track: ShortRun) -> Fit:
    """Return the model of x(k+1) - x(k) that leaves least, in changes of v a step."""
    unit = _size([track.v[k + 1] - track.v[k] for k in _COUNTED])
    return _best(track, DRIFTS, track.x, unit, enough=0.0)


def _best(track: ShortRun, models: Models, course: Array, unit: float, enough: float) -> Fit:
    """Return the best model of the changes in a course, or the first that leaves `enough`."""
    best = ("", np.inf)
    for name, model in models.items():
        left = [(course[k + 1] - course[k]) / track.dt - model(track, k) for k in _COUNTED]
        score = _size(left) / max(unit, 1e-300)
        if score < best[1]:
            best = (name, score)
        if score < enough:
            break
    return best


def _size(values: list[Array]) -> float:
    return float(np.sqrt(sum((each**2).sum() for each in values)))


def squeezed(lab: Lab, speed: float) -> Case:
    """Return 36 particles in disorder, squeezed so that they push, with random velocities."""
    x = cloud(lab.rng, 6, 6, 0.92 * DX, 0.08)
    return case(x, lab.rng.uniform(-speed, speed, x.shape))


@check("integration", needs=("flight",), shows=("a",))
def step_uses_acceleration(lab: Lab) -> Result:
    """Compare the change of v in a step of a squeezed cloud with the accelerations shown."""
    start, long_and_short = squeezed(lab, speed=0.02 * C0), []
    for share in (LONG / 2, LONG / 10):
        dt = duration(start, share)
        # where densities are a memory, it takes some steps until the cloud pushes
        subject = lab.make(start).step(LONG * start.h / start.c0, 3).step(dt)
        before, v = subject.get("a"), subject.v
        subject.step(dt)
        after, gain = subject.get("a"), (subject.v - v) / dt
        need(all_finite(before, after, gain), "the cloud is not finite, which other checks judge")
        if np.abs(after).max() < 1e-4 * start.c0**2 / start.h:
            return inconclusive("hardly any acceleration is shown: nothing to compare")
        candidates = [_factors(gain, a) for a in (before, after, (before + after) / 2)]
        long_and_short.append(min(candidates, key=_from_one))
    return _judge_factors(candidates, *long_and_short)


Factors = tuple[Array, float]


def _factors(gain: Array, a: Array) -> Factors:
    """Return the factors along x and y that turn `a` into the gain of v, and what is left."""
    weak = np.abs(a).max(axis=0) < 1e-6 * np.abs(a).max()
    none = weak & (np.abs(gain).max(axis=0) < 1e-6 * np.abs(gain).max())
    factors = np.where(none, 1.0, [factor(gain[:, k], a[:, k]) for k in (0, 1)])
    left = np.linalg.norm(gain - factors * a) / max(float(np.linalg.norm(gain)), 1e-300)
    return factors, float(left)


def _from_one(found: Factors) -> float:
    return float(np.abs(found[0] - 1).max()) + found[1]


def _judge_factors(candidates: list[Factors], long: Factors, short: Factors) -> Result:
    factors, left = short
    numbers = (f"({factors[0]:.4g}, {factors[1]:.4g})", "(1, 1)")
    if _from_one(short) < 0.15:
        return passed(
            "a squeezed cloud: (dv/dt) / a along x and y, in short steps",
            Measured(*numbers, tolerance="15 % with what is left over"),
        )
    if np.abs(factors * RHO0 - 1).max() < 0.5 and left < 0.3:
        return failed(
            "a squeezed cloud: dv/dt is `a` over the density",
            "Show accelerations [m/s^2] as `a`, not forces a volume.",
            Measured(*numbers),
            link="setup",
        )
    spread = np.ptp([each for each, _ in candidates], axis=0).max()
    if left > 0.03 or spread > 0.05 * np.abs(factors).max():
        return inconclusive(
            f"a squeezed cloud: the change of v is no multiple of `a` ({left:.0%} are left): `a` "
            "may be shown of another moment, or without some of its terms",
            Measured(*numbers),
        )
    ignored = np.abs(factors - 5 * long[0]).max() < 0.5 * np.abs(long[0]).max()
    cause = "dt is ignored there." if ignored else f"here the factor is {numbers[0]}, not 1."
    return failed(
        f"a squeezed cloud: dv/dt is not `a`, but ({long[0][0]:.3g}, {long[0][1]:.3g}) times as "
        f"much in a step of {LONG / 2:g} h/c0, {numbers[0]} in one of {LONG / 10:g} h/c0",
        MOVE + cause,
        Measured(*numbers, tolerance="15 %"),
    )


# A model that a broken scheme follows leaves rounding alone; see `HOLDS` for the unit.
_EXACT = 0.03


@check("integration", needs=("flight",))
def scheme(lab: Lab) -> Result:
    """Name the integrator: take apart each step of a lively cloud by accelerations from outside."""
    start = squeezed(lab, speed=0.05 * C0)
    found = _identify(lab, start, 0.15)
    if found is None:
        return inconclusive("the cloud is not finite, which other checks judge")
    kick, drift = found
    if kick[1] > HOLDS:
        return inconclusive(
            "the steps of a lively cloud fit no known scheme: densities with a memory "
            "(continuity), sub-steps or smoothed velocities hide it",
            Measured(f"{kick[1]:.2g} left", f"< {HOLDS:g}", tolerance="of its change in a step"),
        )
    name = _known(*found)
    text = f"v changes by {kick[0]} dt" + (f", x by {drift[0]} dt" if drift[1] < _EXACT else "")
    numbers = Measured(text)
    if name in _BROKEN:
        again = _identify(lab, start, 0.05)
        if again is None or _known(*again) != name:
            return inconclusive(f"looks like {name}, but not with a shorter step: {text}", numbers)
        return failed(
            f"each step of a lively cloud, taken apart: {text}, exactly, at two dt",
            _BROKEN[name],
            Measured(
                name,
                "symplectic Euler, leapfrog or a predictor-corrector",
                tolerance=f"{_EXACT:.0%} of the change of a in a step",
            ),
        )
    if name == _TAYLOR:
        return inconclusive(
            f"{text}: it gains energy half as fast as forward Euler", Measured(name)
        )
    return passed(f"each step of a lively cloud, taken apart: {text}", numbers)


_TAYLOR = "half a velocity Verlet"
_BROKEN = {
    "forward Euler": "Forward Euler gains energy in every oscillation. Change v first and move "
    "the particles with the new v: v += a * dt; x += v * dt.",
    "lagged accelerations": "The accelerations belong to the step before: compute densities, "
    "pressures and forces at the present positions, and only then change v.",
}


def _identify(lab: Lab, start: Case, share: float) -> tuple[Fit, Fit] | None:
    dt = duration(start, share)
    track = ShortRun(lab, start, dt, *lab.course(start, dt, _COUNTED.stop + 1))
    if not all_finite(track.x, track.v):
        return None
    return best_kick(track), best_drift(track)


def _known(kick: Fit, drift: Fit) -> str:
    """Return a name for the schemes that gain energy, "" for others."""
    if kick[1] > _EXACT or drift[1] > _EXACT:
        return ""
    if kick[0] == "a(k-1)":
        return "lagged accelerations"
    if kick[0] == "a(k)" and drift[0] == "v(k)":
        return "forward Euler"
    if kick[0] == "a(k)" and drift[0] == "mean of v(k) and v(k+1)":
        return _TAYLOR
    return ""


@check("integration", needs=("flight",))
def ringing(lab: Lab) -> Result:
    """Let sound go to and fro in a block: its energy must not grow, least of all with dt."""
    told = "sound in a block of 6 x 6: kinetic energy after ten crossings, in units of the first"
    usual = _ring(lab, LONG)
    numbers = Measured(f"{usual:.3g}", "<= 1", tolerance=f"{_GROWS:g}")
    if usual < _GROWS:
        return passed(f"{told}, with dt = {LONG} h/c0", numbers)
    # a little viscosity, so that what it would cure in every use of the solver is no fault
    long, short = _ring(lab, 2 * LONG, viscosity=0.02), _ring(lab, LONG / 4)
    course = f"{told}: {short:.3g} with dt = {LONG / 4} h/c0, {usual:.3g} with {LONG}, "
    course += f"{long:.3g} with {2 * LONG}"
    if short > usual**0.5 or long < 10:
        return inconclusive(course, Measured(*numbers[:2]))
    return failed(
        f"{course}: the steps put in energy",
        "An oscillation that grows with dt is the mark of forward Euler, and of accelerations or "
        "densities that lag behind: v first, x and densities with the new v, forces at the new x. "
        "If the scheme is right, dt is too long for it.",
        numbers,
    )


# Sound in a healthy solver ends with 0.5 to 1 of its energy.
_GROWS = 3.0


def _ring(lab: Lab, share: float, viscosity: float = 0.0) -> float:
    """Return the most kinetic energy in the last quarter of a run, in units of the first."""
    x = lattice(6, 6)
    s = np.pi * x / (6 * DX)
    v = np.stack([np.sin(s[:, 0]) * np.cos(2 * s[:, 1]), 0.5 * np.sin(s[:, 1])], axis=1)
    start = case(x, 0.02 * C0 * v, viscosity=viscosity)
    subject, energies = lab.make(start), [float((start.v**2).sum())]
    steps = round(10 / share)
    for n in range(steps):
        subject.step(duration(start, share))
        if n > 0.75 * steps:
            energies.append(float((subject.v**2).sum()))
    return max(energies[1:]) / energies[0] if np.isfinite(energies).all() else np.inf
