"""Tests the flicker of animations: motion vectors, counterparts in the next frame, the metric, and the shots."""

import importlib
import unittest
import unittest.mock

import numpy as np

import support

import gltf
from lab import picture_errors, shots, temporal

SHAPE = (90, 160)
FIELD = 0.6
GUIDES = ["--iterations", 8, "--width", 96, "--method", "path", "--no-finish", "--progress", "none"]
GUIDES += ["--layers", "P,Z,normal,CryptoObject00"]


def camera(position=(0.0, 0.0, 0.0), turn=0.0):
    """A camera that looks along -Z, turned about Y by degrees."""
    to_world = gltf.matrix({"translation": position, "rotation": shots.turn_about_y(turn)[0].tolist()})
    return to_world, FIELD


class Scene:
    """An animation of a camera, and of a node named "card"."""

    document = {"nodes": [{"name": "card"}]}

    def __init__(self, cameras, cards=None):
        self.cameras, self.cards = cameras, cards or [np.eye(4)] * len(cameras)

    def camera(self, frame):
        return self.cameras[frame]

    def worlds(self, frame):
        return {0: self.cards[frame]}


def plane(seen_by, point=(0.0, 0.0, -5.0), normal=(0.3, 0.2, 1.0)):
    """The guides of a plane that fills the picture."""
    normal = np.asarray(normal) / np.linalg.norm(normal)
    rays = temporal.rays(seen_by, SHAPE)
    depths = (np.asarray(point) - seen_by[0][:3, 3]) @ normal / (rays @ normal)
    positions = seen_by[0][:3, 3] + depths[..., None] * rays
    normals = np.broadcast_to(normal, positions.shape)
    return temporal.Guides(positions, depths, normals, np.zeros(SHAPE, int), ["card"])


def homography(points, first, second, point=(0.0, 0.0, -5.0), normal=(0.3, 0.2, 1.0)):
    """The pixel coordinates in the second camera of points in the first camera's picture, which lie on a plane: the
    projective map K2 R2' (R1 + (t1 - t2) n' R1 / d) K1^-1."""
    focal = SHAPE[0] / 2 / np.tan(FIELD / 2)
    matrix = np.array([[focal, 0, -SHAPE[1] / 2], [0, -focal, -SHAPE[0] / 2], [0, 0, -1.0]])
    (one, _), (two, _) = first, second
    distance = (np.asarray(point) - one[:3, 3]) @ normal
    move = one[:3, :3] + np.outer(one[:3, 3] - two[:3, 3], np.asarray(normal) @ one[:3, :3]) / distance
    mapped = np.concatenate([points, np.ones((*points.shape[:-1], 1))], -1)
    mapped = mapped @ (matrix @ two[:3, :3].T @ move @ np.linalg.inv(matrix)).T
    return mapped[..., :2] / mapped[..., 2:]


