"""A recommendation in words and as a program."""

import math

from sph_gym.studies.accuracy.policies import RULES
from sph_gym.studies.accuracy.recommend import Advice
from sph_gym.studies.accuracy.settings import FIXED, Setting, build


def describe(advice: Advice) -> list[tuple[str, str]]:
    """Names and values of a recommendation, as they are to be set."""
    scene, choice = advice.problem, advice.choice
    setting, error, promised = choice.setting, choice.error, choice.promised
    built = build(scene, setting)
    assert built.controls is not None
    fixed = setting.controller == FIXED
    said = {True: "", False: f" at the start, then by {setting.controller}"}[fixed]
    told = [
        ("dx", f"{built.dx:.6g} m ({scene.length} / {setting.across})"),
        ("h / dx", f"{setting.width:g}"),
        ("dt", f"{built.controls.dt:.4g} s{said} ({setting.step:g} of the stable step)"),
        ("stiffness", f"{built.controls.stiffness:.4g} Pa{said} (c = {setting.sound:g} c0)"),
        ("epsilon", f"{setting.xsph:g}" if setting.xsph > 0 else "no XSPH"),
        ("kernel", setting.kernel),
        ("density", setting.density),
        ("precision", setting.dtype),
        ("integrator", setting.integrator),
        ("frame", f"{built.frame:.4g} s, of which dt is a whole fraction"),
        ("expected error", f"about {100 * error:.3g} %, at most {100 * promised:.3g} % {scene.of}"),
        ("expected time", f"{advice.seconds:.3g} s of processor time after compilation, 1 thread"),
        ("simulated", f"{built.duration:.4g} s of flow"),
        (
            "compression",
            f"{100 * choice.compression:.2g} % in the mean; Mach number {choice.mach:.2g}",
        ),
    ]
    more = {"budget": _used(advice), "tried": _tried(advice), "caution": advice.caution}
    return told + [(name, text) for name, text in more.items() if text]


def _used(advice: Advice) -> str:
    """How much of a budget is used, and why not all of it."""
    if advice.budget is None:
        return ""
    why = ": nothing finer was measured" if advice.best else ""
    return f"uses {advice.seconds:.2g} of {advice.budget:g} s{why}"


def _tried(advice: Advice) -> str:
    """What a run in this case gave, or that there was none."""
    if advice.tried is None:
        return ""
    if math.isnan(advice.tried):
        return "not in this case, where it would take too long: the promise is an extrapolation"
    return f"in this case, with an error of {100 * advice.tried:.3g} %"


def program(advice: Advice) -> str:
    """Lines of Python that run a recommendation."""
    scene, setting = advice.problem, advice.choice.setting
    built = build(scene, setting)
    assert built.controls is not None
    given = {"dx": built.dx, **scene.given()}
    arguments = "".join(f", {name}={value!r}" for name, value in given.items())
    dt, stiffness, xsph = built.controls
    effects = (
        f"xsph={built.effects.xsph}, continuity={built.effects.continuity}, "
        f"density_diffusion={built.effects.density_diffusion}"
    )
    return f"""from dataclasses import replace
from sph_gym import Controls, Simulation, scenes

scene = scenes.make("{scene.scene}"{arguments})
scene = replace(
    scene,
    h={built.h!r},
    frame={built.frame!r},
    integrator="{setting.integrator}",
    fluid=replace(scene.fluid, kernel="{setting.kernel}"),
    effects=replace(scene.effects, {effects}),
    controls=Controls(dt={dt!r}, stiffness={stiffness!r}, xsph={xsph!r}),
)
sim = Simulation(scene, dtype="{setting.dtype}", threads=1)
{_loop(setting)}"""


def _loop(setting: Setting) -> str:
    """The lines that let it run, to the end or until it blows up, and print its state's error."""
    lines = [
        # the last step would else be as long as a rounding error
        "while sim.time < scene.duration * (1 - 1e-9):",
        "    report = sim.advance(min(scene.frame, scene.duration - sim.time))",
        "    if report.diverged:",
        '        raise SystemExit(f"blew up at t = {sim.time:g} s: {report.cause}, {report.link}")',
        "reference = scenes.reference(scene.name)",
        'print(f"t = {sim.time:g} s, error now: {reference.error(sim):.3g} {reference.unit}")',
    ]
    if setting.controller != FIXED:
        rule = RULES[setting.controller].__name__
        lines.insert(1, "    sim.controls = rule(sim)")
        lines = [f"from sph_gym.controllers import {rule}", f"rule = {rule}()", *lines]
    return "\n".join(lines)
