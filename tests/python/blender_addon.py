"""Compares renders of the add-on's engine with the command line and with closed forms. Needs bpy."""

import concurrent.futures
import math
import os
import pathlib
import re
import threading
import time
import unittest
from unittest import mock

import bpy
import numpy

from addon import Installed, channels, part_of_addon


class Renders(Installed):
    def test_passes_are_the_command_lines_to_the_last_bit(self):
        self.stage()
        self.layer.name = "Shot 7"
        self.passes("use_pass_z", "use_pass_position", "use_pass_normal", "use_pass_cryptomatte_object",
                    "use_pass_cryptomatte_material", "albedo", "parts", "noisy", "noisy_parts", "error", "levels")
        found, expected = self.render_and_keep(), self.by_hand()
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
        # The plane rises towards +y, and the sun is in the zenith: pi W/m2 times the cosine, reflectance 1/2.
        x, y = (numpy.arange(32) + 0.5) / 8 - 2, (11.5 - numpy.arange(24)) / 8
        numpy.testing.assert_allclose(found["Combined.G"], 0.5 * 0.8, rtol=1e-3)
        numpy.testing.assert_allclose(found["Combined.A"], 1, rtol=1e-5)
        numpy.testing.assert_allclose(found["Position.X"], numpy.tile(x, (24, 1)), atol=0.5 / 8 + 1e-4)
        numpy.testing.assert_allclose(found["Position.Y"], numpy.tile(y[:, None], (1, 32)), atol=0.5 / 8 + 1e-4)
        numpy.testing.assert_allclose(found["Position.Z"], 1 + 0.75 * found["Position.Y"], atol=1e-4)
        numpy.testing.assert_allclose(found["Depth.Z"], 10 - found["Position.Z"], atol=1e-4)
        for axis, value in zip("XYZ", (0, -0.6, 0.8)):
            numpy.testing.assert_allclose(found[f"Normal.{axis}"], value, atol=1e-4)

    def test_passes_of_cycles_add_up_to_the_picture(self):
        """Direct and indirect light times the colour, and emission and environment, are the picture."""
        long = bpy.app.version >= (5, 0, 0)
        lobes = ("Diffuse", "Glossy", "Transmission") if long else ("Diff", "Gloss", "Trans")
        kinds = (" Direct", " Indirect", " Color") if long else ("Dir", "Ind", "Col")
        switches = [f"use_pass_{lobe}_{kind}" for lobe in ("diffuse", "glossy", "transmission")
                    for kind in ("direct", "indirect", "color")]
        self.stage()
        self.passes(*switches, "use_pass_emit", "use_pass_environment")
        for finish, method in (("auto", "vcm"), ("off", "path")):
            self.settings.finish, self.settings.method = finish, method
            found = self.render()
            total = sum(found[f"{name}.G"] for name in (("Emission", "Environment") if long else ("Emit", "Env")))
            for lobe in lobes:
                direct, indirect, color = (found[f"{lobe}{kind}.G"] for kind in kinds)
                total = total + (direct + indirect) * color
                self.assertGreater(color.max(), 0, lobe)
                self.assertGreater((direct + indirect).max(), 0, lobe)
            with self.subTest(finish):
                # The denoiser spreads some light to pixels where the lobe's colour is black.
                self.assertLess((total - found["Combined.G"]).max(), 1e-3)
                self.assertGreater(total.sum(), 0.95 * found["Combined.G"].sum())
                if finish == "off":
                    numpy.testing.assert_allclose(total, found["Combined.G"], rtol=1e-3, atol=1e-4)

    def test_direct_light_of_a_lit_plane_is_divided_by_its_colour(self):
        long = bpy.app.version >= (5, 0, 0)
        self.plane(at=(0, 0, 1), turn=(math.atan(0.75), 0, 0))
        self.sun(math.pi)
        self.eye(height=10, width=4)
        self.passes("use_pass_diffuse_direct", "use_pass_diffuse_indirect", "use_pass_diffuse_color")
        self.settings.method, self.settings.finish = "path", "off"
        found = self.render()
        names = ("Diffuse Direct", "Diffuse Indirect", "Diffuse Color") if long else ("DiffDir", "DiffInd", "DiffCol")
        # pi W/m2 times the cosine 0.8, reflectance 1/2.
        for name, value in zip(names, (0.8, 0, 0.5)):
            numpy.testing.assert_allclose(found[f"{name}.G"], value, rtol=1e-3, err_msg=name)

    def test_motion_vectors_are_a_pass(self):
        """A plane moves by two pixels to the right and one up in each frame, with and without other passes."""
        plane = self.plane()
        self.eye(height=10, width=4)
        for axis, expression in enumerate(("(frame - 6) / 4", "(frame - 6) / 8")):
            plane.driver_add("location", axis).driver.expression = expression
        self.scene.frame_set(6)
        self.settings.method, self.settings.finish = "path", "off"
        for more in ((), ("parts",)):
            self.passes("use_pass_vector", *more)
            found = self.render()
            for component, value in zip("XYZW", (-2, -1, -2, -1)):
                numpy.testing.assert_allclose(found[f"Vector.{component}"][12, 16], value, atol=1e-2)

    def test_light_groups_are_passes(self):
        """Each group's light has its colour, and the finished groups sum to the picture."""
        self.plane()
        self.eye()
        for colour, group in (((1, 0, 0), "key"), ((0, 1, 0), "rim light")):
            bpy.ops.scene.view_layer_add_lightgroup(name=group)
            body = self.sun(2)
            body.data.color, body.lightgroup = colour, group
        self.settings.method = "path"
        self.passes("noisy_parts", "noisy")
        found = self.render()
        for group, lit, dark in (("key", "R", "G"), ("rim_light", "G", "R")):
            raw, finished = f"LightGroup_{group}", f"FinishedLightGroup_{group}"
            numpy.testing.assert_allclose(found[f"{raw}.{lit}"], found[f"Noisy.{lit}"], rtol=1e-5)
            numpy.testing.assert_allclose(found[f"{finished}.{lit}"], found[f"Combined.{lit}"], rtol=1e-3)
            for name in (raw, finished):
                self.assertFalse(found[f"{name}.{dark}"].any(), name)
            self.assertFalse(found[f"FinishedCaustic_{group}.{lit}"].any())

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

    def test_motion_blur(self):
        """A moving tile covers each pixel for its share of the time for which the shutter is open."""
        self.plane()
        self.sun(2 * math.pi)  # on reflectance 1/2: radiance 1
        self.eye()
        mesh = bpy.data.meshes.new("tile")
        mesh.from_pydata([(0, -1, 1), (0.5, -1, 1), (0.5, 1, 1), (0, 1, 1)], [], [(0, 1, 2, 3)])
        mesh.materials.append(self.material("black", Base_Color=(0, 0, 0, 1), Roughness=1.0, Specular_IOR_Level=0.0))
        body = self.put("tile", mesh)
        driver = body.driver_add("location", 0).driver
        driver.expression = "(frame - 1) / 2"
        self.scene.render.use_motion_blur, self.scene.render.motion_blur_shutter = True, 1.0
        self.scene.render.motion_blur_position = "START"
        self.settings.method, self.settings.finish, self.settings.iterations = "path", "off", 256
        self.scene.frame_set(1)
        found = self.render()["Combined.G"][12]
        # The tile, four pixels wide, moves by four pixels to the right while the shutter is open. The sun shines
        # straight down, so its shadow is beneath it.
        x = numpy.arange(32) + 0.5 - 16
        covered = numpy.clip(1 - abs(x - 4) / 4, 0, 1)
        numpy.testing.assert_allclose(found, 1 - covered, atol=0.05)

    def test_files_beside_the_scene_are_found(self):
        """A modified, unsaved scene with an image and a library, both with relative paths."""
        picture = bpy.data.images.new("paint", 4, 4)
        picture.generated_color = (1, 1, 0, 1)  # a missing image is magenta
        picture.filepath_raw, picture.file_format = str(self.dir / "paint.png"), "PNG"
        picture.save()
        tile = bpy.data.meshes.new("tile")
        tile.from_pydata([(-1, -1, 3), (1, -1, 3), (1, 1, 3), (-1, 1, 3)], [], [(0, 1, 2, 3)])
        tile.uv_layers.new()
        tile.materials.append(self.material("painted", Roughness=1.0, Specular_IOR_Level=0.0))
        tree = tile.materials[0].node_tree
        paint = tree.nodes.new("ShaderNodeTexImage")
        paint.image = picture
        shader = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        tree.links.new(paint.outputs["Color"], shader.inputs["Base Color"])
        body = bpy.data.objects.new("tile", tile)
        bpy.data.libraries.write(str(self.dir / "tile.blend"), {body}, path_remap="RELATIVE")
        bpy.data.meshes.remove(tile)
        bpy.ops.wm.save_as_mainfile(filepath=str(self.dir / "scene.blend"))
        with bpy.data.libraries.load("//tile.blend", link=True) as (_, wanted):
            wanted.objects = ["tile"]
        self.scene.collection.objects.link(wanted.objects[0])
        self.plane()
        self.sun(math.pi)
        self.eye()
        self.passes("use_pass_z")
        self.settings.method, self.settings.finish = "path", "off"
        found = self.render()
        self.assertAlmostEqual(float(found["Depth.Z"][12, 16]), 7, 4)
        # pi W/m2 on a Lambertian surface gives a radiance equal to its reflectance.
        for channel, value in zip("RGB", (1, 1, 0)):
            self.assertAlmostEqual(float(found[f"Combined.{channel}"][12, 16]), value, 4)

    def test_view_layers_have_passes_of_their_own(self):
        self.stage()
        self.passes("use_pass_z")
        second = self.scene.view_layers.new("second")
        second.use_pass_z, second.caustique.noisy = False, True
        self.render()
        found = channels(self.dir / "render.exr")
        self.assertEqual({name.rsplit(".", 1)[0] for name in found if not name.startswith("Composite")},
                         {"ViewLayer.Combined", "ViewLayer.Depth", "second.Combined", "second.Noisy"})
        self.assertEqual(found["ViewLayer.Combined.G"].tobytes(), found["second.Combined.G"].tobytes())

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
        found = self.render_and_keep()
        expected = self.by_hand("--seed", 7, "--no-combine", "--effects=-caustic", "--max-depth", 5)
        self.assertEqual(found["Combined.G"].tobytes(), expected["Combined.G"].tobytes())
        other = self.by_hand("--seed", 8, "--no-combine", "--effects=-caustic", "--max-depth", 5)
        self.assertNotEqual(found["Combined.G"].tobytes(), other["Combined.G"].tobytes())

    def composite(self, output):
        """Render with a compositor that shows the socket `output(tree, layers)`; `layers` is the Render Layers node.

        Returns the green channel of the result, and the passes.
        """
        if bpy.app.version >= (5, 0, 0):
            tree = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
            self.scene.compositing_node_group = tree
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            shown = tree.nodes.new("NodeGroupOutput")
        else:
            self.scene.use_nodes = True
            tree = self.scene.node_tree
            tree.nodes.clear()
            shown = tree.nodes.new("CompositorNodeComposite")
        layers = tree.nodes.new("CompositorNodeRLayers")
        layers.scene, layers.layer = self.scene, self.layer.name
        tree.links.new(output(tree, layers), shown.inputs[0])
        found = self.render()
        return channels(self.dir / "render.exr")["Composite.Combined.G"], found

    def test_the_compositor_has_every_pass_as_an_output(self):
        self.stage()
        self.layer.name = "Shot"
        self.passes("parts", "use_pass_z")
        shown, found = self.composite(lambda _, layers: layers.outputs["CombinedCaustic"])
        self.assertGreater(shown.max(), 0)
        numpy.testing.assert_array_equal(shown, found["CombinedCaustic.G"])

    def test_the_compositor_picks_objects_by_cryptomatte(self):
        self.stage()
        self.layer.name = "Shot"
        self.passes("use_pass_cryptomatte_object", "use_pass_z")

        def matte(tree, _):
            node = tree.nodes.new("CompositorNodeCryptomatteV2")
            node.source, node.scene = "RENDER", self.scene
            node.layer_name = "Shot.CryptoObject"
            node.matte_id = "ball"
            return node.outputs["Matte"]

        shown, found = self.composite(matte)
        ball = found["Depth.Z"] < 9.9  # depth has one sample per pixel, on the ball or on the table
        self.assertTrue((shown[ball] > 0).all())
        self.assertAlmostEqual(float(shown.sum()), math.pi * (0.7 * 8) ** 2, delta=3)

    def test_the_picture_so_far_is_shown(self):
        self.stage()
        self.settings.iterations = 60
        engine, shown = part_of_addon("engine"), []
        show = engine.Engine._show

        def watched(self, picture, *where):
            shown.append({name: plane.copy() for name, plane in picture.channels.items()})
            show(self, picture, *where)

        # The finished picture is not delivered, so Blender shows the last picture before it.
        with mock.patch.multiple(engine.Engine, _show=watched, _deliver=lambda *_: None):
            found = self.render_and_keep()
        for channel in "RGBA":
            self.assertEqual(found[f"Combined.{channel}"].tobytes(), shown[-1][channel].tobytes())
        numpy.testing.assert_allclose(shown[0]["G"].mean(), self.by_hand()["Combined.G"].mean(), rtol=0.2)

    def test_nothing_is_left_in_the_temporary_folder(self):
        self.stage()
        self.render()
        self.assertEqual(self.temporary(), [])


