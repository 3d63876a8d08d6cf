"""Converts Mitsuba's scenes to glTF for caustique.

`mitsuba_xml` reads the XML, and `xml_shapes`, `xml_materials`, `xml_colours`, `xml_grids` and `xml_lights` read its parts. Mitsuba
itself reads meshes, images and spectra. The file lists all features that are left out or approximated, and caustique
warns of them.
"""

import sys

import mitsuba as mi
import numpy as np
import xml_grids
import xml_lights
import xml_materials
from glb_package import glb, meshes
from gltf import Unsupported, is_closed
from mitsuba_xml import Document
from xml_colours import FAULTS, colour, constant, reason, srgb, to_texture, uniform
from xml_shapes import triangles

#: Largest nesting of instances in each other.
MAX_DEPTH = 8
#: Elements of a scene that do not change what is rendered.
SETTINGS = ("integrator", "sampler", "film", "rfilter")
#: Parameters that do not change what is rendered.
IGNORED = {
    "sampling_weight", "near_clip", "far_clip", "shutter_open", "shutter_close", "max_smooth_angle", "srgb", "samples",
    "silhouette_sampling_weight", "id", "cache", "mipmap_cache", "diffuse_sampling_rate", "specular_sampling_rate",
    "main_specular_sampling", "intensity_scale", "sample_visible", "maximum_anisotropy", "accel", "material_id",
}  # fmt: skip
SHAPES = "obj, ply, serialized, cube, rectangle, sphere, disk, cylinder, shapegroup, instance and merge"


def convert(path, output, parameters=None):
    """Convert the XML at `path` to a .glb, with the environment's image and the grids of media beside it. `parameters`
    override `default`s."""
    mi.set_log_level(mi.LogLevel.Error)
    reader = Reader(path, output, parameters or {})
    try:
        with np.errstate(all="ignore"):
            reader.read()
            data = reader.pack()
    except FAULTS as error:
        raise Unsupported(f"the scene cannot be converted: {reason(error)}") from error
    if reader.sky is not None:
        mi.Bitmap(reader.sky).write(str(sky_file(output)))
    for grid in filter(None, reader.grids.values()):
        reader.grid_file(grid).write_bytes(grid.data)
    output.write_bytes(data)
    for loss in reader.losses:
        print(f"{path}: {loss}", file=sys.stderr)


def sky_file(output):
    """Path of the environment's image, beside the .glb."""
    return output.with_suffix(".environment.exr")


