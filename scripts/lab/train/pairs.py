"""The pairs of pictures (y, z) that equations (5) and (6) of [Choi and Moon 2021] combine."""


def level_pairs(*numbers):
    """Level 1 with each of the levels `numbers`: equation (6), or its dual form with one of them."""
    return lambda stack: (stack["levels"][[0] * len(numbers)], stack["levels"][[n - 1 for n in numbers]])


def finished_pairs(stack):
    """Levels 2 to 5, which share one camera path, with the denoised picture."""
    return stack["levels"][1:], stack["finished"][None].repeat(4, 0)


def deep_pairs(stack):
    """An independent picture (by bdpt) with a correlated one (by sppm), or four of each: equation (5)."""
    return stack["independent"], stack["correlated"]


# Pairs (y, z) of pictures [pairs, h, w, 3] of a stack, the number of pairs, and the least version of the input.
PAIRS = {
    "multi": (level_pairs(2, 3, 4, 5), 4, 1),
    **{f"dual{n}": (level_pairs(n), 1, 1) for n in (2, 3, 4, 5)},
    "finished": (finished_pairs, 4, 3),
    "deep-single": (deep_pairs, 1, 4),
    "deep-multi": (deep_pairs, 4, 5),
}
