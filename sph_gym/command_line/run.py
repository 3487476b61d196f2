"""`sph-gym run`: run a scene, or open a recording; log, watch or film it."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sph_gym import scenes
from sph_gym.command_line.outcome import Outcome
from sph_gym.command_line.parser import (
    ASSIGNMENTS,
    JSON_HELP,
    Parser,
    add_command,
    assignment,
    completed,
)

if TYPE_CHECKING:
    from sph_gym.readings import Readings
    from sph_gym.run import Steering
    from sph_gym.solver.scene import Scene
    from sph_gym.solver.simulation import Simulation

# Files that `run --window` opens.
RECORDINGS = (".npz", ".h5", ".hdf5", ".pvd")
# Known here too, since it takes long to import the controllers.
CONTROLLERS = ("default", "cfl", "tuned_cfl", "adaptive", "pi", "best")
SETTINGS = ("dt", "stiffness", "xsph")


def add(commands: Any) -> None:
    """Add the command to a parser."""
    run = add_command(
        commands,
        "run",
        _run,
        help="run a scene, or open a recording; log, watch or film it",
        examples=(
            ("run dam_break --set dx=0.02 --video dam.mp4", "film a scene"),
            ("run drop_impact --window --controller tuned_cfl", "watch and steer it"),
            ("run dam_break --controller network.npz --json -", "the outcome, for a program"),
            ("run wall_impact --gauge force:right --gauges f.csv", "a force over time"),
            ("run dam_break --dt 0.01 --break-on nan", "where does it break first?"),
            ("run run.npz --window", "open what --save wrote"),
        ),
    )
    text = ", ".join(scenes.names()) + "; or with --window a recording that --save or doctor.watch "
    scene = run.add_argument("scene", help=text + f"wrote: {', '.join(RECORDINGS)}")
    completed(scene, scenes.names())
    _add_settings(run)
    _add_readings(run)
    _add_looks(run)


def _add_settings(run: Parser) -> None:
    add = run.add_argument_group("settings").add_argument
    add("--set", **ASSIGNMENTS, metavar="NAME=VALUE", help="scene arguments")
    add("--seconds", type=float, help="physical time, by default the scene's own")
    add("--dt", type=float, help="time step [s]")
    add("--stiffness", type=float, help="Tait's B [Pa]")
    add("--xsph", type=float, help="XSPH epsilon")
    text = f"what sets these three in every frame: {', '.join(CONTROLLERS)}, an algorithm with a "
    text += "network, such as ppo_warm, or FILE.npz of a network of your own"
    completed(add("--controller", metavar="NAME", help=text), CONTROLLERS)
    add("--dtype", default="float64", help="float64 or float32")
    add("--neighbors", default="grid", help="grid, or brute: is the search to blame?")


def _add_readings(run: Parser) -> None:
    add = run.add_argument_group("numbers").add_argument
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
    add("--json", metavar="PATH", help=JSON_HELP)


def _add_looks(run: Parser) -> None:
    looks = run.add_argument_group("pictures and recordings")
    text = "speed, density, density_error, pressure, neighbors, clumping or energy"
    looks.add_argument("--color", default="speed", help=text)
    looks.add_argument("--arrows", action="store_true", help="draw forces as arrows")
    show = looks.add_mutually_exclusive_group()
    show.add_argument("--window", action="store_true", help="watch and steer it; ? lists the keys")
    show.add_argument("--video", metavar="PATH", help="film it: .mp4 or .gif")
    looks.add_argument("--save", metavar="PATH", help="record it: .npz, .h5, or .pvd for ParaView")


def _run(options: argparse.Namespace) -> Outcome:
    if Path(options.scene).suffix.lower() in RECORDINGS:
        return _replay(options)
    from sph_gym.run import check_targets, run
    from sph_gym.solver.simulation import Simulation

    if options.arrows and not (options.window or options.video):
        raise ValueError("--arrows: expected --window or --video beside it, got neither")
    # before the scene is compiled
    check_targets(options.video, options.save)
    scene = _scene(options.scene, options.set)
    steering = _steering(options, scene)
    sim = Simulation(scene, dtype=options.dtype, neighbors=options.neighbors)
    given = {name: getattr(options, name) for name in SETTINGS}
    sim.controls = sim.controls._replace(**{k: v for k, v in given.items() if v is not None})
    n_logged, readings = _readings(options, sim)
    looks = {name: getattr(options, name) for name in ("color", "arrows", "window", "video")}
    status = run(
        sim, options.seconds, n_logged, readings, save=options.save, steering=steering, **looks
    )
    return Outcome(status, _summary(sim, readings, options) if options.json else None)


def _steering(options: argparse.Namespace, scene: "Scene") -> "Steering":
    """Return the controllers. Raises ValueError for settings that a controller would overwrite."""
    from sph_gym.pilot import controller, controllers
    from sph_gym.run import Steering

    name = options.controller
    found = controllers(scene) if options.window else {}
    if name is None:
        return Steering("", found)
    given = [f"--{setting}" for setting in SETTINGS if getattr(options, setting) is not None]
    if given:
        raise ValueError(f"--controller: expected no {', '.join(given)} beside it: it sets them")
    return Steering(name, found | {name: controller(name, scene)})


def _readings(options: argparse.Namespace, sim: "Simulation") -> "tuple[int, Readings]":
    """Return how many particles to log, and the readings that are asked for."""
    from sph_gym.readings import Every, Readings
    from sph_gym.solver.break_on import BreakOn
    from sph_gym.solver.gauges import Gauge

    gauges = [Gauge.parse(text) for text in options.gauge]
    n_logged, log = _logged(options, sim)
    every = options.every
    if every is not None:
        every = Every.parse(every, "s" if log is None else "steps")
    break_on = BreakOn(sim, options.break_on.split(",")) if options.break_on else None
    return n_logged, Readings(sim, gauges, options.gauges, every, log, break_on)


def _summary(
    sim: "Simulation", readings: "Readings", options: argparse.Namespace
) -> dict[str, Any]:
    """Return the outcome of a run as plain data, in SI units."""
    report, offender = sim.last_report, readings.offender
    return {
        "scene": sim.scene.name,
        "controller": options.controller,
        "time": sim.time,
        "n_substeps": readings.n_substeps,
        "diverged": report.diverged,
        "cause": report.cause,
        "link": report.link,
        "bad_particle": report.bad_particle,
        "offender": None if offender is None else str(offender),
        "controls": sim.controls._asdict(),
        "diagnostics": sim.diagnostics(),
        "readings": dict(zip(readings.columns, readings.rows[-1][1:], strict=True)),
        "warnings": [warning._asdict() for warning in sim.warnings],
    }


def _replay(options: argparse.Namespace) -> Outcome:
    """Open a recording in the window. Raises ValueError with options that need a running scene."""
    from sph_gym.run import replay

    looks = ("scene", "window", "color", "arrows")
    defaults = vars(options.parser.parse_args(["SCENE"]))
    others = [name for name, value in vars(options).items() if value != defaults[name]]
    others = [f"--{name.replace('_', '-')}" for name in others if name not in looks]
    if not Path(options.scene).exists():
        raise FileNotFoundError(f"{options.scene}: there is no such file")
    if not options.window or others:
        given = " ".join(others) or "no --window"
        raise ValueError(
            f"{options.scene}: expected --window, --color and --arrows at most with a recording, "
            f"got {given}"
        )
    return Outcome(replay(options.scene, color=options.color, arrows=options.arrows))


def _logged(options: argparse.Namespace, sim: Any) -> tuple[int, Any]:
    """Return how many particles to log, and the log of those that are named, if any are."""
    from sph_gym.run import LOGGED, spread
    from sph_gym.solver.checks import whole
    from sph_gym.solver.particle_log import ParticleLog

    text = options.log
    try:
        count = None if text is None else int(text)
    except ValueError:
        count = None
    if count is not None and options.particles is not None:
        raise ValueError(f"--log: expected names such as rho,p with --particles, got {text}")
    if count is not None:
        return whole("--log", count), None
    if text is None and options.particles is None:
        return 0 if options.gauge else LOGGED, None
    particles = options.particles
    if particles is None:
        particles = ",".join(map(str, spread(sim)))
    return 0, ParticleLog.parse(text or "rho,p", particles)


def _scene(name: str, assignments: list[str]) -> "Scene":
    from sph_gym.solver.checks import known

    known("scene", name, scenes.names())
    try:
        return scenes.make(name, **dict(map(assignment, assignments)))
    except ArithmeticError as error:
        raise ValueError(
            f"--set: expected numbers of usual sizes, got {' '.join(assignments)}: {error}"
        ) from None