class Reader:
    """Reads a Mitsuba scene and collects the parts of the glTF file."""

    def __init__(self, path, output, parameters):
        self.output = output
        self.meshes, self.lights, self.cameras, self.losses = [], [], [], []
        # {shape: its mesh and material}, {BSDF: its surface}, {BSDF: its material}, {mesh: it is closed}
        self.built, self.surfaces, self.materials = {}, {}, {}
        # {medium: its grid of densities, or None}
        self.grids = {}
        self.one_sided, self.said, self.sky = 0, {}, None
        self.document = Document(path, parameters, self.lose)

    def lose(self, text):
        """Record a feature that is left out or approximated, once."""
        if text not in self.losses:
            self.losses.append(text)

    def read(self):
        """Read all elements of the scene."""
        for node in self.document.elements:
            node.used |= node.tag in ("shape", "emitter", "sensor")
            match node.tag:
                case "shape":
                    self.guarded(node, lambda node=node: self.shape(node, np.eye(4), 0))
                case "emitter":
                    self.guarded(node, lambda node=node: self.emitter(node))
                case "sensor":
                    self.guarded(node, lambda node=node: self.sensor(node))
                case "integrator":
                    self.guarded(node, lambda node=node: self.integrator(node))
                case "bsdf" | "texture" | "medium" | "ref" | "spectrum" | "volume" | "phase":
                    # References use them.
                    pass
                case _ if node.tag not in SETTINGS:
                    self.lose(f"{node.title}: this element is left out")
        if self.one_sided:
            count = f"open shapes without twosided: {self.one_sided}"
            self.lose(f"{count}; they reflect from both sides, and Mitsuba renders their backs black")
        for node in self.document.elements:
            self.name_unread(node)

    def integrator(self, node):
        """Name the settings of an integrator that change the light, and that the file cannot carry."""
        for inner in node.all("integrator"):
            self.integrator(inner)
        longest = 2 if node.type == "direct" else node.whole("max_depth", -1, -1, 2**31 - 1)
        if longest >= 0:
            self.lose(f"{node.title}: its longest path of {longest} is not carried: render with --max-depth {longest}")
        if node.boolean("hide_emitters"):
            self.lose(f"{node.title}: hide_emitters is left out: cameras see the lights")

    def guarded(self, node, read):
        """Read an element; errors of Mitsuba and numpy name it."""
        try:
            read()
        except FAULTS as error:
            raise node.fault(f"it cannot be read: {reason(error)}") from error

    def name_unread(self, node):
        """Record the parameters of the elements in use that nothing has read."""
        if node.tag in SETTINGS or not node.used or node.dropped:
            return
        for child in node.children:
            if child.tag in SETTINGS or child.name in IGNORED or child.tag == "ref" and child.used:
                continue
            if child.used:
                self.name_unread(child)
            elif node.tag != "transform" and child.tag != "transform" or child.name:
                called = " ".join(filter(None, [child.tag, child.name or child.type or child.id]))
                self.lose(f"{node.title}: its {called} is left out")

    def pack(self):
        """The bytes of the .glb."""
        lit = self.lights or "environment" in self.said or any(any(mesh.material.emission) for mesh in self.meshes)
        for what, there, kinds in (
            ("light", lit, xml_lights.KNOWN_LIGHTS),
            ("camera", self.cameras, xml_lights.KNOWN_CAMERAS),
        ):
            if not there:
                lost = f" ({'; '.join(self.losses[:3])})" if self.losses else ""
                raise Unsupported(f"the scene has no {what}: read are {kinds}{lost}; add one")
        extras = {**self.said, "losses": self.losses}
        return glb.pack(self.meshes, lights=self.lights, cameras=self.cameras, extras=extras)

    # --- shapes -------------------------------------------------------------------------------------------------------

    def shape(self, node, outer, depth):
        """Add a shape with its material. `outer` is the transform of the instance around it."""
        node.used = True
        if depth > MAX_DEPTH:
            raise node.fault(f"instances are nested more than {MAX_DEPTH} deep")
        match node.type:
            case "shapegroup":
                # Its instances use it.
                return
            case "instance":
                self.instance(node, outer, depth)
                return
            case "merge":
                for part in node.all("shape"):
                    self.shape(part, outer, depth + 1)
                return
        if node not in self.built:
            self.built[node] = self.build(node)
        if self.built[node] is not None:
            mesh, material, matrix = self.built[node]
            self.add(node, mesh, material, outer @ matrix, matrix)

    def instance(self, node, outer, depth):
        """Add the shapes of a group."""
        groups = [group for group in node.all("shape") if group.type == "shapegroup"]
        if not groups:
            raise node.fault("it refers to no shapegroup; put a ref to one inside")
        for group in groups:
            group.used = True
            for part in group.all("shape"):
                self.shape(part, outer @ node.transform(), depth + 1)

    def add(self, node, mesh, material, matrix, own):
        """Add a placed mesh. glTF keeps the front of a mirrored mesh, Mitsuba flips it."""
        if np.linalg.det(matrix[:3, :3]) * np.linalg.det(own[:3, :3]) < 0.0:
            mesh = mesh.inside_out()
        if not np.isfinite(matrix).all() or not abs(np.linalg.det(matrix[:3, :3])) > 0.0:
            self.lose(f"{node.title}: it is left out, because its transform is singular")
            return
        self.meshes.append(
            meshes.Mesh(
                name=f"{node.id or node.name or f'shape {len(self.meshes)}'} ({node.type})",
                material=material,
                transform=matrix,
                vertices=mesh.vertices,
                triangles=mesh.triangles,
                normals=mesh.normals,
                uvs=mesh.uvs,
                colors=(mesh.attributes or {}).get("colors"),
            )
        )

    def build(self, node):
        """(triangles, material, transform) of a shape, or None with a warning."""
        matrix, mesh = node.transform(), triangles(node)
        if mesh is None:
            node.drop(f"a shape of this type is left out; known are {SHAPES}")
            return None
        if not len(mesh.triangles):
            self.lose(f"{node.title}: it has no triangles")
            return None
        if node.boolean("flip_normals") != (np.linalg.det(matrix[:3, :3]) < 0.0):
            mesh = mesh.inside_out()
        bsdf, emitter = node.child("bsdf", tag="bsdf"), node.child("emitter", tag="emitter")
        interior = node.child("interior")
        node.child("exterior")
        # Without a BSDF, Mitsuba makes lights black, and other shapes grey.
        surface = self.surface(bsdf) if bsdf or not emitter else xml_materials.matte(constant(0.0))
        if surface.base.attribute:
            mesh = self.colored(node, mesh, surface.base.attribute)
        if interior is not None or emitter is not None or not surface.fits_all_meshes:
            material = self.material(bsdf, surface, node, mesh, matrix)
        else:
            key = (bsdf, bool(surface.base.attribute))
            if key not in self.materials:
                self.materials[key] = self.material(bsdf, surface, node, mesh, matrix)
            material = self.materials[key]
        if interior is not None:
            mesh, matrix = self.fill(node, material, interior, (mesh, matrix))
        if emitter is not None:
            mesh = self.emit(emitter, node, mesh, material)
        self.count_one_sided(mesh, surface, material)
        return mesh, material, matrix

    def colored(self, node, mesh, attribute):
        """The mesh with an attribute as its colours."""
        found = (mesh.attributes or {}).get(attribute)
        if found is None or found.shape[1] not in (1, 3):
            self.lose(f'{node.title}: it has no colours "{attribute}"')
            return mesh
        if attribute.startswith("face_"):
            mesh, found = mesh.facets(), np.repeat(found, 3, axis=0)
        mesh.attributes["colors"] = np.broadcast_to(found, (len(found), 3))
        return mesh

    def count_one_sided(self, mesh, surface, material):
        """Count open meshes that only caustique renders from behind."""
        if surface.two_sided or surface.null or material.transmission or any(material.emission):
            return
        mesh.positions = mesh.vertices
        self.one_sided += not is_closed(mesh)

    def surface(self, bsdf):
        """The surface of a BSDF, read once."""
        if bsdf not in self.surfaces:
            self.surfaces[bsdf] = xml_materials.surface(bsdf)
        return self.surfaces[bsdf]

    def material(self, bsdf, surface, node, mesh, matrix):
        """A material of glTF, named by the BSDF or the shape."""
        name = bsdf.id if bsdf is not None and bsdf.id else f"{node.id or node.name or node.place} ({node.type})"
        return xml_materials.material(surface, name, mesh, matrix, self.lose)

    def fill(self, node, material, interior, placed):
        """Put a medium inside a shape. Returns the placed mesh, (triangles, transform), in the space of the grid if there
        is one."""
        if interior.tag != "medium":
            return placed
        if interior not in self.grids:
            self.grids[interior] = xml_grids.density(interior)
        grid = self.grids[interior]
        medium = xml_lights.medium(interior, grid and self.grid_file(grid).name)
        if medium is None:
            return placed
        if material.null_bsdf:
            # A boundary that neither reflects nor refracts.
            material.null_bsdf, material.transmission, material.ior, material.roughness = False, 1.0, 1.0, 0.0
        if material.transmission:
            material.medium = medium
        else:
            self.lose(f"{node.title}: the medium inside is left out, because its surface transmits no light")
        return placed if grid is None else (xml_grids.in_space(*placed, grid.space), grid.space)

    def grid_file(self, grid):
        """Path of the file of a grid, beside the .glb."""
        return self.output.with_suffix(f".{[*filter(None, self.grids.values())].index(grid)}.vol")

    def emit(self, emitter, node, mesh, material):
        """Make a shape emit. Returns the mesh without normals: facets emit from their geometric front."""
        emitter.used = True
        if emitter.type not in ("area", "directionalarea"):
            emitter.drop("on a shape, only area emits")
            return mesh
        if emitter.type == "directionalarea":
            self.lose(f"{emitter.title}: it is taken as an area emitter, which emits into all directions")
        radiance = colour(emitter, "radiance", 1.0, "light")
        color, picture = radiance.color, radiance.picture
        if picture is not None:
            peak = float(max(picture.values.max(), 1e-12))
            color = color * peak
            material.emission_texture = to_texture(picture, srgb(picture.values / peak), self.lose, emitter.title)
        if (color < 0.0).any():
            raise emitter.fault("its radiance is negative")
        material.emission = tuple(float(x) for x in color)
        return type(mesh)(mesh.vertices, mesh.triangles, None, mesh.uvs, mesh.attributes)

    # --- lights and cameras -------------------------------------------------------------------------------------------

    def emitter(self, node):
        """Add a light that is not part of a shape."""
        matrix = node.transform()
        match node.type:
            case "constant":
                color = uniform(node, "radiance", 1.0, "light")
                self.surround(node, {"color": [max(float(x), 0.0) for x in color]})
            case "envmap":
                self.sky = xml_lights.environment_map(node, matrix)
                strength = max(float(uniform(node, "scale", 1.0).mean()), 0.0)
                self.surround(node, {"file": sky_file(self.output).name, "strength": strength})
            case "sky" | "sun" | "sunsky":
                image, sun = xml_lights.sky(node, matrix)
                if image is not None:
                    self.sky = image
                    self.surround(node, {"file": sky_file(self.output).name, "strength": 1.0})
                self.lights += [] if sun is None else [sun]
            case "area" if node.id:
                # Shapes refer to it.
                pass
            case _:
                light = xml_lights.light(node, matrix)
                self.lights += [] if light is None else [light]

    def surround(self, node, environment):
        """Set the environment; a scene has one."""
        if "environment" in self.said:
            self.lose(f"{node.title}: it replaces the environment before it")
        self.said["environment"] = environment

    def sensor(self, node):
        """Add a camera, with the size of its film and the medium around it."""
        width, height, crop = xml_lights.film(node)
        made = xml_lights.camera(node, (width, height))
        if made is None:
            return
        if not self.cameras:
            self.said["resolution"] = [width, height]
            if crop is not None:
                self.said["crop"] = crop
            around = node.child("medium", tag="medium")
            if around is not None and around.type == "heterogeneous":
                self.lose(f"{node.title}: the medium around it is left out: a density that varies needs a mesh around it")
                around = None
            medium = None if around is None else xml_lights.medium(around)
            if medium is not None:
                self.said["medium"] = glb.coefficients(medium)
        self.cameras.append(made)
