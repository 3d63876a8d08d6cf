"""Tests scenes/ and scenes/second/: exported by Blender, small, closed glass, well-formed extras."""

import glob
import math
import os
import struct
import unittest

import support
import glb as container

ROOT = str(support.ROOT)

SCENES = os.path.join(ROOT, "scenes")
NAMES = sorted(f[:-4] for f in [*glob.glob("*.glb", root_dir=SCENES), *glob.glob("second/*.glb", root_dir=SCENES)])
#: Scenes without solid glass, and glass that is intentionally a sheet.
WITHOUT_SOLIDS = {"interior", "blocks", "slide", "second/fairground", "second/stairwell", "second/still"}
SHEETS = {("slide", "slide"), ("second/dining", "pane")}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
CODES = {5121: "B", 5123: "H", 5125: "I", 5126: "f"}


def accessor(document, buffer, index):
    """The elements of an accessor, tuples of numbers."""
    entry = document["accessors"][index]
    view = document["bufferViews"][entry["bufferView"]]
    width, code = COMPONENTS[entry["type"]], CODES[entry["componentType"]]
    at = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
    values = struct.unpack_from(f"<{entry['count'] * width}{code}", buffer, at)
    return list(zip(*[iter(values)] * width))


def triangles(document, mesh):
    total = 0
    for part in mesh["primitives"]:
        source = part.get("indices", part["attributes"]["POSITION"])
        total += document["accessors"][source]["count"] // 3
    return total


def instances(document):
    """Mesh indices, once for each node that uses them."""
    return [node["mesh"] for node in document["nodes"] if "mesh" in node]


def open_edges(document, buffer, mesh):
    """Number of edges with an odd number of triangles, with vertices merged by position."""
    places, uses = {}, {}
    for part in mesh["primitives"]:
        points = accessor(document, buffer, part["attributes"]["POSITION"])
        merged = [places.setdefault(tuple(round(c, 6) for c in p), len(places)) for p in points]
        corners = [merged[i[0]] for i in accessor(document, buffer, part["indices"])]
        for a, b, c in zip(*[iter(corners)] * 3):
            for edge in ((a, b), (b, c), (c, a)):
                if edge[0] != edge[1]:
                    key = (min(edge), max(edge))
                    uses[key] = uses.get(key, 0) + 1
    return sum(count % 2 for count in uses.values())


def numbers(value, count, low=0.0, high=math.inf):
    return len(value) == count and all(isinstance(x, (int, float)) and low <= x <= high for x in value)


def medium_faults(said):
    if set(said) != {"sigma_a", "sigma_s", "g"}:
        return f"medium has keys {sorted(said)}"
    good = numbers(said["sigma_a"], 3) and numbers(said["sigma_s"], 3) and numbers([said["g"]], 1, -1, 1)
    return None if good else f"medium {said}"


def environment_faults(said, folder):
    if set(said) == {"color"}:
        return None if numbers(said["color"], 3) else f"environment colour {said['color']}"
    if set(said) != {"file", "rotation_deg", "strength"}:
        return f"environment has keys {sorted(said)}"
    if not os.path.isfile(os.path.join(folder, said["file"])):
        return f"environment file {said['file']} is missing"
    return None if numbers([said["strength"]], 1) and numbers([said["rotation_deg"]], 1, -math.inf) else f"environment {said}"


def each_scene(check):
    """A test that runs check(self, name, document, buffer) for every scene."""
    def run(self):
        for name in NAMES:
            with self.subTest(scene=name):
                check(self, name, *container.read(os.path.join(SCENES, name + ".glb")))
    return run


