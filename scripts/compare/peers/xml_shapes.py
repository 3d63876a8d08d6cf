"""Shapes of Mitsuba's XML as triangles."""

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from xml_colours import FAULTS, reason

#: Facets along a half circle.
HALF_CIRCLE_FACETS = 64
#: {file type: its plug-in}
FILES = ("obj", "ply", "serialized")
#: Buffers of a mesh of Mitsuba that are no attributes.
BUFFERS = ("vertex_positions", "vertex_normals", "vertex_texcoords")


@dataclass(eq=False)
class Triangles:
    """A mesh in object space, and its attributes by name: of vertices (V, n) or of faces (T, n)."""

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None = None
    uvs: np.ndarray | None = None
    attributes: dict[str, np.ndarray] | None = None

    def inside_out(self):
        """The mesh with its front and back exchanged."""
        normals = None if self.normals is None else -self.normals
        return Triangles(self.vertices, self.triangles[:, ::-1], normals, self.uvs, self.attributes)

    def facets(self):
        """The mesh with its own three vertices for each triangle."""
        corners = self.triangles.ravel()
        pick = lambda array: None if array is None else array[corners]
        attributes = {k: v[corners] if "vertex_" in k else v for k, v in (self.attributes or {}).items()}
        triangles = np.arange(len(corners)).reshape(-1, 3)
        return Triangles(self.vertices[corners], triangles, pick(self.normals), pick(self.uvs), attributes)

    def tangents(self):
        """Normals (T, 3), and derivatives (T, 3) of the position by u and v, of the triangles; None without uvs."""
        if self.uvs is None or not len(self.triangles):
            return None
        corners, uvs = self.vertices[self.triangles], self.uvs[self.triangles]
        edges, (du, dv) = corners[:, 1:] - corners[:, :1], np.moveaxis(uvs[:, 1:] - uvs[:, :1], -1, 0)
        area = du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0]
        usable = np.abs(area) > 1e-12
        if not usable.any():
            return None
        edges, du, dv, area = edges[usable], du[usable], dv[usable], area[usable, None]
        along_u = (edges[:, 0] * dv[:, 1:] - edges[:, 1] * dv[:, :1]) / area
        along_v = (edges[:, 1] * du[:, :1] - edges[:, 0] * du[:, 1:]) / area
        return np.cross(edges[:, 0], edges[:, 1]), along_u, along_v


def triangles(node):
    """The `Triangles` of a shape, or None if its type is unknown. Warnings name what is approximated."""
    match node.type:
        case "obj" | "ply" | "serialized" | "cube" | "rectangle":
            return loaded(node)
        case "sphere":
            center = node.vector("center")
            node.document.lose(
                f"{node.title}: a ball of {2 * HALF_CIRCLE_FACETS * HALF_CIRCLE_FACETS} facets stands in for the sphere"
            )
            return ball(node.number("radius", 1.0), 0.0 if center is None else center)
        case "disk":
            return disk()
        case "cylinder":
            return cylinder(node)
    return None


def loaded(node):
    """A mesh that Mitsuba loads."""
    described = {"type": node.type}
    if node.type in FILES:
        path = node.document.file(node)
        described["filename"] = str(path)
    if node.type in ("obj", "ply"):
        described["flip_tex_coords"] = node.boolean("flip_tex_coords", node.type == "obj")
    if node.type == "serialized":
        described["shape_index"] = node.whole("shape_index", 0)
    flat = node.boolean("face_normals", node.type in ("cube", "rectangle")) or node.type in ("cube", "rectangle")
    try:
        shape = mi.load_dict(described)
        normals, uvs = np.array(shape.vertex_normals_buffer()), np.array(shape.vertex_texcoords_buffer())
        sizes = {"vertex": shape.vertex_count(), "face": shape.face_count()}
        attributes = {
            key: np.array(shape.attribute_buffer(key)).reshape(max(1, sizes[key.split("_")[0]]), -1)
            for key in mi.traverse(shape).keys()
            if key.split("_")[0] in sizes and key not in BUFFERS
        }
    except FAULTS as error:
        raise node.fault(f"it cannot be read: {reason(error)}") from error
    return Triangles(
        np.array(shape.vertex_positions_buffer()).reshape(-1, 3),
        np.array(shape.faces_buffer()).reshape(-1, 3).astype(np.int64),
        None if flat or not normals.size else normals.reshape(-1, 3),
        uvs.reshape(-1, 2) if uvs.size else None,
        attributes,
    )


def ball(radius, center):
    """A sphere, with its poles along the z axis, and the texture coordinates of Mitsuba's."""
    theta = np.linspace(0.0, np.pi, HALF_CIRCLE_FACETS + 1)
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * HALF_CIRCLE_FACETS + 1)
    sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
    normals = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine + 0.0 * phi], -1)
    # The seam has two vertices, whose positions are equal.
    normals[:, -1] = normals[:, 0]
    normals[[0, -1]] = [[[0.0, 0.0, 1.0]], [[0.0, 0.0, -1.0]]]
    v, u = np.meshgrid(theta / np.pi, phi / (2.0 * np.pi), indexing="ij")
    rows, columns = HALF_CIRCLE_FACETS, 2 * HALF_CIRCLE_FACETS
    index = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    upper, lower = np.stack([a, c, d], -1), np.stack([a, d, b], -1)
    # At the poles one of the two triangles of a cell has no area.
    faces = np.concatenate([upper[:-1].reshape(-1, 3), lower[1:].reshape(-1, 3)])
    normals = normals.reshape(-1, 3)
    return Triangles(normals * radius + center, faces, normals, np.stack([u, v], -1).reshape(-1, 2))


def disk():
    """The unit disk, which faces +Z, with polar texture coordinates as Mitsuba's."""
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * HALF_CIRCLE_FACETS + 1)
    radius, first, n = np.repeat([0.0, 1.0], len(phi)), np.arange(len(phi) - 1), len(phi)
    around = np.tile(phi, 2)
    vertices = np.stack([radius * np.cos(around), radius * np.sin(around), 0.0 * around], -1)
    faces = np.stack([first, first + n, first + n + 1], -1)
    return Triangles(vertices, faces, None, np.stack([radius, around / (2.0 * np.pi)], -1))


def cylinder(node):
    """The side of a cylinder from `p0` to `p1`."""
    start, end = node.vector("p0"), node.vector("p1")
    start, end = np.zeros(3) if start is None else start, np.array([0.0, 0.0, 1.0]) if end is None else end
    radius, axis = node.number("radius", 1.0), end - start
    length = np.linalg.norm(axis)
    if not length > 0.0:
        raise node.fault("p0 and p1 are the same point")
    node.document.lose(f"{node.title}: {2 * HALF_CIRCLE_FACETS} facets stand in for the cylinder")
    frame = mi.Frame3f((axis / length).tolist())
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * HALF_CIRCLE_FACETS + 1)
    around = np.cos(phi)[:, None] * np.array(frame.s).ravel() + np.sin(phi)[:, None] * np.array(frame.t).ravel()
    around[-1] = around[0]
    vertices = np.concatenate([start + radius * around, end + radius * around])
    first, n = np.arange(len(phi) - 1), len(phi)
    faces = np.concatenate(
        [np.stack([first, first + 1, first + n + 1], -1), np.stack([first, first + n + 1, first + n], -1)]
    )
    u = phi / (2.0 * np.pi)
    uvs = np.concatenate([np.stack([u, 0.0 * u], -1), np.stack([u, 0.0 * u + 1.0], -1)])
    return Triangles(vertices, faces, np.concatenate([around, around]), uvs)
