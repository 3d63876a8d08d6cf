"""Verdicts on pictures, as arrays (seeds, height, width, 3) of linear radiance.

A statistical verdict treats the pictures of the seeds as independent. It tests whether several means (of each channel,
and of each quarter of the picture) deviate by more than a stated bound plus noise. Noise is a quantile of Student's t,
with one degree of freedom less than seeds, at the error rate ERRORS divided by the number of means; for a known standard
error this rate corresponds to four standard errors. If the noise exceeds the limit `resolves` of the case, it could hide
a fault: the case is undecided, and fails.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

#: Probability that a verdict rejects a correct program: two-sided, four standard errors of a normal distribution.
ERRORS = 6.3e-5


@dataclass(frozen=True)
class Verdict:
    """passed: whether the pictures meet the answer; figure: the numbers behind the verdict; share: deviation over limit."""

    passed: bool
    figure: str
    share: float = 0.0


@cache
def student(freedom, errors):
    """The value that |t| of Student's distribution exceeds with the probability `errors`; freedom: at least 1."""
    # With t = sqrt(freedom) tan(a), the density is proportional to cos(a)^(freedom - 1).
    angle = np.linspace(0, np.pi / 2, 200001)
    mass = np.cumsum(np.cos(angle) ** (freedom - 1))
    beyond = 1 - mass / mass[-1]
    return float(np.sqrt(freedom) * np.tan(angle[np.argmax(beyond <= errors)]))


def means(pictures):
    """The means of the three channels and of the four quarters, of shape (seeds, count)."""
    seeds, height, width, _ = pictures.shape
    rows, columns = np.array_split(np.arange(height), 2), np.array_split(np.arange(width), 2)
    quarters = [pictures[:, r][:, :, c].mean(axis=(1, 2, 3)) for r in rows for c in columns]
    return np.concatenate([pictures.mean(axis=(1, 2)), np.stack(quarters, axis=1)], axis=1)


def zero(values, scale, bound, resolves):
    """Whether the means of `values` (seeds, count) are zero within `bound` and noise, both as shares of `scale`."""
    values = np.asarray(values, float) / scale
    if not np.isfinite(values).all():
        return Verdict(False, "not a finite number", np.inf)
    seeds, count = values.shape
    noise = student(seeds - 1, ERRORS / count) * values.std(axis=0, ddof=1) / np.sqrt(seeds)
    off = np.abs(values.mean(axis=0))
    with np.errstate(divide="ignore"):
        shares = np.divide(off, noise + bound, out=np.zeros_like(off), where=off > 0)
    worst = int(np.argmax(shares))
    share = float(shares[worst])
    figure = f"off by {_percent(off[worst])}; allowed {_percent(bound)} and noise of {_percent(noise[worst])}"
    if share > 1:
        return Verdict(False, figure, share)
    if noise.max() > resolves:
        return Verdict(False, f"undecided: noise of {_percent(noise.max())} is above {_percent(resolves)}", share)
    return Verdict(True, figure, share)


def value(pictures, answer, bound, resolves):
    """Whether all pixels have the radiance `answer`, a number or three, above zero."""
    answer = np.broadcast_to(np.asarray(answer, float), 3)
    return zero(means(pictures / answer) - 1, 1, bound, resolves)


def equal(first, second, bound, resolves):
    """Whether pictures of two scenes with equal seeds have equal means, as shares of the second's. Differences are taken
    seed by seed, so common noise cancels."""
    scale = float(np.mean(second))
    if not scale > 0:
        return Verdict(False, "the picture to compare with is black", np.inf)
    return zero(means(np.asarray(first, float) - second), scale, bound, resolves)


def exact(first, second, factor):
    """Whether the first picture is, to the last bit, the second one times `factor`, a power of two."""
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
    """Whether the means of a series of pictures change smoothly: the difference of each mean from `model` is the average
    of its neighbours', within `bound` (a share of the largest mean) and noise. The first `falling` means must not
    increase."""
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
    """Whether all files have equal bytes; files: {description: bytes}."""
    first, *others = files
    differ = [name for name in others if files[name] != files[first]]
    return Verdict(
        not differ,
        f"{len(files)} equal files" if not differ else f"different from {first}: {', '.join(differ)}",
        float(len(differ)),
    )


def _percent(share):
    return f"{100 * share:.3g} %"
