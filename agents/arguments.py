"""Command lines from typed arguments: the dataclass on top of a program becomes its parser."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields
from itertools import pairwise
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from sph_gym.command_line.parser import WRONG, Parser
from sph_gym.studies.backends import Backend
from sph_gym.studies.jobs import INTERRUPTED

Arguments = TypeVar("Arguments")
# Placeholders of values in --help.
PLACEHOLDERS = {str: "NAME", Path: "PATH", int: "N", float: "X"}
SCENE_HELP = (
    'scene of the environment; "benchmark": all six at once, "benchmark-long_fall": all but one'
)


def option(text: str, default: Any = MISSING) -> Any:
    """Return a field of a dataclass of arguments; `text` is what --help says of it."""
    return field(default=default, metadata={"help": text})


@dataclass(kw_only=True)
class BackendArgs:
    """Arguments of every program that makes many runs: where they run."""

    backend: str = option("where runs go: local, ray or dask", "local")
    address: str | None = option(
        "of a running cluster of Ray or Dask; without, one is started on this machine", None
    )
    workers: int | None = option("side by side on this machine; by default one a processor", None)

    def where(self) -> Backend:
        """Return the backend. Raises ValueError for an unknown name and for wrong options."""
        return Backend(self.backend, self.address, self.workers).checked()


def program() -> str:
    """Return how this program was called: as a module, or by `sph-gym agents`."""
    name = Path(sys.argv[0]).stem
    # `sph-gym agents` leaves the file of the module in sys.argv, as `python -m` does
    by_command = ("agents", name) in pairwise(sys.orig_argv)
    return f"sph-gym agents {name}" if by_command else f"python -m agents.{name}"


def command() -> str:
    """Return the command line of this process, to be told where its results are."""
    return " ".join([program(), *sys.argv[1:]])


def make_parser(kind: type[Any], description: str | None) -> Parser:
    """Return the parser of a program: field n_envs of `kind` is option --n-envs.

    kind: a dataclass whose fields are `option`s of type T, bool, tuple[T, ...], tuple[T, T, T]
    or T | None, where T reads one word.
    """
    parser = Parser(
        prog=program(),
        description=description,
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    hints = get_type_hints(kind)
    for part in fields(kind):
        name, default = part.name.replace("_", "-"), part.default
        text, shown = part.metadata["help"], default
        if isinstance(default, tuple) and default:
            # argparse would print it as Python writes it
            text += f" (default: {' '.join(map(str, default))})"
        if isinstance(default, tuple) or default in (MISSING, None):
            # it comes from the dataclass
            shown = argparse.SUPPRESS
        parser.add_argument(
            f"--{name}",
            required=default is MISSING,
            default=shown,
            help=text,
            **_reading(hints[part.name]),
        )
    return parser


def parse(parser: Parser, kind: type[Arguments], words: list[str] | None = None) -> Arguments:
    """Return the arguments of the command line as a `kind`, whose parser reads them.

    words: by default those of this process. Exits with a message for unknown options and wrong
    values.
    """
    given = vars(parser.parse_args(words))
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in given.items()})


def launch(
    main: Callable[[Arguments], object], kind: type[Arguments], description: str | None
) -> None:
    """Run a program with the arguments of the command line.

    What is wrong with them, or with a file, is told in one line, by the name of the option; the
    exit status is 2 then. Ctrl-C ends it without a traceback, also where a program does nothing
    about it.
    """
    parser = make_parser(kind, description)
    try:
        main(parse(parser, kind))
    except (ValueError, ImportError, OSError) as error:
        # `path` is an argument of the package, and no option; the file that it was given follows
        message = parser.by_option(str(error)).removeprefix("path: ")
        print(f"{program()}: {message}", file=sys.stderr)
        raise SystemExit(WRONG) from None
    except KeyboardInterrupt:
        print(f"{program()}: interrupted", file=sys.stderr)
        raise SystemExit(INTERRUPTED) from None


def _reading(hint: Any) -> dict[str, Any]:
    """Return how argparse reads a value of a type."""
    if get_origin(hint) is UnionType:
        hint = get_args(hint)[0]
    if hint is bool:
        return {"action": argparse.BooleanOptionalAction}
    if get_origin(hint) is tuple:
        kinds = get_args(hint)
        return _reading(kinds[0]) | {"nargs": "+" if Ellipsis in kinds else len(kinds)}
    return {"type": hint, "metavar": PLACEHOLDERS[hint]}