class Vectors(support.Scratch):
    def test_a_plane_moves_by_its_homography_when_the_camera_moves(self):
        first, second = camera(), camera((0.35, -0.2, -0.5), 2.5)
        found = temporal.vectors(Scene([first, second]), plane(first), 0, 1)
        rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5
        centres = np.stack([columns, rows], -1)
        expected = homography(centres, first, second) - centres
        self.assertGreater(np.abs(expected).max(), 10)
        self.assertLess(np.abs(found.vectors - expected).max(), 0.05)

    def test_an_object_moves_with_its_node(self):
        seen_by = camera()
        moved = np.eye(4)
        moved[:3, 3] = (0.1, 0.05, 0)
        found = temporal.vectors(Scene([seen_by] * 2, [np.eye(4), moved]), plane(seen_by, normal=(0, 0, 1)), 0, 1)
        scale = SHAPE[0] / 2 / np.tan(FIELD / 2) / 5
        np.testing.assert_allclose(found.vectors, np.broadcast_to([0.1 * scale, -0.05 * scale], (*SHAPE, 2)))

    def test_the_background_moves_by_the_turn_of_the_camera_alone(self):
        first, second = camera(), camera((3.0, 0.0, 0.0), 1.0)
        guides = plane(first)
        guides.depths[:] = 1e10
        found = temporal.vectors(Scene([first, second]), guides, 0, 1)
        focal = SHAPE[0] / 2 / np.tan(FIELD / 2)
        middle = found.vectors[SHAPE[0] // 2, SHAPE[1] // 2]
        self.assertAlmostEqual(middle[0], focal * np.tan(np.radians(1)), delta=0.05)

    def test_the_program_renders_positions_that_project_to_their_pixels(self):
        """Each position is at a random place of its pixel."""
        file = self.dir / "guides.exr"
        support.run(["render", support.scene("pool"), "-o", file, *GUIDES], check=0)
        guides = temporal.Guides.read(file)
        animation = shots.Animation(support.scene("pool"))
        pixels, depths = temporal.project(guides.positions, animation.camera(0), guides.depths.shape)
        rows, columns = np.mgrid[: guides.depths.shape[0], : guides.depths.shape[1]] + 0.5
        off = pixels - np.stack([columns, rows], -1)
        self.assertGreater((np.abs(off) < 0.5001).all(-1).mean(), 0.99)
        # Six standard errors of the mean of 5184 offsets.
        self.assertLess(np.abs(off.mean((0, 1))).max(), 0.025)
        self.assertLess(np.median(np.abs(depths / guides.depths - 1)), 1e-3)
        self.assertIn("water", guides.names)
        self.assertGreater((guides.objects == guides.names.index("water")).mean(), 0.3)


class Counterparts(unittest.TestCase):
    def setUp(self):
        self.first, self.second = camera(), camera((0.3, 0.0, 0.0))
        self.scene = Scene([self.first, self.second])

    def test_pixels_outside_the_picture_do_not_count(self):
        moved = temporal.vectors(self.scene, plane(self.first, normal=(0, 0, 1)), 0, 1)
        _, _, seen = temporal.counterparts(moved, plane(self.second, normal=(0, 0, 1)))
        step = round(-moved.vectors[0, 0, 0])
        self.assertGreater(step, 5)
        self.assertFalse(seen[:, :step].any())
        self.assertTrue(seen[:, step:].all())

    def test_hidden_surfaces_and_other_normals_do_not_count(self):
        moved = temporal.vectors(self.scene, plane(self.first, normal=(0, 0, 1)), 0, 1)
        there = plane(self.second, normal=(0, 0, 1))
        there.depths[30:60, 50:90] = 3.0
        there.normals = there.normals.copy()
        there.normals[70:80] = (1.0, 0.0, 0.0)
        rows, columns, seen = temporal.counterparts(moved, there)
        inside = (rows > 30) & (rows < 59) & (columns > 50) & (columns < 89)
        self.assertFalse(seen[inside].any())
        self.assertFalse(seen[(rows >= 70) & (rows < 80)].any())
        self.assertGreater(seen.mean(), 0.6)

    def test_vectors_that_are_not_finite_have_no_counterpart(self):
        moved = temporal.vectors(self.scene, plane(self.first), 0, 1)
        moved.vectors[5, 80] = np.nan
        self.assertFalse(temporal.counterparts(moved, plane(self.second))[2][5, 80])


class Flicker(unittest.TestCase):
    """A card moves by whole pixels before a camera that stands still."""

    FRAMES, STEP = 5, (3, -2)

    def setUp(self):
        self.random = np.random.default_rng(8)
        seen_by = camera()
        scale = SHAPE[0] / 2 / np.tan(FIELD / 2) / 5
        cards = [np.eye(4) for _ in range(self.FRAMES)]
        for frame, card in enumerate(cards):
            card[:3, 3] = (self.STEP[0] * frame / scale, -self.STEP[1] * frame / scale, 0)
        guides = plane(seen_by, normal=(0, 0, 1))
        scene = Scene([seen_by] * self.FRAMES, cards)
        self.moved = [temporal.vectors(scene, guides, frame, frame + 1) for frame in range(self.FRAMES - 1)]
        self.guides = guides
        self.truth = np.broadcast_to(np.array([1.0, 2.0, 3.0]), (*SHAPE, 3))
        self.references = [picture_errors.Reference(self.truth, self.truth)] * self.FRAMES
        self.weight = 1 / 4.01

    def matches(self, sign=1):
        """The counterparts; a sign of -1 is a planted fault of the vectors."""
        for moved in self.moved:
            moved.vectors *= sign
        return [temporal.counterparts(moved, self.guides) for moved in self.moved]

    def pattern(self):
        """Pictures whose error is a fixed pattern on the card."""
        pattern = self.random.standard_normal((*SHAPE, 3))
        step = [(self.STEP[1] * frame, self.STEP[0] * frame) for frame in range(self.FRAMES)]
        return [self.truth + np.roll(pattern, rows_columns, (0, 1)) for rows_columns in step]

    def test_an_error_that_moves_with_the_surface_does_not_flicker(self):
        found = temporal.flicker(self.pattern(), self.references, self.matches())
        self.assertLess(found["flicker"], 1e-12)
        self.assertGreater(found["compared"], 0.9)

    def test_vectors_of_the_wrong_sign_are_noticed(self):
        found = temporal.flicker(self.pattern(), self.references, self.matches(-1))
        self.assertAlmostEqual(found["flicker"] / np.sqrt(2 * self.weight), 1, delta=0.03)

    def test_independent_noise_flickers_with_twice_its_variance(self):
        sigma = 0.3
        pictures = [self.truth + sigma * self.random.standard_normal(self.truth.shape) for _ in range(self.FRAMES)]
        found = temporal.flicker(pictures, self.references, self.matches())
        # About 160,000 differences, each error in two of them: five standard errors of the root are 1.1 %.
        self.assertAlmostEqual(found["flicker"] / np.sqrt(2 * sigma**2 * self.weight), 1, delta=0.011)
        self.assertLess(found["flicker_trimmed"], found["flicker"])

    def test_noise_of_the_references_drops_out(self):
        def half():
            return self.truth + 0.5 * self.random.standard_normal(self.truth.shape)

        references = [picture_errors.Reference(half(), half()) for _ in range(self.FRAMES)]
        for reference in references:
            reference.weight = np.full(SHAPE, self.weight)
        pictures = [self.truth + 0.3 * self.random.standard_normal(self.truth.shape) for _ in range(self.FRAMES)]
        found = temporal.flicker(pictures, references, self.matches())
        # Products of the halves' noise have 2.8 times the variance of the signal's square.
        self.assertAlmostEqual(found["flicker"] / np.sqrt(2 * 0.09 * self.weight), 1, delta=0.04)

    def test_ghosts_raise_flicker(self):
        """A bright spot moves over the card. Half of the previous frame's picture, reprojected, adds a ghost."""
        rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
        truth = []
        for frame in range(self.FRAMES):
            spot = np.exp(-(np.square(rows - 45) + np.square(columns - 60 - 9 * frame)) / 8.0)
            truth.append(self.truth + 5 * spot[..., None])
        references = [picture_errors.Reference(one, one) for one in truth]
        matches = self.matches()
        noise = [0.01 * self.random.standard_normal(self.truth.shape) for _ in truth]
        clean = [one + error for one, error in zip(truth, noise, strict=True)]
        ghost = [clean[0]]
        for frame, (to_rows, to_columns, seen) in enumerate(matches):
            past = clean[frame + 1].copy()
            past[to_rows[seen], to_columns[seen]] = clean[frame][seen]
            ghost.append((clean[frame + 1] + past) / 2)
        calm = temporal.flicker(clean, references, matches)
        haunted = temporal.flicker(ghost, references, matches)
        self.assertGreater(haunted["flicker"], 5 * calm["flicker"])

    def test_the_worst_are_left_out_and_holes_do_not_count(self):
        pictures = [self.truth + 0.0 for _ in range(self.FRAMES)]
        pictures[2][40, 70] = 1e3
        pictures[3][50, 70] = np.nan
        found = temporal.flicker(pictures, self.references, self.matches())
        self.assertGreater(found["flicker"], 1)
        self.assertEqual(found["flicker_trimmed"], 0)


class Shots(support.Scratch):
    def test_waves_travel_with_exact_heights_and_normals(self):
        """A frame in between equals the closed form of the waves at its time; so does the still of a frame."""
        path = shots.pool().write(self.dir / "shots" / "pool.glb")
        still = shots.write_still(path, 7, self.dir / "stills" / "pool-frame7.glb")
        shot = shots.Shot(still)
        self.assertNotIn("weights", shot.document["nodes"][shot.node("water")])
        mesh = shot.document["meshes"][shot.document["nodes"][shot.node("water")]["mesh"]]
        attributes = mesh["primitives"][0]["attributes"]
        positions, normals = shot.values(attributes["POSITION"]), shot.values(attributes["NORMAL"])
        top = (positions[:, 1] > -0.4) & (normals[:, 1] > 0.5)
        self.assertGreater(top.sum(), 40_000)
        x, y, z = positions[top].T
        height, slope = np.zeros_like(x), np.zeros((len(x), 2))
        for index, (length, heading) in enumerate(zip(shots.WAVELENGTHS, shots.HEADINGS, strict=True)):
            number = 2 * np.pi / length
            wave = number * np.array([np.cos(heading), -np.sin(heading)])
            phase = x * wave[0] + z * wave[1] + index - np.sqrt(9.81 * number) * 7 / 24
            height += shots.SLOPE / number * np.sin(phase)
            slope += (shots.SLOPE / number * np.cos(phase))[:, None] * wave
        np.testing.assert_allclose(y, shots.WATER_LEVEL + height, atol=1e-6)
        expected = np.stack([-slope[:, 0], np.ones_like(x), -slope[:, 1]], -1)
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        np.testing.assert_allclose(normals[top], expected, atol=1e-5)

    def test_transforms_between_keys_are_interpolated(self):
        path = shots.turntable().write(self.dir / "shots" / "turntable.glb")
        animation = shots.Animation(path)
        bottle = next(index for index, node in enumerate(animation.document["nodes"]) if node["name"] == "bottle")
        turn = animation.worlds(12.5)[bottle] @ np.linalg.inv(animation.worlds(0)[bottle])
        expected = gltf.matrix({"rotation": shots.turn_about_y(shots.TABLE_TURN * 12.5 / shots.FRAMES)[0].tolist()})
        np.testing.assert_allclose(turn, expected, atol=1e-6)

    def test_equal_shots_have_equal_bytes(self):
        for name, make in shots.SHOTS.items():
            with self.subTest(name):
                first = make().write(self.dir / "one" / f"{name}.glb").read_bytes()
                self.assertEqual(first, make().write(self.dir / "two" / f"{name}.glb").read_bytes())

    def test_the_program_moves_the_objects_as_the_vectors_say(self):
        """Rendered positions, moved to the next frame by the transforms, lie on the surfaces that it shows."""
        for name, least in (("turntable", 0.93), ("interior", 0.9)):
            with self.subTest(name):
                path = shots.SHOTS[name]().write(self.dir / "shots" / f"{name}.glb")
                guides = []
                for frame in (4, 6):
                    file = self.dir / f"{frame}.exr"
                    support.run(
                        ["render", path, "-o", file, "--frames", frame, "--frame-seed", "same", *GUIDES], check=0
                    )
                    guides.append(temporal.Guides.read(file))
                moved = temporal.vectors(shots.Animation(path), guides[0], 4, 6)
                self.assertGreater(np.abs(moved.vectors).max(), 1)
                rows, columns, seen = temporal.counterparts(moved, guides[1])
                off = np.linalg.norm(guides[1].positions[rows, columns] - self.move(path, guides[0]), axis=-1)
                # Nearest pixels are up to 0.7 pixels away.
                pixel = 2 * np.tan(shots.Animation(path).camera(6)[1] / 2) / len(rows) * guides[1].depths[rows, columns]
                self.assertGreater(seen.mean(), least)
                self.assertLess(np.median((off / pixel)[seen]), 1)

    @staticmethod
    def move(path, guides):
        """Positions at frame 6 of the surface points that frame 4 shows."""
        animation, moved = shots.Animation(path), guides.positions.copy()
        for index, node in enumerate(animation.document["nodes"]):
            if node.get("name") in guides.names:
                shown = guides.objects == guides.names.index(node["name"])
                step = animation.worlds(6)[index] @ np.linalg.inv(animation.worlds(4)[index])
                moved[shown] = moved[shown] @ step[:3, :3].T + step[:3, 3]
        return moved


class Strip(support.Scratch):
    def test_the_strip_has_a_row_for_each_series_and_eight_frames(self):
        figure = importlib.import_module("lab.figures.flicker")
        truth = np.full((20, 30, 3), 0.5)
        sequence = figure.Sequence.__new__(figure.Sequence)
        sequence.name, sequence.frames = "pool", range(1, 25)
        sequence.references = [picture_errors.Reference(truth, truth)] * 24
        dark = [np.zeros_like(truth)] * 24
        with unittest.mock.patch.object(figure, "CACHE", self.dir), unittest.mock.patch("builtins.print"):
            figure.write_strip(sequence, 2.0, {"auto": dark, "auto, estimate": dark})
        strip = np.asarray(figure.Image.open(self.dir / "strips" / "pool-30-2s.png"))[:, figure.LABEL_WIDTH :]
        self.assertEqual(strip.shape, (60, 240, 3))
        self.assertTrue((strip[:20] == 255).all() and (strip[20:] == 0).all())


class Rows(support.Scratch):
    def test_pictures_of_other_renderers_that_miss_light_are_named_and_not_stored(self):
        figure = importlib.import_module("lab.figures.flicker")
        truth = np.full((20, 30, 3), 0.5)
        here = (*np.mgrid[:20, :30], np.ones((20, 30), bool))
        sequence = figure.Sequence.__new__(figure.Sequence)
        sequence.name, sequence.frames, sequence.halves, sequence.matches = "pool", range(3), [self.dir] * 3, [here] * 2
        sequence.references = [picture_errors.Reference(truth, truth)] * 3
        sequence.made = [{"core_seconds": [1.0, 1.0], "options": [], "program": "none"}] * 3
        sequence.spent = lambda folders: 1.0
        random = np.random.default_rng(1)
        noise = 0.01 * random.standard_normal((3, *truth.shape))

        def pictures(factor):
            return lambda frame: {"noisy": (factor * truth + noise[frame]).astype(np.float32)}

        sources = [
            (name, int, pictures(factor), figure.PEER_PICTURES) for name, factor in (("whole", 1), ("dark", 0.9))
        ]
        measured = lambda folder, reference, halves, pictures_of: {
            name: reference.measure(picture) for name, picture in pictures_of(folder).items()
        }
        patches = {"Sequence": lambda name: sequence, "sources": lambda *_: sources, "write_strip": lambda *_: None}
        with (
            unittest.mock.patch.multiple(figure, **patches),
            unittest.mock.patch.object(figure.renders, "figures", measured),
            unittest.mock.patch("builtins.print"),
        ):
            rows, notes, _ = figure.measure("pool", 1.0, [])
        self.assertEqual([row["row"] for row in rows], ["whole"])
        self.assertAlmostEqual(rows[0]["flicker"], 0.01 * np.sqrt(2 / 0.26), delta=0.001)
        self.assertIn("not comparable", notes["dark"])
