"""Compares UsdLux lights with closed forms of irradiance, for all types and attributes."""

import math
import unittest

import numpy
import OpenEXR
from pxr import Gf, Sdf, UsdGeom, UsdLux

import usd_support
from usd_support import down

ALBEDO = 0.5
HEIGHT = 2.0
# Pixels per side of a picture, and the largest relative size of four standard errors.
SIZE, WORST = 8, 0.04


class Irradiance(usd_support.Stages):
    """Measures irradiance on a floor, from its radiance albedo / pi times irradiance."""

    def measured(self, *options):
        """Irradiance at the floor's centre (3 numbers), and its standard error."""
        self.floor(ALBEDO)
        self.camera((1.5, 0.6, 0))
        picture = self.render("--width", SIZE, "--height", SIZE, "--iterations", 256, "--method", "path",
                              "--no-combine", *options).reshape(-1, 3)
        scale = math.pi / ALBEDO
        return picture.mean(0) * scale, picture.std(0) * scale / math.sqrt(len(picture))

    def check(self, expected, *options):
        """Compare with the expected irradiance, one number or three."""
        expected = numpy.broadcast_to(expected, 3)
        mean, error = self.measured(*options)
        self.assertLess((4 * error / expected).max(), WORST, "too noisy to tell")
        # 0.2 % are allowed because the picture shows 2 cm of the floor and lamps are polygons.
        for got, noise, truth in zip(mean, error, expected):
            self.assertLess(abs(got - truth), 4 * noise + 2e-3 * truth, f"{mean} for {expected}, +- {error}")
        # The test detects a light that is 8 % brighter.
        self.assertTrue((abs(mean - 1.08 * expected) > 4 * error + 2e-3 * expected).all())

    def test_sphere(self):
        self.light("SphereLight", matrix=down(HEIGHT), radius=0.25, intensity=3.0)
        self.check(3 * math.pi * (0.25 / HEIGHT) ** 2)

    def test_light_linking(self):
        """A light shines on the prims of its collection lightLink, and on no others."""
        light = self.light("SphereLight", matrix=down(HEIGHT), radius=0.25, intensity=3.0)
        links = UsdLux.LightAPI(light.GetPrim()).GetLightLinkCollectionAPI()
        links.CreateIncludeRootAttr(False)
        links.CreateIncludesRel().SetTargets(["/Floor"])
        other = self.light("SphereLight", "/Other", matrix=down(HEIGHT), radius=0.25, intensity=1.0)
        UsdLux.LightAPI(other.GetPrim()).GetLightLinkCollectionAPI().CreateExcludesRel().SetTargets(["/Floor"])
        self.check(3 * math.pi * (0.25 / HEIGHT) ** 2)

    def test_shadow_linking(self):
        """Only the prims of its collection shadowLink block the light of a light."""
        light = self.light("SphereLight", matrix=down(HEIGHT), radius=0.25, intensity=3.0)
        UsdLux.LightAPI(light.GetPrim()).GetShadowLinkCollectionAPI().CreateExcludesRel().SetTargets(["/Screen"])
        self.light("SphereLight", "/Other", matrix=down(HEIGHT), radius=0.25, intensity=1.0)
        corners = [(-1, HEIGHT / 2, 1), (1, HEIGHT / 2, 1), (1, HEIGHT / 2, -1), (-1, HEIGHT / 2, -1)]
        self.mesh("/Screen", corners, [4], [0, 1, 2, 3]).CreateDisplayColorAttr([Gf.Vec3f(0)])
        self.check(3 * math.pi * (0.25 / HEIGHT) ** 2)

    def test_sphere_normalized_and_scaled(self):
        scale = Gf.Matrix4d().SetScale(2.0)
        self.light("SphereLight", matrix=scale * down(HEIGHT), radius=0.1, intensity=30.0, normalize=True, exposure=1.0)
        self.check(60 / (4 * math.pi * 0.2 ** 2) * math.pi * (0.2 / HEIGHT) ** 2)

    def test_sphere_as_a_point(self):
        light = self.light("SphereLight", matrix=down(HEIGHT), radius=0.1, intensity=8.0, normalize=True)
        light.CreateTreatAsPointAttr(True)
        self.check(8 / 4 / HEIGHT ** 2)

    def test_stretched_sphere_keeps_its_power_when_normalized(self):
        stretch = Gf.Matrix4d().SetScale((1, 2, 1))
        self.light("SphereLight", matrix=stretch * down(HEIGHT), radius=0.1, intensity=30.0, normalize=True)
        # After `down`, the long axis is parallel to the floor: an ellipse of 0.1 by 0.2.
        p = 1.6
        area = 4 * math.pi * (((0.1 * 0.2) ** p * 2 + (0.1 * 0.1) ** p) / 3) ** (1 / p)
        theta, phi = (numpy.arange(400) + 0.5) / 400 * math.pi, (numpy.arange(800) + 0.5) / 800 * 2 * math.pi
        theta, phi = numpy.meshgrid(theta, phi, indexing="ij")
        unit = numpy.stack([numpy.sin(theta) * numpy.cos(phi), numpy.sin(theta) * numpy.sin(phi), numpy.cos(theta)], 2)
        axes = numpy.array([0.1, 0.1, 0.2])  # in the floor's axes: x, y up, z
        element = numpy.linalg.norm(unit / axes, axis=2) * axes.prod() * numpy.sin(theta) * (math.pi / 400) ** 2
        normal = unit / axes / numpy.linalg.norm(unit / axes, axis=2, keepdims=True)
        self.check(30 / area * _seen(unit * axes + (0, HEIGHT, 0), normal, element))

    def profiled(self, values, **inputs):
        """A sphere light with a profile of these candela at 0, 30, 60 and 90 degrees."""
        path = self.dir / "lamp.ies"
        path.write_text("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 4 1 1 2 0 0 0\n1 1 30\n0 30 60 90\n0\n"
                        + " ".join(map(str, values)) + "\n")
        light = self.light("SphereLight", radius=0.02, intensity=50.0, **inputs)
        shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
        shaping.CreateShapingIesFileAttr(Sdf.AssetPath("lamp.ies"))
        return shaping

    def test_a_profile_multiplies_the_intensity(self):
        self.profiled([4, 4, 1, 0], matrix=down(HEIGHT))
        self.check(50 * math.pi * 0.02 ** 2 * 4 / HEIGHT ** 2)

    def test_a_scaled_profile(self):
        """Turned by 45 degrees, the floor sees 30 degrees of a profile that is stretched by a half."""
        turned = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), 45)) * down(HEIGHT)
        self.profiled([4, 2, 1, 0], matrix=turned).CreateShapingIesAngleScaleAttr(1.5)
        self.check(50 * math.pi * 0.02 ** 2 * 2 / HEIGHT ** 2)

    def test_a_profile_divided_by_its_power(self):
        self.profiled([3, 3, 3, 3], matrix=down(HEIGHT)).CreateShapingIesNormalizeAttr(True)
        self.check(50 * math.pi * 0.02 ** 2 / (2 * math.pi) / HEIGHT ** 2)

    def test_disk(self):
        self.light("DiskLight", matrix=down(HEIGHT), radius=0.5, intensity=2.0)
        self.check(2 * math.pi * 0.25 / (0.25 + HEIGHT ** 2))

    def test_disk_normalized(self):
        self.light("DiskLight", matrix=down(HEIGHT), radius=0.5, intensity=2.0, normalize=True)
        self.check(2 / (math.pi * 0.25) * math.pi * 0.25 / (0.25 + HEIGHT ** 2))

    def rectangle(self, x, y, h):
        """Irradiance below the centre of a rectangle of radiance 1 with half sizes x and y, facing down from height
        h."""
        part = lambda a, b: a / math.hypot(a, h) * math.atan(b / math.hypot(a, h))
        return 2 * (part(x, y) + part(y, x))

    def test_rect(self):
        self.light("RectLight", matrix=down(HEIGHT), width=1.0, height=0.4, intensity=2.0)
        self.check(2 * self.rectangle(0.5, 0.2, HEIGHT))

    def test_rect_normalized_by_its_area_in_the_world(self):
        scale = Gf.Matrix4d().SetScale((0.5, 2, 1))
        self.light("RectLight", matrix=scale * down(HEIGHT), width=1.0, height=0.4, intensity=2.0, normalize=True)
        self.check(2 / 0.4 * self.rectangle(0.25, 0.4, HEIGHT))

    def test_rect_shines_from_one_side(self):
        up = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90)) * Gf.Matrix4d().SetTranslate((0, HEIGHT, 0))
        self.light("RectLight", matrix=up, width=1.0, height=1.0, intensity=2.0)
        mean, _ = self.measured()
        self.assertEqual(mean.max(), 0)

    def test_rect_in_centimetres_with_z_up(self):
        UsdGeom.SetStageMetersPerUnit(self.stage, 0.01)
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.z)
        above = Gf.Matrix4d().SetTranslate((0, 0, 100 * HEIGHT))
        self.light("RectLight", matrix=above, width=100.0, height=40.0, intensity=20000.0, normalize=True)
        mesh = self.mesh("/Floor", [(-100, -100, 0), (100, -100, 0), (100, 100, 0), (-100, 100, 0)], [4], [0, 1, 2, 3])
        mesh.CreateDisplayColorAttr([Gf.Vec3f(ALBEDO)])
        self.floor = lambda *_: mesh
        self.camera = lambda *_: usd_support.Stages.camera(self, (150, 0, 60), width=2.0, up=(0, 0, 1))
        self.check(20000 / 4000 * self.rectangle(0.5, 0.2, HEIGHT))

    def test_cylinder(self):
        side = Gf.Matrix4d().SetTranslate((0, HEIGHT, 0))
        self.light("CylinderLight", matrix=side, radius=0.2, length=1.0, intensity=2.0)
        x, t = numpy.meshgrid((numpy.arange(400) + 0.5) / 400 - 0.5, (numpy.arange(800) + 0.5) / 800 * 2 * math.pi)
        normal = numpy.stack([numpy.zeros_like(t), numpy.cos(t), numpy.sin(t)], 2)
        place = normal * 0.2 + numpy.stack([x, numpy.full_like(x, HEIGHT), numpy.zeros_like(x)], 2)
        self.check(2 * _seen(place, normal, 0.2 * 2 * math.pi / 800 / 400))

    def test_distant(self):
        self.light("DistantLight", matrix=down(), angle=10.0, intensity=40.0)
        self.check(40 * math.pi * math.sin(math.radians(5)) ** 2)

    def test_distant_normalized_and_without_an_angle(self):
        for angle, normalize in ((10.0, True), (0.0, False)):
            self.light("DistantLight", matrix=down(), angle=angle, intensity=3.0, normalize=normalize)
            self.check(3)

    def test_colour_temperature(self):
        self.light("DistantLight", matrix=down(), angle=0.0, intensity=3.0, enableColorTemperature=True,
                   colorTemperature=3000.0, color=Gf.Vec3f(1, 0.5, 0.25))
        red, green, blue = UsdLux.BlackbodyTemperatureAsRgb(3000.0)
        self.assertGreater(red, blue)
        self.check([3 * red, 1.5 * green, 0.75 * blue])

    def test_dome_of_one_colour(self):
        self.light("DomeLight", intensity=2.0, color=Gf.Vec3f(1, 0.5, 0.25))
        self.check(2 * math.pi * numpy.array([1, 0.5, 0.25]))

    def test_mesh_light(self):
        quad = self.mesh("/Lamp", [(-0.5, HEIGHT, -0.2), (0.5, HEIGHT, -0.2), (0.5, HEIGHT, 0.2), (-0.5, HEIGHT, 0.2)],
                         [4], [0, 1, 2, 3])
        light = UsdLux.MeshLightAPI.Apply(quad.GetPrim())
        UsdLux.LightAPI(quad).CreateIntensityAttr(2.0)
        UsdLux.LightAPI(quad).CreateNormalizeAttr(True)
        self.assertTrue(light)
        self.check(2 / 0.4 * self.rectangle(0.5, 0.2, HEIGHT))

    def test_a_profile_and_a_cone_of_a_mesh_light_are_losses(self):
        quad = self.mesh("/Lamp", [(0, 2, 0), (1, 2, 0), (1, 2, 1)], [3], [0, 1, 2])
        UsdLux.MeshLightAPI.Apply(quad.GetPrim())
        shaping = UsdLux.ShapingAPI.Apply(quad.GetPrim())
        shaping.CreateShapingIesFileAttr(Sdf.AssetPath("lamp.ies"))
        shaping.CreateShapingConeAngleAttr(30.0)
        self.assertEqual(self.convert()[2], [
            "/Lamp: its IES profile lamp.ies is not carried: it shines alike in all directions",
            "/Lamp: the cone of a mesh light is not carried: it shines in all directions"])

    def test_hard_cone(self):
        for at, inside in ((0.2, True), (1.9, False)):
            matrix = down() * Gf.Matrix4d().SetTranslate((at, HEIGHT, 0))
            light = self.light("SphereLight", matrix=matrix, radius=0.0, intensity=8.0, normalize=True)
            shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
            shaping.CreateShapingConeAngleAttr(30.0)
            square = at * at + HEIGHT ** 2
            if inside:
                self.check(8 / 4 / square * HEIGHT / math.sqrt(square))
            else:
                self.assertEqual(self.measured()[0].max(), 0)


