"""11. Media: of density zero, very dense, without absorption, and with strong forward and backward scattering."""

from functools import partial
from math import exp, pi

import numpy as np

from . import scene as s
from . import shapes
from .answers import Equal, Value, Values
from .case import FEW, Case

TITLE = "Media"
WHITE = "Light of radiance 1 comes from everywhere and nothing absorbs, so radiance is 1 along every ray."
METHODS = ("path", "bdpt", "vcm", "sppm")
EYE = METHODS[:3]


def cloud(of, half=0.5, eye=(0, 0, 4), field_deg=8):
    """A box of a medium with an invisible border, in a white environment; the camera sees its middle."""
    return (
        s.Scene()
        .within(1)
        .add(shapes.box((-half,) * 3, (half,) * 3), s.glass(1.0, medium=of))
        .seen(eye, (0, 0, 0), field_deg)
    )


def layers(falloff):
    """An absorbing box whose density falls off exponentially along the view."""
    values = np.exp(-falloff * (np.arange(64) + 0.5) / 64)
    file = s.grid(np.broadcast_to(values[:, None, None], (64, 2, 2)), (-0.5,) * 3, (0.5,) * 3)
    name = f"layers-{falloff:g}.vol"
    return cloud(s.medium(2, 0, density=name)).beside(name, file)


def smoke(absorbed, scattered, g=0.0, burns=False):
    """Puffs of smoke in haze, in a box; if it `burns`, it emits as much as it absorbs of a radiance of 1."""
    random = np.random.default_rng(3)
    at = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 24)] * 3, indexing="ij"), -1)
    centres, radii = random.uniform(-0.3, 0.3, (5, 3)), random.uniform(0.1, 0.3, 5)
    far = np.linalg.norm(at[..., None, :] - centres, axis=-1)
    density = 0.1 + 2 * np.maximum(1 - far / radii, 0).sum(-1)
    box = (-0.5,) * 3, (0.5,) * 3
    made = s.medium(absorbed, scattered, g, "smoke.vol", "fire.vol" if burns else None)
    made = cloud(made, field_deg=12).beside("smoke.vol", s.grid(density, *box))
    return made.beside("fire.vol", s.grid(density * absorbed, *box)) if burns else made


def lantern(of):
    """A point light of 1 W/sr one metre above a matte floor, inside a ball of a medium with radius 0.3."""
    made = s.Scene().add(shapes.floor(1.5), s.diffuse(0.5))
    made = made.add(shapes.sphere((0, 1, 0), 0.3, 64), s.glass(1.0, medium=of))
    return made.point((0, 1, 0), 1.0).seen((1, 0.5, 0), (0, 0, 0), 1)


def lit(of):
    """A light, a floor, and a box of the medium `of`, if it is not None."""
    made = (
        s.Scene()
        .add(shapes.floor(1.5), s.diffuse(0.8))
        .add(shapes.ceiling(0.3, 2), s.emitter(6))
        .seen((0, 1.5, 3), (0, 0.3, 0), 30)
    )
    return made if of is None else made.add(shapes.box((-0.4, 0.1, -0.4), (0.4, 0.9, 0.4)), s.glass(1.0, medium=of))


def half_space(albedo):
    """Radiance of a half-space with isotropic scattering, in a white furnace, seen along its normal:
    1 - H(1) sqrt(1 - albedo) [Chandrasekhar 1950; by reciprocity this is the plane albedo]."""
    node, weight = np.polynomial.legendre.leggauss(64)
    mu, weight = (node + 1) / 2, weight / 2
    at = np.append(mu, 1.0)
    h = np.ones_like(at)
    for _ in range(2000):
        # The iteration of 1 / H = sqrt(1 - albedo) + albedo / 2 times the integral of mu' H(mu') / (mu + mu') converges
        # for every albedo.
        h = 1 / (np.sqrt(1 - albedo) + albedo / 2 * (weight * mu * h[:-1] / (at[:, None] + mu)).sum(axis=1))
    return float(1 - h[-1] * np.sqrt(1 - albedo))


G = (0.0, 0.999, -0.999)
FIREFLIES = "Connections between vertices this close together leave fireflies: some pixels are 50 instead of 1 after 32 iterations."
PEAK = (
    "The phase function's peak at g = 0.999 is 1e-3 radians wide: hardly a photon arrives within it, and most of the"
    " light is missing at 80,000 photons."
)
FINER = (
    " Mean free paths are shorter than the resolution of positions, half a µm: a warning names the medium, and the"
    " densest medium that positions resolve replaces it."
)
CLEAR = s.medium(0, 0)

