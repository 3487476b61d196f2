"""Command line: `python -m sph_gym COMMAND`, one of those that `--help` lists."""

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from sph_gym import scenes
from sph_gym.solver.jit import announce_compilation

# Exit status of a command whose output nobody reads any more: that of SIGPIPE in a shell.
PIPE_CLOSED = 141
# Files that `run --window` opens.
RECORDINGS = (".npz", ".h5", ".hdf5", ".pvd")
ASSIGNMENTS: dict[str, Any] = {"nargs": "*", "action": "extend", "default": []}
# Known here too, since it takes long to import the studies.
STUDIES = (
    "startup",
    "validation",
    "throughput",
    "effects",
    "headroom",
    "exploits",
    "soak",
    "stability",
    "accuracy",
    "doctor",
)


def main(arguments: list[str] | None = None) -> int:
    """Carry out a command and return its exit status."""
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


def _carry_out(arguments: list[str] | None) -> int:
    """Carry out a command, and return its exit status when all it printed is on its way."""
    options = _parser().parse_args(arguments)
    announce_compilation()
    try:
        status = int(options.function(options))
        _flush()
        return status
    except BrokenPipeError:
        raise
    except (ValueError, ImportError, OSError, MemoryError) as error:
        print(f"sph_gym: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("sph_gym: interrupted", file=sys.stderr)
        return 130


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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m sph_gym", description=__doc__)
    names = "run | doctor | study | recommend | docs | manifest | dataset"
    commands = parser.add_subparsers(required=True, metavar=names)
    for add in (
        _add_run,
        _add_doctor,
        _add_study,
        _add_recommend,
        _add_docs,
        _add_manifest,
        _add_dataset,
    ):
        add(commands)
    return parser


def _add_run(commands: Any) -> None:
    run = commands.add_parser("run", help="run a scene, or open a recording; log, watch or film it")
    run.set_defaults(function=_run)
    add = run.add_argument
    text = ", ".join(scenes.names()) + "; or with --window a recording that --save or doctor.watch "
    add("scene", help=text + f"wrote: {', '.join(RECORDINGS)}")
    add("--set", **ASSIGNMENTS, metavar="NAME=VALUE", help="scene arguments")
    add("--seconds", type=float, help="physical time, by default the scene's own")
    add("--dt", type=float, help="time step [s]")
    add("--stiffness", type=float, help="Tait's B [Pa]")
    add("--xsph", type=float, help="XSPH epsilon")
    add("--dtype", default="float64", help="float64 or float32")
    add("--neighbors", default="grid", help="grid, or brute: is the search to blame?")
    text = "how many particles to log (by default 3, with gauges none), or what of those that "
    text += "--particles names: rho, p, x, v, a, such as rho,p"
    add("--log", metavar="N|NAMES", help=text)
    add("--particles", metavar="I,J,...", help="indices; by default three, spread over the fluid")
    text = "pressure:X,Y velocity:X,Y level:X force:WALLS, named NAME=...; X,Y may be X,Y,RADIUS "
    text += "or X0,Y0,X1,Y1 for a mean; WALLS: particles, left, right, bottom, top, plate0, ..."
    add("--gauge", action="append", default=[], metavar="GAUGE", help=text)
    text = "write the values of gauges and of --log NAMES there, as CSV"
    add("--gauges", "--csv", metavar="PATH", help=text)
    text = "between two rows: 0.002s or 5steps; a bare number counts steps with --log NAMES, else "
    text += "seconds; by default a frame"
    add("--every", metavar="TIME", help=text)
    text = "nan, density, escape: stop at the first such particle and print its neighbourhood"
    add("--break-on", metavar="CONDITIONS", help=text)
    text = "speed, density, density_error, pressure, neighbors, clumping or energy"
    add("--color", default="speed", help=text)
    add("--arrows", action="store_true", help="draw forces as arrows")
    show = run.add_mutually_exclusive_group()
    show.add_argument("--window", action="store_true", help="watch and steer it; ? lists the keys")
    show.add_argument("--video", metavar="PATH", help="film it: .mp4 or .gif")
    add("--save", metavar="PATH", help="record it: .npz, .h5, or .pvd for ParaView")


def _run(options: argparse.Namespace) -> int:
    if Path(options.scene).suffix.lower() in RECORDINGS:
        return _replay(options)
    from sph_gym.run import Every, Readings, run
    from sph_gym.solver.break_on import BreakOn
    from sph_gym.solver.gauges import Gauge
    from sph_gym.solver.simulation import Simulation

    scene = _scene(options.scene, options.set)
    sim = Simulation(scene, dtype=options.dtype, neighbors=options.neighbors)
    changes = {name: getattr(options, name) for name in ("dt", "stiffness", "xsph")}
    given = {name: value for name, value in changes.items() if value is not None}
    sim.controls = sim.controls._replace(**given)
    look = {name: getattr(options, name) for name in ("color", "arrows", "window", "video")}
    if options.window:
        from sph_gym.pilot import pilots
        from sph_gym.run import CONTROLLERS

        look["controllers"] = CONTROLLERS | pilots(scene)
    gauges = [Gauge.parse(text) for text in options.gauge]
    n_logged, log = _logged(options, sim)
    every = options.every
    if every is not None:
        every = Every.parse(every, "s" if log is None else "steps")
    break_on = BreakOn(sim, options.break_on.split(",")) if options.break_on else None
    readings = Readings(sim, gauges, options.gauges, every, log, break_on)
    return run(sim, options.seconds, n_logged, readings, save=options.save, **look)


def _replay(options: argparse.Namespace) -> int:
    """Open a recording in the window. Raises ValueError with options that need a running scene."""
    from sph_gym.run import replay

    looks = ("scene", "window", "color", "arrows", "function")
    defaults = vars(_parser().parse_args(["run", "SCENE"]))
    others = [name for name, value in vars(options).items() if value != defaults[name]]
    others = [f"--{name.replace('_', '-')}" for name in others if name not in looks]
    if not options.window or others:
        given = " ".join(others) or "no --window"
        raise ValueError(
            f"{options.scene}: expected --window, --color and --arrows at most with a recording, "
            f"got {given}"
        )
    return replay(options.scene, color=options.color, arrows=options.arrows)


def _logged(options: argparse.Namespace, sim: Any) -> tuple[int, Any]:
    """Return how many particles to log, and the log of those that are named, if any are."""
    from sph_gym.run import LOGGED, spread
    from sph_gym.solver.particle_log import ParticleLog

    text = options.log
    try:
        count = None if text is None else int(text)
    except ValueError:
        count = None
    if count is not None and options.particles is not None:
        raise ValueError(f"--log: expected names such as rho,p with --particles, got {text}")
    if count is not None:
        return count, None
    if text is None and options.particles is None:
        return 0 if options.gauge else LOGGED, None
    particles = options.particles
    if particles is None:
        particles = ",".join(map(str, spread(sim)))
    return 0, ParticleLog.parse(text or "rho,p", particles)


def _scene(name: str, assignments: list[str]) -> scenes.Scene:
    try:
        return scenes.make(name, **dict(map(_assignment, assignments)))
    except ArithmeticError as error:
        raise ValueError(
            f"--set: expected numbers of usual sizes, got {' '.join(assignments)}: {error}"
        ) from None


def _assignment(text: str) -> tuple[str, Any]:
    """Return a name and its value, a number if it can be; the scene checks both."""
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise ValueError(f"--set: expected NAME=VALUE, got {text!r}")
    try:
        return name, int(value) if value.isdecimal() else float(value)
    except ValueError:
        return name, value


def _add_doctor(commands: Any) -> None:
    doctor = commands.add_parser(
        "doctor",
        help="find the broken link of a solver: this one, your own, or a recording",
        description="Run the checks of docs/playbook.md. Exit status: 0 healthy, 1 broken (the "
        "last line names the link and the remedy), 2 wrong use.",
    )
    doctor.set_defaults(function=_doctor)
    add = doctor.add_argument
    text = "compare A B: two solvers on the same cases; each is MODULE:FACTORY, FILE.py:FACTORY, "
    add("pair", nargs="*", metavar="compare A B", help=text + "grid, brute, float32 or plain")
    add("--solver", metavar="MODULE:FACTORY", help="your own; also FILE.py:FACTORY")
    add("--scene", help="this solver, with the settings of one of its scenes")
    text = "frames of any solver: .npz, .h5, .hdf5, .pvd, .vtk, .vtu, .csv, or their folder"
    add("--recording", metavar="PATH", help=text)
    text = "a solver with this fault; all: every fault and the link that is found"
    add("--fault", metavar="NAME", help=text)
    add("--skip", nargs="+", default=[], metavar="CHECK", help="checks to leave out")
    add("--seed", type=int, default=0, help="of the random arrangements")
    add("--json", default="", metavar="PATH", help="write the diagnosis there")
    add("--html", default="", metavar="PATH", help="write it there as a page")
    add("--list", action="store_true", help="what the checks do, and the faults")


def _doctor(options: argparse.Namespace) -> int:
    from sph_gym.doctor.command import Request, carry_out, list_checks

    if options.list:
        print(list_checks())
        return 0
    if options.pair and (len(options.pair) != 3 or options.pair[0] != "compare"):
        raise ValueError(f"doctor: expected `compare A B`, got {' '.join(options.pair)}")
    names = ("solver", "scene", "recording", "fault", "skip", "seed", "json", "html")
    chosen = {name: getattr(options, name) for name in names}
    return carry_out(Request(pair=options.pair[1:] or None, **chosen))


def _add_study(commands: Any) -> None:
    study = commands.add_parser("study", help="measure something and print a table")
    study.set_defaults(function=_study)
    add = study.add_argument
    add("name", help=", ".join(STUDIES))
    add("--quick", action="store_true", help="coarser and sooner")
    add("--peers", metavar="PATH", help="throughput, accuracy: folder of a script to race against")
    add("--peers-python", metavar="PYTHON", default=sys.executable, help="what runs that script")
    add("--scenes", nargs="+", metavar="SCENE", help="validation, accuracy: only these scenes")
    text = "validation: anew what was done before; accuracy: its times"
    add("--again", action="store_true", help=text)
    text = "accuracy: run one kept point again; a hash of points.csv"
    add("--point", metavar="KEY", help=text)
    add("--output", default="runs/studies", help="folder of the CSV file")
    add("--backend", default="local", help="headroom, exploits: where runs go, local, ray or dask")
    add("--address", help="of a running cluster of Ray or Dask")
    add("--workers", type=int, help="side by side on this machine; by default one a processor")


def _study(options: argparse.Namespace) -> int:
    from sph_gym.studies import Peers, run_study
    from sph_gym.studies.backends import Backend

    if options.point is not None:
        if options.name != "accuracy":
            raise ValueError(f"--point: only the study accuracy has it, not {options.name}")
        from sph_gym.studies.accuracy import rerun

        return rerun(options.point, Path(options.output) / "accuracy")
    peers = Peers(Path(options.peers), options.peers_python) if options.peers else None
    backend = Backend(options.backend, options.address, options.workers)
    return run_study(
        options.name, options.quick, options.output, peers, options.scenes, options.again, backend
    )


def _add_recommend(commands: Any) -> None:
    recommend = commands.add_parser(
        "recommend", help="settings for an error or a time; without either, what is known"
    )
    recommend.set_defaults(function=_recommend)
    add = recommend.add_argument
    add("scene", help="one that `study accuracy` has measured")
    wanted = recommend.add_mutually_exclusive_group()
    wanted.add_argument("--error", metavar="SHARE", help="such as 0.01 or 1%%")
    text = "processor time after compilation: 10s, 2min"
    wanted.add_argument("--budget", metavar="TIME", help=text)
    add("--set", **ASSIGNMENTS, metavar="NAME=VALUE", help="scene arguments but for dx")
    add("--table", type=Path, help="lines.csv of a study of your own")


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


def _add_docs(commands: Any) -> None:
    docs = commands.add_parser("docs", help="everything about an environment, as Markdown")
    docs.set_defaults(function=_docs)
    add = docs.add_argument
    add("id", nargs="?", help="such as sph_gym/DamBreak-v1; without: a list")
    add("--output", metavar="FOLDER", help="write pages there, by default of all ids")


def _docs(options: argparse.Namespace) -> int:
    from sph_gym.env import documentation

    chosen = [options.id] if options.id else None
    if options.output:
        print(*documentation.write(options.output, chosen), sep="\n")
    else:
        print(documentation.page(options.id) if options.id else documentation.index())
    return 0


def _add_manifest(commands: Any) -> None:
    manifest = commands.add_parser(
        "manifest", help="draw the instances anew and compute their references (hours)"
    )
    manifest.set_defaults(function=_manifest)
    add = manifest.add_argument
    add("--scenes", nargs="+", metavar="SCENE", help="only these environments")
    add("--output", metavar="FOLDER", help="by default, where sph_gym reads them")
    text = "let ids mean other flows than those of the same version did"
    add("--redefine", action="store_true", help=text)
    text = "compute all references, also those that the folder has"
    add("--again", action="store_true", help=text)
    add("--stamp", action="store_true", help="only write the digests of what is there anew")


def _manifest(options: argparse.Namespace) -> int:
    from sph_gym.env.build_manifests import prepare, stamp
    from sph_gym.env.manifest import FOLDER

    folder = Path(options.output) if options.output else FOLDER
    if options.stamp:
        print(*stamp(options.scenes, folder), sep="\n")
    else:
        print(*prepare(options.scenes, folder, options.redefine, options.again), sep="\n")
    return 0


def _add_dataset(commands: Any) -> None:
    dataset = commands.add_parser(
        "dataset",
        help="record Minari datasets of the rule, the oracle and random actions",
        description="Writes sph_gym/SCENE/POLICY-v1 for each scene and policy. Stop it when you "
        "like: finished episodes are kept, and the same command goes on from there.",
    )
    dataset.set_defaults(function=_dataset)
    add = dataset.add_argument
    add("--scenes", nargs="+", metavar="SCENE", help="only these environments")
    text = "of tuned-rule, oracle, random, adaptive-rule; by default the first three"
    add("--policies", nargs="+", metavar="POLICY", help=text)
    add("--episodes", type=int, default=8, help="of each dataset, each on a flow of its own")
    add("--instances", default="train", help="set of the flows: nominal, train, val, test or ood")


def _dataset(options: argparse.Namespace) -> int:
    from sph_gym.env.build_datasets import collect

    for id_ in collect(options.scenes, options.policies, options.episodes, options.instances):
        print(id_, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
