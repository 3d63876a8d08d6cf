"""Speed of rays relative to Embree alone, of the photon map, and of writing EXRs, in one run."""

from ..bench import measure


def main():
    measure("spine", "spine")
