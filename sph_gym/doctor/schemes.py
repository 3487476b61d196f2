"""Which integrator is it? Told from a run, and from accelerations measured apart from it."""

from dataclasses import dataclass, field, replace

import numpy as np

from sph_gym.doctor.case import Array, Case
from sph_gym.doctor.lab import Lab

# The first steps are left out: some solvers start with a step of another kind.
_FIRST, _LAST = 2, 5


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


def follow(lab: Lab, start: Case, dt: float) -> ShortRun:
    """Return the track of a new solver; its steps are those that the models look at."""
    subject = lab.make(start)
    x, v = [subject.x], [subject.v]
    for _ in range(_LAST + 1):
        subject.step(dt)
        x.append(subject.x)
        v.append(subject.v)
    return ShortRun(lab, start, dt, np.stack(x), np.stack(v))


# What the change of v in step k may be made of: the cheap ones first.
KICKS = {
    "a(k)": lambda t, k: t.a(k),
    "a(k+1)": lambda t, k: t.a(k + 1),
    "a(k-1)": lambda t, k: t.a(k - 1),
    "mean of a(k) and a(k+1)": lambda t, k: (t.a(k) + t.a(k + 1)) / 2,
    "mean of a(k-1) and a(k)": lambda t, k: (t.a(k - 1) + t.a(k)) / 2,
    "a half a step ahead": lambda t, k: t.ahead(k, 0.5),
    "mean of a(k) and a a step ahead": lambda t, k: (t.a(k) + t.ahead(k, 1.0)) / 2,
}
DRIFTS = {
    "v(k)": lambda t, k: t.v[k],
    "v(k+1)": lambda t, k: t.v[k + 1],
    "mean of v(k) and v(k+1)": lambda t, k: (t.v[k] + t.v[k + 1]) / 2,
}
# A model holds when it leaves less than this of what the accelerations change in a step.
HOLDS = 0.1


def best_kick(track: ShortRun) -> tuple[str, float]:
    """Return the model of v(k+1) - v(k) that leaves least, and what it leaves (`HOLDS`)."""
    unit = _size([track.a(k + 1) - track.a(k) for k in range(_FIRST, _LAST)])
    best = ("", np.inf)
    for name, model in KICKS.items():
        left = [
            (track.v[k + 1] - track.v[k]) / track.dt - model(track, k) for k in range(_FIRST, _LAST)
        ]
        score = _size(left) / max(unit, 1e-300)
        if score < best[1]:
            best = (name, score)
        if score < HOLDS:
            break
    return best


def best_drift(track: ShortRun) -> tuple[str, float]:
    """Return the model of x(k+1) - x(k) that leaves least, in changes of v a step."""
    unit = _size([track.v[k + 1] - track.v[k] for k in range(_FIRST, _LAST)])
    scores = {
        name: _size(
            [
                (track.x[k + 1] - track.x[k]) / track.dt - model(track, k)
                for k in range(_FIRST, _LAST)
            ]
        )
        / max(unit, 1e-300)
        for name, model in DRIFTS.items()
    }
    name = min(scores, key=lambda each: scores[each])
    return name, scores[name]


def _size(values: list[Array]) -> float:
    return float(np.sqrt(sum((each**2).sum() for each in values)))
