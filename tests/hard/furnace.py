"""7. Furnaces: under uniform light, objects that absorb nothing have the radiance of the light."""

from functools import partial

from . import scene as s
from . import shapes
from .answers import Value, Values
from .case import FEW, METHODS, Case

TITLE = "Furnace"
WHITE = "Light of radiance 1 comes from everywhere and nothing absorbs, so radiance is 1 along every ray."
ROUGHNESS = (0.0, 0.05, 0.3, 1.0)


def closed(albedo, emitted=1.0):
    """A closed box whose walls emit and reflect; the camera inside looks at a wall."""
    walls = shapes.box((-1, -1, -1), (1, 1, 1)).flipped()
    return s.Scene().add(walls, s.glowing(s.diffuse(albedo), emitted)).seen((0.1, 0.2, 0.3), (1, 0.1, 0), 30)


def white(material, mesh=None):
    """A sphere (or `mesh`) in a white environment; the camera looks at its middle."""
    return s.Scene().within(1).add(mesh or shapes.sphere((0, 0, 0), 1), material).seen((0, 0.5, 4), (0, 0, 0), 12)


def mirrors():
    """A closed room of perfect mirrors around a black ball that glows."""
    walls = shapes.box((-1, -1, -1), (1, 1, 1)).flipped()
    lamp = s.Scene().add(shapes.sphere((0.2, 0.1, -0.3), 0.5, smooth=False), s.emitter(1))
    return lamp.add(walls, s.metal(1, 0)).seen((0.8, 0.7, 0.75), (-1, 0.1, 0), 60)


#: The walls are uniform, so wide bandwidths do not blur anything.
WIDE = {None: (), "sppm": ("--initial-bandwidth", "0.3"), "vcm": ("--initial-bandwidth", "0.3")}


def _closed(albedo, iterations, photons, resolves=0.1, methods=METHODS, name="", long=False):
    return Case(
        f"furnace-albedo-{albedo}{name}",
        f"A closed box of albedo {albedo} whose walls emit",
        {"scene": partial(closed, albedo)},
        Value(
            1 / (1 - albedo),
            f"L = 1 + {albedo} L on every wall, so L = 1 / (1 - {albedo}).",
            bound=0.005,
            resolves=resolves,
        ),
        methods,
        iterations=iterations,
        photons=photons,
        options=WIDE,
        size=8,
        long=long,
    )


def _lobe(name, title, material, methods=("path", "bdpt", "vcm"), bound=0.005, iterations=32):
    scenes = {f"roughness-{r:g}": partial(white, material(r)) for r in ROUGHNESS}
    return Case(
        f"furnace-{name}",
        f"{title} in a white furnace, roughness 0 to 1",
        scenes,
        Values({label: 1.0 for label in scenes}, WHITE, bound=bound, resolves=0.06),
        methods=methods,
        iterations=iterations,
    )


def _with(material, layer, roughness, strength):
    """A material with a layer (clearcoat or sheen) of this roughness and strength on top."""
    key = {"clearcoat": "clearcoatFactor", "sheen": "sheenColorFactor"}[layer]
    return _extended(material, layer, {key: strength, f"{layer}RoughnessFactor": roughness})


def _extended(material, name, values):
    """A material with one more extension."""
    return {**material, "extensions": {**material.get("extensions", {}), f"KHR_materials_{name}": values}}


def _own(material, **keys):
    """A material with these keys of the scene format."""
    return {**material, "extras": {"caustique": keys}}


def mirror_below(tint):
    """A mirror below a smooth coat of this colour, faced by the camera in a white environment."""
    coated = _own(_with(s.metal(1, 0), "clearcoat", 0.0, 1.0), coat_color=[tint] * 3)
    return s.Scene().within(1).add(shapes.floor(1), coated).seen((0, 3, 0), (0, 0, 0), 2, (0, 0, 1))


#: The colour of a coat.
COAT = 0.25
#: A white body whose surface lets all light in, with a mean free path of a tenth of its radius.
WAX = _extended(s.diffuse(1), "diffuse_transmission", {"diffuseTransmissionFactor": 1})
WAX = _extended(WAX, "volume", {"thicknessFactor": 1})
WAX = _own(WAX, medium=s.medium(0, 10))

