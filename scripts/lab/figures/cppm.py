"""The chi-squared rule on its own: the size of its test by the number of photons, repeated looks at uniform light, and
what it costs in time and memory."""

from ..bench import measure


def main():
    measure("cppm", "cppm-rule")
