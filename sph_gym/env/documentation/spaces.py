"""What the pages say about actions and observations."""

import inspect
from typing import Any

from sph_gym.env import actions, observations
from sph_gym.env.documentation.markdown import prose, table
from sph_gym.env.documentation.subject import Subject, built
from sph_gym.solver.failure import LINEAR_COURANT
from sph_gym.solver.state import Controls


def action_space(about: Subject) -> str:
    """What an action is, and what it means in physical units."""
    rows = [
        (k, one.name, -1.0, 1.0, one.low, one.high, one.quantity, one.scale, one.meaning)
        for k, one in enumerate(actions.COORDINATES)
    ]
    headings = ["Num", "Action", "Min", "Max", "-1 means", "+1 means", "of", "Scale", "Meaning"]
    parts = [table(headings, rows)]
    if about.scenes:
        headings = ["Scene", "Quantity", "Unit", "at -1", "at +1"]
        parts += ["In physical units, in the nominal instance:", table(headings, _ranges(about))]
    modes = [
        (f'`"{name}"`', f"`{kind().space()}`", kind.__doc__) for name, kind in actions.MODES.items()
    ]
    parts += [table(["`action_mode`", "Space", "Meaning"], modes), f"STEP is {actions.STEP}."]
    headings = ["Discrete action", *(f"adds to {name}" for name in actions.NAMES)]
    choices = [(k, *move) for k, move in enumerate((actions.STEP * actions.MOVES).tolist())]
    parts += ["No coordinate goes beyond -1 and 1.", table(headings, choices)]
    return "\n\n".join(parts)


def _ranges(about: Subject) -> list[tuple[Any, ...]]:
    rows: list[tuple[Any, ...]] = []
    for name in about.scenes:
        scene = built(name, "nominal")[0]
        middle = actions.encode(scene, Controls(1.0, scene.fluid.stiffness(scene.fluid.c0), 0.0))
        ends = [[middle.copy() for _ in range(3)] for _ in range(2)]
        for end, value in zip(ends, (-1.0, 1.0), strict=True):
            for k in range(3):
                end[k][k] = value
        low, high = ([actions.decode(scene, at)[k] for k, at in enumerate(end)] for end in ends)
        sound = [scene.fluid.sound_speed(end[1]) for end in (low, high)]
        inert = "" if scene.effects.xsph else " (does nothing here)"
        rows += [
            (name, "time step where c = c0", "s", low[0], high[0]),
            (name, "sound speed", "m/s", *sound),
            (name, "stiffness", "Pa", low[1], high[1]),
            (name, f"XSPH epsilon{inert}", "-", low[2], high[2]),
        ]
    return rows


def limits(about: Subject) -> str:
    """What is in the agent's hands, and what is not."""
    return prose(f"""
        The agent sets three numbers of the solver, at the beginning of a step, and nothing else.
        Positions, velocities and densities stay as they are.

        - The time step is chosen in multiples of h / c, so that no action asks for one beyond
          {actions.COURANT[1]} of them; it is snapped down so that a whole number fits into the
          frame. The integrator takes about {LINEAR_COURANT}, and less where viscosity or large
          forces act: where it breaks is for the agent to see.
        - The stiffness stays positive and the sound speed within {actions.SOUND[0]} and
          {actions.SOUND[1]} times c0. A change in mid-run is no trick without a price: a fluid
          that is compressed stores energy in proportion to its stiffness, so that the change puts
          energy in or takes it out. `info["control_work"]` tells how much [J/m], and the solver's
          balance of energy takes it into account. `rate_limit=` bounds the factor by which the
          sound speed may change in a step.
        - XSPH moves positions only; velocities are not smoothed.
        - Gravity, walls, the kernel, density, surface tension and the viscosities are physics, and
          out of reach. Artificial viscosity is tied to the nominal c0 (alpha c0 h), not to the
          present sound speed: a softer fluid is not a thinner one.
        - The reference run is out of reach too: no observation comes from it.
    """)


def observation_space(about: Subject) -> str:
    """What the entries of observations are."""
    rows = [
        (k, one.name, one.meaning, float(one.low), float(one.high))
        for k, one in enumerate(observations.Features(rollback=True).rows)
    ]
    channels = [(k, *channel, 0, 255) for k, channel in enumerate(observations.CHANNELS)]
    return "\n\n".join(
        [
            f'`observation="features"`: {inspect.getdoc(observations.Features)}',
            table(["Num", "Observation", "Meaning", "Min", "Max"], rows),
            f'The last one is there only with `on_blowup="rollback"`: '
            f"{len(observations.FEATURES)} entries without it.",
            f'`observation="field"`: {inspect.getdoc(observations.Field)}',
            table(["Channel", "Shows", "Meaning", "Min", "Max"], channels),
        ]
    )
