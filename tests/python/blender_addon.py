"""The add-on in Blender: rendering through the engine against the command line and against numbers. Needs bpy.

The zip is installed as a user would install it, into a repository of extensions that is removed afterwards.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

import bpy
import numpy

import support

sys.path.insert(0, str(support.ROOT / "scripts" / "blender"))
import export  # noqa: E402
import package  # noqa: E402

_REPOSITORY = "caustique_test"
_ADDON = f"bl_ext.{_REPOSITORY}.caustique"
#: OpenEXR's own library, which Blender's Python does not have.
_READER = """
import sys, numpy, OpenEXR
found = {}
for part in OpenEXR.File(sys.argv[1], separate_channels=True).parts:
    found.update((name, channel.pixels) for name, channel in part.channels.items())
numpy.savez(sys.argv[2], **found)
"""


def channels(path):
    """The channels of an EXR file by name, those of all parts together."""
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        python = support.ROOT / ".venv" / "bin" / "python"
        subprocess.run([python, "-c", _READER, path, file.name], check=True, timeout=120)
        with numpy.load(file.name) as found:
            return dict(found)


def part_of_addon(name):
    """A module of the installed add-on."""
    return sys.modules[f"{_ADDON}.{name}"]


class Installed(support.Scratch):
    """With the add-on installed and a scene whose engine it is: a lit plane and a glass ball seen from above."""

    def setUp(self):
        super().setUp()
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.zip = self.dir / "caustique.zip"
        package.build(str(self.zip))
        self.repository = self.dir / "extensions"
        repositories = bpy.context.preferences.extensions.repos
        self.place = repositories.new(
            name=_REPOSITORY, module=_REPOSITORY, custom_directory=str(self.repository))
        self.addCleanup(repositories.remove, self.place)
        self.before = self.registered()
        bpy.ops.extensions.package_install_files(filepath=str(self.zip), repo=_REPOSITORY, enable_on_install=True)
        self.addCleanup(self.uninstall)
        self.preferences = bpy.context.preferences.addons[_ADDON].preferences
        self.preferences.program = str(support.binary())
        self.scene = bpy.context.scene
        self.scene.render.engine = "CAUSTIQUE"
        self.scene.render.resolution_x, self.scene.render.resolution_y = 32, 24
        self.settings = self.scene.caustique_render
        self.settings.iterations, self.settings.method = 2, "vcm"
        self.layer = self.scene.view_layers[0]

    def uninstall(self):
        if _ADDON in bpy.context.preferences.addons:
            index = list(bpy.context.preferences.extensions.repos).index(self.place)
            bpy.ops.extensions.package_uninstall(repo_index=index, pkg_id="caustique")

    def registered(self):
        """All that an add-on may leave behind in Blender."""
        kinds = {name for name in dir(bpy.types)}
        of_data = {kind: set(dir(getattr(bpy.types, kind))) for kind in ("Scene", "ViewLayer", "WindowManager", "Object")}
        handlers = {name: list(getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers)
                    if isinstance(getattr(bpy.app.handlers, name), list)}
        operators = set(dir(bpy.ops.caustique))
        engines = {panel.__name__: frozenset(panel.COMPAT_ENGINES) for panel in bpy.types.Panel.__subclasses__()
                   if hasattr(panel, "COMPAT_ENGINES")}
        files = sorted(path.name for path in self.repository.rglob("*") if path.is_file()) if self.repository.exists() else []
        return kinds, of_data, handlers, operators, engines, files

    def material(self, name, **inputs):
        material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        for socket, value in inputs.items():
            shader.inputs[socket.replace("_", " ")].default_value = value
        return material

    def put(self, name, data, at=(0, 0, 0), turn=(0, 0, 0)):
        body = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(body)
        body.location, body.rotation_euler = at, turn
        return body

    def eye(self, height=10, width=4):
        """An orthographic camera that looks down from `height` (m) on so many metres."""
        data = bpy.data.cameras.new("eye")
        data.type, data.ortho_scale = "ORTHO", width
        self.scene.camera = self.put("eye", data, (0, 0, height))

    def sun(self, irradiance, turn=(0, 0, 0)):
        data = bpy.data.lights.new("sun", "SUN")
        data.energy, data.angle = irradiance, 0
        return self.put("sun", data, turn=turn)

    def plane(self, size=20, reflectance=0.5, **placed):
        mesh = bpy.data.meshes.new("plane")
        half = size / 2
        mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
        mesh.materials.append(self.material("white", Base_Color=(*[reflectance] * 3, 1), Roughness=1.0,
                                            Specular_IOR_Level=0.0))
        return self.put("plane", mesh, **placed)

    def ball(self, name="ball", at=(0, 0, 1), closed=True, radius=0.7):
        import bmesh
        shape = bmesh.new()
        bmesh.ops.create_icosphere(shape, subdivisions=3, radius=radius)
        if not closed:
            bmesh.ops.delete(shape, geom=[v for v in shape.verts if v.co.z > 0.5 * radius], context="VERTS")
        mesh = bpy.data.meshes.new(name)
        shape.to_mesh(mesh)
        shape.free()
        mesh.materials.append(self.material(f"{name} glass", Transmission_Weight=1.0, Roughness=0.0))
        return self.put(name, mesh, at)

    def stage(self):
        self.plane()
        self.ball()
        self.sun(3, (0.4, 0.2, 0))
        self.eye()

    def passes(self, *names):
        """Switch passes on: Blender's own and the add-on's."""
        for name in names:
            setattr(self.layer if name.startswith("use_pass") else self.layer.caustique, name, True)

    def render(self, name="render", animation=False):
        """Render through the engine; the channels of the file that Blender writes, without the view layer's name."""
        settings = self.scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
        self.scene.render.filepath = str(self.dir / (name + ("-####" if animation else "") + ".exr"))
        if animation:
            bpy.ops.render.render(animation=True)
            frames = range(self.scene.frame_start, self.scene.frame_end + 1)
            return [self.read(self.dir / f"{name}-{frame:04}.exr") for frame in frames]
        bpy.ops.render.render(write_still=True)
        return self.read(self.dir / f"{name}.exr")

    def read(self, path):
        return {name.split(".", 1)[1]: pixels for name, pixels in channels(path).items()}

    def by_hand(self, *arguments):
        """The same by the exporter and the command line, in the program's own axes."""
        glb, picture = self.dir / "by-hand.glb", self.dir / "by-hand.exr"
        export.write(str(glb))
        support.run(["render", glb, "-o", picture, "--width", self.scene.render.resolution_x, "--height",
                     self.scene.render.resolution_y, "--exr-naming", "blender", "--progress", "none", "--iterations",
                     self.settings.iterations, "--method", self.settings.method, *arguments], check=0)
        return self.read(picture)

    def temporary(self):
        return [name for name in os.listdir(bpy.app.tempdir) if name.startswith("caustique-")]


