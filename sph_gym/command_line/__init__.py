"""The command line: `sph-gym COMMAND`, also as `python -m sph_gym COMMAND`."""

import os
import sys
from contextlib import nullcontext, redirect_stdout
from typing import Any

from sph_gym.command_line import (
    agents,
    completion,
    doctor,
    environments,
    recommend,
    run,
    study,
)
from sph_gym.command_line.outcome import Outcome, check_place, write_json
from sph_gym.command_line.parser import FAILED, WRONG, Parser
from sph_gym.provenance import VERSION

# Exit statuses besides those of `parser`: that of Ctrl-C and of SIGPIPE in a shell.
INTERRUPTED, PIPE_CLOSED = 130, 141
COMMANDS = (run, doctor, study, recommend, environments, agents, completion)


def main(arguments: list[str] | None = None) -> int:
    """Carry out a command and return its exit status; arguments: by default of this process."""
    try:
        try:
            return _carry_out(arguments)
        except SystemExit:
            # argparse has printed a help, which may still be on its way
            _flush()
            raise
    except BrokenPipeError:
        # whoever read the output has enough of it, as `head` has: no fault, and nothing to say
        _point_to_nowhere()
        return PIPE_CLOSED


def make_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(
        examples=(
            ("run drop_impact --window", "watch a scene"),
            ("docs", "list the environments"),
            ("doctor --solver mine.py:make", "find the fault of your own solver"),
            ("run --help", "the options of a command, with more examples"),
        ),
        prog="sph-gym",
        description="A 2D SPH fluid solver, and environments in which an agent tunes it.",
        epilog=f"exit status: 0 done, {FAILED} done and the answer is bad (blown up, broken, a "
        f"bound missed), {WRONG} wrong use, {INTERRUPTED} Ctrl-C",
    )
    parser.add_argument("--version", action="version", version=f"sph_gym {VERSION}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    return parser


def _carry_out(arguments: list[str] | None) -> int:
    """Carry out a command, and return its exit status when all it printed is on its way."""
    parser = make_parser()
    try:
        options = parser.parse_args(arguments)
        parser = getattr(options, "parser", parser)
        # not before: numba takes long to import, and a help needs none
        from sph_gym.solver.jit import announce_compilation

        announce_compilation()
        status = _outcome(options).status
        _flush()
        return status
    except BrokenPipeError:
        raise
    except (ValueError, ImportError, OSError, MemoryError, RuntimeError) as error:
        print(f"sph_gym: {parser.by_option(_words(error))}", file=sys.stderr)
        return WRONG
    except KeyboardInterrupt:
        print("sph_gym: interrupted", file=sys.stderr)
        return INTERRUPTED


def _words(error: Exception) -> str:
    """Return what an error says, without the number that the system has for it."""
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return str(error)


def _outcome(options: Any) -> Outcome:
    """Carry out a command and write its outcome where --json says."""
    path = getattr(options, "json", None)
    if path:
        check_place(path)
    # what a program reads from the standard output must be nothing but JSON
    aside = redirect_stdout(sys.stderr) if path == "-" else nullcontext()
    with aside:
        outcome: Outcome = options.function(options)
    if path:
        write_json(path, outcome.data)
    return outcome


def _flush() -> None:
    """Send what was printed on its way, if there is anywhere to go."""
    if sys.stdout is not None:
        sys.stdout.flush()


def _point_to_nowhere() -> None:
    """Send what is still to be written to nowhere: Python flushes once more when it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, sys.stdout.fileno())
    except (OSError, ValueError):
        # captured or closed: there is nothing behind it that could complain
        pass
    finally:
        os.close(nowhere)
