"""Run the checks on a solver, in an order in which each builds on what was found sound."""

import importlib.util
import sys
import time
import traceback
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType, ModuleType

from sph_gym.doctor import checks as _checks  # noqa: F401  (fills CHECKS)
from sph_gym.doctor.diagnosis import (
    Diagnosis,
    Ends,
    Result,
    blocked,
    error,
    inconclusive,
    skipped,
)
from sph_gym.doctor.lab import Lab
from sph_gym.doctor.registry import CHECKS, Check
from sph_gym.doctor.subject import Crash, Factory, Hang, Misfit, TooSlow, Unsupported, Waits
from sph_gym.solver.checks import known

# A check may take so long [s]; what is not done by then decides nothing.
CHECK_LIMIT = 40.0
# Without it, changes of velocity tell nothing about accelerations.
CLOCK = "flight"
# Without it, nothing is known of what the solver shows.
FIRST = "adapter"
_UNFIT = "Mend the adapter between the doctor and the solver; docs/playbook.md has the protocol."


class Checkup:
    """A solver under examination: results so far, by check.

    Raises ValueError for unknown names of checks and for a factory that is none.
    """

    def __init__(
        self,
        make: Factory | str,
        skip: Collection[str] = (),
        expected_failed_checks: Mapping[str, str] = MappingProxyType({}),
        seed: int = 0,
    ) -> None:
        for name in (*skip, *expected_failed_checks):
            known("check", name, CHECKS)
        if FIRST in skip:
            raise ValueError(f"skip: expected checks other than {FIRST}, on which all others build")
        if not isinstance(expected_failed_checks, Mapping):
            raise ValueError("expected_failed_checks: expected reasons by check, a dict")
        self.name, factory = resolve(make)
        self._skip, self._expected = frozenset(skip), dict(expected_failed_checks)
        self._lab = Lab(factory, seed)
        self._hung = ""
        self.results: dict[str, Result] = {}

    def result(self, name: str) -> Result:
        """Return the result of one check, done now if it wasn't before, as is what it needs."""
        check = CHECKS[known("check", name, CHECKS)]
        if name not in self.results:
            for needed in _waits_for(check):
                self.result(needed)
            self.results[name] = self._do(check)
        return self.results[name]

    def _do(self, check: Check) -> Result:
        started = time.monotonic()
        found = self._finding(check)
        if check.name == CLOCK and found.broken:
            self._lab.broken_clock = check.name
        if found.broken and check.name in self._expected:
            text = f"expected to fail: {self._expected[check.name]}. {found.message}"
            found = replace(found, status="xfail", message=text)
        return found.of(check, started)

    def _finding(self, check: Check) -> Result:
        if check.name in self._skip:
            return skipped("left out as was asked")
        if self._hung:
            return blocked(f"the solver hung in {self._hung}")
        for name in _waits_for(check):
            other = self.results[name]
            if other.broken or other.status == "xfail":
                return blocked(f"waits for {other.check}, which failed")
            if other.status == "blocked" and name in check.needs:
                return blocked(other.message)
        missing = [name for name in check.shows if name not in self._lab.shown]
        if missing:
            return skipped(f"the solver does not show {', '.join(missing)}")
        self._lab.start(check.name, CHECK_LIMIT)
        try:
            return check.function(self._lab)
        except Misfit as reason:
            return error(f"{reason}", _UNFIT, link="setup")
        except Waits as reason:
            return blocked(f"waits for {reason}, which failed")
        except Unsupported as reason:
            if check.name == FIRST:
                return error(f"not even nine particles: {reason}", _UNFIT)
            return skipped(f"the solver does not support this case: {reason}")
        except Ends as early:
            found: Result = early.args[0]
            return found
        except Crash as reason:
            if check.may_refuse and _is_on_purpose(reason):
                return inconclusive(f"the solver stopped by itself: {reason}")
            remedy = "Read the exception; run the same case under a debugger."
            return error(f"{check.summary} {reason}", remedy)
        except Hang as reason:
            self._hung = check.name
            remedy = "Look for a loop without an end; cells of an infinite or NaN position are one."
            return error(f"{reason}", remedy)
        except TooSlow:
            return inconclusive(f"not done within {CHECK_LIMIT:.0f} s: the solver is too slow")
        except Exception as reason:
            # an experiment that a solver's numbers lead astray must not end in a traceback
            if check.name == FIRST:
                return error(f"{reason!r:.200}", _UNFIT)
            kind = "" if isinstance(reason, ValueError) else f"{type(reason).__name__}: "
            return inconclusive(f"the measured numbers could not be used: {kind}{reason}"[:300])