class Stops(Installed):
    def setUp(self):
        super().setUp()
        self.stage()
        self.settings.iterations = 100_000
        self.enterContext(mock.patch.dict(os.environ, XDG_CACHE_HOME=str(self.dir / "cache")))

    def stop_when(self, condition):
        """Render until `condition(run)` holds, then press Esc. Returns the seconds from then to the end."""
        engine, runs, pressed = part_of_addon("engine"), [], []
        begin = part_of_addon("run").Run

        def watched(*arguments):
            runs.append(begin(*arguments))
            return runs[-1]

        def esc(_engine):
            if not pressed and condition(runs[-1] if runs else None):
                pressed.append(time.monotonic())
            return bool(pressed)

        with mock.patch.object(engine.run, "Run", watched), mock.patch.object(engine.Engine, "_is_cancelled", esc):
            found = self.render()
        self.assertFalse(runs and runs[-1].is_running())
        self.assertIsNotNone(runs[-1]._process.wait(60) if runs else 0)
        return found, time.monotonic() - pressed[0]

    def first_iteration(self):
        """Render until the program reports an iteration, then press Esc. Returns the iteration's number."""
        reported = []

        def reports(run):
            if run and run.progress:
                reported.append(run.progress["iteration"])
            return bool(reported)

        self.stop_when(reports)
        return reported[0]

    def test_in_the_middle_the_picture_so_far_is_kept(self):
        self.passes("use_pass_z", "noisy")
        found, seconds = self.stop_when(lambda run: run and run.progress and run.progress["iteration"] >= 3)
        self.assertLess(seconds, 5)
        self.assertGreater(found["Combined.G"].mean(), 0.1)
        self.assertGreater(found["Noisy.G"].mean(), 0.1)
        self.assertAlmostEqual(float(numpy.median(found["Depth.Z"])), 10, 3)
        self.assertEqual(self.temporary(), [])

    def test_a_large_picture_stops_within_two_seconds(self):
        """The program would take longer to finish the picture. The last picture shown stays."""
        self.scene.render.resolution_x, self.scene.render.resolution_y = 1000, 750
        self.settings.method = "path"
        shown, pressed, ended = [], [], []
        engine, run = part_of_addon("engine").Engine, part_of_addon("run").Run
        show, stop, finish = engine._show, run.stop, run.finish
        with mock.patch.object(engine, "_show", lambda *picture: shown.append(show(*picture))), \
                mock.patch.object(run, "stop", lambda work, *saved: (pressed.append(time.monotonic()), stop(work, *saved))), \
                mock.patch.object(run, "finish", lambda work: (ended.append(time.monotonic()), finish(work))):
            found, _ = self.stop_when(lambda run: shown)
        self.assertLess(ended[0] - pressed[0], 2)
        self.assertGreater(found["Combined.G"].mean(), 0.1)
        self.assertEqual(self.temporary(), [])

    def test_a_killed_render_goes_on(self):
        """As if Blender were killed: its program goes on alone. The next render ends it, and starts from its checkpoint."""
        resume, run = part_of_addon("resume"), part_of_addon("run")
        self.enterContext(mock.patch.object(resume, "_SECONDS_BETWEEN", 1))
        saved, before = [], [0, 0]

        class Killed(BaseException):
            pass

        def watch(_engine, work, *_):
            folder = resume._folder()
            while not any(name.endswith(".checkpoint") for name in os.listdir(folder)):
                before.append(work.progress["iteration"] if work.progress else 0)
                time.sleep(0.1)
            saved.append(work)
            raise Killed

        with mock.patch.multiple(part_of_addon("engine").Engine, _watch=watch), \
                mock.patch.object(resume.Checkpoint, "remove"), mock.patch.object(run.Run, "kill"):
            try:
                self.render()
            except (Killed, RuntimeError, FileNotFoundError):
                pass
        first = self.first_iteration()
        # The last look but one was before the checkpoint, which therefore has at least the iterations until then.
        self.assertGreaterEqual(first, before[-2])
        self.assertGreater(first, 1)
        saved[0]._process.wait(60)

    def test_a_stopped_render_continues(self):
        resume, session = part_of_addon("resume"), part_of_addon("session")

        def checkpoints():
            return [name for name in os.listdir(resume._folder()) if name.endswith(".checkpoint")]

        self.settings.finish = "off"
        self.stop_when(lambda run: run and run.progress and run.progress["iteration"] >= 5)
        done = session.stopped[self.scene.name]
        self.assertGreaterEqual(done, 5)
        self.assertEqual(len(checkpoints()), 1)
        first = self.first_iteration()
        self.assertGreater(first, done, "it continues")
        self.assertEqual(len(checkpoints()), 1)

        # Another number of iterations is another render; its picture is that of a render that was never stopped.
        self.settings.iterations = 40
        self.stop_when(lambda run: run and run.progress and run.progress["iteration"] >= 3)
        continued = self.render()
        self.assertNotIn(self.scene.name, session.stopped)
        self.assertEqual(len(checkpoints()), 1, "a finished render leaves no checkpoint")
        whole = self.render()
        for name, pixels in whole.items():
            self.assertTrue(numpy.array_equal(pixels, continued[name]), name)

    def test_few_checkpoints_are_kept(self):
        resume = part_of_addon("resume")
        folder = pathlib.Path(resume._folder())
        folder.mkdir(parents=True)
        for age in range(5):
            file = folder / f"{age}.checkpoint"
            file.write_bytes(b"")
            os.utime(file, (time.time() - 60 * age,) * 2)
        resume._remove_old(str(folder / "4.checkpoint"))
        self.assertEqual(sorted(path.name[0] for path in folder.iterdir()), ["0", "1", "4"])

    def test_during_the_export(self):
        _, seconds = self.stop_when(lambda run: not run)
        self.assertLess(seconds, 2)
        self.assertEqual(self.temporary(), [])


