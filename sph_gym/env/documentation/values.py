"""Tables and numbers that fill the templates of the pages."""

import inspect
from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from typing import Any

from sph_gym import scenes
from sph_gym.env import actions, contexts, episode, instances, manifest, observations, rewards
from sph_gym.env.distributions import FAMILIES, SHIFTS
from sph_gym.env.documentation.markdown import listed, span, table
from sph_gym.env.identity import Identity
from sph_gym.env.reference import (
    COURANT,
    MATCHED,
    NOMINAL_XSPH,
    SUPPORT,
    TWIN_JITTER,
    TWIN_SOUND,
    WINDOW,
    n_frames,
)
from sph_gym.env.registration import HISTORY
from sph_gym.env.rules import ROLLBACKS, Rules
from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver.failure import LINEAR_COURANT
from sph_gym.solver.simulation import DEFAULT_XSPH
from sph_gym.solver.state import Controls

# An error and an amount of work in every row of the table of examples.
EXAMPLES = ((0.5, 1 / 8), (0.5, 0.5), (0.5, 1.0), (0.5, 4.0), (1.1, 1.0), (3.0, 1.0), (100.0, 1.0))
OWN_FLOW = (
    "There is one instance, your scene; its id is `NAME/custom/HASH`, the hash one of all that "
    "makes it."
)
MANIFESTS = (
    f"The ids of instances mean what the manifests {manifest.VERSION} say; "
    "`env.unwrapped.instance.manifest` tells whether the present flow is listed there."
)


def general(scene: str | None) -> dict[str, Any]:
    """Return the values that all pages share; scene: argument of the environment."""
    return _numbers() | _actions() | _observations() | _rewards() | {
        "info": table(
            ["Key", "Unit", "Meaning"],
            [(f"`{key}`", unit, meaning) for key, (unit, meaning) in episode.INFO.items()],
        ),
        "arguments": _arguments(TuningEnv, {} if scene is None else {"scene": scene}),
        "vector_arguments": _arguments(TuningVectorEnv, {}),
        "history": "\n".join(f"- {version}: {what}" for version, what in HISTORY.items()),
    }  # fmt: skip


def _numbers() -> dict[str, Any]:
    return {
        "most_courant": actions.COURANT[1],
        "linear_courant": LINEAR_COURANT,
        "least_sound": actions.SOUND[0],
        "most_sound": actions.SOUND[1],
        "most_work": f"{rewards.MOST_WORK:g}",
        "mildest": f"{rewards.MILDEST:g}",
        "worst": f"{rewards.WORST:g}",
        "window": WINDOW,
        "reference_courant": COURANT,
        "reference_kernel": MATCHED,
        "reference_support": SUPPORT,
        "own_xsph": NOMINAL_XSPH,
        "twin_sound": TWIN_SOUND,
        "twin_jitter": f"{100 * TWIN_JITTER:g}",
        "xsph": DEFAULT_XSPH,
        "rollbacks": ROLLBACKS["rollback"],
    }


def _actions() -> dict[str, Any]:
    rows = [
        (k, one.name, -1.0, 1.0, one.low, one.high, one.quantity, one.scale, one.meaning)
        for k, one in enumerate(actions.COORDINATES)
    ]
    headings = ["Num", "Action", "Min", "Max", "-1 means", "+1 means", "of", "Scale", "Meaning"]
    modes = [
        (f'`"{name}"`', f"`{kind().space()}`", kind.__doc__) for name, kind in actions.MODES.items()
    ]
    choices = [(k, *move) for k, move in enumerate((actions.STEP * actions.MOVES).tolist())]
    added = ["Discrete action", *(f"adds to {name}" for name in actions.NAMES)]
    return {
        "action_version": actions.VERSION,
        "action_space": actions.Absolute().space(),
        "coordinates": table(headings, rows),
        "action_modes": table(["`action_mode`", "Space", "Meaning"], modes),
        "step": actions.STEP,
        "choices": table(added, choices),
    }


def _observations() -> dict[str, Any]:
    rows = [
        (k, one.name, one.meaning, float(one.low), float(one.high))
        for k, one in enumerate(observations.Features(rollback=True).rows)
    ]
    channels = [(k, *channel, 0, 255) for k, channel in enumerate(observations.CHANNELS)]
    context = [
        (one.name, one.meaning, float(one.low), float(one.high)) for one in observations.CONTEXT
    ]
    return {
        "observation_version": observations.VERSION,
        "context_features": table(["Of the context", "Meaning", "Min", "Max"], context),
        "n_context": len(observations.FEATURES) + len(observations.CONTEXT),
        "n_features": len(observations.FEATURES),
        "features_doc": inspect.getdoc(observations.Features),
        "features": table(["Num", "Observation", "Meaning", "Min", "Max"], rows),
        "field_doc": inspect.getdoc(observations.Field),
        "channels": table(["Channel", "Shows", "Meaning", "Min", "Max"], channels),
    }


def _rewards() -> dict[str, Any]:
    examples = [
        (error, work, sum(rewards.terms(rewards.Errors(0.0, 0.0, 0.0, error), work).values()))
        for error, work in EXAMPLES
    ]
    defaults = rewards.Tolerances()._asdict()
    tolerances = [
        (f"`{name}`", defaults[name], what)
        for name, what in listed(rewards.Tolerances.__doc__).items()
    ]
    return {
        "terms": table(["Term", "What for"], rewards.MEANINGS.items()),
        "examples": table(["e", "work", "reward"], examples),
        "tolerances": table(["Tolerance", "Default", "Of what"], tolerances),
    }


