"""Converts meshes: polygons and primvars of any interpolation to indexed triangles."""

import mapbox_earcut
import numpy
from pxr import UsdGeom

from faults import Invalid

_GREY = (0.18, 0.18, 0.18)


class Faces:
    """The polygons of a mesh.

    `points`: (n, 3). `corners`: point index of each corner of each face. `counts`: number of corners of each face.
    """

    def __init__(self, where, points, counts, corners, mirrored=False):
        self.where = where
        self.points = numpy.asarray(points, numpy.float64).reshape(-1, 3)
        self.counts = numpy.asarray(counts, numpy.int64)
        self.corners = numpy.asarray(corners, numpy.int64)
        if self.counts.sum() != len(self.corners) or (self.counts < 0).any():
            raise Invalid(where, f"faceVertexCounts adds up to {self.counts.sum()}, and faceVertexIndices has "
                        f"{len(self.corners)} numbers", "export the mesh again")
        if len(self.corners) and not 0 <= self.corners.min() <= self.corners.max() < len(self.points):
            raise Invalid(where, f"faceVertexIndices names a point beyond its {len(self.points)} points",
                        "export the mesh again")
        if not (numpy.abs(self.points) <= numpy.finfo(numpy.float32).max).all():
            raise Invalid(where, "points has a coordinate that is not finite", "export the mesh again")
        self.face_of_corner = numpy.repeat(numpy.arange(len(self.counts)), self.counts)
        self._mirrored = mirrored

    def expand(self, values, interpolation, name):
        """The values (count, width) of a primvar, expanded to each corner."""
        sources = {
            UsdGeom.Tokens.constant: (1, lambda: numpy.zeros(len(self.corners), numpy.int64)),
            UsdGeom.Tokens.uniform: (len(self.counts), lambda: self.face_of_corner),
            UsdGeom.Tokens.vertex: (len(self.points), lambda: self.corners),
            UsdGeom.Tokens.varying: (len(self.points), lambda: self.corners),
            UsdGeom.Tokens.faceVarying: (len(self.corners), lambda: numpy.arange(len(self.corners))),
        }
        if interpolation not in sources:
            raise Invalid(self.where, f"{name} has an interpolation {interpolation}",
                        f"it is one of {', '.join(sources)}")
        expected, index = sources[interpolation]
        if len(values) != expected:
            raise Invalid(self.where, f"{name} has {len(values)} values, and {interpolation} interpolation takes "
                        f"{expected}", "export the mesh again")
        return values[index()]

    def triangles(self, hidden=()):
        """Corner indices of each triangle (n, 3) and the face of each. Faces in `hidden` are left out."""
        starts = numpy.cumsum(self.counts) - self.counts
        shown = numpy.ones(len(self.counts), bool)
        shown[list(hidden)] = False
        made, faces = [], []
        for count in numpy.unique(self.counts[shown & (self.counts >= 3)]):
            these = numpy.flatnonzero(shown & (self.counts == count))
            cut = self._triangulate(starts[these], count)
            made.append(cut.reshape(-1, 3))
            faces.append(numpy.repeat(these, count - 2))
        if not made:
            return numpy.empty((0, 3), numpy.int64), numpy.empty(0, numpy.int64)
        made, faces = numpy.concatenate(made), numpy.concatenate(faces)
        order = numpy.argsort(faces, kind="stable")
        made = made[order, ::-1] if self._mirrored else made[order]
        return made, faces[order]

    def _triangulate(self, starts, count):
        """Triangles (faces, count - 2, 3) of faces with `count` corners that begin at `starts`.

        Convex faces become fans; earcut cuts the others.
        """
        fan = numpy.stack([numpy.zeros(count - 2, numpy.int64), numpy.arange(1, count - 1),
                           numpy.arange(2, count)], axis=1)
        cut = numpy.repeat(fan[None], len(starts), axis=0)
        if count > 3:
            at = self.points[self.corners[starts[:, None] + numpy.arange(count)]]
            normals = numpy.cross(at[:, fan[:, 1]] - at[:, :1], at[:, fan[:, 2]] - at[:, :1])
            total = normals.sum(axis=1, keepdims=True)
            for face in numpy.flatnonzero(((normals * total).sum(axis=2) <= 0).any(axis=1)):
                found = _clip_ears(at[face], total[face, 0])
                if len(found) == count - 2:
                    cut[face] = found
        return cut + starts[:, None, None]

    def smooth_normals(self, triangles):
        """Normals at each corner: the area-weighted mean of the triangles at its point."""
        at = self.points[self.corners[triangles]]
        normals = numpy.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
        sums = numpy.zeros_like(self.points)
        for k in range(3):
            numpy.add.at(sums, self.corners[triangles[:, k]], normals)
        return sums[self.corners]

    def closed(self, triangles):
        """Whether each edge has equally many triangles in both directions, with points at equal positions merged."""
        if not len(triangles):
            return False
        size = numpy.abs(self.points).max() or 1.0
        _, merged = numpy.unique(numpy.rint(self.points / size * 1e7), axis=0, return_inverse=True)
        ends = merged.reshape(-1)[self.corners[triangles]]
        edges = numpy.concatenate([ends[:, [0, 1]], ends[:, [1, 2]], ends[:, [2, 0]]])
        edges = numpy.sort(edges[edges[:, 0] != edges[:, 1]], axis=1)
        _, uses = numpy.unique(edges, axis=0, return_counts=True)
        return bool((uses % 2 == 0).all())


