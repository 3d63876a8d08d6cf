"""Rays against bare Embree, the photon map, EXR writing: ratios in one run."""

from ..bench import measure


def main():
    measure("spine", "spine")
