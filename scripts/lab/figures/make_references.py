"""Renders missing references: two independent halves per scene (references.py)."""

import math

from .. import references
from ..cache import Failed
from ..commands import read

ARGUMENTS = references.ARGUMENTS


def main():
    for scene in references.scenes():
        try:
            where, known = references.reference(scene)
            error = read("compare", where / "half1.exr", where / "half2.exr")
        except Failed as failed:
            print(f"{references.name(scene):<20} {failed}", flush=True)
            continue
        spent = "+".join(f"{value:.0f}" for value in known["core_seconds"])
        own, trimmed = (math.sqrt(error[key]) / 2 for key in ("relmse", "relmse_trimmed"))
        text = f"error of the mean {own:.2%}, trimmed {trimmed:.2%}, mean ratio {error['mean_ratio']:.4f}"
        print(
            f"{references.name(scene):<20} {' '.join(known['options'][1:-5]):<16} {spent:>9} core-s  {text}", flush=True
        )
