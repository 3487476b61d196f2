"""`sph-gym study`: measure something and print a table."""

import argparse
import sys
from pathlib import Path
from typing import Any

from sph_gym import scenes
from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import add_command, completed
from sph_gym.studies import BACKENDS, STUDIES, run_study, that_take


def add(commands: Any) -> None:
    """Add the command to a parser."""
    study = add_command(
        commands,
        "study",
        _study,
        help="measure something and print a table",
        examples=(
            ("study validation --scenes poiseuille", "one flow against its exact solution"),
            ("study throughput --quick", "the speed of the solver, coarsely"),
        ),
    )
    add = study.add_argument
    peers, by_scene, anywhere = (", ".join(that_take(o)) for o in ("peers", "chosen", "backend"))
    completed(add("name", help=", ".join(STUDIES)), [*STUDIES])
    add("--quick", action="store_true", help="coarser and sooner")
    add("--peers", metavar="PATH", help=f"{peers}: folder of a script to race against")
    add("--peers-python", metavar="PYTHON", default=sys.executable, help="what runs that script")
    only = add("--scenes", nargs="+", metavar="SCENE", help=f"{by_scene}: only these")
    completed(only, scenes.names())
    text = "validation: anew what was done before; accuracy: its times"
    add("--again", action="store_true", help=text)
    text = "accuracy: run one kept point again; a hash of points.csv"
    add("--point", metavar="KEY", help=text)
    add("--output", default="runs/studies", help="folder of the CSV file")
    text = f"{anywhere}: where runs go: {', '.join(BACKENDS)}"
    completed(add("--backend", help=text), BACKENDS)
    add("--address", help="of a running cluster of Ray or Dask")
    add("--workers", type=int, help="side by side on this machine; by default one a processor")


def _study(options: argparse.Namespace) -> Outcome:
    from sph_gym.studies.backends import Backend
    from sph_gym.studies.peers import Peers

    if options.point is not None:
        if options.name != "accuracy":
            raise ValueError(f"--point: only the study accuracy has it, not {options.name}")
        from sph_gym.studies.accuracy import rerun

        return Outcome(rerun(options.point, Path(options.output) / "accuracy"))
    peers = Peers(Path(options.peers), options.peers_python) if options.peers else None
    where = {"name": options.backend, "address": options.address, "workers": options.workers}
    given = {option: value for option, value in where.items() if value is not None}
    return Outcome(
        run_study(
            options.name,
            options.quick,
            options.output,
            peers,
            options.scenes,
            options.again,
            Backend(**given) if given else None,
        )
    )
