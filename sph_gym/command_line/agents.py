"""`sph-gym agents`: programs that train and compare agents, which a clone of the project has."""

import ast
import runpy
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import add_command
from sph_gym.solver.checks import known

# A file that tells the project's `agents` from another package of that name.
LANDMARK = "compare.py"


def add(commands: Any) -> None:
    """Add the command to a parser."""
    parser = add_command(
        commands,
        "agents",
        _agents,
        help="train, compare and record agents: the programs of agents/ in a clone",
        examples=(
            ("agents", "list the programs"),
            ("agents compare --scene dam_break", "all agents on unseen flows"),
            ("agents ppo --help", "options of a program"),
        ),
    )
    parser.add_argument("program", nargs="?", help="its name; without: a list")
    parser.add_argument("words", nargs="...", help="its own arguments")


def _agents(options: Any) -> Outcome:
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        # as `python -m` does: programs come from the folder of the clone
        sys.path.insert(0, str(Path.cwd()))
    programs = _programs()
    if options.program is None:
        width = max(map(len, programs))
        print(*(f"{name:<{width}}  {text}" for name, text in programs.items()), sep="\n")
        return Outcome()
    name = known("agents", options.program, programs)
    sys.argv = [name, *options.words]
    runpy.run_module(f"agents.{name}", run_name="__main__", alter_sys=True)
    return Outcome()


def _programs() -> dict[str, str]:
    """Return the programs by name, and what each is for. Raises ImportError if there are none."""
    spec = find_spec("agents")
    for place in (spec and spec.submodule_search_locations) or ():
        folder = Path(place)
        if (folder / LANDMARK).is_file():
            return dict(filter(None, map(_program, sorted(folder.glob("*.py")))))
    raise ImportError(
        "agents: expected to run in a clone of the project, whose folder agents/ is no part of "
        "the installed package"
    )


def _program(path: Path) -> tuple[str, str] | None:
    """Return the name of a program and its summary; None for modules that are no programs."""
    text = path.read_text(encoding="utf-8")
    if '\nif __name__ == "__main__"' not in text:
        return None
    summary = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
    return path.stem, summary.partition(": `")[0].rstrip(".")
