"""Tests the program with stages: render, plan, info, frames, errors, and the USD layer that describes an EXR."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
import unittest
from pathlib import Path

import numpy
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdUtils, UsdValidation

import support
import usd_support
from faults import Fault

QUICK = ("--width", 8, "--height", 8, "--iterations", 2, "--method", "path", "--progress", "none", "--no-combine")


class Program(usd_support.Stages):
    def setUp(self):
        super().setUp()
        self.floor()
        self.camera((0, 2, 2), width=1.0)
        self.light("DomeLight", intensity=1.0)
        self.out = self.dir / "out.exr"

    def save(self, text=""):
        """Save the stage, with `text` appended."""
        root = self.stage.GetRootLayer()
        if text:
            root.ImportFromString(root.ExportToString() + text)
        root.Save()

    def run_on(self, command, *options, check=0, env=None):
        return support.run([command, self.path, *options], check=check, env=env)

    def test_the_same_bytes_as_its_glb(self):
        self.convert()
        self.run_on("render", "-o", self.out, *QUICK)
        ours = usd_support.read_exr(self.out)
        support.run(["render", self.dir / "out.glb", "-o", self.out, *QUICK], check=0)
        numpy.testing.assert_array_equal(ours, usd_support.read_exr(self.out))
        self.assertGreater(ours.mean(), 0.4)

    def endless(self):
        """Set the path to a stage of 2^30 prims, by nested references."""
        both = "".join(f'def "{side}" (\nreferences = </A{{1}}>\n) {{{{}}}}\n' for side in "lr")
        levels = "".join(f'def "A{at}" {{\n' + both.format(at, at + 1) + "}\n" for at in range(30))
        self.path = self.dir / "endless.usda"
        self.path.write_text("#usda 1.0\n" + levels + 'def Sphere "A30" {}\n')

    def converters(self):
        """The processes that convert the stage."""
        lines = []
        for entry in Path("/proc").glob("[0-9]*/cmdline"):
            with contextlib.suppress(OSError):
                lines.append(entry.read_bytes())
        return [line for line in lines if b"convert.py" in line and str(self.path).encode() in line]

    def until(self, what):
        end = time.monotonic() + 60
        while not what():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.02)

    def test_a_killed_program_leaves_nothing_of_its_converter(self):
        self.endless()
        for word in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
            with self.subTest(word.name):
                program = subprocess.Popen([support.binary(), "info", self.path], env={**os.environ, "TMPDIR": self.dir},
                                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                self.until(lambda: len(self.converters()) == 2)
                self.assertEqual(len(list(self.dir.glob("caustique-usd-*"))), 1)
                program.send_signal(word)
                self.assertNotEqual(program.wait(), 0)
                self.until(lambda: not self.converters())
                self.until(lambda: not list(self.dir.glob("caustique-usd-*")))

    def test_a_signal_ends_the_conversion_of_a_later_frame(self):
        self.save()
        self.stage.Export(str(self.dir / "shot.1.usda"))
        self.endless()
        self.path = self.path.rename(self.dir / "shot.2.usda")
        command = [support.binary(), "render", self.dir / "shot.#.usda", "-o", self.dir / "shot.#.exr", "--frames",
                   "1-2", *map(str, QUICK)]
        with subprocess.Popen(command, env={**os.environ, "TMPDIR": self.dir}, stderr=subprocess.PIPE,
                              text=True) as program:
            self.until(lambda: len(self.converters()) == 2 or program.poll() is not None)
            program.send_signal(signal.SIGINT)
            said = program.stderr.read()
        self.assertEqual(program.returncode, 130, said)
        self.assertIn(f"frame 2: {self.path}: interrupted while the scene was read\n", said)
        self.until(lambda: not self.converters())
        self.assertEqual(list(self.dir.glob("caustique-usd-*")), [])

    def test_a_conversion_has_limits(self):
        self.endless()
        done = self.run_on("info", check=1, env={"CAUSTIQUE_USD_SECONDS": 1, "TMPDIR": self.dir})
        self.assertIn(f"{self.path}: the conversion takes longer than 1 s\n"
                      "hint: use a simpler stage, or set CAUSTIQUE_USD_SECONDS to more\n", done.stderr)
        self.assertEqual((self.converters(), list(self.dir.glob("caustique-usd-*"))), ([], []))
        done = self.run_on("info", check=2, env={"CAUSTIQUE_USD_SECONDS": "soon"})
        self.assertIn("CAUSTIQUE_USD_SECONDS: soon is no number of seconds\nhint: ", done.stderr)
        command = [sys.executable, usd_support.SCRIPTS / "convert.py", self.path, "--arguments", "--guard", "600",
                   str(150 << 20)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
            fault = json.loads(program.stderr.read().splitlines()[-1])  # while standard input is open
        self.assertEqual(program.returncode, 1)
        self.assertRegex(fault["fault"], "memory|MiB are left|bad_alloc|allocat")

    def test_every_container_and_command(self):
        self.save()
        for suffix in (".usdc", ".usd"):
            self.stage.Export(str(self.dir / f"stage{suffix}"))
        self.assertTrue(UsdUtils.CreateNewUsdzPackage(str(self.path), str(self.dir / "stage.usdz")))
        for suffix in (".usda", ".usdc", ".usd", ".usdz"):
            done = support.run(["info", self.dir / f"stage{suffix}"], check=0)
            self.assertIn("environment 1", done.stdout)
        self.assertIn("emission", self.run_on("plan", *QUICK[:4], "--method", "path", "--no-combine").stdout)

    def test_a_checkpoint_is_of_all_layers(self):
        self.save()
        root = Sdf.Layer.CreateNew(str(self.dir / "root.usda"))
        root.subLayerPaths.append(f"./{self.path.name}")
        root.Save()
        state = self.dir / "state"

        def render(*options, check):
            words = ["render", self.dir / "root.usda", "-o", self.out, *QUICK, *options]
            return support.run(words, check=check)

        render("--checkpoint", state, check=0)
        render("--resume", state, "--no-checkpoint", check=0)
        UsdGeom.Xformable.Get(self.stage, "/Floor").AddTranslateOp().Set((0, -0.1, 0))
        self.save()
        self.assertIn("is of another scene", render("--resume", state, "--no-checkpoint", check=2).stderr)

    def test_frames(self):
        floor = UsdGeom.Xformable.Get(self.stage, "/Floor")
        floor.AddTranslateOp().Set((0, 0, 0), 1)
        UsdGeom.Imageable.Get(self.stage, "/Floor").GetVisibilityAttr().Set("inherited", 1)
        UsdGeom.Imageable.Get(self.stage, "/Floor").GetVisibilityAttr().Set("invisible", 2)
        self.save()
        self.run_on("render", "-o", self.dir / "out.##.exr", "--frames", "1-2", *QUICK)
        first, second = (usd_support.read_exr(self.dir / f"out.0{k}.exr") for k in (1, 2))
        self.assertLess(first.mean(), 0.9)
        numpy.testing.assert_allclose(second, 1, atol=1e-5)

    def test_the_shutter_of_the_camera_blurs_what_moves(self):
        floor = UsdGeom.Xformable.Get(self.stage, "/Floor").AddTranslateOp()
        floor.Set((0, 0, 0), 1)
        floor.Set((1e4, 0, 0), 2)
        camera = UsdGeom.Camera.Get(self.stage, "/Camera")
        camera.CreateShutterOpenAttr(-0.5)
        camera.CreateShutterCloseAttr(0.5)
        self.save()

        def mean(*more):
            said = self.run_on("render", "-o", self.out, *QUICK[:4], *QUICK[6:], "--iterations", 8, *more).stderr
            return usd_support.read_exr(self.out).mean(), said

        # The floor is there in the first half of the time; behind it, the dome has radiance 1.
        still, _ = mean("--frames", 1, "--shutter", 0)
        blurred, said = mean("--frames", 1)
        self.assertAlmostEqual((1 - blurred) / (1 - still), 0.5, delta=0.2)
        self.assertIn("motion blur is the mean of 8 moments", said)
        # A shutter of no length shows its moment, where the floor is gone.
        moment, _ = mean("--frames", 1, "--shutter", "0.5,0.5")
        self.assertAlmostEqual(moment, 1, delta=1e-4)
        _, said = mean()
        self.assertIn("/Camera: its shutter is ignored, because no frame is given (--frames gives one)", said)
        for shutter in ("-0.25,0.25", "0.25,0.25"):
            refused = self.run_on("render", "-o", self.out, *QUICK, "--shutter", shutter, check=2)
            self.assertIn("--shutter needs a frame", refused.stderr)
        settings = UsdRender.Settings.Define(self.stage, "/Settings")
        settings.CreateDisableMotionBlurAttr(True)
        self.save()
        disabled, _ = mean("--frames", 1)
        self.assertAlmostEqual(disabled, still, delta=1e-4)

    def test_the_command_line_overrides_options_of_the_stage(self):
        self.save("""
