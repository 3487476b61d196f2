"""Linear theory of waves in a rectangular tank, and its quantities in a simulation."""

import math
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sph_gym.scenes.shared.tanks import box
from sph_gym.solver.scene import Scene
from sph_gym.solver.simulation import Simulation

Array = NDArray[np.float64]

# Odd modes up to this one; the even ones leave the centre of mass where it is.
MODES = 9


def frequency(mode: int, length: float, depth: float, gravity: float) -> float:
    """Return omega [1/s] of the n-th free wave of a tank: omega^2 = g k tanh(k H), k = n pi / L.

    length, depth: [m]; gravity [m/s^2]. Source: Lamb 1932, article 228.
    """
    k = mode * math.pi / length
    return math.sqrt(gravity * k * math.tanh(k * depth))


def basin(scene: Scene) -> tuple[float, float]:
    """Return the length of a scene's tank and the depth of its water at rest [m]."""
    left, right, *_ = box(scene)
    length = right - left
    return length, len(np.asarray(scene.x)) * scene.dx**2 / length


def shift(mode: int, length: float, depth: float) -> float:
    """Return the shift of the centre of mass to the right per elevation of an odd mode [1].

    An elevation a cos(k x) above the left wall shifts it by -2 a / (k^2 L H).
    """
    k = mode * math.pi / length
    return -2 / (k * k * length * depth)


def crossings(times: Array, values: Array) -> Array:
    """Return the times [s] at which a signal changes its sign, by linear interpolation."""
    at = np.flatnonzero(values[:-1] * values[1:] < 0)
    step = (times[at + 1] - times[at]) / (values[at + 1] - values[at])
    return times[at] - values[at] * step


def ring(times: Array, values: Array) -> tuple[float, float]:
    """Return omega [1/s] and decay rate [1/s] of a decaying oscillation about zero.

    From its zeros and from the peaks between them; nan where there are fewer than three zeros.
    """
    zeros = crossings(times, values)
    if len(zeros) < 3:
        return math.nan, math.nan
    omega = math.pi * (len(zeros) - 1) / (zeros[-1] - zeros[0])
    legs = np.digitize(times, zeros)
    peaks = [np.abs(values[legs == leg]).max(initial=0.0) for leg in range(1, len(zeros))]
    rate = np.polyfit((zeros[1:] + zeros[:-1]) / 2, np.log(np.maximum(peaks, 1e-300)), 1)[0]
    return float(omega), -float(rate)


def com_shift(sim: Simulation) -> float:
    """Return the shift of the centre of mass to the right of the tank's middle [m]."""
    left, right, *_ = box(sim.scene)
    return sim.diagnostics()["com_x"] - (left + right) / 2


class Rolling(NamedTuple):
    """Water in a tank that rolls by theta = roll sin(drive t) about the middle of its floor.

    length, depth: [m]; gravity [m/s^2]; roll [rad], small; drive: angular frequency [1/s].
    """

    length: float
    depth: float
    gravity: float
    roll: float
    drive: float

    def mode(self, n: int) -> tuple[float, float]:
        """Return omega [1/s] and F [m/s^2] of an odd mode: a'' + omega^2 a = F sin(drive t).

        Laplace's equation in the turning tank, projected on cos(k x) cosh(k y), which gives
        F = 2/L (2 omega^2 / k^2 + B drive^2) roll,
        B = 2 H tanh(k H) / k - 4 (1 - 1 / cosh(k H)) / k^2.
        The first term alone would keep the surface horizontal. Source: the linear problem of
        Faltinsen 1978, with roll for sway.
        """
        omega = frequency(n, self.length, self.depth, self.gravity)
        k = n * math.pi / self.length
        kh = k * self.depth
        turning = 2 * self.depth * math.tanh(kh) / k - 4 * (1 - 1 / math.cosh(kh)) / k**2
        force = 2 * omega**2 / k**2 + turning * self.drive**2
        return omega, 2 / self.length * self.roll * force

    def _modes(self) -> list[tuple[float, float]]:
        """Return omega of the odd modes, and F times the shift by their elevation [m/s^2]."""
        modes = ((n, *self.mode(n)) for n in range(1, MODES + 1, 2))
        return [(omega, force * shift(n, self.length, self.depth)) for n, omega, force in modes]

    def shift(self, times: Any) -> Array:
        """Return the shift of the centre of mass to the right of the middle [m] at times [s].

        From rest in the tank, the free waves included that the start of the roll makes.
        """
        times, drive = np.asarray(times, float), self.drive
        forced, total = np.sin(drive * times), np.zeros_like(times)
        for omega, force in self._modes():
            if abs(omega / drive - 1) < 1e-6:
                swing = (forced / drive - times * np.cos(drive * times)) / (2 * drive)
            else:
                swing = forced - drive / omega * np.sin(omega * times)
                swing = swing / (omega**2 - drive**2)
            total += force * swing
        return total

    def response(self) -> float:
        """Return the amplitude of the centre of mass in the long run [m], in step with the roll."""
        return sum(force / (omega**2 - self.drive**2) for omega, force in self._modes())

    def fit(self, times: Array, shift: Array) -> tuple[float, float]:
        """Return the amplitude in step with the roll [m] and omega [1/s] of the free wave in a run.

        Frequency and decay [1/s] of that wave by least squares on a grid that is refined once.
        """
        best, width = (math.inf, math.nan, self.mode(1)[0]), 0.15
        for _ in range(2):
            omegas = best[2] * np.linspace(1 - width, 1 + width, 61)
            for omega, rate in product(omegas, np.linspace(0.0, 1.0, 11)):
                fading, phase = np.exp(-rate * times), omega * times
                follows = self.drive * times
                parts = np.sin(follows), np.cos(follows), np.sin(phase), np.cos(phase)
                columns = np.stack([*parts[:2], *(fading * part for part in parts[2:])], axis=-1)
                shares = np.linalg.lstsq(columns, shift, rcond=None)[0]
                rest = float(((columns @ shares - shift) ** 2).sum())
                best = min(best, (rest, float(shares[0]), float(omega)))
            width /= 30
        return best[1], best[2]
