"""Random materials, objects, lights and cameras, from which the families of training scenes are built.

`r` is a numpy generator everywhere. Lengths are metres; +Z is up, and cameras look from -Y.
"""

import math

import build as b
import numpy as np

# Reflectances at normal incidence.
METALS = [(0.91, 0.92, 0.92), (0.95, 0.64, 0.54), (1.0, 0.77, 0.34), (0.56, 0.57, 0.58), (0.80, 0.60, 0.35)]
# Indices of refraction: water, acrylic, crown glass, lead glass, sapphire, zircon.
GLASSES = [1.333, 1.49, 1.52, 1.66, 1.77, 1.93]


def pick(r, choices):
    """One of a list of choices."""
    return choices[r.integers(len(choices))]


def colour(r, low=0.08, high=0.85, grey=0.5):
    """A reflectance; `grey` is the least weight of its mean."""
    value = r.uniform(low, high, 3)
    weight = r.uniform(grey, 1)
    return tuple(value * (1 - weight) + value.mean() * weight)


def light_colour(r):
    """The colour of a light, from orange to blue, its largest component 1."""
    warm = r.uniform(0, 1)
    value = np.array([1.0, 0.72, 0.42]) * warm + np.array([0.75, 0.87, 1.0]) * (1 - warm)
    return tuple(value / value.max())


def pattern(r, size=384):
    """An image of two or three colours: clouds, tiles, stripes, planks, or speckles."""
    seed, first, second = int(r.integers(1 << 30)), colour(r), colour(r)
    v, u = np.mgrid[0:size, 0:size] / size
    grain = b.noise(size, size, 24, 4, seed)
    kind = r.integers(5)
    if kind == 0:
        amount = np.clip(r.uniform(1, 3) * (b.noise(size, size, int(r.integers(2, 7)), 6, seed) - 0.5) + 0.5, 0, 1)
    elif kind == 1:
        count, joint = int(r.integers(3, 13)), r.uniform(0.01, 0.08)
        shade = np.random.default_rng(seed).random((count, count))
        amount = 0.5 * shade[(v * count).astype(int), (u * count).astype(int)]
        edge = np.minimum(np.minimum(u * count % 1, 1 - u * count % 1), np.minimum(v * count % 1, 1 - v * count % 1))
        amount = np.where(edge < joint, 1.0, amount)
    elif kind == 2:
        amount = (u * int(r.integers(3, 16)) % 1 < r.uniform(0.2, 0.8)) * 1.0
    elif kind == 3:
        amount = np.clip(1.5 * b.noise(size, size, 2, 7, seed, (int(r.integers(8, 30)), 1)) - 0.25, 0, 1)
    else:
        amount = (b.noise(size, size, int(r.integers(40, 120)), 2, seed) > r.uniform(0.55, 0.75)) * 1.0
    return b.blend(first, second, amount) * (0.85 + 0.3 * grain)[..., None]


def matte(r, name="matte"):
    """A diffuse material, of one colour or with a pattern."""
    texture = b.image(name, pattern(r)) if r.random() < 0.5 else None
    return b.principled(
        name, colour(r), r.uniform(0.6, 1), texture=texture, Specular_IOR_Level=r.choice([0.0, 0.2, 0.5])
    )


def shiny(r, name="shiny"):
    """Plastic, varnish or polished stone."""
    texture = b.image(name, pattern(r)) if r.random() < 0.4 else None
    coat = {"Coat_Weight": r.uniform(0.3, 1), "Coat_Roughness": r.uniform(0, 0.15)} if r.random() < 0.4 else {}
    return b.principled(name, colour(r), r.uniform(0.03, 0.4), texture=texture, **coat)


def metal(r, name="metal", rough=0.5):
    """A metal, smooth with probability 0.3, else of a roughness up to `rough`."""
    return b.metal(name, pick(r, METALS), 0.0 if r.random() < 0.3 else r.uniform(0.03, rough))


def clear(r, name="glass", tint=0.4, index=None):
    """Clear or, with probability `tint`, coloured glass; a little rough with probability 0.1."""
    absorption = tuple(r.uniform(0, 12, 3) * r.uniform(0.2, 2)) if r.random() < tint else None
    return b.glass(name, index or pick(r, GLASSES), r.uniform(0.02, 0.15) if r.random() < 0.1 else 0.0, absorption)


