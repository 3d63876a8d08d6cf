"""Tests the conversion of meshes, transforms, instances and cameras in the converter's .glb."""

import math
import unittest

import numpy
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdSkel, Vt

import usd_support
from faults import Fault
from usd_support import corners

# Two adjacent squares with points 0 to 5.
POINTS = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
COUNTS, INDICES = [4, 4], [0, 1, 4, 3, 1, 2, 5, 4]


class Meshes(usd_support.Stages):
    def squares(self, **options):
        return self.mesh("/Squares", POINTS, COUNTS, INDICES, **options)

    def colours(self, interpolation, count):
        """Pairs of a position and a colour at each corner, for a displayColor with `count` values."""
        mesh = self.squares()
        shades = numpy.arange(1, count + 1) / 16
        primvar = mesh.CreateDisplayColorPrimvar(interpolation)
        primvar.Set(Vt.Vec3fArray([Gf.Vec3f(float(s), 0, 1) for s in shades]))
        found = corners(*self.convert()[:2])
        return found["POSITION"], found["COLOR_0"][:, 0] * 16, found["COLOR_0"]

    def test_every_interpolation(self):
        counts = {"constant": 1, "uniform": 2, "vertex": 6, "varying": 6, "faceVarying": 8}
        for interpolation, count in counts.items():
            with self.subTest(interpolation):
                place, value, colour = self.colours(interpolation, count)
                right = place.reshape(-1, 3, 3).mean(1)[:, 0] > 1
                of_corner = numpy.repeat(right, 3)
                point = place[:, 0] + 3 * place[:, 1]
                expected = {
                    "constant": numpy.ones(12), "uniform": 1 + of_corner, "vertex": 1 + point, "varying": 1 + point,
                    "faceVarying": 1 + numpy.array([INDICES[4 * r:4 * r + 4].index(p) + 4 * r
                                                    for r, p in zip(of_corner.astype(int), point)]),
                }[interpolation]
                numpy.testing.assert_allclose(value, expected, atol=1e-5)
                numpy.testing.assert_allclose(colour[:, 1:], [[0, 1, 1]] * 12)

    def test_a_primvar_with_indices_and_one_of_the_wrong_length(self):
        mesh = self.squares()
        primvar = mesh.CreateDisplayColorPrimvar("uniform")
        primvar.Set(Vt.Vec3fArray([Gf.Vec3f(0, 0, 1), Gf.Vec3f(1, 0, 0)]))
        primvar.SetIndices(Vt.IntArray([1, 0]))
        found = corners(*self.convert()[:2])
        left = found["POSITION"].reshape(-1, 3, 3).mean(1)[:, 0] < 1
        numpy.testing.assert_allclose(found["COLOR_0"][:, 0], numpy.repeat(left, 3))
        primvar.SetIndices(Vt.IntArray([1, 0, 1]))
        document, buffer, lost = self.convert()
        self.assertEqual(lost, ["/Squares: displayColor has 3 values, and uniform interpolation takes 2: it is left out"])
        numpy.testing.assert_allclose(corners(document, buffer)["COLOR_0"], [[0.18, 0.18, 0.18, 1]] * 12)
        mesh.GetDisplayColorAttr().Clear()
        mesh.CreateDisplayColorPrimvar("constant").Set(Vt.Vec3fArray([Gf.Vec3f(1, 0, 0), Gf.Vec3f(0, 1, 0)]))
        primvar.BlockIndices()
        document, buffer, lost = self.convert()
        self.assertEqual(lost, ["/Squares: displayColor has 2 values, and constant interpolation takes 1: the first is "
                                "taken"])
        numpy.testing.assert_allclose(corners(document, buffer)["COLOR_0"], [[1, 0, 0, 1]] * 12)

    def test_normals_of_the_wrong_length_are_named_and_left_out(self):
        self.squares().CreateNormalsAttr([(0, 0, 1)] * 5)
        document, buffer, lost = self.convert()
        self.assertNotIn("NORMAL", corners(document, buffer))
        self.assertEqual(lost, ["/Squares: normals has 5 values, and vertex interpolation takes 6: they are left out, and "
                                "its faces are flat"])

    def test_equal_points_become_one_vertex(self):
        self.squares()
        document, buffer, _ = self.convert()
        position = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
        self.assertEqual(document["accessors"][position]["count"], 6)
        self.assertEqual(document["accessors"][position]["max"], [2, 1, 0])
        self.assertNotIn("NORMAL", document["meshes"][0]["primitives"][0]["attributes"])
        self.assertTrue(buffer)

    def test_left_handed_faces_are_turned(self):
        for orientation, sign in ((UsdGeom.Tokens.rightHanded, 1), (UsdGeom.Tokens.leftHanded, -1)):
            self.squares().CreateOrientationAttr(orientation)
            at = corners(*self.convert()[:2])["POSITION"].reshape(-1, 3, 3)
            normals = numpy.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
            numpy.testing.assert_allclose(normals, [[0, 0, sign]] * 4)

    def test_holes_and_concave_polygons(self):
        mesh = self.squares()
        mesh.CreateHoleIndicesAttr([0])
        # An arrow head and a five-pointed star, which a fan from the first corner would not fill correctly.
        arrow = [(0, 0, 0), (2, -1, 0), (0.5, 0, 0), (2, 1, 0)]
        turns = [math.pi * k / 5 for k in range(10)]
        reach = (0.4, 1)
        star = [(reach[k % 2] * math.cos(t), 0, reach[k % 2] * math.sin(t)) for k, t in enumerate(turns)]
        self.mesh("/Arrow", arrow[1:] + arrow[:1], [4], range(4))
        self.mesh("/Star", star, [10], range(10))
        document, buffer, _ = self.convert()

        def area(mesh):
            at = corners(document, buffer, mesh)["POSITION"].reshape(-1, 3, 3)
            crosses = numpy.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
            self.assertTrue((crosses @ crosses.sum(0) > 0).all())
            return numpy.linalg.norm(crosses, axis=1).sum() / 2

        whole = [{m["name"]: i for i, m in enumerate(document["meshes"])}[n] for n in ("/Squares", "/Arrow", "/Star")]
        truth = (1, 0.5, 5 * 0.4 * math.sin(math.pi / 5))
        numpy.testing.assert_allclose([area(m) for m in whole], truth, rtol=1e-5)

    def test_subsets_have_their_materials(self):
        mesh = self.squares()
        left, right = self.material("/Left"), self.material("/Right")
        self.bind(mesh, left)
        subset = UsdGeom.Subset.CreateGeomSubset(mesh, "right", "face", Vt.IntArray([1]), "materialBind")
        self.bind(subset, right)
        document, buffer, lost = self.convert()
        worn = {}
        for at, primitive in enumerate(document["meshes"][0]["primitives"]):
            name = document["materials"][primitive["material"]]["name"]
            worn[name] = corners(document, buffer, 0, at)["POSITION"][:, 0].mean()
        self.assertEqual(worn, {"/Left": 0.5, "/Right": 1.5})
        self.assertEqual(lost, [])

    def test_a_control_mesh_is_named_and_smooth(self):
        self.squares(scheme="catmullClark")
        document, buffer, lost = self.convert()
        self.assertIn("/Squares: subdivision (catmullClark) is not carried", lost[0])
        numpy.testing.assert_allclose(corners(document, buffer)["NORMAL"] @ (0, 0, 1) > 0, True)

    def test_normals_of_the_primvar_come_first(self):
        mesh = self.squares()
        mesh.CreateNormalsAttr([Gf.Vec3f(1, 0, 0)] * 6)
        found = corners(*self.convert()[:2])["NORMAL"]
        numpy.testing.assert_allclose(found, [[1, 0, 0]] * 12)
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("normals", Sdf.ValueTypeNames.Normal3fArray, "uniform")
        primvar.Set(Vt.Vec3fArray([Gf.Vec3f(0, 1, 0)] * 2))
        found = corners(*self.convert()[:2])["NORMAL"]
        numpy.testing.assert_allclose(found, [[0, 1, 0]] * 12)

    def test_shapes_have_their_volume(self):
        truth = {"Sphere": 4 / 3 * math.pi, "Cube": 8, "Cylinder": 2 * math.pi, "Cone": 2 / 3 * math.pi,
                 "Capsule": math.pi / 4 + math.pi / 6}
        for kind in truth:
            for axis in ("X", "Y", "Z"):
                prim = self.stage.DefinePrim(f"/{kind}{axis}", kind)
                if kind not in ("Sphere", "Cube"):
                    prim.GetAttribute("axis").Set(axis)
        document, buffer, lost = self.convert()
        self.assertEqual(lost, [])
        for at, mesh in enumerate(document["meshes"]):
            found = corners(document, buffer, at)
            place = found["POSITION"].reshape(-1, 3, 3).astype(float)
            volume = numpy.linalg.det(place).sum() / 6
            self.assertAlmostEqual(volume / truth[mesh["name"][1:-1]], 1, delta=5e-3, msg=mesh["name"])
            faces = numpy.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
            turned = (found["NORMAL"].reshape(-1, 3, 3) * faces[:, None]).sum(2)
            self.assertTrue((turned > 0).all(), mesh["name"])
            if "Sphere" not in mesh["name"] and "Cube" not in mesh["name"]:
                widest = numpy.argmax(place.reshape(-1, 3).max(0) - place.reshape(-1, 3).min(0))
                if "Capsule" in mesh["name"]:
                    self.assertEqual("XYZ"[widest], mesh["name"][-1])


    def test_shapes_that_differ_only_in_size_share_a_mesh(self):
        for at, radius in enumerate((1.0, 2.5, 0.1)):
            ball = UsdGeom.Sphere.Define(self.stage, f"/Ball{at}")
            ball.CreateRadiusAttr(radius)
            UsdGeom.Cube.Define(self.stage, f"/Cube{at}").CreateSizeAttr(radius)
            UsdGeom.Cylinder.Define(self.stage, f"/Cylinder{at}").CreateRadiusAttr(radius)
        ball.CreateDisplayColorAttr([Gf.Vec3f(1, 0, 0)])
        document, buffer, _ = self.convert()
        nodes = {node["name"]: node for node in document["nodes"]}
        mesh_of = lambda name: nodes[name]["mesh"]
        self.assertEqual(mesh_of("/Ball0"), mesh_of("/Ball1"))
        self.assertNotEqual(mesh_of("/Ball0"), mesh_of("/Ball2"))
        self.assertEqual(len({mesh_of(f"/Cube{at}") for at in range(3)}), 1)
        self.assertEqual(len({mesh_of(f"/Cylinder{at}") for at in range(3)}), 3)
        for name, reach in (("/Ball0", 1), ("/Ball1", 2.5), ("/Ball2", 0.1), ("/Cube1", 1.25), ("/Cylinder1", 2.5)):
            place = corners(document, buffer, mesh_of(name))["POSITION"].reshape(-1, 3)
            self.assertAlmostEqual(abs(place[:, 0]).max() * nodes[name]["matrix"][0], reach, 5, name)


