"""Parts of Mitsuba's scenes, each in its own cell of a picture that Mitsuba and caustique render alike; and random
scenes, which end in a file or in an error that is named."""

import contextlib
import io
import random
import struct
import tempfile
import unittest
import warnings
import zlib
from pathlib import Path

import mitsuba as mi
import numpy as np
from test_from_xml import vol
from translation import from_xml, gltf

import caustique as cq

#: Pixels along a side of a cell, and cells along a row of the picture.
CELL, ROW = 8, 4
#: Largest relative difference of the mean of a cell.
TOLERANCE = 0.03
TEXTURE = '<texture type="bitmap" name="{name}"><string name="filename" value="{file}"/>{more}</texture>'
TURNED = '<transform name="to_uv"><scale x="2" y="1.5"/><rotate z="1" angle="25"/><translate x="0.1" y="0.3"/></transform>'
RAW = '<boolean name="raw" value="true"/>'
SQUARE = '<shape type="rectangle">{at}{inside}</shape>'


def texture(name, file, more=""):
    return TEXTURE.format(name=name, file=file, more=more)


def diffuse(inside, id=""):
    return f'<bsdf type="diffuse" {id}>{inside}</bsdf>'


#: {name: XML of a part; {at} is the transform of its cell}
PARTS = {
    "spectrum": '<shape type="serialized"><string name="filename" value="squares.serialized"/>'
                '<integer name="shape_index" value="1"/>{at}'
                + diffuse('<spectrum name="reflectance" value="400:0.1, 500:0.6, 600:0.3, 700:0.9"/>') + "</shape>",
    "placed texture": '<shape type="obj"><string name="filename" value="square.obj"/>{at}'
                      + diffuse(texture("reflectance", "image.png", TURNED)) + "</shape>",
    "vertex colours": '<shape type="ply"><string name="filename" value="square.ply"/>{at}'
                      + diffuse('<texture type="mesh_attribute" name="reflectance">'
                                '<string name="name" value="vertex_color"/></texture>') + "</shape>",
    "instance": '<shape type="shapegroup" id="group">' + SQUARE.replace(
        "{at}", '<transform name="to_world"><rotate y="1" angle="30"/></transform>').replace(
        "{inside}", diffuse(texture("reflectance", "image.png")))
                + '</shape><shape type="instance"><ref id="group"/>{at}</shape>',
    "mask": SQUARE.replace("{inside}", '<bsdf type="mask">' + texture("opacity", "image.png", RAW)
                           + diffuse('<rgb name="reflectance" value="0.9 0.1 0.2"/>') + "</bsdf>"),
    "blend": SQUARE.replace("{inside}", '<bsdf type="blendbsdf">' + texture("weight", "image.png", RAW)
                            + diffuse('<rgb name="reflectance" value="0.9 0.1 0.2"/>')
                            + diffuse('<rgb name="reflectance" value="0.1 0.2 0.9"/>') + "</bsdf>"),
    "normals": SQUARE.replace("{inside}", '<bsdf type="normalmap">' + texture("normalmap", "normals.png", RAW)
                              + diffuse("") + "</bsdf>"),
    "heights": '<shape type="obj"><string name="filename" value="square.obj"/>{at}<bsdf type="bumpmap">'
               + texture("heights", "image.png", RAW) + '<float name="scale" value="0.3"/>' + diffuse("") + "</bsdf></shape>",
    "glowing texture": SQUARE.replace("{inside}", '<emitter type="area">' + texture("radiance", "image.png") + "</emitter>"),
    "cylinder": '<shape type="cylinder"><point name="p0" x="0" y="-0.7" z="0"/><point name="p1" x="0" y="0.7" z="0"/>'
                '<float name="radius" value="0.6"/>{at}' + diffuse(texture("reflectance", "image.png")) + "</shape>",
    "sphere": '<shape type="sphere"><float name="radius" value="0.8"/>{at}'
              + diffuse(texture("reflectance", "image.png")) + "</shape>",
    "checkerboard": SQUARE.replace("{inside}", diffuse(
        '<texture type="checkerboard" name="reflectance"><float name="color0" value="0.9"/>'
        '<transform name="to_uv"><scale value="1.5"/></transform></texture>')),
}


