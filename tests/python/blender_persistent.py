"""Tests animations with Blender's setting Persistent Data: the frames, and when a second Blender is kept. Needs bpy."""

import signal
import sys
import unittest
from unittest import mock

import bpy
import numpy

from addon import Installed, channels, part_of_addon

import glb

_FRAMES = 3


class Animation(Installed):
    """Renders animations and keeps the second Blenders that they start."""

    def setUp(self):
        super().setUp()
        self.stage()
        render = self.scene.render
        render.resolution_x, render.resolution_y, render.use_persistent_data = 16, 12, True
        self.settings.method, self.settings.finish, self.settings.iterations = "path", "off", 1
        self.scene.frame_start, self.scene.frame_end = 1, _FRAMES
        self.processes, self.jobs, self.alive = [], [], []
        start, run = part_of_addon("handoff").Exporter._start, part_of_addon("handoff").Job.run

        def started(exporter):
            start(exporter)
            self.processes.append(exporter._process)

        def exported(job, *arguments):
            self.jobs.append(job)
            self.alive.append(sum(process.poll() is None for process in self.processes))
            return run(job, *arguments)

        self.enterContext(mock.patch.object(part_of_addon("handoff").Exporter, "_start", started))
        self.enterContext(mock.patch.object(part_of_addon("handoff").Job, "run", exported))
        self.kept = part_of_addon("persistent_data")
        self.addCleanup(self.kept.end)

    def animate(self, thing, path, *values):
        for frame, value in enumerate(values, 1):
            setattr(thing, path, value)
            thing.keyframe_insert(path, frame=frame)

    def turn(self):
        self.animate(bpy.data.objects["ball"], "location", (-1, 0, 1), (0, 0.5, 1), (1, 0, 1))

    def render_frames(self, name="frame"):
        """Render the animation."""
        self.jobs.clear()
        self.alive.clear()
        self.render(name, animation=True)

    def read(self, path):
        """Nothing, because few tests need the files."""

    def frame(self, number, name="frame"):
        """The channels of all view layers of a frame."""
        return channels(self.dir / f"{name}-{number:04}.exr")

    def check_ended(self, processes):
        """Check the number of processes, and that all have ended and left nothing."""
        self.assertEqual(len(self.processes), processes)
        for process in self.processes:
            self.assertIsNotNone(process.poll())
        self.assertEqual(self.temporary(), [])
        self.processes.clear()

    def between_frames(self, number, action):
        """Call `action` before the export of a job, counted from 1."""
        export = self.kept.export

        def watched(job, *arguments):
            watched.count += 1
            if watched.count == number:
                action()
            return export(job, *arguments)

        watched.count = 0
        return mock.patch.object(self.kept, "export", watched)


