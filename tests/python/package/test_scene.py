"""Scenes from numpy meet closed forms; scenes from files give what the command line gives."""

import inspect
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from shared import ROOT, TORUS, ground, sphere, square, still_life

import caustique as cq


class ClosedForms(unittest.TestCase):
    """Known answers, from meshes and numbers alone."""

    def test_a_lambertian_sphere_in_a_uniform_environment(self):
        """A convex body of albedo a under radiance L from everywhere sends out a L, whatever its shape."""
        vertices, triangles = sphere()
        matte = cq.Material(base_color=(0.5, 0.25, 0.75), specular=0.0)
        scene = cq.Scene.from_meshes(
            [cq.Mesh(vertices=vertices, triangles=triangles, material=matte)],
            cameras=[cq.Camera(position=(0, 0, 8), fov=5)], environment=(2.0, 2.0, 2.0),
        )
        image = scene.render(method="path", iterations=64, width=16, height=16, finish=False)
        pixels = image.picture.reshape(-1, 3).astype(float) / [1.0, 0.5, 1.5]
        error = pixels[:, 0].std() / 16
        # Sharp enough to tell an albedo that is off by a hundredth, at four standard errors.
        self.assertLess(error, 0.0025)
        np.testing.assert_allclose(pixels.mean(axis=0), 1.0, atol=4 * error)

    def test_clear_glass_in_a_uniform_environment_is_invisible(self):
        """A furnace: glass neither adds nor takes radiance, so it shows what is behind it."""
        vertices, triangles = sphere()
        glass = cq.Material(transmission=1.0, roughness=0.0, ior=1.5)
        scene = cq.Scene.from_meshes(
            [cq.Mesh(vertices=vertices, triangles=triangles, normals=vertices, material=glass)],
            cameras=[cq.Camera(position=(0, 0, 8), fov=20)], environment=np.full((8, 16, 3), 0.7, np.float32),
        )
        self.assertEqual(scene.warnings, [])
        image = scene.render(method="path", iterations=16, width=8, height=8, finish=False)
        np.testing.assert_allclose(image.picture, 0.7, rtol=2e-3)

    def test_lamps_by_their_units(self):
        """A ground of albedo a under irradiance E sends out a E / pi: of a sun, and of a point lamp I / d^2."""
        lamps = {
            "sun": (cq.SunLight(direction=(0, -1, 0), irradiance=(3.0, 2.0, 1.0)), np.array([3.0, 2.0, 1.0])),
            "point": (cq.PointLight(position=(0, 20, 0), intensity=(800.0, 400.0, 0.0)), np.array([2.0, 1.0, 0.0])),
            "spot": (
                cq.SpotLight(position=(0, 20, 0), target=(0, 0, 0), intensity=(400.0,) * 3, inner=30, outer=40),
                np.array([1.0, 1.0, 1.0]),
            ),
        }
        for name, (lamp, irradiance) in lamps.items():
            with self.subTest(name):
                scene = ground([lamp])
                self.assertEqual(scene.warnings, [])
                image = scene.render(method="path", iterations=2, width=4, height=4, finish=False)
                expected = np.broadcast_to(0.6 * irradiance / np.pi, (4, 4, 3))
                np.testing.assert_allclose(image.picture, expected, rtol=2e-3)

    def test_emission_transforms_and_textures(self):
        """A glowing square, moved and turned towards the camera, shows its radiance; a texture, its texels."""
        vertices, triangles = square()
        turn = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
        upright = np.linalg.inv(turn)
        upright[:3, 3] = (0, 0, -3)
        glow = cq.Material(base_color=(0, 0, 0), emission=(5.0, 0.5, 0.25), specular=0.0)
        camera = cq.Camera(position=(0, 0, 0), target=(0, 0, -1), fov=10)
        mesh = cq.Mesh(vertices=vertices, triangles=triangles, material=glow, transform=upright)
        image = cq.Scene.from_meshes([mesh], cameras=[camera]).render(
            method="path", iterations=1, width=4, height=4, finish=False)
        np.testing.assert_allclose(image.picture, np.broadcast_to([5.0, 0.5, 0.25], (4, 4, 3)), rtol=1e-5)
        np.testing.assert_allclose(image["Z"], 3.0, rtol=1e-5)

        texture = np.zeros((8, 8, 3), np.uint8)
        texture[:4, :4] = 255
        uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])
        matte = cq.Material(base_color_texture=texture, specular=0.0)
        mesh = cq.Mesh(vertices=vertices, triangles=triangles, uvs=uvs, material=matte, transform=upright)
        camera = cq.Camera(position=(0, 0, 0), target=(0, 0, -1), fov=2 * np.degrees(np.arctan(1 / 3)))
        image = cq.Scene.from_meshes([mesh], cameras=[camera], environment=(1.0,) * 3).render(
            method="path", iterations=1, width=16, height=16, finish=False)
        albedo = image["albedo"]
        # Two pixels a texel, the first row on top; between its quarters the texture is interpolated.
        np.testing.assert_allclose(albedo[2:6, 2:6], 1.0, rtol=1e-5)
        np.testing.assert_allclose(albedo[10:14, 2:14], 0.0, atol=1e-5)
        np.testing.assert_allclose(albedo[2:14, 10:14], 0.0, atol=1e-5)


