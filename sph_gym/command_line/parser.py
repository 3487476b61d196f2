"""A parser of command lines whose complaints are one line, with the nearest known word."""

import argparse
import re
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, NoReturn

# Exit statuses: the command did its work and the answer is bad; and wrong use.
FAILED, WRONG = 1, 2
ASSIGNMENTS: dict[str, Any] = {"nargs": "*", "action": "extend", "default": []}
JSON_HELP = "write the outcome there, for a program; - for the standard output"


class Parser(argparse.ArgumentParser):
    """An `argparse.ArgumentParser` in the style of this project.

    examples: command lines without the program's name, each with what it does; --help shows them.
    Options can't be shortened, so that a script still means the same when options are added.
    """

    def __init__(self, examples: Sequence[tuple[str, str]] = (), **named: Any) -> None:
        style: dict[str, Any] = {
            "formatter_class": argparse.RawDescriptionHelpFormatter,
            "allow_abbrev": False,
        }
        super().__init__(**(style | named))
        self.examples = [f"{self.prog.split()[0]} {words}" for words, _ in examples]
        if examples:
            width = max(map(len, self.examples))
            texts = [text for _, text in examples]
            lines = [f"  {e:<{width}}  # {t}" for e, t in zip(self.examples, texts, strict=True)]
            self.epilog = "\n".join(["examples:", *lines, *filter(None, ["", self.epilog])])

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Return the options of a command line; unknown ones end the program with a message."""
        options, rest = self.parse_known_args(args, namespace)
        if rest:
            chosen = getattr(options, "parser", self)
            words = [word for word in rest if word.startswith("-")] or rest
            chosen.error(f"{words[0]}: no such argument{chosen.suggest(words[0])}")
        return options

    def error(self, message: str) -> NoReturn:
        """Print what is wrong in one line, in the words of `solver.checks`, and exit."""
        hint = ""
        if wrong := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
            hint = self.suggest(wrong[1])
            choices = wrong[2].replace("'", "")
            message = f"{message[: wrong.start()]}expected one of {choices}, got {wrong[1]!r}"
        message = re.sub(r"invalid (int|float) value: ", "expected a number, got ", message)
        message = message.removeprefix("argument ")
        name = self.prog if self.prog.startswith("python") else "sph_gym"
        self.exit(WRONG, f"{name}: {message}{hint}; see {self.prog} --help\n")

    def by_option(self, message: str) -> str:
        """Return a message with the option in place of the argument of the package that it names.

        It begins with the argument, as messages of `solver.checks` do: "controls.dt: expected ...".
        """
        name, colon, rest = message.partition(":")
        option = f"--{name.rpartition('.')[2].replace('_', '-')}"
        is_option = bool(colon) and option in self._option_string_actions
        return f"{option}:{rest}" if is_option else message

    def suggest(self, word: str) -> str:
        """Return a question after the option or command that is nearest to a word, or nothing."""
        known = [*self._option_string_actions]
        for action in self._actions:
            known += action.choices or ()
        near = get_close_matches(word.partition("=")[0], known, n=1)
        return f" (did you mean {near[0]}?)" if near else ""


def add_command(commands: Any, name: str, function: Any, **named: Any) -> Parser:
    """Add a command and return its parser; function: takes the options, returns an `Outcome`."""
    parser: Parser = commands.add_parser(name, **named)
    parser.set_defaults(function=function, parser=parser)
    return parser


def completed(action: argparse.Action, words: Sequence[str]) -> None:
    """Let the shell complete an argument by words; others are still taken."""
    action.words = words  # type: ignore[attr-defined]


def assignment(text: str) -> tuple[str, Any]:
    """Return the name and value of NAME=VALUE, the value a number if it can be.

    Raises ValueError for other texts.
    """
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise ValueError(f"--set: expected NAME=VALUE, got {text!r}")
    try:
        return name, int(value) if value.isdecimal() else float(value)
    except ValueError:
        return name, value