class Renders(Installed):
    def test_passes_are_the_command_lines_to_the_last_bit(self):
        self.stage()
        self.layer.name = "Shot 7"
        self.passes("use_pass_z", "use_pass_position", "use_pass_normal", "use_pass_cryptomatte_object",
                    "use_pass_cryptomatte_material", "albedo", "parts", "noisy", "noisy_parts", "error", "levels")
        found, expected = self.render(), self.by_hand()
        for name in ("Position", "Normal"):  # glTF's y is up, Blender's z
            expected[f"{name}.Y"], expected[f"{name}.Z"] = -expected[f"{name}.Z"], expected[f"{name}.Y"]
        expected = {re.sub(r"(Crypto\w+)\.(\w)", lambda m: f"{m[1]}.{m[2].upper()}", name): pixels
                    for name, pixels in expected.items()}
        for name, pixels in found.items():
            if name in expected:
                self.assertEqual(pixels.tobytes(), expected[name].tobytes(), name)
            else:
                self.assertIn(name.split(".")[0], ("Volume", "CombinedVolume"))
                self.assertFalse(pixels.any(), name)
        self.assertEqual(len(found), 4 + 1 + 3 + 3 + 6 * 4 + 3 + 5 * 3 + 3 + 5 * 3 + 3 + 10 * 3)
        self.assertGreater(found["CombinedCaustic.G"].max(), 0)

    def test_numbers_of_a_lit_plane(self):
        slope = math.atan(0.75)
        self.plane(at=(0, 0, 1), turn=(slope, 0, 0))
        self.sun(math.pi)
        self.eye(height=10, width=4)
        self.passes("use_pass_z", "use_pass_position", "use_pass_normal")
        self.settings.method, self.settings.finish = "path", "off"
        found = self.render()
        # The plane rises towards +y, and the sun stands straight above: pi W/m2 times the cosine, half of it reflected.
        x, y = (numpy.arange(32) + 0.5) / 8 - 2, (11.5 - numpy.arange(24)) / 8
        numpy.testing.assert_allclose(found["Combined.G"], 0.5 * 0.8, rtol=1e-3)
        numpy.testing.assert_allclose(found["Combined.A"], 1, rtol=1e-5)
        numpy.testing.assert_allclose(found["Position.X"], numpy.tile(x, (24, 1)), atol=0.5 / 8 + 1e-4)
        numpy.testing.assert_allclose(found["Position.Y"], numpy.tile(y[:, None], (1, 32)), atol=0.5 / 8 + 1e-4)
        numpy.testing.assert_allclose(found["Position.Z"], 1 + 0.75 * found["Position.Y"], atol=1e-4)
        numpy.testing.assert_allclose(found["Depth.Z"], 10 - found["Position.Z"], atol=1e-4)
        for axis, value in zip("XYZ", (0, -0.6, 0.8)):
            numpy.testing.assert_allclose(found[f"Normal.{axis}"], value, atol=1e-4)

    def test_three_frames_move_as_they_are_animated(self):
        self.plane()
        self.sun(3)
        self.eye()
        cube = bpy.data.meshes.new("cube")
        cube.from_pydata([(x, y, 0.1) for x, y in ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5))], [], [(0, 1, 2, 3)])
        body = self.put("tile", cube)
        for frame, at in ((1, -1.5), (2, 0), (3, 1)):
            body.location.x = at
            body.keyframe_insert("location", index=0, frame=frame)
        self.scene.frame_start, self.scene.frame_end = 1, 3
        self.passes("use_pass_z")
        for at, found in zip((-1.5, 0, 1), self.render("frame", animation=True)):
            columns = numpy.flatnonzero((found["Depth.Z"] < 9.95).any(0))
            self.assertEqual((columns[0], columns[-1]), ((at + 2) * 8, (at + 2.5) * 8 - 1))

    def test_a_border_is_a_part_of_the_whole(self):
        self.stage()
        self.passes("use_pass_z")
        whole = self.render("whole")
        render = self.scene.render
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
        part = self.render("part")
        for name in ("Combined.R", "Depth.Z"):
            self.assertEqual(part[name].shape, (12, 16))
            self.assertTrue(numpy.array_equal(part[name], whole[name][:12, 8:24]), name)

    def test_settings_reach_the_program(self):
        self.stage()
        self.settings.seed, self.settings.finish, self.settings.use_caustic = 7, "off", False
        self.settings.arguments = "--max-depth 5"
        found = self.render()
        expected = self.by_hand("--seed", 7, "--no-combine", "--effects=-caustic", "--max-depth", 5)
        self.assertEqual(found["Combined.G"].tobytes(), expected["Combined.G"].tobytes())
        other = self.by_hand("--seed", 8, "--no-combine", "--effects=-caustic", "--max-depth", 5)
        self.assertNotEqual(found["Combined.G"].tobytes(), other["Combined.G"].tobytes())

    def test_the_compositor_finds_objects_by_cryptomatte(self):
        self.stage()
        self.layer.name = "Shot"
        self.passes("use_pass_cryptomatte_object")
        self.render()
        said = subprocess.run([support.ROOT / ".venv" / "bin" / "python", "-c", "import sys, OpenEXR\n"
                               "for part in OpenEXR.File(sys.argv[1]).parts: print(part.header)",
                               self.dir / "render.exr"], capture_output=True, text=True, check=True).stdout
        self.assertIn("Shot.CryptoObject", said)
        self.assertIn('"ball":', said)

    def test_the_picture_so_far_is_shown(self):
        self.stage()
        self.settings.iterations = 60
        engine, shown = part_of_addon("engine"), []
        show = engine.Engine._show

        def watched(self, picture, *where):
            shown.append({name: plane.copy() for name, plane in picture.channels.items()})
            show(self, picture, *where)

        # The finished picture is withheld, so what Blender has is the last one before it.
        with mock.patch.multiple(engine.Engine, _show=watched, _deliver=lambda *_: None):
            found = self.render()
        for channel in "RGBA":
            self.assertEqual(found[f"Combined.{channel}"].tobytes(), shown[-1][channel].tobytes())
        numpy.testing.assert_allclose(shown[0]["G"].mean(), self.by_hand()["Combined.G"].mean(), rtol=0.2)

    def test_nothing_is_left_in_the_temporary_folder(self):
        self.stage()
        self.render()
        self.assertEqual(self.temporary(), [])


