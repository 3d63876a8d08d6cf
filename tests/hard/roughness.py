"""3. Roughness: from mirrors to matte surfaces, without a step where the technique or the lobe changes."""

from functools import partial
from math import pi

import numpy as np

from . import scene as s
from . import shapes
from .answers import Equal, Sweep, Values
from .case import FEW, Case

TITLE = "Roughness"
EYE = ("path", "bdpt", "vcm", "sppm")
TINY = (1e-6, 1e-5, 1e-4, 1e-3)
#: Roughness whose GGX alpha is 0.2, above which photons replace camera paths.
OWNER = 0.2**0.5


def plate(roughness, half=0.4, height=2.0):
    """White metal, seen along its normal, below a square light around the camera, which blocks no light: radiance is the
    share of the lobe that the light covers."""
    return (
        s.Scene()
        .add(shapes.floor(0.2), s.metal(1, roughness))
        .add(shapes.ceiling(half, height), s.emitter(1))
        .seen((0, 1.5, 0), (0, 0, 0), 1, up=(0, 0, -1))
    )


def lobe_share(alpha, half=0.4, height=2.0, count=800):
    """The radiance of plate() without scattering between facets: the integral of the GGX reflection at normal view over
    the light, D(h) G2(o, i) / (4 cos o cos i) cos i, as a sum over `count`² parts; Smith's height-correlated G2.
    """
    at = (np.arange(count) + 0.5) / count * 2 * half - half
    x, z = np.meshgrid(at, at)
    square = x**2 + z**2 + height**2
    cos_i = height / np.sqrt(square)
    cos_h2 = (1 + cos_i) / 2
    density = alpha**2 / (pi * (cos_h2 * (alpha**2 - 1) + 1) ** 2)
    dark = (np.sqrt(1 + alpha**2 * (1 - cos_i**2) / cos_i**2) - 1) / 2
    solid_angle = cos_i / square * (2 * half / count) ** 2
    return float(np.sum(density / (1 + dark) / 4 * solid_angle))


def behind_glass(roughness):
    """A pane of glass in front of an edge from dark to bright, under a grey sky."""
    pane = shapes.box((-1, -1, -0.05), (1, 1, 0.05))
    card = shapes.quad((1.0, 0, -1), (1, 0, 0), (0, 2, 0))
    return (
        s.Scene()
        .within(0.3)
        .add(card, s.emitter(2))
        .add(pane, s.glass(1.5, roughness))
        .seen((0.2, 0.3, 3), (0, 0, 0), 20)
    )


def mirror(roughness):
    """A metal ball under a grey sky with a bright card."""
    card = shapes.quad((1.5, 1, 1), (0, 0, 1), (0, 1, 0)).flipped()
    return (
        s.Scene()
        .within(0.3)
        .add(card, s.emitter(2))
        .add(shapes.sphere((0, 0, 0), 0.5, 48), s.metal(0.9, roughness))
        .seen((0, 0.3, 3), (0, 0, 0), 20)
    )


def _tiny(made):
    return {"0": partial(made, 0.0), **{f"{r:g}": partial(made, r) for r in TINY}}


def lobes(roughness):
    return {f"{r:g}": partial(plate, r) for r in roughness}


#: At these roughnesses, scattering between facets is below the bound, because the albedo of the lobe is close to 1.
SHARP = (0.05, 0.1, 0.2, 0.3, 0.4)
SWEEP = tuple(round(float(r), 3) for r in np.linspace(0.2, 1, 9))
SEAM = tuple(round(OWNER + step, 4) for step in (-0.006, -0.004, -0.002, 0.0, 0.002, 0.004, 0.006))

CASES = [
    Case(
        "rough-delta-metal",
        "Metal of roughness 1e-6 to 1e-3 looks like a mirror",
        _tiny(mirror),
        Equal(
            "0",
            tuple(f"{r:g}" for r in TINY),
            "The lobe tends to a delta function: at an alpha of 1e-6 it is far narrower than a pixel.",
            bound=0.005,
            resolves=0.05,
        ),
        EYE,
        iterations=4,
        photons=5000,
        seeds=FEW,
    ),
    Case(
        "rough-delta-glass",
        "Glass of roughness 1e-6 to 1e-3 looks clear",
        _tiny(behind_glass),
        Equal(
            "0",
            tuple(f"{r:g}" for r in TINY),
            "As for metal, the lobe tends to a delta function.",
            bound=0.005,
            resolves=0.05,
        ),
        EYE,
        iterations=4,
        photons=5000,
        seeds=FEW,
    ),
    Case(
        "rough-lobe",
        "A light that covers part of a lobe, against numerical integration",
        lobes(SHARP),
        Values(
            {f"{r:g}": lobe_share(r * r) for r in SHARP},
            "GGX with Smith's height-correlated shadowing, integrated "
            "over the light. White metal has no Fresnel effect. Scattering between facets adds less than 1 %.",
            bound=0.01,
            resolves=0.05,
        ),
        EYE,
        iterations=48,
        size=8,
        photons=2000,
    ),
    Case(
        "rough-sweep",
        "Roughness from 0.2 to 1 in steps of 0.1: radiance decreases smoothly",
        lobes(SWEEP),
        Sweep(
            {f"{r:g}": lobe_share(r * r) for r in SWEEP},
            "The light covers a smaller share of a wider lobe. The difference from the integral, scattering between"
            " facets, is a smooth function of alpha.",
            bound=0.01,
        ),
        EYE,
        iterations=8,
        photons=2000,
        size=8,
    ),
    Case(
        "rough-seam",
        "Roughness around 0.447 (an alpha of 0.2), where photons replace camera paths",
        lobes(SEAM),
        Sweep({f"{r:g}": lobe_share(r * r) for r in SEAM}, "As in rough-sweep.", bound=0.002),
        ("vcm", "sppm", "path"),
        iterations=16,
        photons=2000,
        size=8,
    ),
]
