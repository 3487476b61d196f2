"""Controllers, without any learning framework: rules, beam search, and exported networks."""

from sph_gym.controllers.adaptive import AdaptiveRule
from sph_gym.controllers.network import Network
from sph_gym.controllers.pi import PiController
from sph_gym.controllers.rules import ArticleCfl, Controller, Static, TunedCfl, nominal

__all__ = [
    "AdaptiveRule", "ArticleCfl", "Controller", "Network", "PiController", "Static", "TunedCfl",
    "nominal",
]  # fmt: skip
