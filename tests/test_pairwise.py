"""The generator of few combinations, and the mixtures of the cases."""

import itertools

from tests.cases import EULER, FACTORS, IN_ONE_PIECE, KICK, MIXED, PREDICTOR
from tests.pairwise import pairwise


def pairs(rows, names):
    return {
        ((one, row[one]), (other, row[other]))
        for row in rows
        for one, other in itertools.combinations(names, 2)
    }


def every_pair(factors):
    return {
        ((one, a), (other, b))
        for one, other in itertools.combinations(factors, 2)
        for a in factors[one]
        for b in factors[other]
    }


def test_every_pair_is_there_in_few_rows():
    factors = {"a": [0, 1, 2], "b": ["x", "y", "z"], "c": [None, True], "d": [1.0, 2.0]}
    rows = pairwise(factors)
    assert pairs(rows, factors) == every_pair(factors)
    assert len(rows) < 12
    assert rows == pairwise(factors)


def test_given_rows_are_not_repeated():
    factors = {"a": [0, 1], "b": [0, 1]}
    given = [{"a": 0, "b": 0}, {"a": 1, "b": 0}]
    assert sorted(row["a"] for row in pairwise(factors, given)) == [0, 1]
    assert all(row["b"] == 1 for row in pairwise(factors, given))
    assert pairwise(factors, pairwise(factors)) == []


def test_the_configurations_of_the_solver_hold_every_pair():
    rows = [*IN_ONE_PIECE, EULER, KICK, PREDICTOR, *(row for _, row in MIXED)]
    assert pairs(rows, FACTORS) == every_pair(FACTORS)
    assert len({name for name, _ in MIXED}) == len(MIXED) <= 10
