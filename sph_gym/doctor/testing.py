"""The checks as tests of somebody else's suite, by pytest.

from sph_gym.doctor import parametrize_with_checks

@parametrize_with_checks([make], expected_failed_checks={"coincident": "not guarded yet"})
def test_solver(make, check):
    check(make)
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

from sph_gym.doctor import checks as _checks  # noqa: F401  (fills CHECKS)
from sph_gym.doctor.checkup import Checkup
from sph_gym.doctor.diagnosis import Result
from sph_gym.doctor.registry import CHECKS
from sph_gym.doctor.subject import Factory


def _test(
    checkup: Checkup, name: str, callback: Callable[[Result], None] | None, make: Factory | str
) -> None:
    """Do one check of the solver under examination, which `make` stands for in the test.

    Checks of one solver share what they have measured, so that each is done once; one that builds
    on a broken link is skipped as blocked instead of failing again. Raises AssertionError with all
    that was found if the check fails. Tests whose check is blocked, skipped or inconclusive are
    skipped, with the reason.
    """
    import pytest

    result = checkup.result(name)
    if callback:
        callback(result)
    if result.broken:
        raise AssertionError(
            f"{result.link}: {result.message}\nmeasured {result.measured}, expected "
            f"{result.expected} {result.unit}\n{result.remedy}"
        )
    if result.status == "xfail":
        pytest.xfail(result.message)
    if result.status != "pass":
        pytest.skip(f"{result.status}: {result.message}")


def parametrize_with_checks(
    makes: Sequence[Factory | str],
    skip: Collection[str] = (),
    expected_failed_checks: Mapping[str, str] = MappingProxyType({}),
    seed: int = 0,
    callback: Callable[[Result], None] | None = None,
) -> Any:
    """Return a decorator that runs a test with each solver and each check.

    makes: factories as for `check_solver`, as are the other arguments. The decorated test takes
    the arguments `make` and `check` and calls `check(make)`. Its ids read `factory-check`, or
    `module:factory-check` where two factories have the same name. callback: is given each result.

    Raises ValueError as `check_solver` does, and ImportError if pytest is missing.
    """
    import pytest

    checkups = [Checkup(make, skip, expected_failed_checks, seed) for make in makes]
    short = [each.name.rpartition(":")[2] for each in checkups]
    parameters = []
    for make, checkup, title in zip(makes, checkups, short, strict=True):
        title = title if short.count(title) == 1 else checkup.name
        for name in CHECKS:
            test = partial(_test, checkup, name, callback)
            parameters.append(pytest.param(make, test, id=f"{title}-{name}"))
    return pytest.mark.parametrize(("make", "check"), parameters)