class Tells(Installed):
    """What goes wrong, and what is left aside, is said where the user looks."""

    def fault(self):
        """The error that a render ends with, as Blender shows it."""
        with self.assertRaises(RuntimeError) as raised:
            self.render()
        self.assertFalse((self.dir / "render.exr").exists())
        return " ".join(str(raised.exception).split())

    def said(self):
        return part_of_addon("session").warnings.get(self.scene.name, [])

    def program(self, text):
        """A stand-in for the program: a shell script."""
        path = self.dir / "stand-in"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        self.preferences.program = str(path)

    def test_a_program_that_is_not_there(self):
        self.stage()
        self.preferences.program = str(self.dir / "nowhere")
        told = self.fault()
        self.assertIn("nowhere is not a program", told)
        self.assertIn("Remedy: clone the repository", told)
        self.assertIn("nowhere", part_of_addon("session").faults[self.scene.name].what)

    def test_a_program_that_is_not_on_the_path(self):
        self.stage()
        self.preferences.program = ""
        with mock.patch.dict(os.environ, PATH=str(self.dir)):
            self.assertIn("the program caustique is not on the PATH Remedy: ", self.fault())
        with mock.patch.dict(os.environ, PATH=f"{support.binary().parent}:{os.environ['PATH']}"):
            self.assertTrue(self.render())

    def test_a_program_that_is_too_old(self):
        self.stage()
        self.program("echo caustique 0.0.9")
        self.assertIn("is version 0.0.9, and the add-on needs 0.1.0 or newer Remedy: update", self.fault())

    def test_a_program_that_is_another(self):
        self.stage()
        self.program("echo something else 1.2.3")
        self.assertIn("does not answer as caustique does", self.fault())

    def test_a_program_that_dies(self):
        self.stage()
        self.program('[ "$1" = --version ] && echo caustique 9.9.9 && exit; [ "$2" = --help ] && exit; kill -9 $$')
        self.assertIn("caustique ended by signal 9", self.fault())

    def test_what_the_program_says_and_its_remedy(self):
        self.stage()
        self.settings.arguments = "--layers Nope"
        told = self.fault()
        self.assertIn('--layers: no layer "Nope" Remedy: there are beauty,', told)
        self.settings.arguments = "--seed 'open"
        self.assertIn("close every quotation mark", self.fault())

    def test_an_animation_ends_at_the_first_fault(self):
        self.stage()
        self.settings.arguments = "--layers Nope"
        self.scene.frame_end = 3
        with self.assertRaises(RuntimeError):
            self.render("frame", animation=True)
        self.assertEqual(list(self.dir.glob("frame-*")), [])

    def test_an_exporter_that_is_none(self):
        self.stage()
        self.preferences.exporter = "/bin/false"
        self.assertIn("the scene could not be exported", self.fault())
        self.assertEqual(self.temporary(), [])

    def test_libraries_that_are_missing(self):
        with mock.patch.dict(os.environ, CAUSTIQUE_OIDN="/nowhere/libOpenImageDenoise.so"):
            faults = part_of_addon("program").missing_libraries(str(support.binary()))
        self.assertEqual([fault.what.split(":")[0] for fault in faults], ["oidn"])
        self.assertTrue(faults[0].remedy)

    def test_warnings_of_the_exporter_and_of_the_program(self):
        self.stage()
        self.ball("bowl", at=(1, 1, 1), closed=False)
        self.render()
        self.assertTrue([line for line in self.said() if line.startswith('material "bowl glass": ')], self.said())
        self.settings.use_caustic = False
        self.render()
        self.assertTrue([line for line in self.said() if "left out, though called for" in line], self.said())

    def test_settings_of_blender_that_are_left_aside(self):
        limits, render = part_of_addon("limits"), self.scene.render
        self.assertEqual(limits.ignored(self.scene), [])
        for name in ("use_motion_blur", "use_multiview", "film_transparent", "use_freestyle"):
            setattr(render, name, True)
        render.pixel_aspect_x = 2
        lines = limits.ignored(self.scene)
        self.assertEqual(len(lines), 5)
        self.assertTrue(all(": " in line for line in lines))

    def test_passes_that_a_method_does_not_make(self):
        self.stage()
        self.settings.method = "path"
        self.passes("levels")
        found = self.render()
        self.assertFalse(found["Level5.G"].any())
        self.assertTrue([line for line in self.said() if "Level5" in line and "choose another method" in line])

    def test_an_image_with_changes_that_are_not_saved(self):
        self.stage()
        picture = bpy.data.images.new("paint", 4, 4)
        picture.pixels[0] = 0.5
        picture.use_fake_user = True
        self.render()
        self.assertTrue([line for line in self.said() if line.startswith('image "paint": ')], self.said())