def surface(r, name="surface"):
    """An opaque material of any kind."""
    return pick(r, [matte, matte, shiny, shiny, metal])(r, name)


def scattering(r, name, density, index=1.4, g=0.0):
    """A solid or liquid that scatters; `density` is the largest scattering coefficient in 1/m."""
    material = b.principled(name, (1, 1, 1), 0.0, IOR=index, Transmission_Weight=1.0)
    fill_medium(material.node_tree, density, colour(r, 0.5, 1.0), g)
    return material


def fill_medium(tree, density, albedo, g=0.0):
    """Connects a homogeneous scattering medium to the output of a node tree of a material or world."""
    node = tree.nodes.new("ShaderNodeVolumeScatter")
    node.inputs["Color"].default_value = (*albedo, 1)
    node.inputs["Density"].default_value, node.inputs["Anisotropy"].default_value = density, g
    tree.links.new(node.outputs[0], b.export.shading.output_of(tree).inputs["Volume"])


def add(name, mesh, material, at=(0, 0, 0), turn=(0, 0, 0), scale=(1, 1, 1)):
    """Adds an object to the scene; a mesh without texture coordinates gets some for a material with a texture."""
    if any(node.type == "TEX_IMAGE" for node in material.node_tree.nodes) and not mesh.uv_layers:
        unwrap(mesh)
    return b.add_object(name, mesh, material, tuple(map(float, at)), tuple(map(float, turn)), tuple(map(float, scale)))


def unwrap(mesh):
    """Texture coordinates by position along the axes that a face is most perpendicular to."""
    vertices, loops = np.empty(3 * len(mesh.vertices)), np.empty(len(mesh.loops), int)
    normals, counts = np.empty(3 * len(mesh.polygons)), np.empty(len(mesh.polygons), int)
    mesh.vertices.foreach_get("co", vertices)
    mesh.loops.foreach_get("vertex_index", loops)
    mesh.polygons.foreach_get("normal", normals)
    mesh.polygons.foreach_get("loop_total", counts)
    at = vertices.reshape(-1, 3)
    at = (at - at.min(0)) / max(np.ptp(at, 0).max(), 1e-9)
    axis = np.repeat(np.abs(normals.reshape(-1, 3)).argmax(1), counts)
    uv = np.take_along_axis(at[loops], np.array([[1, 2], [0, 2], [0, 1]])[axis], 1)
    mesh.uv_layers.new().data.foreach_set("uv", uv.ravel())


def ground(r, size=8.0, material=None):
    """A floor or a table top with a pattern that repeats."""
    material = material or pick(r, [matte, matte, shiny])(r, "ground")
    return add("ground", b.plane("ground", size, size, uv=r.uniform(0.1, 0.5) * size), material)


def room(r, width, depth, height, materials=None, front=True, window=None):
    """A room about the origin, without a front wall unless `front`; returns its materials.

    `window` = (y, z, width, height) cuts an opening into the wall at -X.
    """
    materials = materials or [matte(r, f"wall {k}") for k in range(3)] + [pick(r, [matte, shiny])(r, "floor")]
    uv = r.uniform(0.5, 2)
    add("floor", b.plane("floor", width, depth, uv=uv), materials[3])
    add("ceiling", b.plane("ceiling", width, depth, uv=uv), materials[0], (0, 0, height), (180, 0, 0))
    walls = [("back", width, (0, depth / 2), 0, 1), ("right", depth, (width / 2, 0), -90, 2)]
    walls += [("front", width, (0, -depth / 2), 180, 1)] if front else []
    walls += [("left", depth, (-width / 2, 0), 90, 2)] if window is None else []
    for name, span, at, turn, k in walls:
        add(name, b.plane(name, span, height, uv=uv), materials[k], (*at, height / 2), (90, 0, turn))
    if window is not None:
        y, z, across, up = window
        low, high, x = z - up / 2, z + up / 2, -width / 2 - 0.05
        part = lambda size, at: add("left", b.box("left", size), materials[2], at)
        part((0.1, depth, low), (x, 0, low / 2))
        part((0.1, depth, height - high), (x, 0, (height + high) / 2))
        near, far = y - across / 2 + depth / 2, depth / 2 - y - across / 2
        part((0.1, near, up), (x, -depth / 2 + near / 2, z))
        part((0.1, far, up), (x, depth / 2 - far / 2, z))
    return materials


