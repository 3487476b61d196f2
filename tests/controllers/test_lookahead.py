import pytest

from sph_gym.controllers.lookahead import Transition, beam_search

# A walk on the integers: a step to the right costs 1, one to the left pays 1, 3 pays 10.
END = 3


def play(place, move):
    there = place + move
    return Transition(there, 10.0 if there == END else -float(move), there == END)


def search(depth, width, same=lambda place: place):
    return beam_search(0, lambda place: (-1, 1), play, depth, width, same)


def test_a_beam_finds_what_greed_does_not():
    found = search(depth=3, width=3)
    assert found.moves == (1, 1, 1)
    assert found.earned == 8.0
    assert found.over
    assert search(depth=3, width=1).moves == (-1, -1, -1)


def test_a_branch_that_is_over_is_kept_as_it_is():
    assert search(depth=7, width=4).moves == (1, 1, 1)


def test_branches_that_are_the_same_take_one_place():
    seen = []

    def moves(place):
        seen.append(place)
        return (-1, 1, 1, 1)

    beam_search(0, moves, play, 2, 3, lambda place: place)
    assert sorted(seen) == [-1, 0, 1]


def test_depth_limits_the_moves():
    assert len(search(depth=2, width=5).moves) == 2


@pytest.mark.parametrize(("depth", "width"), [(0, 1), (1, 0)])
def test_nothing_to_search_is_refused(depth, width):
    with pytest.raises(ValueError, match="depth, width: expected at least 1"):
        search(depth, width)
