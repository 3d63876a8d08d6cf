"""Verdicts on pictures, as arrays (seeds, height, width, 3) of linear radiance.

A statistical verdict takes the seeds' pictures as independent and asks whether several means (of each channel, and of
each quarter of the picture) deviate by more than a stated bound plus noise. Noise is Student's t with as many degrees
of freedom as there are seeds less one, at ERRORS divided by the number of means: what four standard errors are where
the standard error is known. Noise may not hide a fault: where it exceeds what the case says it resolves, the case is
undecided, and that fails.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

#: Probability that a verdict is wrong about a program that is right: that of four standard errors, both sides.
ERRORS = 6.3e-5


@dataclass(frozen=True)
class Verdict:
    """passed: whether the answer is met; figure: what it rests on, in words; share: deviation over limit."""

    passed: bool
    figure: str
    share: float = 0.0


@cache
def student(freedom, errors):
    """What Student's t exceeds in absolute value with the probability `errors`; freedom: degrees of it, at least 1."""
    # With t = sqrt(freedom) tan(a) the density is in proportion to cos(a)^(freedom - 1).
    angle = np.linspace(0, np.pi / 2, 200001)
    mass = np.cumsum(np.cos(angle) ** (freedom - 1))
    beyond = 1 - mass / mass[-1]
    return float(np.sqrt(freedom) * np.tan(angle[np.argmax(beyond <= errors)]))


def means(pictures):
    """The means that are judged, (seeds, count): of the three channels, and of the four quarters."""
    seeds, height, width, _ = pictures.shape
    rows, columns = np.array_split(np.arange(height), 2), np.array_split(np.arange(width), 2)
    quarters = [pictures[:, r][:, :, c].mean(axis=(1, 2, 3)) for r in rows for c in columns]
    return np.concatenate([pictures.mean(axis=(1, 2)), np.stack(quarters, axis=1)], axis=1)


def zero(values, scale, bound, resolves):
    """Whether `values` (seeds, count) have means of zero but for `bound` and noise, both as shares of `scale`."""
    values = np.asarray(values, float) / scale
    if not np.isfinite(values).all():
        return Verdict(False, "not a finite number", np.inf)
    seeds, count = values.shape
    noise = student(seeds - 1, ERRORS / count) * values.std(axis=0, ddof=1) / np.sqrt(seeds)
    off = np.abs(values.mean(axis=0))
    worst = int(np.argmax(off / (noise + bound)))
    share = float(off[worst] / (noise[worst] + bound))
    figure = f"off by {_percent(off[worst])}; allowed {_percent(bound)} and noise of {_percent(noise[worst])}"
    if share > 1:
        return Verdict(False, figure, share)
    if noise.max() > resolves:
        return Verdict(False, f"undecided: noise of {_percent(noise.max())} is above {_percent(resolves)}", share)
    return Verdict(True, figure, share)


def value(pictures, answer, bound, resolves):
    """Whether a picture is of the same radiance everywhere: `answer`, a number or three, above zero."""
    answer = np.broadcast_to(np.asarray(answer, float), 3)
    return zero(means(pictures / answer) - 1, 1, bound, resolves)


def equal(first, second, bound, resolves):
    """Whether two pictures with the same seeds have the same means, as shares of the second's. Differences are taken
    seed by seed, so noise that both have in common is none."""
    scale = float(np.mean(second))
    if not scale > 0:
        return Verdict(False, "the picture to compare with is black", np.inf)
    return zero(means(np.asarray(first, float) - second), scale, bound, resolves)


def exact(first, second, factor):
    """Whether the first picture is the second times a power of two, to the last bit."""
    wanted = np.asarray(second) * np.float32(factor)
    if not np.any(wanted):
        return Verdict(False, "the picture to compare with is black", np.inf)
    wrong = int(np.count_nonzero(~(np.asarray(first) == wanted)))
    return Verdict(wrong == 0, f"{wrong} of {wanted.size} numbers differ", float(wrong))


def black(pictures, most):
    """Whether no pixel of any picture is brighter than `most`."""
    found = float(np.max(pictures)) if np.isfinite(pictures).all() else np.inf
    return Verdict(found <= most, f"brightest pixel {found:.3g}; allowed {most:.3g}", found / most)


def sweep(series, model, bound, resolves, falling=0):
    """Whether a series of pictures changes smoothly: the mean of each, less what `model` says of it, is that of its
    neighbours but for `bound` (of the largest mean) and noise, and of the first `falling` none is above the one
    before it."""
    rows = np.stack([pictures.mean(axis=(1, 2, 3)) for pictures in series], axis=1)
    scale = float(rows.mean(axis=0).max())
    if not scale > 0:
        return Verdict(False, "all pictures are black", np.inf)
    rest = rows - np.asarray(model)
    bent = zero(rest[:, 1:-1] - (rest[:, :-2] + rest[:, 2:]) / 2, scale, bound, resolves)
    if not falling or not bent.passed:
        return bent
    steps = np.diff(rows[:, :falling], axis=1) / scale
    noise = student(len(rows) - 1, ERRORS / steps.shape[1]) * steps.std(axis=0, ddof=1) / np.sqrt(len(rows))
    rise = float(np.max(steps.mean(axis=0) - noise))
    if rise > 0:
        return Verdict(False, f"rises by {_percent(rise)} more than noise explains", np.inf)
    return bent


def same(files):
    """Whether all of these bytes are equal; files: {what it is: bytes}."""
    first, *others = files
    differ = [name for name in others if files[name] != files[first]]
    return Verdict(
        not differ,
        f"{len(files)} files alike" if not differ else f"unlike {first}: {', '.join(differ)}",
        float(len(differ)),
    )


def _percent(share):
    return f"{100 * share:.3g} %"
