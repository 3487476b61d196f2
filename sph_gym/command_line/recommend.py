"""`sph-gym recommend`: settings of a scene for an error or a time."""

import argparse
from pathlib import Path
from typing import Any

from sph_gym import scenes
from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import (
    ASSIGNMENTS,
    JSON_HELP,
    add_command,
    assignment,
    completed,
)


def add(commands: Any) -> None:
    """Add the command to a parser."""
    recommend = add_command(
        commands,
        "recommend",
        _recommend,
        help="settings for an error or a time; without either, what is known",
        examples=(
            ("recommend elliptical_drop", "what is known of a scene"),
            ("recommend elliptical_drop --error 1%", "the cheapest settings for 1 % of error"),
            ("recommend taylor_green --budget 10s --json -", "the best of ten seconds, as JSON"),
        ),
    )
    add = recommend.add_argument
    completed(add("scene", help="one that `study accuracy` has measured"), scenes.names())
    wanted = recommend.add_mutually_exclusive_group()
    wanted.add_argument("--error", metavar="SHARE", help="such as 0.01 or 1%%")
    text = "processor time after compilation: 10s, 2min"
    wanted.add_argument("--budget", metavar="TIME", help=text)
    add("--set", **ASSIGNMENTS, metavar="NAME=VALUE", help="scene arguments but for dx")
    add("--table", type=Path, help="lines.csv of a study of your own")
    add("--json", metavar="PATH", help=JSON_HELP)


def _recommend(options: argparse.Namespace) -> Outcome:
    from sph_gym import recommend

    if options.error is None and options.budget is None:
        given = [f"--{name}" for name in ("set", "table", "json") if getattr(options, name)]
        if given:
            raise ValueError(
                f"{', '.join(given)}: expected --error or --budget beside it, got neither"
            )
        print(*recommend.summarize(options.scene), sep="\n")
        return Outcome()
    advice = recommend.advise(
        options.scene,
        None if options.error is None else recommend.parse_error(options.error),
        None if options.budget is None else recommend.parse_budget(options.budget),
        dict(map(assignment, options.set)),
        options.table,
    )
    for name, value in recommend.describe(advice):
        print(f"{name + ':':<16}{value}")
    print("", recommend.program(advice), sep="\n")
    return Outcome(data=recommend.to_dict(advice))