class Diagnoses(Installed):
    def ask(self):
        bpy.ops.caustique.diagnose()
        return part_of_addon("session").plans[self.scene.name]

    def test_glass_that_is_a_thin_wall(self):
        self.plane()
        self.sun(3)
        self.eye()
        self.ball("bowl", closed=False)
        self.ball("ball", at=(1, 1, 1))
        plan = self.ask()
        self.assertTrue([line for line in plan.warnings if '"bowl"' in line and "thin wall" in line], plan.warnings)
        self.assertEqual([thing.name for thing in self.scene.objects if thing.select_get()], ["bowl"])
        self.assertEqual(bpy.context.view_layer.objects.active.name, "bowl")
        self.assertEqual(set(part_of_addon("properties").EFFECTS), {effect["name"] for effect in plan.said["effects"]})

    def test_a_lamp_in_a_box_names_the_box(self):
        self.plane()
        self.eye()
        self.ball()
        import bmesh
        shape = bmesh.new()
        bmesh.ops.create_cube(shape, size=0.5)
        mesh = bpy.data.meshes.new("casing")
        shape.to_mesh(mesh)
        shape.free()
        mesh.materials.append(self.material("iron", Roughness=1.0))
        self.put("casing", mesh, (0, 1, 3))
        lamp = bpy.data.lights.new("lamp", "POINT")
        self.put("lamp", lamp, (0, 1, 3))
        self.ask()
        self.assertIn("casing", [thing.name for thing in self.scene.objects if thing.select_get()])

    def test_headlines(self):
        self.plane()
        self.sun(3)
        self.eye()
        self.assertIn("Nothing in the scene casts a caustic", self.ask().headline)
        self.ball()
        self.assertIn("Caustics are rendered, by photons", self.ask().headline)
        self.settings.use_caustic = self.settings.use_sds = False
        self.assertIn("they are left out", self.ask().headline)

    def test_a_fault(self):
        self.stage()
        self.preferences.program = "/nowhere"
        with self.assertRaises(RuntimeError):
            bpy.ops.caustique.diagnose()
        self.assertIn("Remedy", str(part_of_addon("session").plans[self.scene.name].fault))

    def test_names_in_lines(self):
        self.stage()
        named = part_of_addon("asking").named
        for line, names in (('object "ball": no light', ["ball"]), ('material "ball glass" on "x" and 2 more', ["ball"]),
                            ('light "sun": all its light stays within "plane"', ["sun", "plane"]),
                            ('world "plane": its nodes', []), ("nothing", [])):
            self.assertEqual([thing.name for thing in named(self.scene, [line])], names, line)


