"""The pairs of pictures (y, z) that equations (5) and (6) of [Choi and Moon 2021] combine."""

from typing import NamedTuple


def level_pairs(*numbers):
    """Level 1 with each of the levels `numbers`: equation (6), or its dual form with one of them."""
    return lambda stack: (stack["levels"][[0] * len(numbers)], stack["levels"][[n - 1 for n in numbers]])


def finished_pairs(stack):
    """Returns the pairs of pictures for networks that read the finished picture: each of the levels 2 to 5, which share
    one camera path, with the denoised picture."""
    return stack["levels"][1:], stack["finished"][None].repeat(4, 0)


def deep_pairs(stack):
    """An independent picture (by bdpt) with a correlated one (by sppm), or four of each: equation (5)."""
    return stack["independent"], stack["correlated"]


class Pairs(NamedTuple):
    """`of` returns the pictures y and z [count, h, w, 3] of a stack. `version` is the least version of the input that has
    what they need, `identities` the pairs with different z."""

    of: object
    count: int
    version: int
    identities: tuple


PAIRS = {
    "multi": Pairs(level_pairs(2, 3, 4, 5), 4, 1, (0, 1, 2, 3)),
    **{f"dual{n}": Pairs(level_pairs(n), 1, 1, (0,)) for n in (2, 3, 4, 5)},
    "finished": Pairs(finished_pairs, 4, 3, (0,)),
    "deep-single": Pairs(deep_pairs, 1, 4, (0,)),
    "deep-multi": Pairs(deep_pairs, 4, 5, (0, 1, 2, 3)),
}