class EveryScene(unittest.TestCase):
    def test_both_sets_are_there_with_their_scripts(self):
        self.assertLessEqual({"cornell", "pool", "torus", "interior", "lamp", "gems"}, set(NAMES))
        self.assertGreaterEqual(sum(name.startswith("second/") for name in NAMES), 9)
        for name in NAMES:
            self.assertTrue(os.path.isfile(os.path.join(SCENES, name + ".py")), name)

    @each_scene
    def test_small_and_written_by_blender(self, name, document, buffer):
        self.assertLess(os.path.getsize(os.path.join(SCENES, name + ".glb")), 5_000_000)
        self.assertTrue(document["asset"]["generator"].startswith("Khronos glTF Blender I/O v"))

    @each_scene
    def test_nothing_lies_outside_the_file_but_the_environment(self, name, document, buffer):
        self.assertEqual([b.get("uri") for b in document["buffers"]], [None])
        self.assertLessEqual(document["buffers"][0]["byteLength"], len(buffer))
        for image in document.get("images", []):
            self.assertIn("bufferView", image)

    def test_interior_is_large(self):
        document, _ = container.read(os.path.join(SCENES, "interior.glb"))
        self.assertGreaterEqual(sum(triangles(document, m) for m in document["meshes"]), 100_000)
        self.assertGreaterEqual(sum(triangles(document, document["meshes"][i]) for i in instances(document)), 200_000)

    @each_scene
    def test_positions_are_finite_and_normals_unit(self, name, document, buffer):
        for mesh in document["meshes"]:
            for part in mesh["primitives"]:
                for point in accessor(document, buffer, part["attributes"]["POSITION"]):
                    self.assertTrue(all(map(math.isfinite, point)))
                for normal in accessor(document, buffer, part["attributes"]["NORMAL"]):
                    self.assertAlmostEqual(math.hypot(*normal), 1, delta=1e-3)

    @each_scene
    def test_glass_is_solid_and_closed(self, name, document, buffer):
        solid = set()
        for index, material in enumerate(document["materials"]):
            extensions = material.get("extensions", {})
            sheet = (name, material["name"]) in SHEETS
            if extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) > 0 and not sheet:
                self.assertGreater(extensions.get("KHR_materials_volume", {}).get("thicknessFactor", 0), 0, material["name"])
                solid.add(index)
        self.assertEqual(bool(solid), name not in WITHOUT_SOLIDS)
        for mesh in document["meshes"]:
            if solid & {part.get("material") for part in mesh["primitives"]}:
                self.assertEqual(open_edges(document, buffer, mesh), 0, mesh["name"])

    def test_a_missing_triangle_is_found(self):
        document, buffer = container.read(os.path.join(SCENES, "cornell.glb"))
        sphere = next(m for m in document["meshes"] if m["name"] == "glass sphere")
        document["accessors"][sphere["primitives"][0]["indices"]]["count"] -= 3
        self.assertEqual(open_edges(document, buffer, sphere), 3)

    @each_scene
    def test_extras(self, name, document, buffer):
        said = document["scenes"][0].get("extras", {}).get("caustique", {})
        self.assertLessEqual(set(said), {"environment", "medium"})
        if "environment" in said:
            self.assertIsNone(environment_faults(said["environment"], os.path.dirname(os.path.join(SCENES, name))))
        if "medium" in said:
            self.assertIsNone(medium_faults(said["medium"]))
        for camera in document["cameras"]:
            lens = camera.get("extras", {}).get("caustique")
            if lens is not None:
                self.assertEqual(set(lens), {"aperture_radius", "focus_distance"})
                self.assertTrue(numbers(lens.values(), 2, 1e-9))
        for material in document["materials"]:
            inside = material.get("extras", {}).get("caustique", {}).get("medium")
            if inside is not None:
                self.assertIsNone(medium_faults(inside))

    @each_scene
    def test_lights(self, name, document, buffer):
        lamps = document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
        glowing = [m for m in document["materials"] if any(m.get("emissiveFactor", []))]
        environment = "environment" in document["scenes"][0].get("extras", {}).get("caustique", {})
        self.assertTrue(lamps or glowing or environment)
        for material in glowing:
            self.assertFalse(material.get("doubleSided", False), material["name"])
        for node in document["nodes"]:
            if "KHR_lights_punctual" in node.get("extensions", {}):
                kind = lamps[node["extensions"]["KHR_lights_punctual"]["light"]]["type"]
                key = "angle_deg" if kind == "directional" else "radius"
                said = node.get("extras", {}).get("caustique", {})
                # A spot without a radius shines from a point.
                if kind != "spot" or key in said:
                    self.assertGreater(said[key], 0, node["name"])

    def test_every_kind_of_light_occurs(self):
        documents = [container.read(os.path.join(SCENES, name + ".glb"))[0] for name in NAMES]
        kinds = {light["type"] for d in documents for light in d.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])}
        self.assertEqual(kinds, {"point", "spot", "directional"})

    @each_scene
    def test_cameras_with_a_view(self, name, document, buffer):
        cameras = document["cameras"]
        others = {"stadium": ["Close up"]}.get(name, [])
        self.assertEqual([camera.get("name") for camera in cameras[1:]], others)
        placed = [node["camera"] for node in document["nodes"] if "camera" in node]
        self.assertEqual(sorted(placed), list(range(len(cameras))))
        for camera in cameras:
            self.assertTrue(0.1 < camera["perspective"]["yfov"] < 2, camera)

    def test_gems_disperse(self):
        document, _ = container.read(os.path.join(SCENES, "gems.glb"))
        spread = [m["extensions"]["KHR_materials_dispersion"]["dispersion"] for m in document["materials"]
                  if "KHR_materials_dispersion" in m.get("extensions", {})]
        self.assertGreaterEqual(len(spread), 5)
        self.assertTrue(all(0.2 < s < 0.5 for s in spread))


if __name__ == "__main__":
    unittest.main()