def panel(r, at, size, power, turn=(180, 0, 0), tint=None):
    """A rectangular area light; `power` is its radiance times its area."""
    radiance = np.array(tint or light_colour(r)) * power / (size[0] * size[1])
    return add("panel", b.plane("panel", *size), b.emission("panel", tuple(radiance)), at, turn)


def glowing(r, at, radius, power):
    """A glowing ball."""
    radiance = np.array(light_colour(r)) * power / (4 * math.pi * radius**2)
    return add("bulb", b.sphere("bulb", radius, 4), b.emission("bulb", tuple(radiance)), at)


def daylight(r, low=15, high=70, sun=True, sky=1.0):
    """A sun at `low` to `high` degrees above the horizon, and a uniform sky."""
    turn, lift = r.uniform(0, 2 * math.pi), math.radians(r.uniform(low, high))
    if sun:
        toward = (math.cos(turn) * math.cos(lift), math.sin(turn) * math.cos(lift), -math.sin(lift))
        b.sun(
            "sun",
            toward,
            r.uniform(2, 6),
            (1.0, r.uniform(0.8, 1), r.uniform(0.6, 1)),
            r.choice([0.53, 0.53, 2.0, 5.0]),
        )
    b.sky(tuple(np.array([0.22, 0.3, 0.42]) * r.uniform(0.3, 1.8) * sky))


def lamp_or_sun(r, size=1.0):
    """One small bright light above a table of this size, and weak light from elsewhere: a sun, a spot, or a panel."""
    turn = r.uniform(0, 2 * math.pi)
    at = np.array([math.cos(turn), math.sin(turn), r.uniform(0.7, 2.0)]) * size * r.uniform(1.0, 1.8)
    kind = r.integers(4)
    if kind == 0:
        return daylight(r, 25, 75)
    if kind == 1:
        b.spot(
            "spot",
            tuple(at),
            (0, 0, 0),
            90 * size**2,
            r.uniform(30, 70),
            light_colour(r),
            r.uniform(0, 0.6),
            0.01 * size,
        )
    elif kind == 2:
        b.point("point", tuple(at), 60 * size**2, light_colour(r), r.uniform(0.005, 0.05) * size)
    else:
        glowing(r, at, r.uniform(0.02, 0.12) * size, 60 * size**2)
    b.sky(tuple(np.array(light_colour(r)) * r.uniform(0.01, 0.3)))
    return None


def solid(r, size, smooth=5):
    """A mesh that stands on z = 0 and fits a cube of `size`, with the height of its centre and a name."""
    kind = r.integers(6)
    if kind == 0:
        return b.sphere("ball", size / 2, smooth), size / 2
    if kind == 1:
        shape = size * r.uniform(0.4, 1, 3)
        return b.box("box", tuple(shape), 0.04 * size), shape[2] / 2
    if kind == 2:
        return b.torus("torus", 0.35 * size, 0.14 * size, 96, 32), 0.14 * size
    if kind == 3:
        return b.lathe(
            "cylinder", b.rounded([(0, 0), (0.4 * size, 0), (0.4 * size, size), (0, size)], 0.05 * size, 4), 64
        ), 0
    if kind == 4:
        return b.lathe(
            "cone", b.rounded([(0, 0), (0.45 * size, 0), (0.02 * size, size), (0, size)], 0.03 * size, 3), 64
        ), 0
    return turned(r, size), 0


def turned(r, size):
    """A turned solid of a random smooth profile, as of a chess piece or a vase."""
    heights = np.linspace(0, size, 9)
    radii = size * r.uniform(0.1, 0.42, 9)
    radii[0] = 0.35 * size
    fine = np.linspace(0, size, 49)
    curve = np.interp(fine, heights, radii)
    curve = np.convolve(np.pad(curve, 4, mode="edge"), np.ones(9) / 9, "valid")
    return b.lathe("turned", [(0, 0), *zip(curve, fine), (0, size)], 64)


def places(r, count, extent, gap, tries=300):
    """Up to `count` points within a disc of radius `extent` that are at least `gap` apart."""
    found = []
    for _ in range(tries):
        at = r.uniform(-extent, extent, 2)
        if np.hypot(*at) < extent and all(np.hypot(*(at - other)) > gap for other in found):
            found.append(at)
        if len(found) == count:
            break
    return found


