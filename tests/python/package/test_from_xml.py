"""Scenes of Mitsuba that are wrong or are only read in part: an error or a loss that is named, and no file that misses
it."""

import contextlib
import io
import struct
import tempfile
import unittest
from pathlib import Path

from translation import ROOT, from_xml, gltf, to_xml

CAMERA = '<sensor type="perspective"><float name="fov" value="45"/></sensor>'
LIGHT = '<emitter type="point"><rgb name="intensity" value="1"/></emitter>'
FLOOR = '<shape type="rectangle" id="floor"/>'


def vol(values, box=(5, 5, 5, 7, 7, 7), channels=1):
    """The bytes of a grid of cells along x, of Mitsuba's format."""
    head = struct.pack("<3sB5i6f", b"VOL", 3, 1, len(values) // channels, 1, 1, channels, *box)
    return head + struct.pack(f"<{len(values)}f", *values)


class Reads(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.output = self.folder / "scene.glb"

    def write(self, inside, name="scene.xml", version="3.0.0"):
        path = self.folder / name
        path.write_text(f'<scene version="{version}">{inside}</scene>')
        return path

    def document(self, xml):
        with contextlib.redirect_stderr(io.StringIO()):
            from_xml.convert(xml, self.output)
        return gltf.chunks(self.output.read_bytes())[0]

    def refusal(self, xml):
        with self.assertRaises(gltf.Unsupported) as caught, contextlib.redirect_stderr(io.StringIO()):
            from_xml.convert(xml, self.output)
        self.assertEqual([path.suffix for path in self.folder.iterdir() if path.suffix != ".xml"], [])
        return str(caught.exception)

    def test_faults_name_the_element(self):
        """No value of an element ends in a traceback."""
        for wrong, message in [
            ('<shape type="obj"/>', 'shape (obj): filename="": there is no such file'),
            ('<shape type="ply"><string name="filename" value="no.ply"/></shape>', 'filename="no.ply": there is no'),
            ('<emitter type="envmap"><string name="filename" value="no.exr"/></emitter>', "there is no such file"),
            ('<emitter type="envmap"><string name="filename" value="scene.xml"/></emitter>', 'emitter (envmap): scene.xml: this image cannot be read'),
            ('<shape type="obj" id="body"><string name="filename" value="scene.xml"/></shape>', 'shape "body" (obj): it cannot be read'),
            ('<shape type="sphere"><float name="radius" value="wide"/></shape>', 'value="wide" has a word that is no number'),
            ('<shape type="sphere"><point name="center" x="a"/></shape>', 'point "center": x="a" has a word that is no number'),
            ('<shape type="cube"><transform name="to_world"><rotate y="1"/></transform></shape>', 'rotate: a rotation has an axis and an angle'),
            ('<shape type="cube"><transform name="to_world"><matrix value="1 2 3"/></transform></shape>', "a matrix has 9 or 16"),
            ('<shape type="cube"><transform name="to_world"><scale value="x"/></transform></shape>', 'scale: value="x" has a word'),
            ('<shape type="cube"><bsdf type="dielectric"><string name="int_ior" value="jelly"/></bsdf></shape>',
             'bsdf (dielectric): int_ior="jelly" is neither a number nor of vacuum'),
            ('<shape type="cube"><bsdf type="conductor"><string name="material" value="Xx"/></bsdf></shape>', 'its metal "Xx" cannot be'),
            ('<shape type="cube"><ref id="nothing"/></shape>', 'nothing has the id "nothing"'),
            ('<emitter type="point"><rgb name="intensity" value="1 2"/></emitter>', 'rgb "intensity": a colour has 1 or 3 numbers'),
            ('<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="0"/></film></sensor>', "width is 0; it is a whole number from 1"),
        ]:
            with self.subTest(wrong):
                self.assertIn(message, self.refusal(self.write(CAMERA + LIGHT + FLOOR + wrong)))

    def test_files_that_are_no_xml(self):
        path = self.folder / "scene.xml"
        for data in (b"", b"<scene>", b"\xff\xfe\x00", b"glTF" + bytes(20)):
            path.write_bytes(data)
            self.assertIn("scene.xml: it is no XML", self.refusal(path))

    def test_included_files_are_read(self):
        """Elements, materials that references name, and the values of `default`, which the outer file decides."""
        self.write('<default name="power" value="7"/><default name="wide" value="9"/>'
                   '<emitter type="point"><rgb name="intensity" value="$power"/></emitter>'
                   '<bsdf type="diffuse" id="red"><rgb name="reflectance" value="1 0 0"/></bsdf>', "light.xml")
        (self.folder / "floor.xml").write_text('<shape type="rectangle"><ref id="red"/></shape>')
        outer = '<default name="power" value="3"/><default name="part" value="floor"/>'
        found = self.document(self.write(outer + CAMERA + '<include filename="light.xml"/><include filename="$part.xml"/>'))
        self.assertEqual(found["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"], 3)
        self.assertEqual(found["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"], [1, 0, 0, 1])

    def test_includes_that_cannot_be_read(self):
        for include, message in [
            ('<include filename="no.xml"/>', 'include "no.xml": there is no such file'), ("<include/>", "no such file"),
            ('<include filename="scene.xml"/>', "the file includes itself"),
            ('<shape type="cube"><include filename="scene.xml"/></shape>', "the file includes itself"),
        ]:
            with self.subTest(include):
                self.assertIn(message, self.refusal(self.write(CAMERA + LIGHT + FLOOR + include)))

    def test_a_scene_without_light_or_camera_is_refused(self):
        self.assertIn("the scene has no light: read are area,", self.refusal(self.write(CAMERA + FLOOR)))
        projector = '<emitter type="projector"/>'
        self.assertIn("an emitter of type projector is left out", self.refusal(self.write(CAMERA + FLOOR + projector)))
        self.assertIn("the scene has no camera: read are", self.refusal(self.write(LIGHT + FLOOR)))
        glow = '<shape type="disk"><emitter type="area"><rgb name="radiance" value="1"/></emitter></shape>'
        self.document(self.write(CAMERA + glow))

    def test_settings_of_the_integrator_that_change_the_light_are_losses(self):
        for integrator, said in [
            ('<integrator type="path"><integer name="max_depth" value="2"/></integrator>', ["--max-depth 2"]),
            ('<integrator type="path"><integer name="max_depth" value="-1"/></integrator>', []),
            ('<integrator type="direct"/>', ["--max-depth 2"]),
            ('<integrator type="aov"><integrator type="path"><integer name="max_depth" value="7"/></integrator></integrator>',
             ["--max-depth 7"]),
            ('<integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>', ["hide_emitters"]),
        ]:
            with self.subTest(integrator):
                losses = self.losses(integrator)
                self.assertEqual(len(losses), len(said), losses)
                self.assertTrue(all(word in loss for word, loss in zip(said, losses)), losses)

    def test_grids_of_density_that_are_not_carried_are_named(self):
        volume = '<volume type="{}" name="sigma_t"><string name="filename" value="smoke.vol"/>{}</volume>'
        grid, flat = volume.format("gridvolume", ""), '<transform name="to_world"><scale z="0"/></transform>'
        cube = '<shape type="cube"><bsdf type="null"/><medium type="{}" name="interior">{}</medium></shape>'
        camera = '<sensor type="perspective"><medium type="heterogeneous">{}</medium></sensor>'
        (self.folder / "smoke.vol").write_bytes(vol([1, 2, 3], channels=3))
        for part, reason in [(cube.format("heterogeneous", grid), "its density has 3 channels"),
                             (cube.format("homogeneous", grid), "varies over space"),
                             (cube.format("heterogeneous", volume.format("sdf", "")), "a volume of type sdf"),
                             (camera.format(grid), "needs a mesh around it")]:
            losses = self.losses(part, "" if "sensor" in part else CAMERA)
            self.assertTrue(any(reason in loss for loss in losses), losses)
        (self.folder / "smoke.vol").write_bytes(vol([1, 2, 3]))
        losses = self.losses(cube.format("heterogeneous", volume.format("gridvolume", flat)))
        self.assertTrue(any("is singular" in loss for loss in losses), losses)
        self.output.unlink()
        for data, reason in [(b"VOL\x04" + bytes(60), "no .vol file of version 3"), (vol([1, 2, 3])[:-1], "cut off"), (b"", "no .vol")]:
            (self.folder / "smoke.vol").write_bytes(data)
            scene = self.write(CAMERA + LIGHT + cube.format("heterogeneous", grid))
            with self.assertRaisesRegex(gltf.Unsupported, reason), contextlib.redirect_stderr(io.StringIO()):
                from_xml.convert(scene, self.output)
            self.assertFalse(self.output.exists())

    def losses(self, inside, camera=CAMERA):
        """The losses of a scene with a camera, a light and this."""
        return self.document(self.write(camera + LIGHT + inside))["scenes"][0]["extras"]["caustique"]["losses"]

    def test_the_documented_command_is_not_refused(self):
        text = (ROOT / "docs" / "researchers.md").read_text()
        scene = text.split("mitsuba.py export ")[1].split()[0]
        to_xml.write(ROOT / scene, self.folder / "out.xml", gltf.refuse)
        self.assertTrue((self.folder / "out.xml").stat().st_size)


if __name__ == "__main__":
    unittest.main()