class Places(usd_support.Stages):
    def matrices(self, **options):
        """{name: world matrix} of the nodes with meshes, for column vectors."""
        document, _, _ = self.convert(**options)
        nodes = [n for n in document.get("nodes", ()) if "mesh" in n]
        return {n["name"]: numpy.array(n["matrix"]).reshape(4, 4) for n in nodes}, document

    def test_axes_and_units(self):
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self.stage, 0.01)
        self.mesh("/Squares", POINTS, COUNTS, INDICES)
        found, _ = self.matrices()
        for point, truth in (((100, 0, 0), (1, 0, 0)), ((0, 100, 0), (0, 0, -1)), ((0, 0, 100), (0, 1, 0))):
            numpy.testing.assert_allclose(numpy.array([*point, 1]) @ found["/Squares"], [*truth, 1], atol=1e-12)

    def test_visibility_purpose_and_a_reset_stack(self):
        top = UsdGeom.Xform.Define(self.stage, "/Top")
        top.AddTranslateOp().Set((1, 2, 3))
        for name in ("Shown", "Hidden", "Proxy", "Render", "Guide", "Reset"):
            mesh = self.mesh(f"/Top/{name}", POINTS, COUNTS, INDICES)
            if name in ("Proxy", "Render", "Guide"):
                mesh.CreatePurposeAttr(name.lower())
        UsdGeom.Imageable.Get(self.stage, "/Top/Hidden").MakeInvisible()
        UsdGeom.Xformable.Get(self.stage, "/Top/Reset").SetResetXformStack(True)
        found, _ = self.matrices()
        self.assertEqual(set(found), {"/Top/Shown", "/Top/Render", "/Top/Reset"})
        self.assertEqual([*found["/Top/Shown"][3]], [1, 2, 3, 1])
        self.assertEqual([*found["/Top/Reset"][3]], [0, 0, 0, 1])

    def test_instances_share_a_mesh(self):
        self.stage.CreateClassPrim("/Kind")
        self.mesh("/Kind/Squares", POINTS, COUNTS, INDICES)
        for at in range(3):
            copy = UsdGeom.Xform.Define(self.stage, f"/Copy{at}")
            copy.GetPrim().GetReferences().AddInternalReference("/Kind")
            copy.GetPrim().SetInstanceable(True)
            copy.AddTranslateOp().Set((at, 0, 0))
        found, document = self.matrices()
        self.assertEqual(sorted(found), [f"/Copy{at}/Squares" for at in range(3)])
        self.assertEqual(len(document["meshes"]), 1)
        self.assertEqual([found[f"/Copy{at}/Squares"][3, 0] for at in range(3)], [0, 1, 2])

    def test_instances_of_other_colours_do_not_share(self):
        self.stage.CreateClassPrim("/Kind")
        self.mesh("/Kind/Squares", POINTS, COUNTS, INDICES)
        for at in range(3):
            copy = self.stage.DefinePrim(f"/Copy{at}", "Xform")
            copy.GetReferences().AddInternalReference("/Kind")
            copy.SetInstanceable(True)
            colour = UsdGeom.PrimvarsAPI(copy).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray)
            colour.Set(Vt.Vec3fArray([Gf.Vec3f(float(at > 0), 0, 0)]))
        document, buffer, _ = self.convert()
        self.assertEqual(len(document["meshes"]), 2)
        for node in document["nodes"]:
            red = corners(document, buffer, node["mesh"])["COLOR_0"][0, 0]
            self.assertEqual(red, float(node["name"] != "/Copy0/Squares"))

    def test_a_point_instancer(self):
        instancer = UsdGeom.PointInstancer.Define(self.stage, "/Many")
        for name in ("A", "B"):
            self.mesh(f"/Many/{name}", POINTS, COUNTS, INDICES)
        UsdGeom.Xformable.Get(self.stage, "/Many/B").AddTranslateOp().Set((0, 5, 0))
        instancer.CreatePrototypesRel().SetTargets(["/Many/A", "/Many/B"])
        instancer.CreateProtoIndicesAttr([0, 1, 0, 1])
        instancer.CreatePositionsAttr([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)])
        instancer.CreateScalesAttr([(1, 1, 1), (2, 2, 2), (1, 1, 1), (1, 1, 1)])
        instancer.CreateInvisibleIdsAttr([2])
        instancer.AddTranslateOp().Set((0, 0, 7))
        document, _, lost = self.convert()
        nodes = [(n["mesh"], n["matrix"][12:15], n["matrix"][0]) for n in document["nodes"]]
        self.assertEqual(nodes, [(0, [0, 0, 7], 1), (1, [1, 10, 7], 2), (1, [3, 5, 7], 1)])
        self.assertEqual((len(document["meshes"]), lost), (2, []))
        instancer.GetProtoIndicesAttr().Set([0, 1, 0, 2])
        document, _, lost = self.convert()
        self.assertEqual(lost, ["/Many: protoIndices names a prototype beyond its 2: it is left out (export it again)"])
        self.assertNotIn("nodes", document)

    def test_references_payloads_and_variants_are_composed(self):
        other = Usd.Stage.CreateNew(str(self.dir / "part.usda"))
        mesh = UsdGeom.Mesh.Define(other, "/Part/Squares")
        mesh.CreatePointsAttr(POINTS)
        mesh.CreateFaceVertexCountsAttr(COUNTS)
        mesh.CreateFaceVertexIndicesAttr(INDICES)
        mesh.CreateSubdivisionSchemeAttr("none")
        other.SetDefaultPrim(other.GetPrimAtPath("/Part"))
        other.Save()
        prim = self.stage.DefinePrim("/Set", "Xform")
        variants = prim.GetVariantSets().AddVariantSet("kind")
        for name in ("empty", "full"):
            variants.AddVariant(name)
            variants.SetVariantSelection(name)
            if name == "full":
                with variants.GetVariantEditContext():
                    prim.GetPayloads().AddPayload("./part.usda")
        self.assertEqual(set(self.matrices()[0]), {"/Set/Squares"})
        variants.SetVariantSelection("empty")
        self.assertEqual(self.matrices()[0], {})

    def test_a_file_outside_the_folder_is_refused_unless_allowed(self):
        inner = self.dir / "inner"
        inner.mkdir()
        Usd.Stage.CreateNew(str(self.dir / "part.usda")).Save()
        stage = Usd.Stage.CreateNew(str(inner / "stage.usda"))
        stage.GetRootLayer().subLayerPaths.append("../part.usda")
        stage.Save()
        with self.assertRaisesRegex(Fault, "part.usda is outside the scene's folder"):
            self.convert(inner / "stage.usda")
        self.convert(inner / "stage.usda", allow_outside=True)

    def test_images_outside_the_folder_are_refused_whether_they_are_there_or_not(self):
        inner = self.dir / "inner"
        inner.mkdir()
        (self.dir / "sky.hdr").write_bytes(b"")
        (inner / "link.hdr").symlink_to(self.dir / "sky.hdr")
        stage = Usd.Stage.CreateNew(str(inner / "stage.usda"))
        light = UsdLux.DomeLight.Define(stage, "/Sky")
        for name in ("../sky.hdr", "../no.hdr", "/etc/hostname", "/nowhere/no.hdr", "link.hdr"):
            light.CreateTextureFileAttr(name)
            stage.Save()
            with self.subTest(name), self.assertRaisesRegex(Fault, "^/Sky: the file .* is outside the scene's folder"):
                self.convert(inner / "stage.usda")
        for name in ("http://example.org/sky.hdr", "file:///etc/hostname", "%2e%2e/sky.hdr", "C:/sky.hdr", "..\\sky.hdr"):
            light.CreateTextureFileAttr(name)
            stage.Save()
            with self.subTest(name):
                try:
                    said, = self.convert(inner / "stage.usda")[2]
                except Fault as fault:
                    said = str(fault)
                self.assertRegex(said, "^/Sky: the file .* is (not found|outside)")

    def test_time_samples(self):
        self.stage.SetStartTimeCode(1)
        self.stage.SetEndTimeCode(3)
        mesh = self.mesh("/Squares", POINTS, COUNTS, INDICES)
        move = mesh.AddTranslateOp()
        move.Set((1, 0, 0), 1)
        move.Set((3, 0, 0), 3)
        visibility = mesh.CreateVisibilityAttr()
        visibility.Set("inherited", 1)
        visibility.Set("invisible", 3)
        self.assertEqual(self.matrices()[0]["/Squares"][3, 0], 1)
        self.assertEqual(self.matrices(frame=2)[0]["/Squares"][3, 0], 2)
        found, document = self.matrices(frame=3)
        self.assertEqual(found, {})
        said = document["scenes"][0]["extras"]["caustique"]
        self.assertEqual((said["frame"], said["frame_rate"]), (3, [24, 1]))


