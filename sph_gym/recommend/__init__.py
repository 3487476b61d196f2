"""Settings of a scene for an error or a budget, from tables of measured runs."""

from sph_gym.recommend.advice import Advice, advise
from sph_gym.recommend.published import summarize
from sph_gym.recommend.text import describe, parse_budget, parse_error, program, to_dict

__all__ = [
    "Advice",
    "advise",
    "describe",
    "parse_budget",
    "parse_error",
    "program",
    "summarize",
    "to_dict",
]