def files(folder):
    """Write the images and meshes that the parts use."""
    v, u = np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 8), indexing="ij")
    image = np.stack([u, v, 1 - u * v], -1)
    normals = np.stack([0.35 + 0.3 * u, 0.6 - 0.4 * v, 0.9 + 0 * u], -1)
    for name, values in (("image", image), ("normals", normals)):
        mi.Bitmap(np.rint(255 * values).astype(np.uint8)).write(str(folder / f"{name}.png"))
    (folder / "square.obj").write_text(
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")
    (folder / "square.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property float r\nproperty float g\nproperty float b\nelement face 2\nproperty list uchar int vertex_index\n"
        "end_header\n-1 -1 0 1 0 0\n1 -1 0 0 1 0\n1 1 0 0 0 1\n-1 1 0 .5 .5 .5\n3 0 1 2\n3 0 2 3\n")
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    data, starts = b"", []
    for size in (3.0, 0.8):
        starts.append(len(data))
        body = struct.pack("<I5sQQ", 0x1000, b"mesh\0", 4, 2) + (size * corners).astype("<f4").tobytes()
        body += np.array([[0, 1, 2], [0, 2, 3]], "<u4").tobytes()
        data += struct.pack("<HH", 0x041C, 4) + zlib.compress(body)
    (folder / "squares.serialized").write_bytes(data + struct.pack("<QQI", *starts, 2))


class Parts(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def scene(self, parts):
        """A scene with a part in each cell, under a slanted sun and a weak sky, and an orthographic camera."""
        rows = -(-len(parts) // ROW)
        shapes = ""
        for index, part in enumerate(parts.values()):
            x, y = index % ROW - (ROW - 1) / 2, (rows - 1) / 2 - index // ROW
            scale = '<scale x="-0.4" y="0.4" z="0.4"/>' if "instance" in part else '<scale value="0.4"/>'
            at = f'<transform name="to_world">{scale}<translate x="{x}" y="{y}"/></transform>'
            shapes += part.replace("{at}", at)
        path = self.folder / "scene.xml"
        (self.folder / "parts.xml").write_text(f'<scene version="3.0.0">{shapes}</scene>')
        path.write_text(
            f'<scene version="3.0.0"><default name="brightness" value="1"/>'
            f'<integrator type="path"/><sensor type="orthographic"><transform name="to_world">'
            f'<scale x="{ROW / 2}" y="{ROW / 2}"/><lookat origin="0 0 5" target="0 0 0" up="0 1 0"/></transform>'
            f'<film type="hdrfilm"><integer name="width" value="{ROW * CELL}"/>'
            f'<integer name="height" value="{rows * CELL}"/><rfilter type="box"/></film></sensor>'
            '<emitter type="constant"><float name="radiance" value="0.3"/></emitter><emitter type="directional">'
            '<vector name="direction" x="0.6" y="-0.3" z="-1"/><rgb name="irradiance" value="2 1.8 1.5"/></emitter>'
            '<include filename="parts.xml"/></scene>')
        return path

    def cells(self, picture):
        """Mean (rows, columns, 3) of the cells of a picture."""
        height, width = picture.shape[:2]
        return picture.reshape(height // CELL, CELL, width // CELL, CELL, 3).mean((1, 3)).reshape(-1, 3)

    def convert(self, path):
        """Convert a scene. Returns the warnings."""
        said = io.StringIO()
        with contextlib.redirect_stderr(said):
            from_xml.convert(path, self.folder / "scene.glb")
        return said.getvalue()

    def ratios(self, path):
        """Means of the cells of caustique's picture of the converted scene, relative to Mitsuba's of the file."""
        theirs = self.cells(np.array(mi.render(mi.load_file(str(path)), spp=512, seed=1))[..., :3])
        with warnings.catch_warnings(action="ignore"):
            ours = cq.Scene(self.folder / "scene.glb").render(method="path", iterations=512, seed=1, finish=False).picture
        return self.cells(ours) / theirs

    def test_each_part_looks_as_in_mitsuba(self):
        files(self.folder)
        path = self.scene(PARTS)
        self.convert(path)
        for name, ratio in zip(PARTS, self.ratios(path), strict=True):
            with self.subTest(name):
                np.testing.assert_allclose(ratio, 1.0, atol=TOLERANCE)

    def test_a_texture_that_is_upside_down_is_detected(self):
        files(self.folder)
        part = PARTS["placed texture"]
        self.convert(self.scene({"part": part.replace('y="1.5"', 'y="-1.5"')}))
        path = self.scene({"part": part})
        self.assertGreater(np.abs(self.ratios(path) - 1.0).max(), TOLERANCE)
        self.convert(path)
        np.testing.assert_allclose(self.ratios(path), 1.0, atol=TOLERANCE)

    def test_features_that_are_left_out_are_named_with_their_place(self):
        scene = self.folder / "scene.xml"
        scene.write_text(
            '<scene version="0.5.0">\n<sensor type="perspective"/>\n<emitter type="point"/>\n'
            '<shape type="hair" id="fur"/>\n<widget/>\n'
            '<shape type="cube"><bsdf type="roughconductor"><float name="alphaU" value="0.1"/><float name="alphaV" value="0.4"/>'
            '<float name="gloss" value="1"/></bsdf></shape>\n'
            '<shape type="cube"><bsdf type="velvet"/></shape>\n</scene>')
        said = self.convert(scene)
        for line in ('line 4: shape "fur" (hair): a shape of this type is left out', "line 5: widget: this element is left out",
                     "line 6: bsdf (roughconductor): its float gloss is left out", "line 7: bsdf (velvet): a BSDF of this type"):
            self.assertIn(line, said)
        material = gltf.chunks((self.folder / "scene.glb").read_bytes())[0]["materials"][0]
        # alpha is the square of the roughness; along the other axis it is mix(alpha, 1, strength^2).
        low = material["pbrMetallicRoughness"]["roughnessFactor"] ** 2
        anisotropy = material["extensions"]["KHR_materials_anisotropy"]
        self.assertAlmostEqual(low, 0.1)
        self.assertAlmostEqual(low + (1 - low) * anisotropy["anisotropyStrength"] ** 2, 0.4)
        self.assertAlmostEqual(anisotropy["anisotropyRotation"], np.pi / 2)

    def test_smoke_absorbs_as_its_grid_says(self):
        """Four cells from the right to the left, 1 1 3 3, of an absorbing grid before a sky of 1. The box of the grid is the
        unit cube, or that of the file, in a turned mesh that is larger. The transmittance is exp(-0.4 value 2) where the
        cells at the ends are, and 1 where the box is not."""
        turn = '<scale x="-1"/>'
        for place, more, box in [('<scale value="2"/><translate x="-1" y="-1" z="-1"/>', "", (5, 5, 5, 7, 7, 7)),
                                 ("", '<boolean name="use_grid_bbox" value="true"/>', (-1, -1, -1, 1, 1, 1))]:
            (self.folder / "smoke.vol").write_bytes(vol([1, 1, 3, 3], box))
            path = self.folder / "scene.xml"
            path.write_text(
                '<scene version="3.0.0"><sensor type="perspective"><transform name="to_world">'
                '<lookat origin="0 0 100" target="0 0 0" up="0 1 0"/></transform>'
                f'<float name="fov" value="{np.degrees(2 * np.arctan(1.5 / 100))}"/><film type="hdrfilm">'
                '<integer name="width" value="6"/><integer name="height" value="4"/><rfilter type="box"/></film></sensor>'
                '<emitter type="constant"><float name="radiance" value="1"/></emitter>'
                '<shape type="cube"><transform name="to_world"><scale x="2" y="3" z="4"/><rotate y="1" angle="10"/></transform>'
                '<bsdf type="null"/><medium type="heterogeneous" name="interior"><float name="scale" value="0.4"/>'
                '<rgb name="albedo" value="0"/><volume type="gridvolume" name="sigma_t">'
                f'<transform name="to_world">{place}{turn}</transform><string name="filename" value="smoke.vol"/>{more}'
                "</volume></medium></shape></scene>")
            self.assertEqual(self.convert(path), "")
            scene = cq.Scene(self.folder / "scene.glb")
            columns = scene.render(method="path", iterations=1024, seed=1, finish=False).picture.mean((0, 2))
            # Columns are half a metre wide.
            np.testing.assert_allclose(columns[[0, 1, 4, 5]], [1.0, np.exp(-2.4), np.exp(-0.8), 1.0], atol=TOLERANCE)

    def test_a_shapegroup_is_written_once(self):
        files(self.folder)
        group = PARTS["instance"].replace("{at}", "")
        copies = "".join(f'<shape type="instance"><ref id="group"/><transform name="to_world"><translate x="{x}"/>'
                         "</transform></shape>" for x in range(20))
        path = self.scene({"group": group + copies})
        self.convert(path)
        document = gltf.chunks((self.folder / "scene.glb").read_bytes())[0]
        self.assertEqual(len(document["meshes"]), 1)
        self.assertEqual(sum("mesh" in node for node in document["nodes"]), 21)

    def test_a_sun_and_a_sky_have_the_light_of_mitsubas(self):
        path = self.folder / "scene.xml"
        path.write_text(
            '<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"><transform name="to_world">'
            '<lookat origin="0 5 0" target="0 0 0" up="0 0 1"/></transform><film type="hdrfilm">'
            '<integer name="width" value="8"/><integer name="height" value="8"/><rfilter type="box"/></film></sensor>'
            '<emitter type="sunsky"><vector name="sun_direction" x="0.3" y="1" z="0.2"/>'
            '<transform name="to_world"><rotate x="1" angle="-90"/></transform></emitter>'
            '<shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="-90"/></transform></shape>'
            "</scene>")
        self.convert(path)
        theirs = np.array(mi.render(mi.load_file(str(path)), spp=2048, seed=1))[..., :3].mean((0, 1))
        with warnings.catch_warnings(action="ignore"):
            scene = cq.Scene(self.folder / "scene.glb")
            ours = scene.render(method="path", iterations=256, seed=1, finish=False).picture.mean((0, 1))
        np.testing.assert_allclose(ours / theirs, 1.0, atol=TOLERANCE)


TAGS = {
    "shape": "obj ply serialized cube rectangle sphere disk cylinder shapegroup instance merge bspline".split(),
    "bsdf": [*from_xml.xml_materials.READERS, "velvet"],
    "emitter": "area point spot directional constant envmap projector sky".split(),
    "sensor": "perspective thinlens orthographic fisheye".split(),
    "texture": "bitmap checkerboard mesh_attribute scale noise".split(),
    "medium": "homogeneous heterogeneous".split(),
    "film": ["hdrfilm"], "phase": ["hg", "sggx"], "integrator": ["path"], "volume": ["constvolume", "gridvolume"],
}
VALUES = "float integer boolean string rgb spectrum point vector blackbody srgb".split()
NAMES = (
    "reflectance diffuse_reflectance radiance intensity alpha alpha_u int_ior eta k material opacity weight weights scale "
    "filename to_uv width height fov fov_axis center radius p0 p1 position direction cutoff_angle sigma_t albedo interior "
    "distribution base_color roughness metallic normalmap focal_length focus_distance shape_index flip_normals"
).split()
WORDS = ["", "1", "-1", "0", "0.5 0.2 0.1", "1e300", "nan", "x", "#ff0000", "400:1, 500:2", "true", "image.png", "square.obj",
         "squares.serialized", "$x", "1 2", "Cu", "ggx", "3000K", "\u00e9"]


def random_element(chance, depth=0):
    """A random element, with attributes that may be missing or of a wrong type."""
    attributes = {}
    kind = chance.choice(("plugin", "value", "value", "transform", "ref", "other"))
    if kind == "plugin" or depth == 0:
        tag = chance.choice(list(TAGS))
        attributes["type"] = chance.choice(TAGS[tag])
    else:
        tag = {"value": chance.choice(VALUES), "transform": "transform", "ref": "ref"}.get(
            kind, chance.choice(["default", "alias", "include", "path", "animation", "widget"]))
    for key, values in (("name", NAMES), ("value", WORDS), ("id", "abc"), ("x", WORDS), ("filename", WORDS),
                        ("temperature", WORDS), ("as", "abc")):
        if chance.random() < {"name": 0.8, "value": 0.6, "id": 0.4}.get(key, 0.1):
            attributes[key] = chance.choice(values)
    if chance.random() < 0.05 and attributes:
        attributes.pop(chance.choice(list(attributes)))
    words = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    if tag == "transform":
        steps = "".join(f'<{chance.choice(["rotate", "scale", "translate", "lookat", "matrix", "shear"])} '
                        f'{chance.choice(["x", "value", "angle", "origin"])}="{chance.choice(WORDS)}"/>'
                        for _ in range(chance.randrange(3)))
        return f"<transform {words}>{steps}</transform>"
    inner = "".join(random_element(chance, depth + 1) for _ in range(chance.randrange(5 if depth < 3 else 1)))
    return f"<{tag} {words}>{inner}</{tag}>"


class Random(unittest.TestCase):
    def test_no_random_scene_ends_in_a_traceback(self):
        with tempfile.TemporaryDirectory() as name:
            folder, results = Path(name), {"read": 0, "refused": 0}
            files(folder)
            for seed in range(400):
                chance = random.Random(seed)
                version = chance.choice(["3.0.0", "0.5.0", "2.1.0", "x"])
                inside = "".join(random_element(chance) for _ in range(chance.randrange(1, 7)))
                if seed % 2:
                    inside += '<sensor type="perspective"/><emitter type="point"/>'
                path = folder / "scene.xml"
                path.write_text(f'<scene version="{version}">{inside}</scene>')
                try:
                    with contextlib.redirect_stderr(io.StringIO()):
                        from_xml.convert(path, folder / "scene.glb")
                    results["read"] += 1
                except gltf.Unsupported as error:
                    self.assertNotIn("Traceback", str(error))
                    self.assertTrue(str(error))
                    results["refused"] += 1
            # Both ends are tried.
            self.assertGreater(min(results.values()), 20, results)


if __name__ == "__main__":
    unittest.main()