def defaults(kind: type[Any]) -> dict[str, Any]:
    """Return the defaults of an environment's arguments by name."""
    found = inspect.signature(kind).parameters.values()
    own = {one.name: one.default for one in found if one.default is not one.empty}
    rules = {one.name: one.default for one in fields(Rules)}
    return own | rules if kind is TuningEnv else own


def _arguments(kind: type[Any], given: dict[str, Any]) -> str:
    usual = defaults(kind) | given
    rows = [
        (f"`{name}`", f"`{getattr(usual[name], 'value', usual[name])!r}`", meaning)
        for name, meaning in listed(kind.__doc__).items()
    ]
    return table(["Parameter", "Default", "Description"], rows)


# --- what depends on the scenes of a page ---------------------------------------------------


@cache
def _built(name: str, split: str) -> list[Any]:
    """Return all scenes of a set."""
    size = instances.SIZES[split]
    return [instances.instance(name, split, number).build() for number in range(size)]


def builders(names: Sequence[str]) -> str:
    """Return the descriptions of the scenes' arguments."""
    found = [FAMILIES[name].scene for name in names]
    return "\n\n".join(f"`{builder}`: {scenes.description(builder)[1]}" for builder in found)


def labels(names: Sequence[str]) -> str:
    """Return the labels of scenes, their reasons, and the headroom."""
    found = [(name, FAMILIES[name]) for name in names]
    rows = [
        (f"`{name}`", family.label, family.diagnostic or instances.BENCHMARK, family.gain)
        for name, family in found
    ]
    return table(["Scene", "Label", "Why", "Headroom"], rows)


def units(names: Sequence[str]) -> str:
    """Return the ends of the action space in physical units."""
    rows: list[tuple[Any, ...]] = []
    for name in names:
        scene = _built(name, "nominal")[0]
        middle = actions.encode(scene, Controls(1.0, scene.fluid.stiffness(scene.fluid.c0), 0.0))
        ends = []
        for value in (-1.0, 1.0):
            at = [middle.copy() for _ in range(3)]
            for k in range(3):
                at[k][k] = value
            ends.append([actions.decode(scene, at[k])[k] for k in range(3)])
        low, high = ends
        sound = [scene.fluid.sound_speed(end[1]) for end in ends]
        inert = "" if scene.effects.xsph else " (does nothing here)"
        rows += [
            (name, "time step where c = c0", "s", low[0], high[0]),
            (name, "sound speed", "m/s", *sound),
            (name, "stiffness", "Pa", low[1], high[1]),
            (name, f"XSPH epsilon{inert}", "-", low[2], high[2]),
        ]
    found = table(["Scene", "Quantity", "Unit", "at -1", "at +1"], rows)
    return f"In physical units, in the nominal instance:\n\n{found}" if names else ""


def n_steps(names: Sequence[str]) -> str:
    """Return the numbers of steps of the nominal instances."""
    ends = [f"{n_frames(_built(name, 'nominal')[0])} ({name})" for name in names]
    return f", in the nominal instance {', '.join(ends)}" if ends else ""


def flows(names: Sequence[str]) -> dict[str, str]:
    """Return the sets of instances, and what is drawn in each."""
    sets = [(f'`"{split}"`', size, instances.PURPOSES[split])
            for split, size in instances.SIZES.items()]  # fmt: skip
    shifts = [(k, f'`"{shift}"`', instances.ODD[shift]) for k, shift in enumerate(SHIFTS)]
    identity = [(f"`{field}`", what) for field, what in listed(Identity.__doc__).items()]
    ranges = [
        f"Ranges of what `{name}` is made with:\n\n"
        + table([f"`{name}`", *instances.SIZES], _ranges(name))
        for name in names
    ]
    return {
        "sets": table(["`instances`", "Flows of a scene", "Purpose"], sets),
        "shifts": table([f"NUMBER % {len(SHIFTS)}", "`shift`", "Meaning"], shifts),
        "identity": table(["Field", "Meaning"], identity),
        "kinds": _kinds(),
        "ranges": "\n\n".join(ranges),
    }


def _kinds() -> str:
    """Return the kinds of contexts, their shares and their ranges."""
    usual, shares = contexts.Context(), contexts.KINDS
    ends = {"noisy": contexts.NOISY, "damped": contexts.DAMPED, "plain": (usual.alpha,)}
    supports = {"noisy": contexts.NARROW, "damped": contexts.WIDE}
    rows = [
        (
            f'`"{kind}"`',
            f"{shares.count(kind)} of {len(shares)}",
            span(alphas),
            span(supports.get(kind, (usual.support,))),
        )
        for kind, alphas in ends.items()
    ]
    return table(['`info["context"]`', "Share", "alpha", "h / dx"], rows)


def _ranges(name: str) -> list[list[str]]:
    """Return the range of every argument in every set, and of what follows from them.

    Flows that another scene shows count only in the latter.
    """
    columns, builder = [], FAMILIES[name].scene
    usual = scenes.parameters(builder)
    for split, size in instances.SIZES.items():
        drawn = [instances.instance(name, split, k).drawn for k in range(size)]
        made = [usual | one.arguments for one in drawn if one.builder == builder]
        shown = _built(name, split)
        numerics = [contexts.of(scene) for scene in shown]
        columns.append(
            {key: [one[key] for one in made] for key in usual}
            | {
                "alpha": [one.alpha for one in numerics],
                "h / dx": [one.support for one in numerics],
                "viscosity / (h c0)": [one.viscosity for one in numerics],
                "fluid particles": [len(scene.x) for scene in shown],
                "duration [s]": [scene.duration for scene in shown],
                "steps": [n_frames(scene) for scene in shown],
            }
        )
    return [[key, *(span(column[key]) for column in columns)] for key in columns[0]]