class Frames(Animation):
    def test_frames_are_those_of_single_exports_to_the_last_bit(self):
        self.turn()
        shader = next(n for n in bpy.data.materials["white"].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        self.animate(shader.inputs["Base Color"], "default_value", (0.8, 0.1, 0.1, 1), (0.1, 0.8, 0.1, 1), (0.1, 0.1, 0.8, 1))
        self.animate(bpy.data.lights["sun"], "energy", 1.0, 2.0, 4.0)
        second = self.scene.view_layers.new("second")
        hidden = bpy.data.collections.new("hidden")
        self.scene.collection.children.link(hidden)
        hidden.objects.link(bpy.data.objects["ball"])
        self.scene.collection.objects.unlink(bpy.data.objects["ball"])
        second.layer_collection.children["hidden"].exclude = True
        self.render_frames("kept")
        self.check_ended(1)
        self.scene.render.use_persistent_data = False
        self.render_frames("single")
        self.check_ended(2 * _FRAMES)
        kept, single = ([self.frame(number, name) for number in range(1, _FRAMES + 1)] for name in ("kept", "single"))
        for frame, (found, expected) in enumerate(zip(kept, single), 1):
            self.assertEqual(found.keys(), expected.keys())
            for name, pixels in expected.items():
                self.assertEqual(found[name].tobytes(), pixels.tobytes(), f"{name} of frame {frame}")
        # The test sees the animation and the view layers.
        means = numpy.array([[found[f"second.Combined.{channel}"].mean() for channel in "RGB"] for found in kept])
        numpy.testing.assert_allclose(means / means[0, 0], [[1, 1 / 8, 1 / 8], [1 / 4, 2, 1 / 4], [1 / 2, 1 / 2, 4]], rtol=1e-3)
        pictures = {found["ViewLayer.Combined.G"].tobytes() for found in kept}
        pictures |= {found["second.Combined.G"].tobytes() for found in kept}
        self.assertEqual(len(pictures), 2 * _FRAMES)

    def test_single_pictures_keep_nothing(self):
        self.render()
        self.check_ended(1)
        self.assertIsNone(self.kept._kept)

    def test_values_of_materials_are_those_of_the_exported_frame(self):
        """The copy holds the values of the open frame."""
        shader = next(n for n in bpy.data.materials["white"].node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        self.animate(shader.inputs["Roughness"], "default_value", 0.25, 0.5, 0.75)
        self.scene.frame_set(1)
        job = part_of_addon("handoff").Job(self.scene, self.layer.name, 3.0, str(self.dir), "")
        job.copy()
        job.run(lambda: False)
        document, _ = glb.read(self.dir / "scene.glb")
        material = next(one for one in document["materials"] if one["name"] == "white")
        self.assertEqual(material["pbrMetallicRoughness"]["roughnessFactor"], 0.75)


class Changes(Animation):
    def setUp(self):
        super().setUp()
        self.turn()

    def check_changed(self, action, processes):
        """Check the frames and the processes if `action` is called before the second frame."""
        with self.between_frames(2, action):
            self.render_frames()
        self.check_ended(processes)

    def test_a_changed_scene_is_copied_again(self):
        def widen():
            bpy.data.objects["ball"].scale = 2, 2, 2
            bpy.context.view_layer.update()  # as Blender's window does

        self.check_changed(widen, 2)
        changed = self.frame(2)
        self.render_frames()
        self.check_ended(1)
        unchanged = self.frame(2)
        self.assertEqual(changed["ViewLayer.Combined.G"].tobytes(), unchanged["ViewLayer.Combined.G"].tobytes())

    def test_other_settings_of_the_add_on_copy_the_scene_again(self):
        self.check_changed(lambda: setattr(self.preferences, "exporter", sys.executable), 2)

    def test_a_killed_process_is_replaced(self):
        def kill():
            self.processes[-1].send_signal(signal.SIGKILL)
            self.processes[-1].wait()

        self.check_changed(kill, 2)

    def test_a_process_that_dies_or_fails_during_an_export_is_replaced(self):
        begin = part_of_addon("handoff").Exporter.begin

        def killed(exporter, job):
            begin(exporter, job)
            if len(self.jobs) == 2:
                exporter._process.kill()

        def broken(exporter, job):
            begin(exporter, {**job, "scene": "none"} if len(self.jobs) == 2 else job)

        for planted in (killed, broken):
            with self.subTest(planted.__name__), mock.patch.object(part_of_addon("handoff").Exporter, "begin", planted):
                self.render_frames()
                self.assertEqual(len(self.jobs), _FRAMES + 1)
                self.check_ended(2)

    def test_frames_that_a_copy_of_another_frame_may_change_have_their_own(self):
        def foreign(*_):
            pass

        for name in ("frame_change_pre", "render_post"):
            self.assertFalse(self.kept._has_handlers())
            getattr(bpy.app.handlers, name).append(foreign)
            self.assertTrue(self.kept._has_handlers(), name)
            getattr(bpy.app.handlers, name).remove(foreign)

        ball = bpy.data.objects["ball"]
        for name, kind in (("cloth", "CLOTH"), ("dust", "PARTICLE_SYSTEM")):
            self.assertFalse(self.kept._needs_copies())
            ball.modifiers.new(name, kind)
            self.assertTrue(self.kept._needs_copies(), name)
            ball.modifiers.clear()
        with mock.patch.object(part_of_addon("handoff"), "scripts_allowed", lambda: True):
            self.assertFalse(self.kept._needs_copies())
            bpy.data.texts.new("rig.py").use_module = True
            self.assertTrue(self.kept._needs_copies())
        self.assertFalse(self.kept._needs_copies(), "scripts do not run")

    def test_animated_properties_of_add_ons_have_their_own_copies(self):
        """The second Blender lacks the add-on, but a copy may have the value of its frame."""
        material, ball = bpy.data.materials["ball glass"], bpy.data.objects["ball"]
        self.animate(material, "caustique_abbe", 20.0, 30.0, 40.0)
        self.render_frames()
        self.check_ended(_FRAMES)
        material.animation_data_clear()
        ball.animation_data.nla_tracks.new().strips.new("strip", 1, ball.animation_data.action)
        ball.driver_add("scale", 0).driver.expression = "1 + frame / 10"
        self.render_frames()
        self.check_ended(1)


class Ends(Animation):
    def test_after_esc(self):
        """Blender does not know of this Esc, so that it renders the third frame."""
        handoff, engine = part_of_addon("handoff"), part_of_addon("engine").Engine
        begin, watch, pressed = handoff.Exporter.begin, engine._watch, []

        def begun(exporter, job):
            begin(exporter, job)
            pressed[:] = [True] if len(self.jobs) == 2 else []

        with mock.patch.object(handoff.Exporter, "begin", begun), \
                mock.patch.object(engine, "_is_cancelled", lambda _: bool(pressed and pressed.pop())):
            self.render_frames()
        self.assertEqual(self.alive, [0, 1, 0])
        self.check_ended(2)

        def stopped(*arguments):
            watch(*arguments)
            return len(self.jobs) == 2

        with mock.patch.object(engine, "_watch", stopped):
            self.render_frames()
        self.assertEqual(self.alive, [0, 1, 0])
        self.check_ended(2)

    def test_after_an_error(self):
        begin = part_of_addon("run").Run.__init__

        def failing(run, *arguments):
            if len(self.jobs) == 2:
                raise part_of_addon("fault").Fault("planted fault")
            begin(run, *arguments)

        with mock.patch.object(part_of_addon("run").Run, "__init__", failing), \
                self.assertRaisesRegex(RuntimeError, "planted fault"):
            self.render_frames()
        self.check_ended(1)

    def test_with_the_events_of_blender_and_with_blender(self):
        """Each of these events ends the second Blender of an animation that is still there."""
        handlers = bpy.app.handlers
        events = [(name, lambda name=name: [function(self.scene, None) for function in getattr(handlers, name)])
                  for name in ("render_init", "render_complete", "render_cancel")]
        events += [("disabling the add-on", self.disable)]
        for name, happen in events:
            job = part_of_addon("handoff").Job(self.scene, "ViewLayer", 1.0, str(self.dir), "")
            self.kept.export(job, lambda: False, lambda _: None)
            self.assertTrue(job.exporter.is_running(), name)
            happen()
            self.assertFalse(job.exporter.is_running(), name)
            self.assertEqual(self.temporary(), [], name)

    def test_a_second_blender_ends_with_its_input(self):
        """As if Blender were killed."""
        job = part_of_addon("handoff").Job(self.scene, "ViewLayer", 1.0, str(self.dir), "")
        self.kept.export(job, lambda: False, lambda _: None)
        job.exporter._input.close()
        self.assertEqual(self.processes[0].wait(timeout=20), 0)


class Temporal(Installed):
    def test_frames_are_finished_with_their_neighbours(self):
        """The finished frames are those of `caustique finish`, and the kept ones are gone. Without vectors a warning."""
        self.stage()
        ball = bpy.data.objects["ball"]
        for frame, x in ((1, -1), (4, 1)):
            ball.location.x = x
            ball.keyframe_insert("location", frame=frame)
        self.scene.render.resolution_x, self.scene.render.resolution_y = 32, 24
        self.settings.method, self.settings.iterations, self.settings.use_temporal = "path", 4, True
        self.scene.frame_start, self.scene.frame_end = 1, 4
        self.layer.use_pass_vector = True
        self.render("frame", animation=True)
        folder = self.dir / "temporal"
        name = bpy.path.clean_name(self.layer.name)
        wanted = {f"{name}.{frame:04}.{kind}" for frame in range(1, 5) for kind in ("exr", "png")}
        self.assertEqual({path.name for path in folder.iterdir()}, wanted)
        session = part_of_addon("session")
        self.assertNotIn("motion vectors", "".join(session.warnings.get(self.scene.name, [])))
        finished, alone = (channels(path) for path in (folder / f"{name}.0002.exr", self.dir / "frame-0002.exr"))
        red = next(key for key in finished if key.endswith("Combined.R") or key == "R")
        other = next(key for key in alone if key.endswith("Combined.R") or key == "R")
        self.assertEqual(finished[red].shape, alone[other].shape)
        self.assertTrue(numpy.isfinite(finished[red]).all())
        self.assertTrue((finished[red] != alone[other]).any())
        self.assertAlmostEqual(float(finished[red].mean() / alone[other].mean()), 1.0, delta=0.1)
        self.layer.use_pass_vector = False
        self.scene.frame_end = 1
        self.render("again", animation=True)
        self.assertIn("switch on Passes > Data > Vector", "".join(session.warnings[self.scene.name]))


if __name__ == "__main__":
    unittest.main()