class Skins(usd_support.Stages):
    def test_a_joint_moves_its_mesh(self):
        root = UsdSkel.Root.Define(self.stage, "/Root")
        skeleton = UsdSkel.Skeleton.Define(self.stage, "/Root/Skeleton")
        animation = UsdSkel.Animation.Define(self.stage, "/Root/Animation")
        still = Vt.Matrix4dArray([Gf.Matrix4d(1)] * 2)
        skeleton.CreateJointsAttr(["A", "B"])
        skeleton.CreateBindTransformsAttr(still)
        skeleton.CreateRestTransformsAttr(still)
        animation.CreateJointsAttr(["A", "B"])
        for frame, height in ((1, 0), (3, 4)):
            animation.CreateTranslationsAttr().Set(Vt.Vec3fArray([Gf.Vec3f(0), Gf.Vec3f(0, 0, height)]), frame)
        animation.CreateRotationsAttr([Gf.Quatf(1)] * 2)
        animation.CreateScalesAttr([Gf.Vec3h(1)] * 2)
        UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/Root/Animation"])
        mesh = self.mesh("/Root/Mesh", POINTS, COUNTS, INDICES)
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateSkeletonRel().SetTargets(["/Root/Skeleton"])
        binding.CreateJointIndicesPrimvar(False, 1).Set([0, 0, 0, 1, 1, 1])
        binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 6)
        self.assertTrue(root)
        for frame, height in ((1, 0), (2, 2), (3, 4)):
            at = corners(*self.convert(frame=frame)[:2])["POSITION"]
            numpy.testing.assert_allclose(at[:, 2], height * at[:, 1], atol=1e-6)