class Environment(usd_support.Stages):
    def check(self, expected, kind=None, **inputs):
        """Compare the environment of a stage with a floor and at most one light."""
        self.stage.RemovePrim("/Light")
        if kind:
            self.light(kind, **inputs)
        document, _, _ = self.convert()
        self.assertEqual(document["scenes"][0]["extras"]["caustique"].get("environment"), expected)

    def test_a_stage_says_that_it_is_dark_only_if_it_has_a_light(self):
        """Without one, the program adds its studio, as to glTF files."""
        black = {"color": [0.0] * 3}
        self.floor()
        self.check(None)
        self.check(black, "SphereLight", intensity=2.0)
        self.check(black, "SphereLight", intensity=0.0)
        self.check(black, "DomeLight", intensity=0.0)
        self.check({"color": [2.0] * 3}, "DomeLight", intensity=2.0)
        UsdGeom.Imageable(self.light("SphereLight")).MakeInvisible()
        self.assertEqual(self.convert()[0]["scenes"][0]["extras"]["caustique"]["environment"], black)
        self.stage.RemovePrim("/Light")
        UsdLux.MeshLightAPI.Apply(self.stage.GetPrimAtPath("/Floor"))
        self.check(black)


def _seen(place, normal, element):
    """Irradiance at the origin, facing +y, from a convex body of radiance 1, given as points, normals and areas."""
    distance = numpy.linalg.norm(place, axis=2)
    towards = -(normal * place).sum(2) / distance
    return (numpy.clip(towards, 0, None) * place[:, :, 1] / distance / distance ** 2 * element).sum()


