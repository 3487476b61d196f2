"""Controllers, without any learning framework: rules, beam search, and exported networks."""

from collections.abc import Callable

from sph_gym.controllers.adaptive import AdaptiveRule
from sph_gym.controllers.network import Network
from sph_gym.controllers.pi import PiController
from sph_gym.controllers.rules import ArticleCfl, Controller, Static, TunedCfl, nominal
from sph_gym.controllers.shipped import ShippedPolicy, shipped

# Rules by name. Every run takes one of its own, for some remember it.
RULES: dict[str, Callable[[], Controller]] = {
    "default": lambda: nominal,
    "cfl": ArticleCfl,
    "tuned_cfl": TunedCfl,
    "adaptive": AdaptiveRule,
    "pi": PiController,
}

__all__ = [
    "RULES", "AdaptiveRule", "ArticleCfl", "Controller", "Network", "PiController",
    "ShippedPolicy", "Static", "TunedCfl", "nominal", "shipped",
]  # fmt: skip
