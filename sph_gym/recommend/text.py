"""Recommendations as text: wishes are read, advice is written in words and as a program."""

import math
from typing import Any

from sph_gym.recommend.advice import Advice, at_most_one
from sph_gym.recommend.settings import FIXED, RULES, Setting, build
from sph_gym.solver.checks import positive

UNITS = {"ms": 1e-3, "min": 60.0, "h": 3600.0, "s": 1.0}


def _stripped(name: str, text: str, examples: str) -> str:
    """Return a text without spaces around it. Raises ValueError for anything that is no text."""
    if not isinstance(text, str):
        raise ValueError(f"{name}: expected a text such as {examples}, got {text!r}")
    return text.strip()


def parse_error(text: str) -> float:
    """Return the share in a text such as 0.01 or 1%.

    Raises ValueError for others, and for 1 without a sign, which is all of it: 1 % must be meant.
    """
    number = _stripped("error", text, "0.01 or 1%")
    try:
        value = positive("error", float(number.removesuffix("%")))
    except ValueError:
        raise ValueError(
            f"error: expected a share above 0 such as 0.01 or 1%, got {text!r}"
        ) from None
    if value == 1 and not number.endswith("%"):
        raise ValueError(f"error: expected a share below 1, got {text!r}: did you mean 1%?")
    return at_most_one(value / 100 if number.endswith("%") else value)


def parse_budget(text: str) -> float:
    """Return the seconds in a text such as 10s, 500ms, 2min, 1h or 10, else raise ValueError."""
    number = _stripped("budget", text, "10s, 500ms or 2min").lower()
    unit = next((u for u in UNITS if number.endswith(u)), "")
    try:
        return positive("budget", float(number.removesuffix(unit)) * UNITS.get(unit, 1.0))
    except ValueError:
        raise ValueError(
            f"budget: expected a time above 0 such as 10s, 500ms or 2min, got {text!r}"
        ) from None


def describe(advice: Advice) -> list[tuple[str, str]]:
    """Return names and values of a recommendation, as they are to be set."""
    case, choice, setting = advice.case, advice.choice, advice.choice.setting
    scene = build(case, setting)
    assert scene.controls is not None
    rule = "" if setting.controller == FIXED else f" at the start, then by {setting.controller}"
    expected = f"about {100 * choice.error:.3g} %, at most {100 * choice.promised:.3g} % {case.of}"
    lines = {
        "dx": f"{scene.dx:.6g} m ({case.length} / {setting.across})",
        "h / dx": f"{setting.width:g}",
        "dt": f"{scene.controls.dt:.4g} s{rule} ({setting.step:g} of the stable step)",
        "stiffness": f"{scene.controls.stiffness:.4g} Pa{rule} (c = {setting.sound:g} c0)",
        "epsilon": f"{setting.xsph:g}" if setting.xsph > 0 else "no XSPH",
        "kernel": setting.kernel,
        "density": setting.density,
        "precision": setting.dtype,
        "integrator": setting.integrator,
        "frame": f"{scene.frame:.4g} s, of which dt is a whole fraction",
        "expected error": expected,
        "expected time": f"{advice.seconds:.3g} s of processor time after compilation, 1 thread",
        "simulated": f"{scene.duration:.4g} s of flow",
        "compression": f"{100 * choice.compression:.2g} % in the mean; "
        f"Mach number {choice.mach:.2g}",
        **_remarks(advice),
    }
    return list(lines.items())


def to_dict(advice: Advice) -> dict[str, Any]:
    """Return a recommendation as plain data, in SI units; errors are shares."""
    case, choice, setting = advice.case, advice.choice, advice.choice.setting
    scene = build(case, setting)
    assert scene.controls is not None
    return {
        "scene": case.scene,
        "arguments": {"dx": scene.dx, **case.given()},
        "h": scene.h,
        "frame": scene.frame,
        "controls": scene.controls._asdict(),
        "controller": setting.controller,
        "kernel": setting.kernel,
        "density": setting.density,
        "dtype": setting.dtype,
        "integrator": setting.integrator,
        "expected_error": choice.error,
        "promised_error": choice.promised,
        "tried_error": advice.tried,
        "seconds": advice.seconds,
        "program": program(advice),
    }


def _remarks(advice: Advice) -> dict[str, str]:
    """Return the use of a budget, the result of a run in the case, and a warning of scatter."""
    found = {}
    if advice.budget is not None:
        why = ": nothing finer was measured" if advice.best else ""
        found["budget"] = f"uses {advice.seconds:.2g} of {advice.budget:g} s{why}"
    if advice.tried is not None:
        found["tried"] = (
            "not in this case, where it would take too long: the promise is an extrapolation"
            if math.isnan(advice.tried)
            else f"in this case, with an error of {100 * advice.tried:.3g} %"
        )
    if advice.floor:
        found["caution"] = (
            f"errors are within their scatter, up to {100 * advice.floor:.3g} % at any resolution: "
            "more time buys nothing"
        )
    return found


def program(advice: Advice) -> str:
    """Return lines of Python that run a recommendation."""
    case, setting = advice.case, advice.choice.setting
    scene = build(case, setting)
    assert scene.controls is not None
    given = {"dx": scene.dx, **case.given()}
    arguments = "".join(f", {name}={value!r}" for name, value in given.items())
    dt, stiffness, xsph = scene.controls
    effects = (
        f"xsph={scene.effects.xsph}, continuity={scene.effects.continuity}, "
        f"density_diffusion={scene.effects.density_diffusion}"
    )
    return f"""from dataclasses import replace
from sph_gym import Controls, Simulation, scenes

scene = scenes.make("{case.scene}"{arguments})
scene = replace(
    scene,
    h={scene.h!r},
    frame={scene.frame!r},
    integrator="{setting.integrator}",
    fluid=replace(scene.fluid, kernel="{setting.kernel}"),
    effects=replace(scene.effects, {effects}),
    controls=Controls(dt={dt!r}, stiffness={stiffness!r}, xsph={xsph!r}),
)
sim = Simulation(scene, dtype="{setting.dtype}", threads=1)
{_loop(setting)}"""


def _loop(setting: Setting) -> str:
    """Return the lines that run it to the end or until it blows up, and print its last error."""
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