CASES = [
    Case(
        "furnace-mirrors",
        "A closed room of perfect mirrors with a glowing ball",
        {"scene": mirrors},
        Value(
            1.0,
            "Mirrors lose nothing, and almost every ray continues until it hits the ball: radiance is the ball's along"
            " every ray.",
            bound=0.005,
            resolves=0.1,
        ),
        ("path", "bdpt", "vcm", "sppm"),
        iterations=8,
        photons=1000,
    ),
    _closed(0.5, {None: 32, "sppm": 12}, 10000),
    _closed(0.9, {None: 32, "sppm": 4}, 5000),
    _closed(0.99, {None: 48, "sppm": 8}, 500, 0.1, ("path", "sppm")),
    _closed(0.99, 48, 500, 0.1, ("bdpt", "vcm"), "-connected", long=True),
    _closed(0.999, 8, 100, 0.3, ("path",)),
    _closed(0.999, {None: 48, "sppm": 2}, 100, 0.3, ("bdpt", "vcm", "sppm"), "-connected", long=True),
    Case(
        "furnace-diffuse",
        "A white Lambertian sphere in a white furnace",
        {"scene": partial(white, s.diffuse(1))},
        Value(1.0, WHITE, resolves=0.05),
        iterations=32,
        photons=1000,
    ),
    _lobe("metal", "White metal", lambda r: s.metal(1, r), bound=0.01),
    _lobe("glass", "Clear glass", lambda r: s.glass(1.5, r), bound=0.01),
    _lobe("plastic", "A dielectric coat over a white base", lambda r: s.plastic(1, r), bound=0.01),
    _lobe(
        "clearcoat", "A clear coat over white metal", lambda r: _with(s.metal(1, 0.5), "clearcoat", r, 1.0), bound=0.01
    ),
    _lobe("sheen", "White sheen over a white base", lambda r: _with(s.diffuse(1), "sheen", r, [1, 1, 1]), bound=0.01),
    _lobe(
        "film",
        "White metal below a thin film",
        lambda r: _extended(s.metal(1, r), "iridescence", {"iridescenceFactor": 1}),
        bound=0.01,
    ),
    _lobe(
        "paper",
        "White paper that transmits part of the diffuse light",
        lambda r: _extended(s.plastic(1, r), "diffuse_transmission", {"diffuseTransmissionFactor": 0.4}),
        bound=0.01,
    ),
    _lobe(
        "rough-diffuse",
        "A rough diffuse base (EON) below a dielectric coat",
        lambda r: _own(s.plastic(1, r), diffuse_roughness=1.0),
        bound=0.01,
        iterations=8,
    ),
    _lobe(
        "fibers",
        "White sheen of fibres over a white base",
        lambda r: _own(_with(s.diffuse(1), "sheen", r, [1, 1, 1]), sheen_model="fibers"),
        bound=0.015,
        iterations=8,
    ),
    _lobe(
        "coat-index",
        "A clear coat of index 2 over white metal",
        lambda r: _own(_with(s.metal(1, 0.5), "clearcoat", r, 1.0), coat_ior=2.0),
        bound=0.01,
        iterations=8,
    ),
    Case(
        "furnace-wax",
        "A body that scatters all light below its surface in a white furnace",
        {"scene": partial(white, WAX)},
        Value(1.0, WHITE, bound=0.005, resolves=0.2),
        ("path", "bdpt", "vcm"),
        iterations=32,
    ),
    Case(
        "coat-tint",
        "A tinted coat on a mirror, seen straight on in a white furnace",
        {"scene": lambda: mirror_below(COAT)},
        Value(
            0.04 + 0.96 * COAT,
            "A coat of index 1.5 reflects 0.04 and lets the rest pass to the mirror and back, tinted once.",
            bound=0.005,
            resolves=0.05,
        ),
        ("path", "bdpt", "vcm"),
        iterations=512,
    ),
    Case(
        "furnace-glass-box",
        "A closed box of clear glass, seen through its edges and corners",
        {"scene": partial(white, s.glass(1.5), shapes.box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3)))},
        Value(1.0, WHITE),
        seeds=FEW,
    ),
]
