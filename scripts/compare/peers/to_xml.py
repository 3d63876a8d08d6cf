"""Converts a glTF scene to a Mitsuba 3 scene: an XML file, and a folder with meshes as PLY and images as EXR."""

import xml.etree.ElementTree as ET

import gltf
import mitsuba as mi
import mitsuba_world
import numpy as np
from mitsuba_materials import Materials

#: {XML element: plug-ins that `mitsuba_world` and `mitsuba_materials` use}
TAGS = {
    "bsdf": "diffuse twosided plastic roughplastic dielectric roughdielectric thindielectric principled blendbsdf",
    "shape": "ply sphere disk",
    "emitter": "area point spot directional constant envmap",
    "texture": "bitmap",
    "medium": "homogeneous",
    "phase": "hg",
    "integrator": "path volpathmis",
    "sensor": "perspective thinlens",
    "film": "hdrfilm",
    "rfilter": "box",
    "sampler": "independent",
}
TAG = {plugin: tag for tag, plugins in TAGS.items() for plugin in plugins.split()}
#: Default width in pixels, if the scene has none.
DEFAULT_WIDTH = 640


#: Rough plug-ins, whose functions differ from caustique's.
ROUGH = {"roughplastic": "rough matte surfaces", "roughdielectric": "rough glass", "principled": "metals"}


def write(path, output, lose=gltf.refuse):
    """Convert the scene at `path` with its first camera. `lose` receives a text for each approximation or omission."""
    scene = gltf.read(path, lose)
    folder = output.with_suffix(".files")
    folder.mkdir(parents=True, exist_ok=True)
    writer = Writer(folder)
    root = gltf.extras(scene.document["scenes"][scene.document.get("scene", 0)])
    aspect = scene.cameras[0].aspect if scene.cameras else 1.0
    width, height = root.get("resolution", [DEFAULT_WIDTH, round(DEFAULT_WIDTH / aspect)])
    described = mitsuba_world.describe(scene, width, height, Materials(scene, False), writer.shape)
    kinds = set(_types(described))
    if kinds & {"point", "spot", "directional"} and kinds & {"dielectric", "thindielectric", "principled"}:
        lose("lamps without a size: Mitsuba's path tracers do not find their light through glass and off mirrors")
    rough = sorted(ROUGH[kind] for kind in kinds & set(ROUGH))
    if rough:
        lose(
            f"{', '.join(rough)}: Mitsuba's masking of facets differs, and light that they scatter more than once is lost"
        )
    element = ET.Element("scene", version="3.0.0")
    for name, value in described.items():
        if name != "type":
            writer.add(element, name, value)
    ET.indent(element)
    ET.ElementTree(element).write(output, encoding="utf-8", xml_declaration=True)


def _types(described):
    """Yields the types of the Mitsuba plug-ins in a nested description (dict)."""
    if isinstance(described, dict):
        yield described["type"]
        for part in described.values():
            yield from _types(part)


class Writer:
    """Writes XML elements, and the files that they refer to."""

    def __init__(self, folder):
        self.folder, self.files = folder, 0

    def file(self, extension):
        """Path of the next file, and its name in the XML."""
        self.files += 1
        path = self.folder / f"{self.files}.{extension}"
        return path, f"{self.folder.name}/{path.name}"

    def shape(self, mesh, materials, inside):
        """Write a mesh to a file. Returns its element's description."""
        path, name = self.file("ply")
        shape = mitsuba_world.make_mesh(mesh, materials, None)
        shape.write_ply(str(path))
        emission = materials.emission(mesh.material)
        described = {
            "type": "ply",
            "filename": name,
            "face_normals": mesh.normals is None or emission is not None,
            "bsdf": materials.describe(mesh),
        }
        if emission is not None:
            described["emitter"] = {"type": "area", "radiance": emission}
        return described if inside is None else {**described, "interior": inside}

    def image(self, array):
        """Write an image of scene-linear floats to a file. Returns its name."""
        path, name = self.file("exr")
        mi.Bitmap(np.ascontiguousarray(np.array(array), np.float32)).write(str(path))
        return name

    def add(self, parent, name, value):
        """Add a named value to an element."""
        if isinstance(value, dict) and value["type"] == "rgb":
            colour = np.broadcast_to(value["value"], 3)
            ET.SubElement(parent, "rgb", name=name, value=" ".join(repr(float(x)) for x in colour))
        elif isinstance(value, dict):
            child = ET.SubElement(parent, TAG[value["type"]], type=value["type"], name=name)
            for key, part in value.items():
                if key != "type":
                    self.add(child, key, part)
        elif isinstance(value, bool):
            ET.SubElement(parent, "boolean", name=name, value=str(value).lower())
        elif isinstance(value, int):
            ET.SubElement(parent, "integer", name=name, value=str(value))
        elif isinstance(value, (float, np.floating)):
            ET.SubElement(parent, "float", name=name, value=repr(float(value)))
        elif isinstance(value, str):
            ET.SubElement(parent, "string", name=name, value=value)
        elif isinstance(value, list):
            kind = "vector" if name == "direction" else "point"
            ET.SubElement(parent, kind, name=name, **{axis: repr(float(x)) for axis, x in zip("xyz", value)})
        elif name in ("bitmap", "data"):
            self.add(parent, "filename", self.image(value))
        else:
            child = ET.SubElement(parent, "transform", name=name)
            numbers = np.array(value.matrix, dtype=float).ravel()
            ET.SubElement(child, "matrix", value=" ".join(repr(float(x)) for x in numbers))
