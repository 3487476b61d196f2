"""`sph-gym completion`: a script that lets the shell complete commands, options and names."""

import argparse
from typing import Any

from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import add_command
from sph_gym.extras import needs_extra

SHELLS = ("bash", "zsh", "tcsh")


def add(commands: Any) -> None:
    """Add the command to a parser."""
    place = "~/.local/share/bash-completion/completions/sph-gym"
    parser = add_command(
        commands,
        "completion",
        _completion,
        help="a script that lets the shell complete commands, options and names",
        examples=((f"completion bash > {place}", "for bash, from the next shell on"),),
    )
    parser.add_argument("shell", choices=SHELLS, help=", ".join(SHELLS), metavar="SHELL")


def _completion(options: argparse.Namespace) -> Outcome:
    from sph_gym.command_line import make_parser

    with needs_extra("completion"):
        import shtab
    parser = make_parser()
    _offer_words(parser)
    print(shtab.complete(parser, shell=options.shell))
    return Outcome()


def _offer_words(parser: argparse.ArgumentParser) -> None:
    """Make choices of the words by which arguments of a parser and its commands are completed."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _offer_words(command)
        elif hasattr(action, "words"):
            action.choices = action.words
