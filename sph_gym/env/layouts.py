"""Layouts of observations and actions with their versions: what a network was trained with."""

from sph_gym.env import actions, observations
from sph_gym.env.rules import Rules


def observation_layout(rules: Rules) -> str:
    """Return the layout of the observations, such as "features v2"."""
    rolled_back = "+rollbacks" if rules.rollbacks else ""
    return f"{rules.observation}{rolled_back} v{observations.VERSION}"


def action_layout(mode: str) -> str:
    """Return the layout of the actions of an `action_mode`, such as "absolute v2"."""
    return f"{mode} v{actions.VERSION}"