class Cameras(usd_support.Stages):
    def camera_of(self):
        document, _, lost = self.convert()
        return document["cameras"][0], document["nodes"][-1], lost

    def test_lens_focus_and_shift_in_centimetres(self):
        UsdGeom.SetStageMetersPerUnit(self.stage, 0.01)
        camera = self.camera((0, 0, 100))
        camera.GetHorizontalApertureAttr().Set(36.0)
        camera.GetVerticalApertureAttr().Set(24.0)
        camera.GetFocalLengthAttr().Set(50.0)
        camera.CreateFStopAttr(2.0)
        camera.CreateFocusDistanceAttr(250.0)
        camera.CreateHorizontalApertureOffsetAttr(3.6)
        camera.CreateVerticalApertureOffsetAttr(-2.4)
        found, node, lost = self.camera_of()
        said = found["extras"]["caustique"]
        self.assertAlmostEqual(found["perspective"]["yfov"], 2 * math.atan(12 / 50))
        self.assertAlmostEqual(found["perspective"]["aspectRatio"], 1.5)
        # 50 mm at f/2 has an aperture of 25 mm.
        self.assertAlmostEqual(said["aperture_radius"], 0.0125)
        self.assertAlmostEqual(said["focus_distance"], 2.5)
        numpy.testing.assert_allclose(said["shift"], [0.1, -0.1], rtol=1e-6)
        numpy.testing.assert_allclose(node["matrix"][12:15], [0, 0, 1])
        self.assertEqual(lost, [])

    def test_an_orthographic_camera_of_a_stage_in_metres(self):
        camera = self.camera((0, 0, 5))
        camera.CreateProjectionAttr("orthographic")
        found, _, _ = self.camera_of()
        self.assertAlmostEqual(found["orthographic"]["xmag"], 1.0)

    def test_render_settings(self):
        self.camera((0, 0, 5))
        second = UsdGeom.Camera.Define(self.stage, "/Second")
        root = self.stage.GetRootLayer()
        root.ImportFromString(root.ExportToString() + """
def RenderSettings "Settings" {
    rel camera = </Second>
    rel products = </Product>
    uniform int2 resolution = (200, 100)
    uniform float4 dataWindowNDC = (0.25, 0, 1, 0.5)
    custom string caustique:method = "bdpt"
    custom int caustique:max_depth = 7
    custom bool caustique:no_combine = 1
    custom bool caustique:film_transparent = 1
}
def RenderProduct "Product" {
    rel orderedVars = [</Ci>, </N>, </What>]
}
def RenderVar "Ci" {
    uniform string sourceName = "Ci"
}
def RenderVar "N" {
    uniform string sourceName = "normal"
}
def RenderVar "What" {
    uniform string sourceName = "primvars:fur"
}
""")
        document, _, lost = self.convert()
        said = document["scenes"][0]["extras"]["caustique"]
        self.assertEqual((said["resolution"], said["crop"]), ([200, 100], [0.25, 0.5, 0.75, 0.5]))
        self.assertTrue(said["film_transparent"])
        self.assertEqual([c["name"] for c in document["cameras"]], ["/Second", "/Camera"])
        # A picture with a wider aspect ratio than the aperture shows more at the sides.
        aperture = second.GetVerticalApertureAttr().Get() / second.GetFocalLengthAttr().Get()
        self.assertAlmostEqual(document["cameras"][0]["perspective"]["yfov"], 2 * math.atan(aperture / 2), places=6)
        self.assertEqual(lost, ['/What: there is no layer for the RenderVar\'s sourceName "primvars:fur"'])
        options = usd_support.convert.arguments(str(self.path))
        self.assertEqual(options, ["--layers=beauty,normal", "--max-depth=7", "--method=bdpt", "--no-combine"])

    def test_a_camera_that_does_not_exist_is_named(self):
        root = self.stage.GetRootLayer()
        root.ImportFromString(root.ExportToString() + 'def RenderSettings "S" {\nrel camera = </Nobody>\n}')
        self.assertEqual(self.convert()[2], ["/S: its camera /Nobody is not there: the first of the stage is taken"])