def RenderSettings "Settings" {
    uniform int2 resolution = (12, 6)
    rel products = </Product>
    custom int caustique:iterations = 1
    custom string caustique:method = "path"
    custom bool caustique:no_combine = 1
}
def RenderProduct "Product" {
    rel orderedVars = [</Var>]
}
def RenderVar "Var" {
    uniform string sourceName = "normal"
}
""")
        self.run_on("render", "-o", self.out, "--progress", "none")
        shown = support.run(["info", self.out], check=0).stdout
        self.assertIn("12 x 6 pixels, 1 layers", shown)
        normals = usd_support.OpenEXR.File(str(self.out), separate_channels=True).channels()
        self.assertAlmostEqual(float(normals["normal.Y"].pixels.max()), 1, places=4)
        self.run_on("render", "-o", self.out, "--progress", "none", "--layers", "beauty", "--width", 4, "--height", 4)
        self.assertIn("4 x 4 pixels", support.run(["info", self.out], check=0).stdout)

    def products(self, *products):
        """Save the stage with RenderSettings with these products, (prim's name, productName or None) each."""
        settings = UsdRender.Settings.Define(self.stage, "/Settings")
        for name, file in products:
            product = UsdRender.Product.Define(self.stage, f"/{name}")
            if file is not None:
                product.CreateProductNameAttr(str(file))
            settings.GetProductsRel().AddTarget(f"/{name}")
        self.save()

    def in_the_folder(self, *options, check=0):
        """Render in the test's folder, without -o."""
        return support.run(["render", self.path, *QUICK, *options], check=check, cwd=self.dir)

    def test_a_product_names_the_output_and_the_command_line_another(self):
        self.products(("Product", "renders/of the stage.exr"))
        (self.dir / "renders").mkdir()
        self.in_the_folder()
        named = self.dir / "renders" / "of the stage.exr"
        picture = usd_support.read_exr(named)
        named.unlink()
        self.in_the_folder("-o", self.out)
        self.assertFalse(named.exists())
        numpy.testing.assert_array_equal(picture, usd_support.read_exr(self.out))
        self.assertIn("emission", self.run_on("plan").stdout)

    def test_a_product_names_an_output_for_each_frame(self):
        self.products(("Product", self.dir / "shot.####.exr"))
        self.in_the_folder("--frames", "7-8")
        self.assertEqual(sorted(path.name for path in self.dir.glob("*.exr")), ["shot.0007.exr", "shot.0008.exr"])
        done = self.in_the_folder(check=2)
        self.assertIn("shot.####.exr: its name has a place for a frame's number", done.stderr)

    def test_a_product_that_cannot_be_written(self):
        for file, code, said in (
            ("no/such.exr", 1, "no/such.exr: its folder does not exist"),
            ("picture.png", 2, "picture.png: the name does not end in .exr"),
        ):
            with self.subTest(file):
                self.stage.RemovePrim("/Product")
                self.products(("Product", file))
                self.assertIn(said, self.in_the_folder(check=code).stderr)
        self.assertEqual(list(self.dir.glob("**/*.exr")), [])

    def test_no_file_of_a_stage_is_overwritten(self):
        sky = self.dir / "sky.exr"
        header = {"compression": usd_support.OpenEXR.ZIP_COMPRESSION, "type": usd_support.OpenEXR.scanlineimage}
        texels = numpy.ones((2, 4, 3), numpy.float32)
        usd_support.OpenEXR.File(header, {"RGB": texels}).write(str(sky))
        dome = UsdLux.DomeLight.Define(self.stage, "/Sky")
        dome.CreateTextureFileAttr(Sdf.AssetPath("./sky.exr"))
        layer = self.dir / "layer.usda"
        layer.write_text("#usda 1.0\n")
        self.stage.GetRootLayer().subLayerPaths.append("./layer.usda")
        self.products(("Product", "sky.exr"))
        before = sky.read_bytes()
        for options, said in (
            ((), "sky.exr: "), (("-o", "./sky.exr"), "./sky.exr: "),
            (("-o", "out.exr", "--usd-layer", "layer.usda"), "layer.usda: "),
        ):
            with self.subTest(options):
                done = self.in_the_folder(*options, check=2)
                self.assertTrue(done.stderr.startswith(said), done.stderr)
                self.assertIn(" is an input, which is not overwritten", done.stderr)
        self.assertEqual((sky.read_bytes(), layer.read_text()), (before, "#usda 1.0\n"))

    def test_a_product_outside_the_folder_of_the_stage(self):
        inner = self.dir / "inner"
        inner.mkdir()
        self.products(("Product", "../victim.exr"))
        self.path = self.path.rename(inner / "stage.usda")
        victim = self.dir / "victim.exr"
        victim.write_text("precious")
        for folder in (inner, inner / "..", "/"):
            done = support.run(["render", self.path, *QUICK], check=2, cwd=folder)
            self.assertIn("RenderProduct names the output ../victim.exr, which is outside its folder", done.stderr)
        self.assertEqual(victim.read_text(), "precious")
        support.run(["render", self.path, *QUICK, "--allow-outside"], check=0, cwd=inner)
        self.assertNotEqual(victim.read_bytes()[:4], b"prec")

    def test_without_a_product_the_picture_is_beside_the_stage(self):
        for file in ("", None):
            with self.subTest(file):
                self.stage.RemovePrim("/Product")
                self.products(("Product", file))
                self.in_the_folder()
                for kind in ("exr", "png"):
                    (self.dir / f"stage.{kind}").unlink()

    def test_several_products_need_a_name_for_the_one_that_is_rendered(self):
        self.products(("A", "a.exr"), ("B", "b.exr"))
        done = self.in_the_folder(check=2)
        self.assertIn("stage.usda: RenderSettings has several products, and a render writes one: a.exr, b.exr", done.stderr)
        self.assertEqual(list(self.dir.glob("*.exr")), [])
        done = self.in_the_folder("-o", self.out)
        self.assertIn("stage.usda: /B: only the first product is rendered", done.stderr)

    def test_a_product_whose_name_changes_with_time(self):
        self.products(("Product", None))
        name = UsdRender.Product.Get(self.stage, "/Product").CreateProductNameAttr()
        name.Set(str(self.dir / "one.exr"), 1)
        name.Set(str(self.dir / "two.exr"), 2)
        self.save()
        self.assertIn("/Product: its productName changes with time", self.in_the_folder().stderr)
        self.assertTrue((self.dir / "one.exr").exists())

    def test_an_option_that_does_not_exist(self):
        self.save('def RenderSettings "Settings" {\n custom int caustique:iterationz = 1\n}\n')
        done = self.run_on("render", "-o", self.out, check=1)
        self.assertIn("stage.usda: /Settings: caustique:iterationz is nothing that a stage may say", done.stderr)

    def test_a_value_that_an_option_does_not_take(self):
        self.save('def RenderSettings "Settings" {\n custom string caustique:method = "scanline"\n}\n')
        done = self.run_on("render", "-o", self.out, check=2)
        self.assertIn("stage.usda: RenderSettings", done.stderr)
        self.assertIn("scanline", done.stderr)

    def test_files_and_permissions_in_a_stage_are_refused(self):
        for name in ("png", "output", "checkpoint", "usd_layer", "allow_outside", "env", "model", "preview"):
            with self.subTest(name):
                self.stage.RemovePrim("/Settings")
                settings = UsdRender.Settings.Define(self.stage, "/Settings")
                settings.GetPrim().CreateAttribute(f"caustique:{name}", Sdf.ValueTypeNames.String).Set("/tmp/a")
                with self.assertRaisesRegex(Fault, f"/Settings: caustique:{name} is nothing"):
                    self.convert()

    def test_losses_are_warnings_and_strict_stops_at_them(self):
        self.stage.DefinePrim("/Hair", "BasisCurves")
        self.save()
        done = self.run_on("render", "-o", self.out, *QUICK)
        self.assertIn("stage.usda: /Hair: curves are not carried", done.stderr)
        done = self.run_on("render", "-o", self.out, "--strict", *QUICK, check=1)
        self.assertIn("--strict", done.stderr)

    def test_faults_are_errors_that_name_the_prim(self):
        UsdLux.DomeLight.Get(self.stage, "/Light").CreateTextureFileAttr("../sky.exr")
        self.save()
        for command in (("render", "-o", self.out, *QUICK), ("info",), ("plan",)):
            done = self.run_on(*command, check=1)
            self.assertIn("stage.usda: /Light: the file ", done.stderr)
            self.assertIn("is outside the scene's folder\nhint: put it beside the scene file", done.stderr)
            self.assertNotIn("Traceback", done.stderr)
        self.path.write_text("#usda 1.0\ndef Mesh {")
        done = self.run_on("info", check=1)
        self.assertIn("USD cannot read it", done.stderr)
        self.path.unlink()
        self.assertIn("No such file", self.run_on("info", check=1).stderr)

    def test_a_python_without_usd(self):
        self.save()
        done = self.run_on("info", check=1, env={"CAUSTIQUE_USD_PYTHON": self.dir / "none"})
        self.assertIn("no such file", done.stderr)
        bare = self.dir / "python"
        bare.write_text(f'#!/bin/sh\nexec {sys.executable} -I -S "$@"\n')
        bare.chmod(0o755)
        done = self.run_on("info", check=1, env={"CAUSTIQUE_USD_PYTHON": bare})
        self.assertIn("lacks a module", done.stderr)
        self.assertIn("pip install usd-core", done.stderr)
        done = support.run(["doctor"], env={"CAUSTIQUE_USD_PYTHON": bare})
        self.assertIn("not usable, needed to read .usd files", done.stdout)
        self.assertRegex(support.run(["doctor"]).stdout, r"USD +\d+\.\d+")


class Layer(usd_support.Stages):
    def test_usdchecker_passes_and_the_vars_are_the_layers(self):
        self.floor()
        self.camera((0, 2, 2), width=1.0)
        self.light("DomeLight", intensity=1.0)
        self.stage.GetRootLayer().Save()
        out, path = self.dir / 'a "quoted" name.exr', self.dir / "layer.usda"
        support.run(["render", self.path, "-o", out, "--usd-layer", path, *QUICK], check=0)
        stage = Usd.Stage.Open(str(path))
        self.assertEqual(_faults(stage), [])
        settings = UsdRender.Settings.GetStageRenderSettings(stage)
        product = UsdRender.Product.Get(stage, settings.GetProductsRel().GetTargets()[0])
        self.assertEqual(product.GetProductNameAttr().Get(), f"./{out.name}")
        self.assertEqual(product.GetResolutionAttr().Get(), Gf.Vec2i(8, 8))
        names = {UsdRender.Var.Get(stage, target).GetSourceNameAttr().Get()
                 for target in product.GetOrderedVarsRel().GetTargets()}
        channels = usd_support.OpenEXR.File(str(out), separate_channels=True).channels()
        # The picture and Z are at the root of the file.
        of_root = {"R": "beauty", "G": "beauty", "B": "beauty", "A": "beauty", "Z": "Z"}
        self.assertEqual(names, {name.rpartition(".")[0] or of_root[name] for name in channels})

    def test_the_checker_finds_faults(self):
        path = self.dir / "bare.usda"
        Sdf.Layer.CreateNew(str(path)).Save()
        self.assertNotEqual(_faults(Usd.Stage.Open(str(path))), [])

    def test_the_layer_needs_a_usda_name_and_an_exr(self):
        self.stage.GetRootLayer().Save()
        done = support.run(["render", self.path, "-o", self.dir / "o.exr", "--usd-layer", self.dir / "o.txt"], check=2)
        self.assertIn("does not end in .usda", done.stderr)
        done = support.run(["render", self.path, "-o", "-", "--usd-layer", self.dir / "o.usda"], check=2)
        self.assertIn("--usd-layer", done.stderr)


def _faults(stage):
    """The output of usdchecker, which runs all validators of USD, for a stage."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    return [error.GetErrorAsString() for error in UsdValidation.ValidationContext(validators).Validate(stage)]


if __name__ == "__main__":
    unittest.main()
