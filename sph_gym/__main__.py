"""Command line: `python -m sph_gym run | study | recommend | docs | manifest`."""

import argparse
import sys
from pathlib import Path
from typing import Any

from sph_gym import scenes

STUDIES = (
    "startup", "validation", "throughput", "effects", "headroom", "exploits", "soak", "stability",
    "accuracy",
)  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Parse and carry out; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.function(options))
    except (ValueError, ImportError, OSError, MemoryError) as error:
        print(f"sph_gym: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("sph_gym: interrupted", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m sph_gym", description=__doc__)
    commands = parser.add_subparsers(
        required=True, metavar="run | study | recommend | docs | manifest"
    )
    run = commands.add_parser("run", help="run a scene; log, watch or film it")
    run.set_defaults(function=_run)
    run.add_argument("scene", help=", ".join(scenes.names()))
    run.add_argument(
        "--set", nargs="*", action="extend", default=[], metavar="NAME=VALUE",
        help="scene arguments",
    )  # fmt: skip
    run.add_argument("--seconds", type=float, help="physical time, by default the scene's own")
    run.add_argument("--dt", type=float, help="time step [s]")
    run.add_argument("--stiffness", type=float, help="Tait's B [Pa]")
    run.add_argument("--xsph", type=float, help="XSPH epsilon")
    run.add_argument("--dtype", default="float64", help="float64 or float32")
    run.add_argument("--neighbors", default="grid", help="grid, or brute: is the search to blame?")
    run.add_argument("--log", type=int, default=3, metavar="N", help="particles to log, 0: none")
    run.add_argument("--color", default="speed", help="speed, density, pressure or neighbors")
    run.add_argument("--arrows", action="store_true", help="draw forces as arrows")
    show = run.add_mutually_exclusive_group()
    show.add_argument("--window", action="store_true", help="watch it; keys are shown there")
    show.add_argument("--video", metavar="PATH", help="film it: .mp4 or .gif")
    run.add_argument("--save", metavar="PATH", help="record it: .npz, .h5, or .pvd for ParaView")
    study = commands.add_parser("study", help="measure something and print a table")
    study.set_defaults(function=_study)
    study.add_argument("name", help=", ".join(STUDIES))
    study.add_argument("--quick", action="store_true", help="coarser and sooner")
    study.add_argument(
        "--peers", metavar="PATH", help="throughput, accuracy: folder of a script to race against"
    )
    study.add_argument(
        "--peers-python", metavar="PYTHON", default=sys.executable, help="what runs that script"
    )
    study.add_argument(
        "--scenes", nargs="+", metavar="SCENE", help="validation, accuracy: only these scenes"
    )
    study.add_argument(
        "--again", action="store_true",
        help="validation: anew what was done before; accuracy: its times",
    )  # fmt: skip
    study.add_argument(
        "--point", metavar="KEY", help="accuracy: run one kept point again; a hash of points.csv"
    )
    study.add_argument("--output", default="runs/studies", help="folder of the CSV file")
    _add_recommend(commands)
    docs = commands.add_parser("docs", help="everything about an environment, as Markdown")
    docs.set_defaults(function=_docs)
    docs.add_argument("id", nargs="?", help="such as sph_gym/DamBreak-v0; without: a list")
    docs.add_argument("--output", metavar="FOLDER", help="write pages there, by default of all ids")
    manifest = commands.add_parser(
        "manifest", help="draw the instances anew and compute their references (an hour)"
    )
    manifest.set_defaults(function=_manifest)
    manifest.add_argument("--scenes", nargs="+", metavar="SCENE", help="only these environments")
    manifest.add_argument("--output", metavar="FOLDER", help="by default, where sph_gym reads them")
    manifest.add_argument(
        "--redefine", action="store_true",
        help="let ids mean other flows than those of the same version did",
    )  # fmt: skip
    manifest.add_argument(
        "--stamp", action="store_true", help="only write the digests of what is there anew"
    )
    return parser