def still_life(r, count, extent, size, material):
    """Solids of random shapes on the ground; `material(r)` makes the material of each."""
    for at in places(r, count, extent, size * 1.15):
        mesh, lift = solid(r, size * r.uniform(0.5, 1))
        add("thing", mesh, material(r), (*at, lift + 0.0002), (0, 0, r.uniform(0, 360)))


def rim(radius, height, foot=0.0, flare=0.0, wave=0.0, steps=12):
    """The outer profile of a vessel: radius and height from the foot to the rim."""
    t = np.linspace(0, 1, steps)
    shape = radius * (1 + flare * t**2 + wave * np.sin(2 * math.pi * t))
    return [(0, foot), *zip(shape, foot + t * (height - foot))]


def vessel(r, radius, height, material, at, liquid=None, wall=0.08, flare=0.0, wave=0.0, sides=72):
    """A glass, of walls `wall` times its radius thick, and perhaps a liquid that reaches a little into the wall."""
    thick = wall * radius
    outside = rim(radius, height, 0, flare, wave)
    inside = [(max(x - thick, 0), z) for x, z in rim(radius, height, 1.5 * thick, flare, wave)]
    inside[0] = (0, 1.5 * thick)
    material["caustique"] = {"priority": 1}
    add(
        "vessel",
        b.lathe("vessel", b.rounded(outside, thick, 3) + b.rounded(inside, thick, 3)[::-1], sides),
        material,
        (*at, 0.0003),
    )
    if liquid is not None:
        level = height * r.uniform(0.35, 0.85)
        low = [(x + 0.15 * thick * (x > 0), z - 0.15 * thick) for x, z in inside if z < level]
        edge = float(np.interp(level, [z for _, z in inside], [x for x, _ in inside])) + 0.15 * thick
        add("liquid", b.lathe("liquid", [*low, (edge, level), (0, level)], sides), liquid, (*at, 0.0003))


def ripples(r, extent, height, count=24):
    """A function of x and y: the height of waves, from a fifth of `extent` downwards."""
    lengths = extent * np.exp(r.uniform(math.log(0.03), math.log(0.25), count))
    headings, phases = r.normal(r.uniform(0, 6.3), 0.9, count), r.uniform(0, 6.3, count)
    heights = height * (lengths / lengths.max()) ** 1.5 * np.exp(r.normal(0, 0.3, count))
    waves = np.stack([np.cos(headings), np.sin(headings)], 1) * (2 * math.pi / lengths)[:, None]
    return lambda x, y: float(np.sum(heights * np.sin(waves @ (x, y) + phases)))


def water(r, width, depth, bottom, level, roughness=1.0, tint=True, at=(0, 0)):
    """A body of water with ripples; it reaches a little below `bottom`."""
    wave = ripples(r, max(width, depth), 0.004 * max(width, depth) ** 0.7 * roughness)
    place = lambda u, v: ((u - 0.5) * width, (v - 0.5) * depth)
    mesh = b.sheet("water", 110, 110, lambda u, v: (*place(u, v), level + wave(*place(u, v))), bottom=bottom - 0.005)
    material = b.glass("water", 1.333, absorption=(0.42, 0.075, 0.035) if tint else None)
    return add("water", mesh, material, (*at, 0))


def look(r, target, distance, lift=(12, 50), turn=(-60, 60), lens=(32, 60), blur=0.15):
    """A camera at `distance` from about `target`, out of focus elsewhere with probability `blur`."""
    across, up = math.radians(r.uniform(*turn)), math.radians(r.uniform(*lift))
    aim = np.array(target) + r.normal(0, 0.05, 3) * distance * [1, 1, 0.5]
    direction = np.array([math.sin(across) * math.cos(up), -math.cos(across) * math.cos(up), math.sin(up)])
    fstop = distance * r.uniform(1, 6) if r.random() < blur else None
    b.camera(tuple(aim + direction * distance * r.uniform(0.85, 1.2)), tuple(aim), r.uniform(*lens), fstop)


def inside(r, width, depth, height, lens=(20, 32)):
    """A camera near the front wall of a room, which looks to its far half."""
    at = (r.uniform(-0.35, 0.35) * width, -0.46 * depth, r.uniform(0.35, 0.7) * height)
    to = (r.uniform(-0.3, 0.3) * width, r.uniform(0.1, 0.4) * depth, r.uniform(0.1, 0.45) * height)
    b.camera(at, to, r.uniform(*lens))
