"""Averages and intervals of a few values."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


def interquartile_mean(values: Values) -> Any:
    """Return the mean without the lowest and the highest quarter, along the last axis."""
    from scipy.stats import trim_mean

    return trim_mean(values, 0.25, axis=-1)


def bootstrap_interval(values: Values) -> tuple[float, float, float]:
    """Return the mean and the ends of its 95 % bootstrap confidence interval."""
    from scipy.stats import bootstrap

    values = np.asarray(values, dtype=float)
    mean = float(values.mean())
    if len(values) < 2 or np.ptp(values) == 0:
        return mean, mean, mean
    rng = np.random.default_rng(0)
    found = bootstrap((values,), np.mean, rng=rng, method="percentile").confidence_interval
    return mean, float(found.low), float(found.high)