class MainThread(Installed):
    """Renders run in a thread, and Blender's list of timers has no lock: only the main thread may add a timer."""

    def test_tasks_of_a_render_run_in_the_main_thread(self):
        handoff = part_of_addon("handoff")
        self.assertTrue(bpy.app.timers.is_registered(handoff.run_tasks))
        threads = []

        def fails():
            raise ValueError("planted fault")

        with mock.patch.object(bpy.app.timers, "register", side_effect=AssertionError("in a thread")), \
                concurrent.futures.ThreadPoolExecutor() as pool:
            works = [lambda: threads.append(threading.current_thread()), fails]
            results = [pool.submit(handoff.in_main_thread, work, lambda: False) for work in works]
            while not all(result.done() for result in results):
                self.assertGreater(handoff.run_tasks(), 0)
            self.assertIsNone(results[0].result())
            self.assertRaisesRegex(ValueError, "planted fault", results[1].result)
        self.assertEqual(threads, [threading.main_thread()])

    def test_cancelled_tasks_do_not_run(self):
        handoff, ran = part_of_addon("handoff"), []
        with concurrent.futures.ThreadPoolExecutor() as pool:
            result = pool.submit(handoff.in_main_thread, lambda: ran.append(1), lambda: True)
            self.assertRaises(part_of_addon("fault").Cancelled, result.result)
        handoff.run_tasks()
        self.assertEqual(ran, [])


if __name__ == "__main__":
    unittest.main()
