"""Errors and times as people write them."""

from sph_gym.solver.checks import positive

UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}


def parse_error(text: str) -> float:
    """A share of a text such as 0.01 or 1%. Raises ValueError for others."""
    number = text.strip()
    try:
        value = positive("error", float(number.removesuffix("%")))
    except ValueError:
        raise ValueError(
            f"error: expected a share above 0 such as 0.01 or 1%, got {text!r}"
        ) from None
    return share_of_one(value / 100 if number.endswith("%") else value)


def share_of_one(error: float) -> float:
    """An error that is one. Raises ValueError above 1, where percents must be meant."""
    if error > 1:
        raise ValueError(
            f"error: expected a share of at most 1, got {error:g}: did you mean {error / 100:g}?"
        )
    return error


def parse_budget(text: str) -> float:
    """Seconds of a text such as 10s, 500ms, 2min, 1h or 10. Raises ValueError for others."""
    number = text.strip().lower()
    unit = next((u for u in ("ms", "min", "h", "s") if number.endswith(u)), "")
    try:
        return positive("budget", float(number.removesuffix(unit)) * UNITS.get(unit, 1.0))
    except ValueError:
        raise ValueError(
            f"budget: expected a time above 0 such as 10s, 500ms or 2min, got {text!r}"
        ) from None
