"""What stands under the headings of a page."""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from sph_gym import scenes
from sph_gym.env import actions, episode, instances, observations, rewards, settings
from sph_gym.env.documentation.markdown import listed, prose, span, table
from sph_gym.env.draws import FAMILIES
from sph_gym.env.reference import TWIN_SOUND, WINDOW, n_frames
from sph_gym.env.registration import HISTORY
from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver.failure import LINEAR_COURANT
from sph_gym.solver.simulation import DEFAULT_XSPH
from sph_gym.solver.state import Controls

# An error and an amount of work in every row of the table of examples.
EXAMPLES = ((0.5, 1 / 8), (0.5, 0.5), (0.5, 1.0), (0.5, 8.0), (1.1, 1.0), (3.0, 1.0), (100.0, 1.0))


class Subject(NamedTuple):
    """What a page is about.

    id: of the environment; scene: the argument that it is registered with, None for one of the
    user's own; scenes: the names of those that it shows.
    """

    id: str
    scene: str | None
    scenes: tuple[str, ...]

    @property
    def summary(self) -> str:
        """What happens, in a sentence."""
        if self.scene is None:
            return "A `Scene` of your own, given as `scene=`."
        if self.scene == settings.MIXED:
            return f"Every reset draws one of the scenes {', '.join(self.scenes)}."
        return scenes.description(FAMILIES[self.scene].builder)[0]


def head(about: Subject) -> str:
    """The table on top of a page."""
    extra = ", scene=scene" if about.scene is None else ""
    rows = [
        ("Action Space", f"`{actions.Absolute().space()}`"),
        ("Observation Space", f"`Box(-1.0 or 0.0, 1.0, ({len(observations.FEATURES)},), float32)`"),
        ("Make", f'`import sph_gym; gymnasium.make("{about.id}"{extra})`'),
    ]
    return table(["", ""], rows)


def _description(about: Subject) -> str:
    general = prose("""
        A 2D SPH fluid solver runs; in every step, a frame of fixed physical time, the agent sets
        its time step, its stiffness and its XSPH epsilon. It is paid for saving work as long as
        the flow stays what a fine run shows, and charged for blow-ups, clumping, compression and
        infidelity.
    """)
    parts = [about.summary, general]
    for name in about.scenes:
        builder = FAMILIES[name].builder
        parts.append(f"`{builder}`: {scenes.description(builder)[1]}")
    return "\n\n".join(parts)


def _action_space(about: Subject) -> str:
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
    return "\n\n".join(parts)


def _ranges(about: Subject) -> list[tuple[Any, ...]]:
    rows: list[tuple[Any, ...]] = []
    for name in about.scenes:
        scene = _built(name, "nominal")[0]
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


def _limits(about: Subject) -> str:
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


def _observation_space(about: Subject) -> str:
    rows = [
        (k, one.name, one.meaning, float(one.low), float(one.high))
        for k, one in enumerate(observations.Features(rollback=True).rows)
    ]
    return "\n\n".join(
        [
            f'`observation="features"`: {inspect.getdoc(observations.Features)}',
            table(["Num", "Observation", "Meaning", "Min", "Max"], rows),
            f'The last one is there only with `on_blowup="rollback"`: '
            f"{len(observations.FEATURES)} entries without it.",
            f'`observation="field"`: {inspect.getdoc(observations.Field)}',
        ]
    )


def _rewards(about: Subject) -> str:
    formula = prose(f"""
        e = max(density, clumping, fidelity), each in multiples of its tolerance:

        - e <= 1: work pays min(max(1/2 - ln(work) / {rewards.WORK_RANGE:.4g}, 0), 1);
        - e > 1: the term that sets e is -min(1/2 + log10(e), {rewards.WORST}), all others are 0;
        - blow-up: -{rewards.WORST} for every step that is left, the present one included, or for
          that one alone if it is taken back.

        The reward is the sum of the terms, each times its weight (`reward_weights`, 1 unless
        given), or all of them in this order as an array with `reward="vector"`:
    """)
    tolerances = listed(rewards.Tolerances.__doc__)
    defaults = rewards.Tolerances()._asdict()
    examples = [
        (error, work, sum(rewards.terms(rewards.Errors(0.0, 0.0, error), work).values()))
        for error, work in EXAMPLES
    ]
    return "\n\n".join(
        [
            formula,
            table(["Term", "What for"], rewards.MEANINGS.items()),
            "For example:",
            table(["e", "work", "reward"], examples),
            f"Tolerances, WINDOW = {WINDOW}:",
            table(
                ["Tolerance", "Default", "Of what"],
                [(f"`{name}`", defaults[name], what) for name, what in tolerances.items()],
            ),
            "The reference is a fine run of the same instance at nominal stiffness; its twins, a "
            f"run at {TWIN_SOUND} c0 and one with jittered particles, tell how far equally good "
            "runs differ.",
        ]
    )


