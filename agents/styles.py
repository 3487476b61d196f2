"""Styles of the agents in plots and tables, and a sentence about each."""

from typing import Literal, NamedTuple

Line = str | tuple[float, tuple[float, ...]]
Marker = str | tuple[int, Literal[0, 1, 2], int]


class AgentStyle(NamedTuple):
    """An agent in plots and tables.

    colour, marker, line: as matplotlib takes them; width: of its lines [points].
    """

    label: str
    colour: str
    marker: Marker
    line: Line = "-"
    width: float = 1.6


# Colours of M. Okabe and K. Ito, which colour-blind eyes tell apart; markers and line styles do
# the same in greyscale. The lines of the random agent jump all over the picture: they are thin.
STYLES: dict[str, AgentStyle] = {
    "random": AgentStyle("random", "#56B4E9", "*", (0, (1, 1.5)), 0.8),
    "default": AgentStyle("default", "#000000", "o"),
    "cfl": AgentStyle("CFL", "#E69F00", "s", (0, (5, 2))),
    "tuned_cfl": AgentStyle("tuned CFL", "#0072B2", "D", (0, (6, 1.5, 1, 1.5))),
    "adaptive": AgentStyle("adaptive", "#6A3D9A", "d", (0, (4, 1.5))),
    "pi": AgentStyle("PI controller", "#17BECF", "<", (0, (2, 1, 2, 3))),
    "grid_search": AgentStyle("grid search", "#CC79A7", "^", (0, (3, 1.5))),
    "random_search": AgentStyle("random search", "#E377C2", ">", (0, (3, 3))),
    "tpe": AgentStyle("TPE", "#B07AA1", "p", (0, (3, 1, 1, 1))),
    "cma_es": AgentStyle("CMA-ES", "#7F4F7A", "H", (0, (6, 3))),
    "hindsight": AgentStyle("best static in hindsight", "#F781BF", (4, 1, 0), (0, (1, 1))),
    "lookahead": AgentStyle("look-ahead", "#8C8C00", "X", (0, (8, 2, 1, 2, 1, 2))),
    "short_lookahead": AgentStyle("short look-ahead", "#B5B52E", (6, 2, 0), (0, (8, 2))),
    "ppo": AgentStyle("PPO", "#009E73", "v"),
    "ppo_lagrangian": AgentStyle("Lagrangian PPO", "#1B4D3E", r"$\clubsuit$", (0, (5, 1))),
    "ppo_warm": AgentStyle("PPO after imitation", "#66C2A5", "8", "-", 2.4),
    "imitation": AgentStyle("imitation", "#4DAF4A", r"$\spadesuit$", (0, (2, 1))),
    "rollout": AgentStyle("rollouts", "#B2182B", r"$\bigstar$", "-", 2.4),
    "sac": AgentStyle("SAC", "#D55E00", "P"),
    "dqn": AgentStyle("DQN", "#A0522D", "h", (0, (4, 1, 1, 1))),
}
# Description of each agent, as the end of a sentence that begins with its label.
SENTENCES = {
    "random": "draws every action at random; what anything sensible has to beat.",
    "default": "keeps the scene's nominal constants; what you get if you tune nothing.",
    "cfl": "keeps the nominal stiffness and takes, in every frame, the largest time step that the "
    "usual stability limits (Courant, force, viscosity) allow.",
    "tuned_cfl": "softens the fluid as far as its present speed permits and steps close to the "
    "edge of stability, as a practitioner would; its work is the unit of work.",
    "adaptive": "is the tuned CFL rule with an XSPH epsilon that follows the measured noise.",
    "pi": "is the tuned CFL rule; a PI controller corrects its sound speed, to keep the density "
    "error at half its tolerance.",
    "grid_search": "keeps one setting for the whole run, the best of a grid that was tried on "
    "training instances.",
    "random_search": "keeps one setting for the whole run, the best of random ones that were tried "
    "on training instances.",
    "tpe": "keeps one setting for the whole run, found on training instances by a tree-structured "
    "Parzen estimator.",
    "cma_es": "keeps one setting for the whole run, found on training instances by the evolution "
    "strategy CMA-ES.",
    "hindsight": "keeps the setting that turned out best on this very instance; no agent can know "
    "it beforehand.",
    "lookahead": "tries settings on snapshots of the episode and keeps the best; it sees the "
    "reference and the future, so it is a bound and no competitor.",
    "short_lookahead": "tries settings for eight steps on copies of the episode in which particles "
    "are moved a little, keeps the best one for two steps, and tries again; it sees the reference, "
    "but can't rely on rounding.",
    "ppo": "a small neural network that looks at the flow in every frame, trained on training "
    "instances by proximal policy optimisation.",
    "ppo_lagrangian": "PPO that also keeps the share of steps out of tolerance below a limit, by a "
    "price on each of them.",
    "ppo_warm": "PPO that began with the network of the imitation.",
    "imitation": "a small neural network that has learned the actions of a teacher, the look-ahead "
    "oracle unless said otherwise, for the states that it visits itself.",
    "rollout": "a small neural network that has learned which action earns most, from actions "
    "that were tried side by side in the states that it visits.",
    "sac": "a small neural network that looks at the flow in every frame, trained on training "
    "instances by the soft actor-critic method.",
    "dqn": "a small neural network that values 27 small changes of the settings in every frame, "
    "trained on training instances by deep Q-learning.",
}


def style_of(agent: str) -> AgentStyle:
    """Return the style of an agent; one of your own is grey and keeps its name.

    "ppo-small" is a variant of "ppo": its label says so, and its colour is lighter.
    """
    base, _, variant = agent.partition("-")
    if base not in STYLES:
        return AgentStyle(agent, "#777777", r"$\heartsuit$", (0, (1, 3)))
    own = STYLES[base]
    if not variant:
        return own
    lighter = "#" + "".join(f"{(int(own.colour[k : k + 2], 16) + 255) // 2:02X}" for k in (1, 3, 5))
    label = f"{own.label}, {variant.replace('_', ' ')}"
    return own._replace(label=label, colour=lighter, line=(0, (2, 2)))


def sentence(agent: str) -> str:
    """Return what an agent does, as the end of a sentence."""
    return SENTENCES.get(agent, "an agent of your own.")
