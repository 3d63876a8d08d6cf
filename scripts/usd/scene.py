"""Converts a stage to a document: traverses its prims and adds a node for each visible one."""

import math

import numpy
from pxr import Gf, UsdGeom, UsdLux, UsdShade

import cameras
import lights
import meshes
import shapes
from document import Document
from dome import Dome, is_dome
from faults import Invalid
from materials import Materials
from render_settings import Settings
from stage import PREDICATE, custom_keys

_UNSUPPORTED = {"BasisCurves": "curves are", "NurbsCurves": "curves are", "HermiteCurves": "curves are",
           "Points": "points are", "NurbsPatch": "a NURBS patch is", "TetMesh": "a tetrahedral mesh is",
           "Volume": "a volume is", "GeometryLight": "a GeometryLight is"}


class Scene:
    """Fills a `Document` with the visible prims of a stage at its time code."""

    def __init__(self, stage, folder):
        self._stage, self.document = stage, Document()
        self._settings = Settings(stage)
        self._materials = Materials(stage, self.document)
        self._dome = Dome(stage, folder)
        self._meshes = {}
        self._cameras = []
        self._within = []  # stack of instancers whose prototypes are being visited
        self._lit = False  # whether there is a light of any kind, shown or hidden: then there is no studio

    def fill(self):
        """Traverse the whole USD stage and add its visible prims to the glTF document."""
        purposes = self._settings.purposes()
        for child in self._stage.stage.GetPseudoRoot().GetFilteredChildren(PREDICATE):
            for make, matrix in self._walk(child, Gf.Matrix4d(1), True, "default", purposes):
                self._place(make, matrix)
        keys = self._settings.keys()
        self._place_cameras(keys)
        self._settings.arguments()  # the program reads these; here they record their losses
        if self._dome.keys is not None:
            keys["environment"] = self._dome.keys
        elif self._lit:
            keys.setdefault("environment", {"color": [0.0] * 3})
        keys["losses"] = self._stage.losses.lines
        self.document.json["scenes"][0]["extras"] = {"caustique": keys}

    def _add_loss(self, invalid):
        self._stage.losses.add(invalid.where, f"{invalid.fault}: it is left out ({invalid.hint})")

    def _place(self, make, matrix):
        try:
            made = make(matrix)
        except Invalid as invalid:
            return self._add_loss(invalid)
        if made is not None:
            world = matrix * self._stage.to_world
            self.document.node({**made, "matrix": [float(x) for row in world for x in row]})

    def _place_cameras(self, keys):
        """Put the chosen camera first, because readers take the first."""
        asked, settings = self._settings.camera(), self._settings
        self._cameras.sort(key=lambda seen: seen[0].GetPath() != asked)
        for at, (prim, matrix) in enumerate(self._cameras):
            node = cameras.node(prim, self._stage, self.document, settings.aspect(), settings.policy(), settings.lens())
            self._place(lambda _, node=node, prim=prim: {"name": str(prim.GetPath()), **node}, matrix)
            times = cameras.shutter(prim, self._stage) if at == 0 and settings.blurs() else None
            if times:
                keys.setdefault("shutter", times)
            stops = cameras.exposure(prim, self._stage)
            if at == 0 and stops:
                keys.setdefault("exposure", stops)

    def _walk(self, prim, above, shown, purpose, purposes, own_transform=True):
        """Yield a function that makes a node from a matrix, and the matrix (in stage units), for each visible prim."""
        rest, get = [(prim, above, shown, purpose, own_transform)], self._stage.get
        while rest:  # no recursion, because stages may be deeper than Python's limit
            prim, matrix, shown, purpose, own_transform = rest.pop()
            self._lit = self._lit or prim.HasAPI(UsdLux.LightAPI)
            if own_transform and prim.IsA(UsdGeom.Xformable):
                xformable = UsdGeom.Xformable(prim)
                local = xformable.GetLocalTransformation(self._stage.time)
                matrix = local if xformable.GetResetXformStack() else local * matrix
                try:
                    _check_matrix(prim.GetPath(), matrix, "look at its xformOps")
                except Invalid as invalid:
                    self._add_loss(invalid)
                    continue
            if prim.IsA(UsdGeom.Imageable):
                imageable = UsdGeom.Imageable(prim)
                shown = shown and get(imageable.GetVisibilityAttr()) != UsdGeom.Tokens.invisible
                if imageable.GetPurposeAttr().HasAuthoredValue():
                    purpose = get(imageable.GetPurposeAttr())
            if prim.IsA(UsdGeom.Camera):
                self._cameras.append((prim, matrix))
            elif shown and purpose in purposes:
                try:
                    yield from self._visible(prim, matrix, purposes)
                except Invalid as invalid:
                    self._add_loss(invalid)
            if not prim.IsA(UsdGeom.PointInstancer):
                rest += [(child, matrix, shown, purpose, True) for child in prim.GetFilteredChildren(PREDICATE)][::-1]

    def _visible(self, prim, matrix, purposes):
        name, kind = str(prim.GetPath()), prim.GetTypeName()
        if prim.IsA(UsdGeom.PointInstancer):
            yield from self._instances(prim, matrix, purposes)
        elif is_dome(prim):
            self._dome.add(prim, matrix * self._stage.to_world)
        elif prim.HasAPI(UsdLux.LightAPI) and not prim.IsA(UsdGeom.Gprim):
            if kind != "PortalLight":
                yield (lambda at: _named(name, lights.node(prim, self._stage, self.document, at))), matrix
        elif prim.IsA(UsdGeom.Mesh) or shapes.is_shape(prim) and kind not in _UNSUPPORTED:
            mesh, size = self._mesh(prim)
            if mesh is not None:
                keys = {**self._stage.links.of_mesh(prim), **custom_keys(prim, self._stage)}
                extras = {"extras": {"caustique": keys}} if keys else {}
                yield (lambda _: {"name": name, "mesh": mesh, **extras}), Gf.Matrix4d().SetScale(size) * matrix
        elif kind in _UNSUPPORTED:
            self._stage.losses.add(name, f"{_UNSUPPORTED[kind]} not carried: convert to a mesh")

    def _instances(self, prim, matrix, purposes):
        """Yield the copies of a PointInstancer's prototypes. They share meshes, and each copy is a node."""
        instancer, where, stage = UsdGeom.PointInstancer(prim), prim.GetPath(), self._stage
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        indices = stage.get(instancer.GetProtoIndicesAttr(), ())
        if len(indices) and not 0 <= min(indices) <= max(indices) < len(targets):
            raise Invalid(where, f"protoIndices names a prototype beyond its {len(targets)}", "export it again")
        mask = instancer.ComputeMaskAtTime(stage.time)
        places = instancer.ComputeInstanceTransformsAtTime(
            stage.time, stage.time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask)
        if len(places) != len(indices):
            raise Invalid(where, f"it has {len(indices)} protoIndices, and positions for {len(places)}",
                        "export it again")
        if any(primvar.HasAuthoredValue() for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvars()):
            stage.losses.add(where, "primvars of its copies are not carried: all look alike")
        parts = {}
        for at, (index, place) in enumerate(zip(indices, places)):
            if mask and not mask[at]:
                continue
            if index not in parts:
                prototype = stage.stage.GetPrimAtPath(targets[index])
                parts[index] = []
                if not prototype:
                    stage.losses.add(where, f"its prototype {targets[index]} is not there: its copies are left out")
                    continue
                if where in self._within:
                    raise Invalid(where, "it is a part of its own prototypes", "take it out of them")
                self._within.append(where)
                parts[index] = list(self._walk(prototype, Gf.Matrix4d(1), True, "default", purposes, False))
                self._within.pop()
            for make, within in parts[index]:
                at = within * place * matrix
                _check_matrix(where, at, "look at its positions, orientations and scales")
                yield make, at

    def _mesh(self, prim):
        """The glTF mesh of a Mesh or another shape (None if empty), and its scale.

        Instances, and shapes that differ only in size, share one mesh if their materials and primvars are equal.
        """
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        material = self._materials.bound(prim)
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        parts = [(s, self._materials.bound(s.GetPrim()) or material) for s in subsets]
        form, size = (source.GetPath(), self._inherited(prim) if prim.IsInstanceProxy() else ()), 1.0
        if shapes.is_shape(prim) and not parts and not prim.HasAPI(UsdLux.LightAPI):
            shape, size = shapes.shared_shape(prim, self._stage)
            form = shape, self._primvars(prim)
        key = form, material and material.GetPath(), tuple(m and m.GetPath() for _, m in parts)
        if key not in self._meshes:
            self._meshes[key] = self._convert_mesh(prim, material, parts, size)
        return self._meshes[key], size

    def _primvars(self, prim):
        """All primvars of a shape, own and inherited: names, values and interpolations."""
        found = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
        moment = self._stage.time
        return tuple((primvar.GetName(), primvar.GetInterpolation(), str(primvar.Get(moment)),
                      str(primvar.GetIndices(moment))) for primvar in found)

    def _inherited(self, prim):
        """Names and values of the primvars that meshes of an instance inherit from outside."""
        found = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
        outside = [primvar for primvar in found if not primvar.GetAttr().GetPrim().IsInstanceProxy()]
        return tuple((primvar.GetName(), str(primvar.Get(self._stage.time))) for primvar in outside)

    def _convert_mesh(self, prim, material, parts, size):
        stage, where, holes = self._stage, prim.GetPath(), ()
        if prim.IsA(UsdGeom.Mesh):
            found = meshes.of_prim(prim, stage)
            if found is None:
                stage.losses.add(where, "it has no points")
                return None
            faces, holes = found
            normals = self._normals(prim, faces)
        else:
            found = shapes.of_prim(prim, stage, size)
            if found is None:
                stage.losses.add(where, f"a {prim.GetTypeName()} is not carried")
                return None
            faces, normals = found
        triangles, of_face = faces.triangles(holes)
        closed = faces.closed(triangles)
        light_radiance = self._mesh_light(prim, faces, triangles)
        if isinstance(normals, str):
            normals = faces.smooth_normals(triangles)
        primitives, rest = [], numpy.ones(len(faces.counts), bool)
        for subset, part in parts:
            chosen = self._subset_faces(subset, len(faces.counts))
            taken = numpy.zeros(len(faces.counts), bool)
            taken[chosen] = True
            primitives.append((triangles[taken[of_face]], part))
            rest[chosen] = False
        primitives.append((triangles[rest[of_face]], material))
        fades = meshes.primvar(prim, "displayOpacity", stage) is not None
        made = [self._primitive(prim, faces, normals, corners.reshape(-1),
                                self._materials.for_mesh(part, closed, light_radiance, fades))
                for corners, part in primitives if len(corners)]
        return self.document.add("meshes", {"name": str(where), "primitives": made}) if made else None

    def _subset_faces(self, subset, count):
        """The face indices of a GeomSubset on a mesh of `count` faces."""
        where = subset.GetPrim().GetPath()
        if self._stage.get(subset.GetElementTypeAttr(), "face") != "face":
            self._stage.losses.add(where, "a subset of anything but faces is not carried")
            return []
        chosen = numpy.asarray(self._stage.get(subset.GetIndicesAttr(), ()), numpy.int64)
        inside = (chosen >= 0) & (chosen < count)
        if not inside.all():
            self._stage.losses.add(where, f"its indices name a face beyond the mesh's {count}: they are left out")
        return chosen[inside]

    def _normals(self, prim, faces):
        """Normals at each corner; None for flat faces; "smooth" for a subdivision surface."""
        scheme = self._stage.get(UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr(), "catmullClark")
        if scheme == "none":
            return meshes.authored_normals(prim, faces, self._stage)
        self._stage.losses.add(prim.GetPath(), f"subdivision ({scheme}) is not carried: its control mesh is shown, "
                                "shaded smoothly (subdivide it before it is exported)")
        return "smooth"

    def _mesh_light(self, prim, faces, triangles):
        """Radiance of a mesh light (UsdLuxMeshLightAPI), or None."""
        if not prim.HasAPI(UsdLux.LightAPI):
            return None
        light = lights.Light(prim, self._stage)
        cone = light.cone()
        if cone is not None and (cone[0] < math.pi / 2 or cone[1] > 0):
            light.add_loss("the cone of a mesh light is not carried: it shines in all directions")
        at = faces.points[faces.corners[triangles]]
        matrix = numpy.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(self._stage.time))[:3, :3]
        across = numpy.cross((at[:, 1] - at[:, 0]) @ matrix, (at[:, 2] - at[:, 0]) @ matrix)
        return light.radiance(float(numpy.linalg.norm(across, axis=1).sum() / 2))

    def _primitive(self, prim, faces, normals, corners, material):
        stage, names, arrays = self._stage, [], []
        if normals is not None:
            names.append("NORMAL")
            arrays.append(normals)
        for at, name in enumerate(material.sets):
            found = meshes.primvar(prim, name, stage)
            if found is None or found[0].shape[1] < 2:
                stage.losses.add(prim.GetPath(), f"it has no primvar {name} for the textures of its material: they "
                                  "are one colour on it")
                found = numpy.zeros((1, 2)), UsdGeom.Tokens.constant
            values = meshes.expanded(found, name, faces, stage, (0.0, 0.0))[:, :2] * (1, -1) + (0, 1)
            names.append(f"TEXCOORD_{at}")
            arrays.append(values)
        if material.color:
            names.append("COLOR_0")
            arrays.append(meshes.colours(prim, material.color, faces, stage))
        positions, values, index = meshes.weld(faces, corners, arrays)
        attributes = {"POSITION": self.document.floats(positions, bounds=True)}
        attributes.update((name, self.document.floats(array)) for name, array in zip(names, values))
        return {"attributes": attributes, "indices": self.document.indices(index), "material": material.index}


def _check_matrix(where, matrix, hint):
    """Raise an Invalid if a transform overflows single precision, which glTF cannot store."""
    if not (numpy.abs(numpy.array(matrix)) <= numpy.finfo(numpy.float32).max).all():
        raise Invalid(where, "its transform is not finite", hint)


def _named(name, made):
    return None if made is None else {"name": name, **made}
