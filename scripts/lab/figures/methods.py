"""Processor seconds of every method: of an iteration, of a million light paths, of a million camera paths."""

from ..bench import measure


def main():
    measure("methods", "methods")