@cache
def _built(name: str, split: str) -> list[Any]:
    """All scenes of a set."""
    size = instances.SIZES[split]
    return [instances.instance(name, split, number).build() for number in range(size)]


def _starting_state(about: Subject) -> str:
    start = prose(f"""
        The fluid of the instance, at rest unless the scene says otherwise, with the scene's
        nominal controls: the stiffness of c0, the stable time step of the start, and epsilon
        {DEFAULT_XSPH}.
    """)
    if not about.scenes:
        return (
            f"{start}\n\nThere is one instance, your scene; its id is `NAME/custom/HASH`, the hash "
            "one of all that makes it."
        )
    choice = prose("""
        `instances=` names the set from which a reset draws with the environment's own generator;
        `reset(options={"instance": "SCENE/SET/NUMBER"})` chooses, and `info["instance_id"]`
        says which it is: listed in a versioned manifest, with its reference, or at another
        spacing than the default one `SCENE/SET/NUMBER/dx=SPACING`. Lengths are drawn in
        multiples of dx: the ranges below are those of the default dx; what "ood" shows by
        another scene is in none of them but the last three.
    """)
    sizes = [(f'`"{split}"`', size, instances.PURPOSES[split])
             for split, size in instances.SIZES.items()]  # fmt: skip
    parts = [start, choice, table(["`instances`", "Flows of a scene", "Purpose"], sizes)]
    for name in about.scenes:
        headings = [f"`{name}`", *instances.SIZES]
        parts += [f"Ranges of what `{name}` is made with:", table(headings, _drawn(name))]
    return "\n\n".join(parts)


def _drawn(name: str) -> list[list[str]]:
    """Smallest and largest value of every argument in every set, and what follows from them.

    Of the flows that are shown by another scene, only the latter.
    """
    columns, builder = [], FAMILIES[name].builder
    usual = scenes.parameters(builder)
    for split, size in instances.SIZES.items():
        drawn = [instances.instance(name, split, k).drawn for k in range(size)]
        made = [usual | one.arguments for one in drawn if one.builder == builder]
        built = _built(name, split)
        columns.append(
            {key: [one[key] for one in made] for key in usual}
            | {
                "viscosity / (h c0)": [one.viscosity or 0.0 for one in drawn],
                "fluid particles": [len(scene.x) for scene in built],
                "duration [s]": [scene.duration for scene in built],
                "steps": [n_frames(scene) for scene in built],
            }
        )
    return [[key, *(span(column[key]) for column in columns)] for key in columns[0]]


def _episode_end(about: Subject) -> str:
    ends = [f"{n_frames(_built(name, 'nominal')[0])} ({name})" for name in about.scenes]
    steps = f", in the nominal instance {', '.join(ends)}" if ends else ""
    return prose(f"""
        1. Truncation: after duration / frame steps{steps}.
        2. Termination: the solver blew up. The observation is the last finite state, and
           `info["blowup_cause"]` says why. With `on_blowup="rollback"` the step is taken back
           instead, at most {settings.ROLLBACKS["rollback"]} times in a row.
    """)


def _information(about: Subject) -> str:
    rows = [(f"`{key}`", unit, meaning) for key, (unit, meaning) in episode.INFO.items()]
    return table(["Key", "Unit", "Meaning"], rows)


def defaults(function: Callable[..., Any]) -> dict[str, Any]:
    """The arguments of a constructor that have a default, and the default."""
    arguments = inspect.signature(function).parameters.values()
    return {one.name: one.default for one in arguments if one.default is not one.empty}


def _arguments(about: Subject) -> str:
    given = {} if about.scene is None else {"scene": about.scene}
    return _argument_table(TuningEnv, given)


def _argument_table(kind: type[Any], given: dict[str, Any]) -> str:
    meanings = listed(kind.__doc__)
    rows = [
        (f"`{name}`", f"`{given.get(name, getattr(value, 'value', value))!r}`", meanings[name])
        for name, value in defaults(kind).items()
    ]
    return table(["Parameter", "Default", "Description"], rows)


def _vector(about: Subject) -> str:
    extra = ", scene=scene" if about.scene is None else ""
    text = f"""`gymnasium.make_vec("{about.id}", num_envs=64{extra})` gives the native one: the
same episodes to the last bit, side by side on threads. It takes the arguments above and:"""
    return f"{text}\n\n{_argument_table(TuningVectorEnv, {})}"


def _history(about: Subject) -> str:
    return "\n".join(f"- {version}: {what}" for version, what in HISTORY.items())


SECTIONS: dict[str, Callable[[Subject], str]] = {
    "Description": _description,
    "Action Space": _action_space,
    "What the agent may and may not change": _limits,
    "Observation Space": _observation_space,
    "Rewards": _rewards,
    "Starting State": _starting_state,
    "Episode End": _episode_end,
    "Information": _information,
    "Arguments": _arguments,
    "Vectorized environment": _vector,
    "Version History": _history,
}
