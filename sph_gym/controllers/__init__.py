"""Controllers, without any learning framework: rules, beam search, and exported networks."""

from sph_gym.controllers.network import Network
from sph_gym.controllers.rules import (
    AdaptiveRule,
    ArticleCfl,
    Controller,
    Static,
    TunedCfl,
    nominal,
)

__all__ = [
    "AdaptiveRule",
    "ArticleCfl",
    "Controller",
    "Network",
    "Static",
    "TunedCfl",
    "nominal",
]
