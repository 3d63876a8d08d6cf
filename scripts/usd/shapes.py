"""Converts UsdGeom's shapes other than meshes to faces with normals."""

import math

import numpy
from pxr import UsdGeom

from meshes import Faces

_SIDES, _RINGS = 64, 32


# {shape whose instances differ only in size: (attribute of the size, its default)}
_SIZES = {"Sphere": ("radius", 1.0), "Cube": ("size", 2.0)}
# Attributes that define a shape.
_ATTRIBUTES = ("radius", "radiusTop", "radiusBottom", "height", "size", "width", "length", "axis")


def shared_shape(prim, stage):
    """A key that is equal for shapes that differ only in size, and the size of this shape."""
    kind = prim.GetTypeName()
    if kind in _SIZES:
        name, usual = _SIZES[kind]
        size = float(stage.get(prim.GetAttribute(name), usual)) / usual
        if size > 0:
            return (kind,), size
    return (kind, *(stage.get(prim.GetAttribute(name)) for name in _ATTRIBUTES)), 1.0


def of_prim(prim, stage, size=1.0):
    """Faces of a Sphere, Cube, Cylinder, Cone, Capsule or Plane divided by `size`, and normals at each corner.

    Returns None for other prims.
    """
    kind = prim.GetTypeName()
    get = lambda name, default: float(stage.get(prim.GetAttribute(name), default)) / size
    if kind == "Cube":
        return _cube(prim.GetPath(), get("size", 2.0) / 2)
    if kind == "Plane":
        return _plane(prim, get("width", 2.0) / 2, get("length", 2.0) / 2, stage)
    radius, height = get("radius", 1.0), get("height", 2.0)
    profiles = {
        "Sphere": lambda: _arc(radius, 0.0, -90, 90),
        "Cylinder": lambda: _cylinder(get("radius", 1.0), get("radius", 1.0), height),
        "Cylinder_1": lambda: _cylinder(get("radiusBottom", 1.0), get("radiusTop", 1.0), height),
        "Cone": lambda: _cylinder(radius, 0.0, height),
        "Capsule": lambda: _arc(get("radius", 0.5), -get("height", 1.0) / 2, -90, 0)
        + _arc(get("radius", 0.5), get("height", 1.0) / 2, 0, 90),
        "Capsule_1": lambda: _arc(get("radiusBottom", 0.5), -get("height", 1.0) / 2, -90, 0)
        + _arc(get("radiusTop", 0.5), get("height", 1.0) / 2, 0, 90),
    }
    if kind not in profiles:
        return None
    axis = _axis(prim, stage) if kind != "Sphere" else "Z"
    return revolved(prim.GetPath(), profiles[kind](), axis)


def _axis(prim, stage):
    axis = stage.get(prim.GetAttribute("axis"), "Z")
    if axis not in ("X", "Y", "Z"):
        stage.losses.add(prim.GetPath(), f"its axis is {axis}, which is none of X, Y and Z: it is taken as Z")
        return "Z"
    return axis


def _arc(radius, at, low, high):
    """A profile of a sphere: (distance from the axis, position along it, the normal's two components) for each ring."""
    steps = max(2, round(_RINGS * (high - low) / 180))
    turns = [math.radians(low + (high - low) * k / steps) for k in range(steps + 1)]
    return [(radius * max(math.cos(t), 0.0) if abs(abs(t) - math.pi / 2) > 1e-9 else 0.0, at + radius * math.sin(t),
             math.cos(t), math.sin(t)) for t in turns]


def _cylinder(bottom, top, height):
    """The profile of a frustum with caps. Points at edges occur twice, with both normals."""
    half, slope = height / 2, math.hypot(height, bottom - top) or 1.0
    side = height / slope, (bottom - top) / slope
    return [(0.0, -half, 0.0, -1.0), (bottom, -half, 0.0, -1.0), (bottom, -half, *side), (top, half, *side),
            (top, half, 0.0, 1.0), (0.0, half, 0.0, 1.0)]


def revolved(where, profile, axis="Z", sides=_SIDES):
    """Faces of a surface of revolution about an axis. The outside is to the right of the upward profile."""
    turns = numpy.arange(sides) * 2 * math.pi / sides
    ring = numpy.stack([numpy.cos(turns), numpy.sin(turns)], axis=1)
    points, normals, corners = [], [], []
    for r, z, outward, up in profile:
        points.append(numpy.concatenate([ring * r, numpy.full((sides, 1), z)], axis=1))
        normals.append(numpy.concatenate([ring * outward, numpy.full((sides, 1), up)], axis=1))
    k = numpy.arange(sides)
    following = (k + 1) % sides
    for i, (low, high) in enumerate(zip(profile, profile[1:])):
        if low[:2] == high[:2] or low[0] == high[0] == 0:
            continue
        a, b, c, d = (i * sides + k, i * sides + following, (i + 1) * sides + following, (i + 1) * sides + k)
        if low[0] == 0:
            corners.append(numpy.stack([a, c, d], axis=1))
        elif high[0] == 0:
            corners.append(numpy.stack([a, b, c], axis=1))
        else:
            corners.append(numpy.stack([a, b, c, d], axis=1))
    order = {"Z": [0, 1, 2], "X": [2, 0, 1], "Y": [1, 2, 0]}[axis]
    points, normals = (numpy.concatenate(part)[:, order] for part in (points, normals))
    corners = corners or [numpy.empty((0, 3), numpy.int64)]  # a profile without length or radius
    counts = numpy.concatenate([numpy.full(len(part), part.shape[1]) for part in corners])
    faces = Faces(where, points, counts, numpy.concatenate([part.reshape(-1) for part in corners]))
    return faces, normals[faces.corners]


def _cube(where, half):
    signs = numpy.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = Faces(where, signs * half, [4] * 6, numpy.array(quads).reshape(-1))
    return faces, _flat(faces)


def _plane(prim, half_width, half_length, stage):
    """A plane across its axis: width along X (Z for axis X), length along Y (Z for axis Y)."""
    axis = _axis(prim, stage)
    flat = [(-half_width, -half_length), (half_width, -half_length), (half_width, half_length),
            (-half_width, half_length)]
    place = {"Z": lambda u, v: (u, v, 0), "Y": lambda u, v: (u, 0, -v), "X": lambda u, v: (0, v, -u)}[axis]
    faces = Faces(prim.GetPath(), [place(u, v) for u, v in flat], [4], [0, 1, 2, 3])
    return faces, _flat(faces)


def of_sphere(where, radius):
    """Faces of a sphere about the origin, and normals at each corner."""
    return revolved(where, _arc(radius, 0.0, -90, 90))


def polygon(where, corners):
    """One face in the plane z = 0."""
    return Faces(where, [(x, y, 0.0) for x, y in corners], [len(corners)], numpy.arange(len(corners)))


def _flat(faces):
    """The face normal at each corner."""
    triangles, of_face = faces.triangles()
    at = faces.points[faces.corners[triangles]]
    normals = numpy.zeros((len(faces.counts), 3))
    normals[of_face] = numpy.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    normals /= numpy.linalg.norm(normals, axis=1, keepdims=True)
    return normals[faces.face_of_corner]


def is_shape(prim):
    """Whether a prim is a Gprim without points."""
    return prim.IsA(UsdGeom.Gprim) and not prim.IsA(UsdGeom.PointBased)
