"""Few combinations that hold every pair of values of any two factors."""

import itertools
import random

# More attempts would hardly find fewer rows, and take longer.
N_ATTEMPTS = 20
N_CANDIDATES = 10


def pairwise(factors, given=()):
    """Return rows, each a dict by factor, that together with the given ones hold all pairs.

    factors: by name, the list of its values. The result depends on these arguments only.
    """
    attempts = [_rows(factors, given, random.Random(seed)) for seed in range(N_ATTEMPTS)]
    return [{name: factors[name][row[name]] for name in factors} for row in min(attempts, key=len)]


def _rows(factors, given, rng):
    """Take the one of some random rows that holds most of the missing pairs, until none is."""
    choices = {name: range(len(factors[name])) for name in factors}
    todo = {
        pair
        for one, other in itertools.combinations(factors, 2)
        for pair in itertools.product(_settings(one, choices), _settings(other, choices))
    }
    for row in given:
        todo -= _pairs({name: factors[name].index(row[name]) for name in factors}, factors)
    found = []
    while todo:
        starts = rng.choices(sorted(todo), k=N_CANDIDATES)
        rows = [_filled(dict(start), choices, todo, rng) for start in starts]
        found.append(max(rows, key=lambda row: len(_pairs(row, factors) & todo)))
        todo -= _pairs(found[-1], factors)
    return found


def _settings(name, choices):
    return [(name, k) for k in choices[name]]


def _filled(row, choices, todo, rng):
    """Give each factor that has no value yet the one that brings most of the missing pairs."""
    for name in rng.sample(list(choices), len(choices)):
        if name not in row:
            order = rng.sample(choices[name], len(choices[name]))
            row[name] = max(order, key=lambda k: len(_pairs(row | {name: k}, choices) & todo))
    return row


def _pairs(row, names):
    return set(itertools.combinations([(name, row[name]) for name in names if name in row], 2))
