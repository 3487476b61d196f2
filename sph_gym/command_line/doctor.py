"""`sph-gym doctor`: find the broken link of a solver."""

import argparse
from typing import Any

from sph_gym import scenes
from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import JSON_HELP, add_command, completed


def add(commands: Any) -> None:
    """Add the command to a parser."""
    doctor = add_command(
        commands,
        "doctor",
        _doctor,
        help="find the broken link of a solver: this one, your own, or a recording",
        description="Run the checks of docs/playbook.md. Exit status: 0 healthy, 1 broken (the "
        "last line names the link and the remedy), 2 wrong use.",
        examples=(
            ("doctor", "this solver"),
            ("doctor --solver mine.py:make --json -", "your own, for a program"),
            ("doctor --recording run.h5", "frames of any solver"),
            ("doctor compare mine.py:make plain", "two solvers, link by link"),
        ),
    )
    add = doctor.add_argument
    text = "compare A B: two solvers on the same cases; each is MODULE:FACTORY, FILE.py:FACTORY, "
    add("pair", nargs="*", metavar="compare A B", help=text + "grid, brute, float32 or plain")
    add(
        "--solver",
        metavar="MODULE:FACTORY",
        help="your own solver, by the function that makes it; also FILE.py:FACTORY",
    )
    scene = add("--scene", help="this solver, with the settings of one of its scenes")
    completed(scene, scenes.names())
    text = "frames of any solver: .npz, .h5, .hdf5, .pvd, .vtk, .vtu, .csv, or their folder"
    add("--recording", metavar="PATH", help=text)
    text = "a solver with this fault; all: every fault and the link that is found"
    add("--fault", metavar="NAME", help=text)
    add(
        "--skip",
        nargs="+",
        default=[],
        metavar="CHECK",
        help="names of checks to leave out; --list shows all",
    )
    add("--seed", type=int, default=0, help="of the random arrangements")
    add("--json", metavar="PATH", help=JSON_HELP)
    add("--html", default="", metavar="PATH", help="write it there as a page")
    add("--list", action="store_true", help="what the checks do, and the faults")


def _doctor(options: argparse.Namespace) -> Outcome:
    from sph_gym.doctor.command import ExaminationRequest, carry_out, list_checks

    if options.list:
        print(list_checks())
        return Outcome()
    if options.pair and (len(options.pair) != 3 or options.pair[0] != "compare"):
        raise ValueError(f"doctor: expected `compare A B`, got {' '.join(options.pair)}")
    if options.fault == "all" and options.json:
        raise ValueError("--fault all: expected no --json beside it")
    names = ("solver", "scene", "recording", "fault", "skip", "seed", "html")
    chosen = {name: getattr(options, name) for name in names}
    status, diagnosis = carry_out(ExaminationRequest(pair=options.pair[1:] or None, **chosen))
    return Outcome(status, None if diagnosis is None else diagnosis.to_dict())
