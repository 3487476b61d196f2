"""Who sets the controls, without any learning framework: rules, and an exported network."""

from sph_gym.controllers.network import Network
from sph_gym.controllers.rules import ArticleCfl, Controller, Static, TunedCfl, nominal

__all__ = ["ArticleCfl", "Controller", "Network", "Static", "TunedCfl", "nominal"]