class Dome(usd_support.Stages):
    """Orientation of dome images: in OpenEXR their centre is at +Z, and +X is a quarter to the left."""

    def seen(self, kind="DomeLight", matrix=None, file="sky.exr", pixels=None, **inputs):
        """Radiance along +X, +Y, +Z, -X, -Y and -Z of the stage."""
        self.stage.RemovePrim("/Light")
        pixels = self.panels() if pixels is None else pixels
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": pixels}).write(str(self.dir / "sky.exr"))
        light = self.light(kind, matrix=matrix, **inputs)
        light.CreateTextureFileAttr(Sdf.AssetPath(file))
        z_up = UsdGeom.GetStageUpAxis(self.stage) == "Z"
        found = []
        for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 0, -1)):
            up = (0, 0, 1) if z_up else (0, 1, 0)
            up = (1, 0, 0) if any(a * b for a, b in zip(up, axis)) else up
            self.camera((0, 0, 0), axis, width=0.1, up=up)
            picture = self.render("--width", 2, "--height", 2, "--iterations", 1, "--method", "path", "--no-combine")
            found.append([round(float(c), 3) for c in picture.mean((0, 1))])
        return found

    @staticmethod
    def panels():
        """An image with a different colour around each axis: [+X, +Y, +Z, -X, -Y, -Z]."""
        pixels = numpy.zeros((32, 64, 3), numpy.float32)
        for at, colour in zip((48, 16, 32, 0), (Dome.NEG_X, Dome.X, Dome.Z, Dome.NEG_Z)):
            for k in range(-8, 8):
                pixels[:, (at + k) % 64] = colour
        pixels[:6], pixels[-6:] = Dome.Y, Dome.NEG_Y
        return pixels

    X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    NEG_X, NEG_Y, NEG_Z = (0.25, 0, 0), (0, 0.25, 0), (0, 0, 0.25)

    def expect(self, found, *colours):
        numpy.testing.assert_allclose(found, colours, atol=2e-3)

    def test_as_it_is(self):
        self.expect(self.seen(), self.X, self.Y, self.Z, self.NEG_X, self.NEG_Y, self.NEG_Z)

    def test_turned_about_the_vertical(self):
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), 90))
        # +Z turns to +X, +X to -Z.
        self.expect(self.seen(matrix=turn), self.Z, self.Y, self.NEG_X, self.NEG_Z, self.NEG_Y, self.X)

    def test_tilted_and_tinted(self):
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90))
        # +Y turns to +Z, +Z to -Y.
        found = self.seen(matrix=turn, color=Gf.Vec3f(1, 2, 4))
        tint = lambda c: tuple(a * b for a, b in zip(c, (1, 2, 4)))
        self.expect(found, *map(tint, (self.X, self.NEG_Z, self.Y, self.NEG_X, self.Z, self.NEG_Y)))

    def test_pole_along_the_stage_up_axis(self):
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.z)
        found = self.seen("DomeLight_1")
        self.assertEqual((found[2], found[5]), (list(self.Y), list(self.NEG_Y)))
        self.expect([found[0], found[3]], self.X, self.NEG_X)


if __name__ == "__main__":
    unittest.main()
