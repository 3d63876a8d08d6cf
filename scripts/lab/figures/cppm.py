"""The chi-squared rule on its own: the size of its test by number of photons, repeated tests of uniform light, and its
cost in time and memory."""

from ..bench import measure


def main():
    measure("cppm", "cppm-rule")
