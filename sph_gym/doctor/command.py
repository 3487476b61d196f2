"""Carry out `sph-gym doctor`: examine, print as it goes, write pages."""

import faulthandler
import sys
import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from sph_gym.doctor.checkup import check_solver
from sph_gym.doctor.comparison import compare
from sph_gym.doctor.diagnosis import Diagnosis, Result, row
from sph_gym.doctor.registry import CHECKS
from sph_gym.doctor.report import write_page
from sph_gym.doctor.subject import Factory
from sph_gym.extras import progress_bar, say
from sph_gym.solver.checks import known

WIDTH = 100
# An examination may take so long [s] at most.
LONGEST = 1800


class ExaminationRequest(NamedTuple):
    """A request to examine exactly one of the first five, or, without any, this solver.

    solver: "module:factory"; scene: a name; recording: a path; fault: a name of `faults.FAULTS`,
    or "all"; pair: two solvers to compare; skip: checks to leave out; html: where to write the
    diagnosis as a page, "" for nowhere; None: not asked for.
    """

    solver: str | None = None
    scene: str | None = None
    recording: str | None = None
    fault: str | None = None
    pair: Sequence[str] | None = None
    skip: Sequence[str] = ()
    seed: int = 0
    html: str = ""


def list_checks() -> str:
    """Return the checks by name, link and what they do, then the faults, as text."""
    from sph_gym.doctor.faults import FAULTS

    lines = ["checks:"]
    for check in CHECKS.values():
        step = f"step {check.step}" if check.step else ""
        lines.append(f"{check.link:<12}{check.name:<26}{step:<8}{check.summary}")
    lines += ["", "faults:"]
    lines += [f"{fault.link:<12}{name:<34}{fault.what}" for name, fault in FAULTS.items()]
    return "\n".join(lines)


def carry_out(request: ExaminationRequest) -> tuple[int, Diagnosis | None]:
    """Examine what is asked for and print the outcome.

    Returns the exit status, 0 healthy, 1 not; and the diagnosis, None for all faults at once.
    Raises ValueError for unknown names, and if more than one thing is to be examined.
    """
    if "" not in sys.path:
        # modules of the user's folder, as `python -m` finds them
        sys.path.insert(0, "")
    asked = [name for name in ("solver", "scene", "recording", "fault", "pair") if
             getattr(request, name) is not None]  # fmt: skip
    if len(asked) > 1:
        raise ValueError(f"doctor: expected one of {', '.join(asked)}, got {len(asked)}")
    if request.skip and {"recording", "pair"} & set(asked):
        raise ValueError(f"--skip: expected no --{asked[0]} beside it")
    if request.fault == "all" and (request.html or request.skip):
        raise ValueError("--fault all: expected no --html or --skip beside it")
    if request.fault == "all":
        from sph_gym.doctor.matrix import measure, show

        return show(measure()), None
    diagnosis = _examined(request)
    if request.html:
        write_page(diagnosis, request.html)
    print(_ending(diagnosis))
    return (0 if diagnosis.ok else 1), diagnosis


def _examined(request: ExaminationRequest) -> Diagnosis:
    """Examine what is asked for, and print each result."""
    if request.recording is not None:
        from sph_gym.doctor.recordings import check_recording

        diagnosis = check_recording(request.recording)
    elif request.pair is not None:
        from sph_gym.doctor.here import short_name

        a, b = (short_name(each) for each in request.pair)
        diagnosis = compare(a, b, request.seed)
    else:
        return _of_solver(request)
    print(*map(row, diagnosis.results), sep="\n")
    return diagnosis


def _of_solver(request: ExaminationRequest) -> Diagnosis:
    make = _factory(request)
    if request.solver is not None:
        # the last resort for compiled code that never returns: where it hangs, and an end
        faulthandler.dump_traceback_later(LONGEST, exit=True, file=sys.__stderr__ or sys.stderr)
    try:
        with progress_bar(len(CHECKS), unit="check") as bar:

            def show(result: Result) -> None:
                say(row(result))
                bar.update()

            return check_solver(make, request.skip, seed=request.seed, callback=show)
    finally:
        faulthandler.cancel_dump_traceback_later()


def _factory(request: ExaminationRequest) -> Factory | str:
    """Return the solver that is asked for, by default this package's own."""
    if request.solver is not None:
        return request.solver
    if request.fault is not None:
        from sph_gym.doctor.faults import FAULTS

        return FAULTS[known("fault", request.fault, FAULTS)].make
    from sph_gym.doctor.here import here, of_scene

    return here() if request.scene is None else of_scene(request.scene)


def _ending(diagnosis: Diagnosis) -> str:
    """Return what stands below the rows: each broken link in full, and the verdict last."""
    broken = [each for each in diagnosis.results if each.broken]
    parts = [_paragraph(each) for each in broken]
    parts += [f"note: {note}" for note in diagnosis.notes]
    parts.append(diagnosis.counts)
    return "\n".join(["", *parts, diagnosis.verdict])


def _paragraph(result: Result) -> str:
    head = f"{result.link}: {result.check}" + (f" (step {result.step})" if result.step else "")
    lines = [head]
    for text in (result.message, result.remedy):
        lines += textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="  ")
    return "\n".join([*lines, ""])