CASES = [
    Case(
        "media-none",
        "A medium of density zero has no effect",
        {"without": partial(lit, None), "with": partial(lit, CLEAR)},
        Equal("without", ("with",), "Coefficients of zero neither absorb nor scatter.", resolves=0.06),
        METHODS,
        iterations=4,
        seeds=FEW,
    ),
    Case(
        "media-absorbing",
        "An absorbing box of optical depth 0.001, 1 and 20",
        {f"{depth:g}": partial(cloud, s.medium(depth, 0)) for depth in (0.001, 1, 20)},
        Values(
            {f"{depth:g}": exp(-depth) for depth in (0.001, 1, 20)},
            "Beer-Lambert law: exp(-depth), along rays that differ in length by less than the bound.",
            bound=0.06,
        ),
        ("path", "bdpt", "vcm", "sppm"),
        iterations=8,
        photons=2000,
        seeds=FEW,
    ),
    Case(
        "media-colour",
        "A box with different absorption of red, green and blue",
        {"scene": partial(cloud, s.medium((0.1, 1, 3), 0))},
        Value([exp(-0.1), exp(-1), exp(-3)], "Beer-Lambert law for each channel.", bound=0.01),
        METHODS,
        iterations=8,
        photons=2000,
        seeds=FEW,
    ),
    Case(
        "media-layers",
        "A box whose density falls off exponentially along the view",
        {f"{k:g}": partial(layers, k) for k in (0.5, 2, 8)},
        Values(
            {f"{k:g}": exp(-2 * (1 - exp(-k)) / k) for k in (0.5, 2, 8)},
            "Beer-Lambert law: exp(-2 times the integral of exp(-k z) from 0 to 1), within the error of 64 cells.",
            bound=0.01,
            resolves=0.1,
        ),
        METHODS,
        iterations=32,
        photons=2000,
        seeds=FEW,
    ),
    Case(
        "media-smoke",
        "Puffs of smoke without absorption, g = 0 and 0.6, in a white furnace",
        {f"g{g:g}": partial(smoke, 0, 8, g) for g in (0.0, 0.6)},
        Values({f"g{g:g}": 1.0 for g in (0.0, 0.6)}, WHITE, bound=0.005, resolves=0.1),
        EYE,
        iterations=32,
    ),
    Case(
        "media-fire",
        "Burning smoke that emits what it absorbs, in a white furnace",
        {"scene": partial(smoke, 4, 0, 0.0, True)},
        Value(1.0, "A medium in equilibrium with the light around it is invisible [Kirchhoff].", 0.005, 0.1),
        METHODS,
        iterations=32,
        photons=2000,
        seeds=FEW,
    ),
    Case(
        "media-eye-inside",
        "A camera inside a scattering box, and inside an absorbing one",
        {
            "scatters": partial(cloud, s.medium(0, 3), 0.5, (0, 0, 0.2)),
            "absorbs": partial(cloud, s.medium(1, 0), 0.5, (0, 0, 0.2)),
        },
        Values(
            {"scatters": 1.0, "absorbs": exp(-0.7)},
            WHITE
            + " An absorbing path of length 0.7 leaves exp(-0.7). Kernels of photons reach out of the box, within the"
            " bound.",
            bound=0.03,
            resolves=0.25,
        ),
        METHODS,
        iterations={None: 16, "sppm": 4},
        photons=100000,
    ),
    Case(
        "media-lamp-inside",
        "A point light inside an absorbing ball",
        {"scene": partial(lantern, s.medium(2, 0))},
        Value(
            0.5 / pi * exp(-0.6), "Albedo / pi times I / d², times exp(-2 0.3) for the path in the ball.", bound=0.005
        ),
        METHODS,
        size=8,
        seeds=FEW,
    ),
    Case(
        "media-albedo-1",
        "A scattering box without absorption, g = 0, 0.999 and -0.999, in a white furnace",
        {f"g{g:g}": partial(cloud, s.medium(0, 3, g)) for g in G},
        Values({f"g{g:g}": 1.0 for g in G}, WHITE, bound=0.005, resolves=0.1),
        METHODS,
        iterations={None: 20, "sppm": 2},
        fails={"sppm": PEAK},
    ),
    Case(
        "media-dense",
        "A box of 0.1 mm with albedo 1 and a scattering coefficient of 10^6 per metre, in a white furnace",
        {"scene": partial(cloud, s.medium(0, 1e6), 5e-5, (0, 0, 4e-4))},
        Value(1.0, WHITE, bound=0.005, resolves=0.15),
        ("path", "bdpt", "vcm"),
        iterations={None: 4, "path": 32},
        fails=dict.fromkeys(("bdpt", "vcm"), FIREFLIES),
        size=8,
    ),
    *(
        Case(
            f"media-half-space-{density:.0e}".replace("e+0", "e"),
            f"A layer of one metre with an extinction coefficient of {density:g} per metre, albedo 0.5 and 0.9",
            {f"{a:g}": partial(cloud, s.medium((1 - a) * density, a * density)) for a in (0.5, 0.9)},
            Values(
                {f"{a:g}": half_space(a) for a in (0.5, 0.9)},
                "At this density, a metre acts like a half-space, whose radiance in "
                "a white furnace is 1 - H(1) sqrt(1 - albedo), with Chandrasekhar's H for isotropic scattering."
                + FINER
                * (density > 1e2),
                bound=0.01,
                resolves=0.1,
            ),
            EYE,
            iterations={None: 32, "vcm": 48, "bdpt": 48},
            size=8,
        )
        for density in (1e2, 1e4, 1e6, 1e30)
    ),
]
