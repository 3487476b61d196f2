"""Beam search over snapshots for the sequence of settings that earns most."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

State = TypeVar("State")
Move = TypeVar("Move")


class Branch(NamedTuple, Generic[State, Move]):
    """One way to go on: the state it leads to, what it earned, its moves, and whether it ends."""

    state: State
    earned: float
    moves: tuple[Move, ...]
    over: bool


class Transition(NamedTuple, Generic[State]):
    """Result of a move: the state after it, its reward, and whether that is the end."""

    state: State
    reward: float
    over: bool


def beam_search(
    state: State,
    moves: Callable[[State], Sequence[Move]],
    play: Callable[[State, Move], Transition[State]],
    depth: int,
    width: int,
    same: Callable[[State], Any],
) -> Branch[State, Move]:
    """Return the best branch of at most `depth` moves from a state.

    moves: what may be tried in a state; play: tries it; width: how many branches go on after
    every move, by what they have earned; same: branches of which this is equal count as one, so
    that a beam doesn't fill up with copies. Raises ValueError for a depth or width below 1.
    """
    if depth < 1 or width < 1:
        raise ValueError(f"depth, width: expected at least 1, got {depth} and {width}")
    beam = [Branch[State, Move](state, 0.0, (), False)]
    for _ in range(depth):
        if all(branch.over for branch in beam):
            break
        grown = [branch for branch in beam if branch.over]
        for branch in beam:
            if not branch.over:
                grown += [_follow(branch, move, play) for move in moves(branch.state)]
        beam = _best(grown, width, same)
    return beam[0]


def _follow(
    branch: Branch[State, Move], move: Move, play: Callable[[State, Move], Transition[State]]
) -> Branch[State, Move]:
    state, reward, over = play(branch.state, move)
    return Branch(state, branch.earned + reward, (*branch.moves, move), over)


def _best(
    branches: list[Branch[State, Move]], width: int, same: Callable[[State], Any]
) -> list[Branch[State, Move]]:
    """Return the `width` branches that earned most, one of each kind, best first.

    At most half of them are siblings, unless there are no others: the one that earns most now may
    be a dead end, with all its siblings.
    """
    kept: dict[Any, Branch[State, Move]] = {}
    spare: dict[Any, Branch[State, Move]] = {}
    siblings = Counter[tuple[Move, ...]]()
    # a stable sort: of equals, the one that was tried first
    for branch in sorted(branches, key=lambda branch: -branch.earned):
        parent, kind = branch.moves[:-1], same(branch.state)
        if kind in kept:
            continue
        if siblings[parent] < max(width // 2, 1):
            siblings[parent] += 1
            kept[kind] = branch
        else:
            spare.setdefault(kind, branch)
        if len(kept) == width:
            break
    for kind, branch in spare.items():
        if len(kept) < width:
            kept.setdefault(kind, branch)
    return sorted(kept.values(), key=lambda branch: -branch.earned)