class Bad(usd_support.Stages):
    """Faults and losses name the prim."""

    def test_invalid_meshes_are_left_out(self):
        self.mesh("/World/Whole", POINTS, COUNTS, INDICES)
        cases = (
            (POINTS, [4, 4], INDICES[:-1], "faceVertexCounts adds up to 8, and faceVertexIndices has 7 numbers"),
            (POINTS, [4, 4], [*INDICES[:-1], 9], "faceVertexIndices names a point beyond its 6 points"),
            ([(math.nan, 0, 0), *POINTS[1:]], [4, 4], INDICES, "points has a coordinate that is not finite"),
        )
        for points, counts, indices, fault in cases:
            self.mesh("/World/Broken", points, counts, indices)
            document, _, lost = self.convert()
            self.assertEqual(lost, [f"/World/Broken: {fault}: it is left out (export the mesh again)"])
            self.assertEqual([node["name"] for node in document["nodes"]], ["/World/Whole"])

    def test_files_that_are_no_stage(self):
        for text in (b"", b"#usda 1.0\ndef Mesh {", b"PXR-USDC\0\0\0\0"):
            path = self.dir / "broken.usda"
            path.write_bytes(text)
            with self.assertRaisesRegex(Fault, "USD cannot read it"):
                self.convert(path)

    def test_a_reference_to_nothing_is_named(self):
        self.stage.DefinePrim("/World").GetReferences().AddReference("./missing.usda")
        _, _, lost = self.convert()
        self.assertEqual(len(lost), 1)
        self.assertIn("missing.usda", lost[0])

    def test_losses_are_named(self):
        for kind in ("BasisCurves", "Points", "NurbsPatch", "Volume"):
            self.stage.DefinePrim("/" + kind, kind)
        _, _, lost = self.convert()
        named = sorted(line.split(":")[0] for line in lost)
        self.assertEqual(named, ["/BasisCurves", "/NurbsPatch", "/Points", "/Volume"])


if __name__ == "__main__":
    unittest.main()