class BesideTheCommandLine(unittest.TestCase):
    """The package is the program: the same settings give the same bytes."""

    PROGRAM = os.environ.get("CAUSTIQUE_BIN", ROOT / "target" / "release" / "caustique")

    def by_program(self, scene, *options):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "out.exr"
            subprocess.run([self.PROGRAM, "render", scene, "-o", path, "--progress", "none", *options],
                           check=True, capture_output=True)
            return cq.read(path)

    def assert_same(self, a, b, crop=None):
        """A file's picture is as large as its display window: what is rendered is the window `crop` of it."""
        self.assertEqual(sorted(a.keys()), sorted(b.keys()))
        left, top, width, height = crop or (0, 0, *reversed(a.shape))
        window = np.s_[top:top + height, left:left + width]
        for name, planes in a.layers.items():
            for component, values in planes.items():
                there = b.layers[name][component][window]
                self.assertTrue(values.tobytes() == there.tobytes(), f"{name}.{component}")

    def test_info_is_that_of_the_program(self):
        output = subprocess.run([self.PROGRAM, "info", "--json", TORUS], check=True, capture_output=True).stdout
        self.assertEqual(cq.Scene(TORUS).info(), json.loads(output))

    def test_a_texture_makes_a_film_as_thick_as_the_number(self):
        def picture(**film):
            matte = cq.Material(base_color=(0.5, 0.5, 0.5), roughness=0.3, iridescence=1.0, **film)
            vertices, triangles = square()
            mesh = cq.Mesh(vertices=vertices, triangles=triangles, uvs=vertices[:, :2], material=matte)
            camera = cq.Camera(position=(0, 3, 0), up=(0, 0, 1))
            scene = cq.Scene.from_meshes([mesh], cameras=[camera], environment=(1.0, 1.0, 1.0))
            return scene.render(method="path", iterations=4, width=8, height=8, finish=False).picture

        half = np.full((2, 2, 3), 51, np.uint8)  # a fifth
        textured = picture(iridescence_thickness_texture=half, iridescence_thickness=500, iridescence_thickness_minimum=250)
        np.testing.assert_allclose(textured, picture(iridescence_thickness=300), rtol=1e-5)
        self.assertGreater(np.abs(textured / picture(iridescence_thickness=500) - 1).max(), 0.01)

    def test_materials_have_the_parameters_of_gltf(self):
        """Each is in the packed file, and the reader accepts all of them without a warning."""
        image = np.full((2, 2, 4), 128, np.uint8)
        layered = cq.Material(
            base_color_texture=cq.Texture(pixels=image, scale=(2, 3), offset=(0.5, 0), rotation=90, wrap="mirror", nearest=True),
            metallic_roughness_texture=image[..., :3], normal_texture=image[..., :3], emission_texture=image[..., :3],
            emission=(2, 2, 2), clearcoat=0.5, clearcoat_roughness=0.1, sheen_color=(0.1, 0.2, 0.3), sheen_roughness=0.4,
            iridescence=0.5, iridescence_thickness=300.0, diffuse_transmission=0.25,
            anisotropy=0.5, anisotropy_rotation=90, specular_color=(1, 0.5, 0.2), double_sided=True,
            diffuse_roughness=0.5, coat_ior=1.75, coat_color=(1, 0.5, 0.25), sheen_model="fibers",
            iridescence_texture=image[..., :3], iridescence_thickness_texture=image[..., :3],
            iridescence_thickness_minimum=200.0, diffuse_roughness_texture=image[..., :3], coat_color_texture=image[..., :3],
            coat_ior_texture=cq.Texture(pixels=image[..., :3], scale=(2, 2)),
        )
        vertices, triangles = square()
        mesh = cq.Mesh(vertices=vertices, triangles=triangles, uvs=vertices[:, :2], colors=np.ones((4, 3)), material=layered)
        copies = [replace(mesh, transform=np.diag([x, x, x, 1])) for x in (1, 2)]
        camera = cq.Camera(position=(0, 3, 0), up=(0, 0, 1), orthographic_height=4.0, aspect=1.0, shift=(0.1, 0.0))
        data = cq.pack(copies, cameras=[camera])
        document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
        self.assertEqual((len(document["meshes"]), len(document["materials"]), len(document["nodes"])), (1, 1, 3))
        material, placed = document["materials"][0], document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        self.assertEqual(material["alphaMode"], "BLEND")
        self.assertEqual(material["extensions"]["KHR_materials_specular"]["specularColorFactor"], [1, 0.5, 0.2])
        self.assertEqual(material["extensions"]["KHR_materials_clearcoat"],
                         {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1})
        film = material["extensions"]["KHR_materials_iridescence"]
        self.assertEqual(len({film.pop(key)["index"] for key in ("iridescenceTexture", "iridescenceThicknessTexture")}), 2)
        self.assertEqual(film, {"iridescenceFactor": 0.5, "iridescenceThicknessMaximum": 300,
                                "iridescenceThicknessMinimum": 200})
        self.assertEqual(material["extensions"]["KHR_materials_diffuse_transmission"], {"diffuseTransmissionFactor": 0.25})
        own = material["extras"]["caustique"]
        textures = {name: own.pop(f"{name}_texture") for name in ("diffuse_roughness", "coat_ior", "coat_color")}
        self.assertEqual(own, {"diffuse_roughness": 0.5, "coat_ior": 1.75, "coat_color": [1, 0.5, 0.25],
                               "sheen_model": "fibers"})
        self.assertEqual(textures["coat_ior"]["extensions"]["KHR_texture_transform"]["scale"], [2, 2])
        self.assertEqual(len({found["index"] for found in textures.values()}), 3)
        self.assertAlmostEqual(placed["extensions"]["KHR_texture_transform"]["rotation"], -np.pi / 2)
        self.assertEqual(document["cameras"][0]["orthographic"]["ymag"], 2)
        self.assertEqual(cq.Scene.from_meshes(copies, cameras=[camera], strict=True).warnings, [])
        with self.assertRaisesRegex(ValueError, 'wrap is "repeat"'):
            cq.pack([replace(mesh, material=cq.Material(base_color_texture=cq.Texture(pixels=image, wrap="tile")))])

    def test_every_layer_of_a_render(self):
        cases = [
            ({}, []),
            ({"method": "sppm", "photons": 2000, "alpha": 0.7, "seed": 5, "crop": (4, 2, 16, 8)},
             ["--method", "sppm", "--photons", "2000", "--alpha", "0.7", "--seed", "5", "--crop", "4,2,16,8"]),
            ({"method": "vcm", "guide": True, "finish": False, "max_depth": 6},
             ["--method", "vcm", "--guide", "on", "--no-combine", "--max-depth", "6"]),
        ]
        for keywords, options in cases:
            with self.subTest(**keywords), warnings.catch_warnings(action="ignore"):
                image = cq.Scene(TORUS).render(iterations=4, width=32, threads=3, **keywords)
                self.assert_same(image, self.by_program(TORUS, "--iterations", "4", "--width", "32", *options),
                                 keywords.get("crop"))
        self.assertFalse(np.array_equal(image.picture, cq.Scene(TORUS).render(iterations=4, width=32).picture))

    def test_filters_and_parameters_of_cppm(self):
        for keywords, options in [
            ({"filter": "blackman-harris", "method": "path"}, ["--method", "path", "--filter", "blackman-harris"]),
            ({"filter": ("gaussian", 2.0), "method": "cppm", "photons": 2000, "cppm_grid": (2, 4), "cppm_k": 0.5,
              "cppm_beta": 1.5, "cppm_significance": 0.2, "cppm_plus": True},
             ["--filter", "gaussian", "2", "--method", "cppm", "--photons", "2000", "--cppm-grid", "2,4", "--cppm-k", "0.5",
              "--cppm-beta", "1.5", "--cppm-significance", "0.2", "--cppm-plus"]),
        ]:
            with self.subTest(**keywords), warnings.catch_warnings(action="ignore"):
                image = cq.Scene(TORUS).render(iterations=3, width=24, **keywords)
                plain = cq.Scene(TORUS).render(iterations=3, width=24, method=keywords["method"])
                self.assert_same(image, self.by_program(TORUS, "--iterations", "3", "--width", "24", *options))
                self.assertFalse(np.array_equal(image["Noisy"], plain["Noisy"]))

    def test_packed_meshes_are_a_file_of_the_program(self):
        vertices, triangles = sphere(8)
        meshes = [cq.Mesh(vertices=vertices, triangles=triangles, material=cq.Material(transmission=1, roughness=0))]
        lights = [cq.PointLight(position=(0, 3, 0), intensity=(10, 10, 10), radius=0.1)]
        cameras = [cq.Camera(position=(0, 0, 5))]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "packed.glb"
            path.write_bytes(cq.pack(meshes, lights=lights, cameras=cameras))
            there = self.by_program(path, "--iterations", "2", "--width", "16", "--height", "16", "--env", "0,0,0")
        here = cq.Scene.from_meshes(meshes, lights=lights, cameras=cameras).render(iterations=2, width=16, height=16)
        self.assert_same(here, there)

    def test_a_plan(self):
        out = subprocess.run([self.PROGRAM, "plan", TORUS, "--json", "--width", "64", "--method", "vcm"],
                             check=True, capture_output=True, text=True).stdout
        plan = cq.Scene(TORUS).plan(width=64, method="vcm")
        self.assertEqual(plan, json.loads(out))