def _clip_ears(at, normal):
    """Triangles of one polygon by ear clipping in the plane across its normal. Indices are of the polygon's corners."""
    axis = int(numpy.argmax(numpy.abs(normal)))
    flat = numpy.ascontiguousarray(numpy.delete(at, axis, axis=1))
    cut = mapbox_earcut.triangulate_float64(flat, numpy.array([len(flat)], numpy.uint32)).reshape(-1, 3).astype(int)
    a, b, c = (at[cut[:, k]] for k in range(3))
    turned = (numpy.cross(b - a, c - a) @ normal) < 0
    cut[turned] = cut[turned][:, ::-1]
    return cut


def of_prim(prim, stage):
    """The faces of a Mesh prim and the indices of its holes."""
    mesh, where = UsdGeom.Mesh(prim), prim.GetPath()
    get = stage.get
    points = get(mesh.GetPointsAttr())
    if points is None or not len(points):
        return None
    mirrored = get(mesh.GetOrientationAttr()) == UsdGeom.Tokens.leftHanded
    faces = Faces(where, points, get(mesh.GetFaceVertexCountsAttr(), ()), get(mesh.GetFaceVertexIndicesAttr(), ()),
                  mirrored)
    if (faces.counts < 3).any():
        stage.losses.add(where, f"{(faces.counts < 3).sum()} faces with fewer than 3 corners are left out")
    holes = [h for h in get(mesh.GetHoleIndicesAttr(), ()) if 0 <= h < len(faces.counts)]
    return faces, holes


def primvar(prim, name, stage):
    """Values (count, width) of a primvar with resolved indices, and its interpolation; None without values."""
    found = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    values = found.ComputeFlattened(stage.time) if found and found.HasValue() else None
    if values is None:
        return None
    try:
        values = numpy.asarray(values, numpy.float64)
    except (TypeError, ValueError):
        return None
    if not values.size:
        stage.losses.add(prim.GetPath(), f"its primvar {name} has no values and is ignored")
        return None
    return values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1), found.GetInterpolation()


def expanded(found, name, faces, stage, fallback):
    """The values of a primvar at each corner of the faces, an array (corners, width). `found`: result of `primvar`. If the
    number of its values is wrong, the stage reports a loss, and all values are `fallback`."""
    values, interpolation = found
    if interpolation == UsdGeom.Tokens.constant and len(values) > 1:
        stage.losses.add(faces.where, f"{name} has {len(values)} values, and constant interpolation takes 1: the first is "
                          "taken")
        values = values[:1]
    try:
        return faces.expand(values, interpolation, name)
    except Invalid as fault:
        stage.losses.add(faces.where, f"{fault.fault}: it is left out")
        return numpy.tile(fallback, (len(faces.corners), 1))


def authored_normals(prim, faces, stage):
    """Authored normals at each corner, from primvars:normals, else normals; None if absent or of the wrong length."""
    found = primvar(prim, "normals", stage)
    if found is None:
        mesh = UsdGeom.PointBased(prim)
        values = stage.get(mesh.GetNormalsAttr()) if mesh else None
        if values is None or not len(values):
            return None
        found = numpy.asarray(values, numpy.float64), mesh.GetNormalsInterpolation()
    if found[0].shape[1] != 3:
        stage.losses.add(prim.GetPath(), f"normals has {found[0].shape[1]} numbers each: they are left out, and "
                          "its faces are flat")
        return None
    try:
        return faces.expand(*found, "normals")
    except Invalid as fault:
        stage.losses.add(prim.GetPath(), f"{fault.fault}: they are left out, and its faces are flat")
        return None


def colours(prim, name, faces, stage):
    """Red, green, blue and opacity at each corner from a colour primvar; grey if it is absent."""
    found = primvar(prim, name, stage)
    if found is not None and found[0].shape[1] < 3:
        found = numpy.repeat(found[0][:, :1], 3, axis=1), found[1]
    rgb = numpy.tile(_GREY, (len(faces.corners), 1)) if found is None else \
        expanded(found, name, faces, stage, _GREY)[:, :3]
    opacity = primvar(prim, "displayOpacity", stage) if name == "displayColor" else None
    alpha = numpy.ones((len(rgb), 1)) if opacity is None else \
        expanded(opacity, "displayOpacity", faces, stage, (1.0,))[:, :1]
    return numpy.concatenate([rgb, alpha], axis=1)


def weld(faces, corners, attributes):
    """Merge corners (of triangles, flat) with equal positions and attributes to one vertex.

    `attributes`: arrays (corners of the mesh, width). Returns positions and attributes of the vertices in single
    precision, and the vertex index of each corner.
    """
    rows = [faces.corners[corners].astype(numpy.float64)[:, None]]
    rows += [array[corners].astype(numpy.float32).astype(numpy.float64) for array in attributes]
    rows = numpy.concatenate(rows, axis=1)
    _, first, index = numpy.unique(rows, axis=0, return_index=True, return_inverse=True)
    vertices = corners[first]
    positions = faces.points[faces.corners[vertices]].astype(numpy.float32)
    return positions, [array[vertices].astype(numpy.float32) for array in attributes], index.reshape(-1)