def _is_on_purpose(error: Crash) -> bool:
    """Return whether a solver raised an error on purpose, and not because of a NaN."""
    trace = traceback.extract_tb(error.__cause__.__traceback__ if error.__cause__ else None)
    line = (trace[-1].line or "") if trace else ""
    text = f"{error.__cause__}".lower()
    return line.startswith(("raise", "assert")) and not any(w in text for w in ("nan", "finite"))


def _waits_for(check: Check) -> Collection[str]:
    """Return the names of the checks that have to be done before."""
    names = list(CHECKS)
    return names[: names.index(check.name)] if check.last else check.needs


def resolve(make: Factory | str) -> tuple[str, Factory]:
    """Return the name of a factory and the factory itself.

    make: a function, "module:factory", or "folder/file.py:factory", which is loaded by itself, so
    that two versions of one file can be compared.
    Raises ValueError where there is none, and ImportError where the module can't be imported.
    """
    if not isinstance(make, str):
        if not callable(make):
            raise ValueError(f"make: expected a function or 'module:factory', got {make!r}")
        name = getattr(make, "__name__", type(make).__name__)
        return f"{getattr(make, '__module__', '')}:{name}", make
    module, _, name = make.rpartition(":")
    if not (module and name):
        raise ValueError(f"make: expected a function or 'module:factory', got {make!r}")
    found = getattr(_load(module), name, None)
    if not callable(found):
        raise ValueError(f"make: {module} has no function {name!r}")
    return make, found


def _load(module: str) -> ModuleType:
    try:
        return _load_file(Path(module)) if module.endswith(".py") else import_module(module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ImportError) and error.name == module:
            raise
        raise ValueError(
            f"make: importing {module} raised {type(error).__name__}: {error}"
        ) from None


def _load_file(path: Path) -> ModuleType:
    path = path.resolve()
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    # a name of its own: two versions of a file must not share one entry of sys.modules
    spec = importlib.util.spec_from_file_location(f"doctor_{path.stem}_{abs(hash(path))}", path)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[loaded.__name__] = loaded
    if str(path.parent) not in sys.path:
        # for what stands beside it
        sys.path.append(str(path.parent))
    spec.loader.exec_module(loaded)
    return loaded


def check_solver(
    make: Factory | str,
    skip: Collection[str] = (),
    expected_failed_checks: Mapping[str, str] = MappingProxyType({}),
    seed: int = 0,
    callback: Callable[[Result], None] | None = None,
) -> Diagnosis:
    """Examine a solver and return what was found.

    make: a function of a `Case` that returns a solver, or "module:factory"; skip: names of checks
    to leave out; expected_failed_checks: reasons by check: where such a check fails, its status is
    "xfail"; seed: of the random arrangements; callback: is given each result as it comes.

    Whatever the solver does ends in a result, not in an exception. A hang does not, outside of the
    main thread and in compiled code that never returns. Raises ValueError for unknown names of
    checks and for a factory that is none, ImportError if its module can't be imported.
    """
    checkup = Checkup(make, skip, expected_failed_checks, seed)
    for name in CHECKS:
        result = checkup.result(name)
        if callback:
            callback(result)
    return Diagnosis(tuple(checkup.results.values()), checkup.name)