class Lives(Installed):
    def test_uninstalled_nothing_is_left(self):
        self.assertNotEqual(self.registered(), self.before)
        self.uninstall()
        for found, before in zip(self.registered(), self.before):
            self.assertEqual(found, before)
        self.assertNotIn(_ADDON, sys.modules)

    def test_blender_finds_no_fault_with_the_package(self):
        tool = next(path for folder in sys.path for path in [os.path.join(folder, "bl_pkg", "cli", "blender_ext.py")]
                    if os.path.isfile(path))
        done = subprocess.run([sys.executable, tool, "validate", self.zip], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_versions_agree(self):
        versions = {tuple(map(int, re.search(pattern, (support.ROOT / name).read_text(), re.M)[1].split(".")))
                    for name, pattern in (("Cargo.toml", r'^version = "([\d.]+)"'),
                                          ("scripts/blender/caustique_addon/blender_manifest.toml", r'^version = "([\d.]+)"'))}
        source = (support.ROOT / "scripts/blender/caustique_addon/__init__.py").read_text()
        versions.add(tuple(map(int, re.search(r'"version": \((.+?)\)', source)[1].split(","))))
        versions.add(part_of_addon("program").OLDEST)
        self.assertEqual(len(versions), 1)

    def test_panels_of_blender_show(self):
        self.scene.render.engine = "CYCLES"
        panels = [panel for panel in bpy.types.Panel.__subclasses__() if "CAUSTIQUE" in getattr(panel, "COMPAT_ENGINES", ())]
        names = {panel.__name__ for panel in panels}
        self.assertLessEqual({"EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface", "DATA_PT_lens", "DATA_PT_camera_dof",
                              "RENDER_PT_output", "RENDER_PT_color_management", "VIEWLAYER_PT_layer"}, names)
        self.assertFalse([name for name in names if name.startswith("CYCLES_") or "freestyle" in name])


class Stops(Installed):
    def setUp(self):
        super().setUp()
        self.stage()
        self.settings.iterations = 100_000

    def stop_when(self, condition):
        """Render until `condition(run)` holds, then as if the user had pressed Esc; seconds from then to the end."""
        engine, runs, pressed = part_of_addon("engine"), [], []
        begin = part_of_addon("run").Run

        def watched(*arguments):
            runs.append(begin(*arguments))
            return runs[-1]

        def esc(_engine):
            if not pressed and condition(runs[-1] if runs else None):
                pressed.append(time.monotonic())
            return bool(pressed)

        with mock.patch.object(engine.run, "Run", watched), mock.patch.object(engine.Engine, "_stopped", esc):
            found = self.render()
        self.assertFalse(runs and runs[-1].working())
        return found, time.monotonic() - pressed[0]

    def test_in_the_middle_the_picture_so_far_is_kept(self):
        self.passes("use_pass_z", "noisy")
        found, seconds = self.stop_when(lambda run: run and run.progress and run.progress["iteration"] >= 3)
        self.assertLess(seconds, 5)
        self.assertGreater(found["Combined.G"].mean(), 0.1)
        self.assertGreater(found["Noisy.G"].mean(), 0.1)
        self.assertAlmostEqual(float(numpy.median(found["Depth.Z"])), 10, 3)
        self.assertEqual(self.temporary(), [])

    def test_during_the_export(self):
        _, seconds = self.stop_when(lambda run: not run)
        self.assertLess(seconds, 2)
        self.assertEqual(self.temporary(), [])


if __name__ == "__main__":
    unittest.main()
