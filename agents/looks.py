"""How each agent is shown: its label, colour, marker and the sentence that explains it."""

from typing import NamedTuple

Line = str | tuple[float, tuple[float, ...]]


class Agent(NamedTuple):
    """How an agent is named, drawn and described.

    colour, marker, line: as matplotlib takes them; width: of its lines [points].
    """

    label: str
    colour: str
    marker: str
    line: Line
    sentence: str
    width: float = 1.6


# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; markers and line styles do
# the same in greyscale.
AGENTS: dict[str, Agent] = {
    "random": Agent(
        "random",
        "#56B4E9",
        "*",
        (0, (1, 1.5)),
        "draws every action at random; what anything sensible has to beat.",
        # its lines jump all over the picture
        0.8,
    ),
    "default": Agent(
        "default",
        "#000000",
        "o",
        "-",
        "keeps the scene's nominal constants; what you get if you tune nothing.",
    ),
    "cfl": Agent(
        "CFL",
        "#E69F00",
        "s",
        (0, (5, 2)),
        "keeps the nominal stiffness and takes, in every frame, the largest time step that the "
        "usual stability limits (Courant, force, viscosity) allow.",
    ),
    "tuned_cfl": Agent(
        "tuned CFL",
        "#0072B2",
        "D",
        (0, (6, 1.5, 1, 1.5)),
        "softens the fluid as far as its present speed permits and steps close to the edge of "
        "stability, as a practitioner would; its work is the unit of work.",
    ),
    "grid_search": Agent(
        "grid search",
        "#CC79A7",
        "^",
        (0, (3, 1.5)),
        "keeps one setting for the whole run, the best of a grid that was tried on "
        "training instances.",
    ),
    "lookahead": Agent(
        "look-ahead",
        "#8C8C00",
        "X",
        (0, (8, 2, 1, 2, 1, 2)),
        "tries settings on snapshots of the episode and keeps the best; it sees the reference and "
        "the future, so it is a bound and no competitor.",
    ),
    "ppo": Agent(
        "PPO",
        "#009E73",
        "v",
        "-",
        "a small neural network that looks at the flow in every frame, trained on training "
        "instances by proximal policy optimisation.",
    ),
    "sac": Agent(
        "SAC",
        "#D55E00",
        "P",
        "-",
        "a small neural network that looks at the flow in every frame, trained on training "
        "instances by the soft actor-critic method.",
    ),
    "dqn": Agent(
        "DQN",
        "#A0522D",
        "h",
        (0, (4, 1, 1, 1)),
        "a small neural network that values 27 small changes of the settings in every frame, "
        "trained on training instances by deep Q-learning.",
    ),
}


def look(agent: str) -> Agent:
    """How to draw an agent; one that isn't in AGENTS is grey and keeps its name."""
    return AGENTS.get(agent, Agent(agent, "#777777", "p", (0, (2, 1)), "an agent of your own."))