def _add_recommend(commands: Any) -> None:
    recommend = commands.add_parser(
        "recommend", help="settings for an error or a time; without either, what is known"
    )
    recommend.set_defaults(function=_recommend)
    recommend.add_argument("scene", help="one that `study accuracy` has measured")
    wanted = recommend.add_mutually_exclusive_group()
    wanted.add_argument("--error", metavar="SHARE", help="such as 0.01 or 1%%")
    wanted.add_argument(
        "--budget", metavar="TIME", help="processor time after compilation: 10s, 2min"
    )
    recommend.add_argument(
        "--set", nargs="*", action="extend", default=[], metavar="NAME=VALUE",
        help="scene arguments but for dx",
    )  # fmt: skip
    recommend.add_argument("--table", type=Path, help="lines.csv of a study of your own")


def _run(options: argparse.Namespace) -> int:
    from sph_gym.run import run

    changes = {name: getattr(options, name) for name in ("dt", "stiffness", "xsph")}
    return run(
        _scene(options.scene, options.set),
        seconds=options.seconds,
        controls={name: value for name, value in changes.items() if value is not None},
        dtype=options.dtype,
        neighbors=options.neighbors,
        n_logged=options.log,
        color=options.color,
        arrows=options.arrows,
        window=options.window,
        video=options.video,
        save=options.save,
    )


def _scene(name: str, assignments: list[str]) -> scenes.Scene:
    try:
        return scenes.make(name, **dict(map(_assignment, assignments)))
    except ArithmeticError as error:
        raise ValueError(
            f"--set: expected numbers of usual sizes, got {' '.join(assignments)}: {error}"
        ) from None


def _assignment(text: str) -> tuple[str, Any]:
    """A name, and a value that is a number if it can be; what it may be, the scene says."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise ValueError(f"--set: expected NAME=VALUE, got {text!r}")
    try:
        return name, int(value) if value.isdecimal() else float(value)
    except ValueError:
        return name, value


def _study(options: argparse.Namespace) -> int:
    from sph_gym.studies import Peers, run_study

    if options.point is not None:
        if options.name != "accuracy":
            raise ValueError(f"--point: only the study accuracy has it, not {options.name}")
        from sph_gym.studies.accuracy import rerun

        return rerun(options.point, Path(options.output) / "accuracy")
    peers = Peers(Path(options.peers), options.peers_python) if options.peers else None
    return run_study(
        options.name, options.quick, options.output, peers, options.scenes, options.again
    )


def _recommend(options: argparse.Namespace) -> int:
    from sph_gym import recommend

    if options.error is None and options.budget is None:
        if options.set or options.table:
            raise ValueError("--set, --table: expected --error or --budget beside it, got neither")
        print(*recommend.summarize(options.scene), sep="\n")
        return 0
    advice = recommend.advise(
        options.scene,
        None if options.error is None else recommend.parse_error(options.error),
        None if options.budget is None else recommend.parse_budget(options.budget),
        dict(map(_assignment, options.set)),
        options.table,
    )
    for name, value in recommend.describe(advice):
        print(f"{name + ':':<16}{value}")
    print("", recommend.program(advice), sep="\n")
    return 0


def _docs(options: argparse.Namespace) -> int:
    from sph_gym.env import documentation

    chosen = [options.id] if options.id else None
    if options.output:
        print(*documentation.write(options.output, chosen), sep="\n")
    else:
        print(documentation.page(options.id) if options.id else documentation.index())
    return 0


def _manifest(options: argparse.Namespace) -> int:
    from sph_gym.env.manifest import FOLDER
    from sph_gym.env.preparation import prepare, stamp

    folder = Path(options.output) if options.output else FOLDER
    if options.stamp:
        print(*stamp(options.scenes, folder), sep="\n")
    else:
        print(*prepare(options.scenes, folder, options.redefine), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
