"""What stands under the headings of a page."""

import inspect
from collections.abc import Callable
from typing import Any

from sph_gym import scenes
from sph_gym.env import (
    actions,
    episode,
    instances,
    labels,
    manifest,
    observations,
    rewards,
    settings,
)
from sph_gym.env.documentation.markdown import listed, prose, span, table
from sph_gym.env.documentation.spaces import action_space, limits, observation_space
from sph_gym.env.documentation.subject import Subject, built
from sph_gym.env.draws import FAMILIES, SHIFTS
from sph_gym.env.identity import Identity
from sph_gym.env.reference import TWIN_SOUND, WINDOW, n_frames
from sph_gym.env.registration import HISTORY
from sph_gym.env.tuning import TuningEnv
from sph_gym.env.vector import TuningVectorEnv
from sph_gym.solver.simulation import DEFAULT_XSPH

# An error and an amount of work in every row of the table of examples.
EXAMPLES = ((0.5, 1 / 8), (0.5, 0.5), (0.5, 1.0), (0.5, 4.0), (1.1, 1.0), (3.0, 1.0), (100.0, 1.0))


def _own(about: Subject) -> str:
    """The argument without which an environment can't be made."""
    return ", scene=scene" if about.scene is None else ""


def head(about: Subject) -> str:
    """The table on top of a page."""
    extra = _own(about)
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
    parts = [about.story, general]
    for name in about.scenes:
        builder = FAMILIES[name].builder
        parts.append(f"`{builder}`: {scenes.description(builder)[1]}")
    if about.scenes:
        parts.append(_labels(about))
    return "\n\n".join(parts)


def _labels(about: Subject) -> str:
    """What the scenes are good for, and how much there is to gain."""
    rows = [
        (f"`{name}`", labels.label(name), instances.why(name), labels.headroom(name))
        for name in about.scenes
    ]
    meanings = [f"- *{name}*: {meaning}" for name, meaning in labels.MEANINGS.items()]
    return "\n\n".join(
        [
            table(["Scene", "Label", "Why", "Headroom"], rows),
            "\n".join(meanings),
            "Headroom is how much less the look-ahead oracle works than the best static setting, "
            "both within tolerance (`python -m sph_gym study headroom`).",
        ]
    )


def _rewards(about: Subject) -> str:
    extra = _own(about)
    formula = prose(f"""
        e = max(density, clumping, fidelity), each in multiples of its tolerance:

        - e <= 1: work pays 1 - min(work, {rewards.MOST_WORK:g}) / 2;
        - e > 1: the term that sets e is -min({rewards.MILDEST:g} + log10(e), {rewards.WORST:g}),
          all others are 0;
        - blow-up: -{rewards.WORST:g} for every step that is left, the present one included, or for
          that one alone if it is taken back.

        The reward is the sum of the terms, each times its weight (`reward_weights`, 1 unless
        given), or all of them in this order as an array with `reward="vector"`, for algorithms
        with many objectives. Gymnasium's checker knows scalars only, so leave it out, as
        `mo_gymnasium.make` does by default:
        `gymnasium.make("{about.id}"{extra}, reward="vector", disable_env_checker=True)`.
        `env.unwrapped.reward_space` bounds the terms.
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
            "runs differ. All of it is `env.unwrapped.episode.reference`; the potential energy and "
            "the front that it holds besides are judged by nothing, and are there to be drawn.",
        ]
    )


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
    shifts = [(k, f'`"{shift}"`', instances.ODD[shift]) for k, shift in enumerate(SHIFTS)]
    parts += [
        'The number of an instance of "ood" says what is out of distribution:',
        table([f"NUMBER % {len(SHIFTS)}", "`shift`", "Meaning"], shifts),
        "`env.unwrapped.instance` tells all about the present flow:",
        table(["Field", "Meaning"], [(f"`{k}`", what) for k, what in _identity().items()]),
    ]
    for name in about.scenes:
        headings = [f"`{name}`", *instances.SIZES]
        parts += [f"Ranges of what `{name}` is made with:", table(headings, _drawn(name))]
    return "\n\n".join(parts)


def _identity() -> dict[str, str]:
    return listed(Identity.__doc__)


def _drawn(name: str) -> list[list[str]]:
    """Smallest and largest value of every argument in every set, and what follows from them.

    Of the flows that are shown by another scene, only the latter.
    """
    columns, builder = [], FAMILIES[name].builder
    usual = scenes.parameters(builder)
    for split, size in instances.SIZES.items():
        drawn = [instances.instance(name, split, k).drawn for k in range(size)]
        made = [usual | one.arguments for one in drawn if one.builder == builder]
        shown = built(name, split)
        columns.append(
            {key: [one[key] for one in made] for key in usual}
            | {
                "viscosity / (h c0)": [one.viscosity or 0.0 for one in drawn],
                "fluid particles": [len(scene.x) for scene in shown],
                "duration [s]": [scene.duration for scene in shown],
                "steps": [n_frames(scene) for scene in shown],
            }
        )
    return [[key, *(span(column[key]) for column in columns)] for key in columns[0]]


def _episode_end(about: Subject) -> str:
    ends = [f"{n_frames(built(name, 'nominal')[0])} ({name})" for name in about.scenes]
    steps = f", in the nominal instance {', '.join(ends)}" if ends else ""
    return prose(f"""
        1. Truncation: after duration / frame steps{steps}.
        2. Termination: the solver blew up. The observation is the last finite state, and
           `info["blowup_cause"]` says why. With `on_blowup="rollback"` the step is taken back
           instead, at most {settings.ROLLBACKS["rollback"]} times in a row.
    """)


def _information(about: Subject) -> str:
    rows = [(f"`{key}`", unit, meaning) for key, (unit, meaning) in episode.INFO.items()]
    text = prose("""
        `info` has the same entries after a reset and after every step. In a step that is taken
        back, they tell of what blew up and what it cost, while the observation is of the state to
        go on from.
    """)
    return "\n\n".join([text, table(["Key", "Unit", "Meaning"], rows)])


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
    extra = _own(about)
    text = f"""`gymnasium.make_vec("{about.id}", num_envs=64{extra})` gives the native one: the
same episodes to the last bit, side by side on threads. It takes the arguments above and:"""
    return f"{text}\n\n{_argument_table(TuningVectorEnv, {})}"


def _history(about: Subject) -> str:
    versions = "\n".join(f"- {version}: {what}" for version, what in HISTORY.items())
    if not about.scenes:
        return versions
    return (
        f"{versions}\n\nThe ids of instances mean what the manifests {manifest.VERSION} say; "
        "`env.unwrapped.instance.manifest` tells whether the present flow is listed there."
    )


SECTIONS: dict[str, Callable[[Subject], str]] = {
    "Description": _description,
    "Action Space": action_space,
    "What the agent may and may not change": limits,
    "Observation Space": observation_space,
    "Rewards": _rewards,
    "Starting State": _starting_state,
    "Episode End": _episode_end,
    "Information": _information,
    "Arguments": _arguments,
    "Vectorized environment": _vector,
    "Version History": _history,
}