class Running(unittest.TestCase):
    """Progress, ends, threads."""

    @classmethod
    def setUpClass(cls):
        cls.scene = still_life()

    def render(self, **options):
        return self.scene.render(method="path", width=8, height=8, finish=False, **options)

    def test_progress_comes_in_the_calling_thread_once_an_iteration(self):
        steps = []
        self.render(iterations=5, progress=lambda p: steps.append((p.iteration, p.iterations, threading.get_ident())))
        self.assertEqual(steps, [(i, 5, threading.get_ident()) for i in range(1, 6)])

    def test_false_ends_it_and_keeps_what_is_done(self):
        image = self.render(iterations=1000, progress=lambda p: p.iteration < 3)
        self.assertEqual(image.header["iterations"], 3)
        whole = self.render(iterations=3)
        self.assertEqual(image["Noisy"].tobytes(), whole["Noisy"].tobytes())
        # Values other than False let the render continue.
        self.assertEqual(self.render(iterations=4, progress=lambda p: None).header["iterations"], 4)

    def test_an_exception_comes_out_with_the_image(self):
        def fail(progress):
            if progress.iteration == 2:
                raise KeyboardInterrupt

        with self.assertRaises(KeyboardInterrupt) as caught:
            self.render(iterations=1000, progress=fail)
        self.assertEqual(caught.exception.image.header["iterations"], 2)

    def test_a_signal_ends_it(self):
        def kill():
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

        timer = threading.Timer(0.5, kill)
        timer.start()
        with self.assertRaises(KeyboardInterrupt) as caught:
            self.render(time=60)
        self.assertGreater(caught.exception.image.header["iterations"], 0)

    def test_two_renders_at_once_are_those_of_one_after_another(self):
        alone = [self.render(iterations=20, seed=seed)["Noisy"].tobytes() for seed in (1, 2)]
        both = [None, None]

        def run(index):
            both[index] = self.render(iterations=20, seed=index + 1)["Noisy"].tobytes()

        threads = [threading.Thread(target=run, args=(index,)) for index in (0, 1)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertTrue(alone == both)
        self.assertTrue(both[0] != both[1])

    def test_python_goes_on_meanwhile(self):
        """Another thread counts while a render runs: the lock is not held."""
        counts, done = [0], threading.Event()

        def count():
            while not done.is_set():
                counts[0] += 1
                done.wait(0.005)

        thread = threading.Thread(target=count)
        thread.start()
        self.render(time=0.5)
        done.set()
        thread.join()
        self.assertGreater(counts[0], 20)


class Divided(unittest.TestCase):
    """Shards and checkpoints give what one render in one process gives, bit by bit."""

    ASKED = {"width": 24, "iterations": 6, "seed": 3}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.enterContext(warnings.catch_warnings(action="ignore"))
        self.scene = cq.Scene(TORUS)
        self.whole = self.scene.render(**self.ASKED)

    def assert_same(self, image):
        self.assertEqual(sorted(image.keys()), sorted(self.whole.keys()))
        for name, planes in self.whole.layers.items():
            for component, values in planes.items():
                self.assertEqual(values.tobytes(), image.layers[name][component].tobytes(), f"{name}.{component}")

    def shards(self, count=3, **options):
        files = [self.folder / f"{index}.exr" for index in range(count)]
        for index, file in enumerate(files):
            self.scene.render(shard=(index, count), **self.ASKED | options).save(file)
        return files

    def test_shards_merge_to_the_render(self):
        files = self.shards()
        self.assert_same(cq.merge(files[::-1]))
        with self.assertRaisesRegex(cq.Error, "shard 1 of 3 is missing"):
            cq.merge([files[0], files[2]])
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            part = cq.merge([files[0], files[2]], partial=True)
        self.assertIn("shard 1 is missing", str(caught[0].message))
        self.assertFalse(np.array_equal(part["Noisy"], self.whole["Noisy"]))
        program = [BesideTheCommandLine.PROGRAM, "merge", *files, "-o", self.folder / "merged.exr"]
        subprocess.run(program, check=True, capture_output=True)
        self.assert_same(cq.read(self.folder / "merged.exr"))

    def test_shards_ask_for_their_finish(self):
        bare = self.scene.render(finish=False, **self.ASKED)
        files = self.shards(2, finish=False)
        self.assertTrue(np.array_equal(cq.merge(files).picture, bare.picture))
        self.assertFalse(np.array_equal(cq.merge(files, finish=True).picture, bare.picture))

    def test_shards_of_scenes_that_are_not_the_same_do_not_merge(self):
        files = self.shards(2)
        cq.Scene(TORUS, environment=(1.0, 1.0, 1.0)).render(shard=(1, 2), **self.ASKED).save(files[1])
        with self.assertRaisesRegex(cq.Error, "environment"):
            cq.merge(files)

    def test_a_render_goes_on_from_its_checkpoint(self):
        state = self.folder / "state"
        self.scene.render(checkpoint=state, checkpoint_every=0.001, **self.ASKED | {"iterations": 2})
        self.assert_same(self.scene.render(resume=state, **self.ASKED))
        with self.assertRaisesRegex(cq.Error, "another seed"):
            self.scene.render(resume=state, **self.ASKED | {"seed": 4})

    def test_what_no_other_process_could_read(self):
        sky = np.ones((4, 8, 3))
        for scene in (still_life(), cq.Scene(TORUS, environment=sky)):
            for options in ({"shard": (0, 2)}, {"checkpoint": self.folder / "a"}, {"resume": self.folder / "a"}):
                with self.assertRaisesRegex(cq.Error, "another process"):
                    scene.render(**self.ASKED | options)


class Faults(unittest.TestCase):
    """Errors name the fault and the remedy."""

    def test_unknown_keywords_name_the_nearest(self):
        scene = ground([])
        for call, wrong, near in [
            (scene.render, "iteration", "iterations"), (scene.plan, "photon", "photons"),
            (scene.converge, "method", "methods"), (lambda **k: cq.Scene(TORUS, **k), "enviroment", "environment"),
        ]:
            with self.subTest(wrong), self.assertRaisesRegex(TypeError, f"'{wrong}'; did you mean '{near}'"):
                call(**{wrong: 3})

    def test_values_out_of_range_and_of_no_effect(self):
        scene = ground([])
        for options, fault, hint in [
            ({"method": "photons"}, "method='photons'", "'sppm'"),
            ({"iterations": 0}, "iterations=0", "from 1 to"),
            ({"method": "path", "photons": 5}, "photons has no effect", "leave photons out"),
            ({"method": "vcm", "levels": 9}, "levels=9", "from 1 to 5"),
            ({"width": 10**5}, "100000", "32768"),
            ({"layers": "Nosy", "method": "path"}, "Nosy", "Noisy"),
            ({"camera": "front"}, "front", "camera"),
            ({"crop": (0, 0, 2, 2.5)}, "crop", "pixels"),
            ({"filter": "hat"}, "no filter 'hat'", "gaussian"),
            ({"filter": ("box", 99)}, "99", "0.1 to 8"),
            ({"cppm_k": 0.5, "method": "sppm"}, "cppm_k has no effect", "method='cppm'"),
            ({"cppm_grid": (9, 9), "method": "cppm"}, "cppm_grid=(9, 9)", "2 to 64"),
            ({"checkpoint_every": 0.0}, "checkpoint_every=0", "above 0"),
        ]:
            with self.subTest(**options), self.assertRaises(cq.Error) as caught:
                scene.render(**{"height": 8, "width": 8} | options)
            self.assertIn(fault, str(caught.exception))
            self.assertIn(hint, caught.exception.hint)
        with self.assertRaisesRegex(TypeError, "argument 'width'"):
            scene.render(width="wide")
        with self.assertRaisesRegex(ValueError, "argument 'seed'"):
            scene.render(seed=-1)

    def test_signatures_name_the_arguments(self):
        scene = ground([])
        for call, some in ((scene.plan, {"kernel", "photon_memory"}), (scene.render, {"memory", "radius_rule", "eye_paths"})):
            names = set(inspect.signature(call).parameters)
            self.assertLessEqual(some | {"method", "indirect", "threads"}, names)
            # None is an argument that is left out; a name that is unknown would be a TypeError.
            with self.assertRaisesRegex(cq.Error, "iterations=0"):
                call(**dict.fromkeys(names) | {"iterations": 0})

    def test_options_of_the_command_line(self):
        scene = cq.Scene(TORUS)
        small = {"method": "sppm", "iterations": 2, "width": 16, "levels": 1, "photons": 2000, "finish": False}
        plain = scene.render(**small).picture
        for options in ({"kernel": "gaussian"}, {"radius_rule": "local"}, {"indirect": "paths"}):
            with self.subTest(**options):
                self.assertFalse(np.array_equal(scene.render(**small | options).picture, plain))
        with self.assertRaisesRegex(cq.Error, "kernel='cone' does not exist\nhint: one of 'box'"):
            scene.render(**small, kernel="cone")
        with self.assertRaisesRegex(cq.Error, "MiB"):
            scene.render(method="path", iterations=1, width=2048, memory=1)

    def test_scenes_that_are_wrong(self):
        vertices, triangles = square()
        with self.assertRaises(cq.Error) as caught:
            cq.Scene.from_meshes([cq.Mesh(vertices=vertices, triangles=triangles + 10)])
        self.assertEqual(caught.exception.kind, "scene")
        self.assertIn("past the 4 vertices", str(caught.exception))
        # Arrays have no file, and nothing to export again.
        self.assertTrue(caught.exception.place.startswith('mesh "mesh"'), caught.exception.place)
        self.assertIn("correct the mesh arrays", caught.exception.hint)
        with self.assertRaises(cq.Error) as caught:
            cq.Scene("no/such.glb")
        self.assertEqual(caught.exception.kind, "io")
        for arrays, text in [
            ({"vertices": vertices[:, :2]}, r"mesh \"mesh\", vertices: an array of shape \(N, 3\)"),
            ({"triangles": triangles - 1}, "from 0 up"),
            ({"triangles": triangles * 1.0}, "whole numbers"),
            ({"triangles": triangles + 2**32}, f"index {2**32 + 3} is past"),
            ({"transform": np.eye(3)}, r"\(4, 4\)"),
        ]:
            with self.subTest(text), self.assertRaisesRegex(ValueError, text):
                cq.Scene.from_meshes([cq.Mesh(**{"vertices": vertices, "triangles": triangles} | arrays)])
        with self.assertRaises(cq.Error):
            cq.Scene.from_meshes([cq.Mesh(vertices=vertices * np.nan, triangles=triangles)])
        for made, text in [
            (lambda: cq.Material(ior="glass"), "Material: ior is a number, not 'glass'"),
            (lambda: cq.Material(base_color=0.5), "Material: base_color is three numbers, not 0.5"),
            (lambda: cq.Medium(sigma_s=(1.0, "a", 1.0)), "Medium: sigma_s is three numbers"),
            (lambda: cq.SunLight(direction=(0, 1), irradiance=np.ones(3)), "SunLight: direction is three numbers"),
        ]:
            with self.subTest(text), self.assertRaisesRegex(TypeError, text):
                made()

    def test_a_pickled_scene_is_built_again_from_its_source(self):
        """From a path, also in another folder, and from bytes; with the options, arrays among them."""
        small = {"method": "path", "iterations": 2, "width": 8, "finish": False}
        sky = np.full((2, 4, 3), 0.5, np.float32)
        here = os.getcwd()
        self.addCleanup(os.chdir, here)
        os.chdir(TORUS.parent)
        scenes = [cq.Scene(TORUS.name, environment=sky), cq.Scene(TORUS.name, glass="thin"), still_life()]
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            for scene in scenes:
                again = pickle.loads(pickle.dumps(scene))
                self.assertIs(type(again), cq.Scene)
                np.testing.assert_array_equal(again.render(**small).picture, scene.render(**small).picture)
                self.assertEqual(again.warnings, scene.warnings)
            os.chdir(here)

    def test_messages_name_arguments_not_options(self):
        with tempfile.TemporaryDirectory() as folder:
            for options in ({"width": 10**5}, {"crop": (0, 0, 99, 99)}, {"layers": "Nosy"}, {"method": "sppm", "knn": 0},
                            {"resume": f"{folder}/no"}, {"shard": (0, 2), "method": "cppm"}):
                with self.subTest(**options), self.assertRaises(cq.Error) as caught:
                    cq.Scene(TORUS).render(**{"height": 8, "width": 8, "method": "path"} | options)
                for text in (str(caught.exception), caught.exception.hint or "", caught.exception.place):
                    self.assertNotRegex(text, r"(^|[ '(])--[a-z]")
        with self.assertWarns(cq.SceneWarning) as caught:
            pane = cq.Mesh(vertices=square()[0], triangles=square()[1], material=cq.Material(transmission=1.0))
            cq.Scene.from_meshes([pane])
        self.assertNotIn(" --", " ".join(str(one.message) for one in caught.warnings))

    def test_threads_have_a_bound(self):
        scene = ground([])
        for call in (lambda: scene.render(threads=65535), lambda: cq.Scene(TORUS, threads=10**9),
                     lambda: scene.plan(threads=4096), lambda: cq.combine(scene.render(width=2), threads=65535)):
            with self.assertRaisesRegex(cq.Error, "threads=.* is out of range\nhint: at most"):
                call()

    def test_arrays_beyond_memory_are_a_memory_error(self):
        """Arrays that take none of it themselves."""
        vast = np.broadcast_to(np.float32(1), (2**20, 2**20, 3))
        for call in (lambda: cq.Image.from_arrays({"": vast}), lambda: cq.compare(vast, vast),
                     lambda: cq.Scene(TORUS, environment=vast),
                     lambda: cq.pack([cq.Mesh(vertices=np.broadcast_to(1.0, (2**40, 3)), triangles=square()[1])])):
            with self.assertRaises(MemoryError):
                call()

    def test_what_is_approximated_is_a_warning(self):
        vertices, triangles = square()
        glass = cq.Material(transmission=1.0, roughness=0.0, name="pane")
        meshes = [cq.Mesh(vertices=vertices, triangles=triangles, material=glass)]
        with self.assertWarnsRegex(cq.SceneWarning, "pane|mesh"):
            scene = cq.Scene.from_meshes(meshes, cameras=[cq.Camera()])
        self.assertTrue(scene.warnings)
        with self.assertRaises(cq.Error):
            cq.Scene.from_meshes(meshes, cameras=[cq.Camera()], strict=True)

    def test_a_named_library_that_is_missing_says_so(self):
        found = cq.libraries()
        self.assertTrue(found["embree"]["found"], found)
        code = "import caustique; print(caustique.libraries(oidn='/no/such.so')['oidn'])"
        output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        self.assertIn("no such file", output)
        self.assertIn("setup.sh", output)


if __name__ == "__main__":
    unittest.main()
