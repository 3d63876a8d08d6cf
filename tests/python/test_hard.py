"""The suite of hard cases: its judges reject planted faults, its scenes and answers are what they say."""

import contextlib
import io
import json
import math
import tempfile
import unittest
from pathlib import Path

import numpy as np

import support
from tests.hard import answers, families, judge, shapes
from tests.hard import run as suite
from tests.hard import scene as s
from tests.hard.case import Case
from tests.hard.stage import Stage

SHAPE = (8, 16, 16, 3)


def noisy(seed, mean=1.0, spread=0.1, shape=SHAPE):
    """Pictures whose numbers are gamma distributed around `mean`, as radiance often is: skewed, never negative."""
    return np.random.default_rng(seed).gamma(1 / spread**2, mean * spread**2, shape)


class Judges(unittest.TestCase):
    def test_student_is_what_tables_say(self):
        for freedom, errors, wanted in ((7, 0.05, 2.3646), (3, 0.01, 5.8409), (1, 0.1, 6.3138), (30, 0.001, 3.6460)):
            self.assertAlmostEqual(judge.student(freedom, errors), wanted, delta=2e-3 * wanted)

    def test_value_takes_what_is_right_and_rejects_planted_faults(self):
        right = noisy(1)
        self.assertTrue(judge.value(right, 1.0, 0.002, 0.05).passed)
        lost = right * 0.95
        self.assertFalse(judge.value(lost, 1.0, 0.002, 0.05).passed)
        tinted = right * (1, 1, 1.06)
        self.assertFalse(judge.value(tinted, 1.0, 0.002, 0.05).passed)
        corner = right.copy()
        corner[:, :8, :8] *= 1.12
        self.assertFalse(judge.value(corner, 1.0, 0.002, 0.05).passed)
        hole = right.copy()
        hole[3, 2, 2, 1] = np.nan
        self.assertFalse(judge.value(hole, 1.0, 0.002, 0.05).passed)

    def test_noise_does_not_hide_a_fault(self):
        verdict = judge.value(noisy(2, spread=5.0), 1.0, 0.002, 0.05)
        self.assertFalse(verdict.passed)
        self.assertIn("undecided", verdict.figure)

    def test_value_rejects_what_is_right_as_seldom_as_it_says(self):
        wrong = sum(
            not judge.value(noisy(100 + i, spread=0.5, shape=(8, 4, 4, 3)), 1.0, 0.0, 9.0).passed for i in range(2000)
        )
        self.assertLessEqual(wrong, 3)

    def test_equal_sees_a_difference_that_is_smaller_than_the_noise_in_common(self):
        like = noisy(3, spread=1.5)
        self.assertTrue(judge.equal(like * 1.0005, like, 0.001, 0.03).passed)
        self.assertFalse(judge.equal(like * 1.01, like, 0.001, 0.03).passed)
        self.assertTrue(judge.equal(noisy(4), noisy(5), 0.002, 0.1).passed)
        self.assertFalse(judge.equal(noisy(4, mean=1.2), noisy(5), 0.002, 0.1).passed)
        self.assertFalse(judge.equal(np.zeros(SHAPE), np.zeros(SHAPE), 0.002, 0.05).passed)

    def test_without_noise_and_bound_no_mean_may_differ(self):
        like = np.ones(SHAPE)
        self.assertTrue(judge.equal(like, like, 0.0, 0.05).passed)
        for channel in range(3):
            other = like.copy()
            other[..., channel] += 1e-9
            self.assertFalse(judge.equal(other, like, 0.0, 0.05).passed)

    def test_exact_sees_the_last_bit(self):
        like = np.float32(noisy(6))
        self.assertTrue(judge.exact(like * np.float32(2.0**40), like, 2.0**40).passed)
        bit = like.copy()
        bit[0, 0, 0, 0] = np.nextafter(bit[0, 0, 0, 0], np.float32(9))
        self.assertFalse(judge.exact(bit, like, 1.0).passed)
        self.assertFalse(judge.exact(like * 0, like * 0, 1.0).passed)
        self.assertFalse(judge.exact(like * np.nan, like * np.nan, 1.0).passed)

    def test_sweep_sees_a_seam_and_a_rise(self):
        falling = [noisy(10 + i, mean=1 - 0.02 * i, spread=0.1) for i in range(9)]
        self.assertTrue(judge.sweep(falling, 0, 0.005, 0.03, 9).passed)
        seam = [*falling[:4], falling[4] * 1.03, *falling[5:]]
        self.assertFalse(judge.sweep(seam, 0, 0.005, 0.03, 9).passed)
        rising = falling[::-1]
        self.assertFalse(judge.sweep(rising, 0, 0.005, 0.03, 9).passed)
        self.assertTrue(judge.sweep(rising, 0, 0.005, 0.03).passed)

    def test_black_and_same(self):
        self.assertTrue(judge.black(np.zeros(SHAPE), 1e-6).passed)
        firefly = np.zeros(SHAPE)
        firefly[0, 1, 2, 0] = 1e-5
        self.assertFalse(judge.black(firefly, 1e-6).passed)
        self.assertTrue(judge.same({"one": b"ab", "two": b"ab"}).passed)
        self.assertFalse(judge.same({"one": b"ab", "two": b"ac"}).passed)


class Shapes(unittest.TestCase):
    def area_vectors(self, mesh):
        a, b, c = (mesh.positions[mesh.triangles[:, i]] for i in range(3))
        return np.cross(b - a, c - a) / 2, (a + b + c) / 3

    def test_closed_shapes_face_out_and_close(self):
        for mesh, volume in ((shapes.box((-1, -1, -1), (1, 2, 1)), 12.0), (shapes.sphere((3, 0, 0), 1, 64), 4.19)):
            area, middle = self.area_vectors(mesh)
            self.assertLess(np.abs(area.sum(axis=0)).max(), 1e-9)
            self.assertAlmostEqual(float((area * middle).sum() / 3), volume, delta=0.02)

    def test_floor_grid_and_ceiling_face_up_and_down(self):
        for mesh, sign in ((shapes.floor(1), 1), (shapes.grid(1, 3), 1), (shapes.ceiling(1, 2), -1)):
            area, _ = self.area_vectors(mesh)
            self.assertAlmostEqual(float(area[:, 1].sum()), 4.0 * sign)
            self.assertTrue((area[:, 1] * sign > 0).all())

    def test_powers_of_two_scale_exactly(self):
        made = (
            s.Scene()
            .add(shapes.sphere((0.1, 0.2, 0.3), 0.7), s.diffuse(1))
            .seen((0.1, 2, 3), (0, 0.3, 0), 30)
            .scaled(1)
        )
        twice = made.scaled(2.0**20)
        self.assertTrue((twice.objects[0][0].positions == made.objects[0][0].positions * np.float32(2.0**20)).all())
        self.assertEqual([c * 2.0**20 for c in made.camera[0]], list(twice.camera[0]))


class Closed(unittest.TestCase):
    """Closed forms against sums that know nothing of them."""

    def test_form_factor_of_a_square(self):
        from tests.hard import lights

        at = (np.arange(800) + 0.5) / 800 - 0.5
        x, z = np.meshgrid(at, at)
        summed = np.sum(4.0 / (x**2 + z**2 + 4.0) ** 2) / 800**2 / math.pi
        self.assertAlmostEqual(lights.form_factor(0.5, 2.0), summed, delta=1e-6)

    def test_line_lamp(self):
        from tests.hard import grazing

        at = (np.arange(20000) + 0.5) / 20000 - 0.5
        self.assertAlmostEqual(grazing.lit_by_slit(), 0.5 / math.pi * np.mean(0.01 / (at**2 + 0.01) ** 2), delta=1e-4)

    def test_ggx_lobe_holds_all_its_light(self):
        from tests.hard import roughness

        self.assertAlmostEqual(roughness.lobe_share(0.1, half=40.0, count=4000), 1.0, delta=0.015)

    def test_half_space_is_what_walks_find(self):
        from tests.hard import media

        random, walks, albedo, back = np.random.default_rng(7), 200_000, 0.5, 0.0
        depth, cosine, alive = np.zeros(walks), np.ones(walks), np.ones(walks)
        for _ in range(30):
            depth = depth + cosine * random.exponential(size=walks)
            back += float(np.sum(alive * (depth < 0)))
            alive = np.where(depth < 0, 0, alive * albedo)
            depth = np.maximum(depth, 0)
            cosine = random.uniform(-1, 1, walks)
        self.assertAlmostEqual(back / walks, media.half_space(albedo), delta=0.002)


class Suite(unittest.TestCase):
    def test_names_are_unlike_and_every_scene_writes(self):
        cases = families.cases()
        self.assertEqual(len({case.name for case in cases}), len(cases))
        with tempfile.TemporaryDirectory() as folder:
            for case in cases:
                if not case.long:
                    case.write(Path(folder))
                self.assertTrue(set(case.answer.shown()) <= set(case.scenes), case.name)
                self.assertTrue(set(case.fails) <= set(case.methods), case.name)
                self.assertTrue(case.answer.derivation.endswith("."), case.name)
            for path in Path(folder).glob("*.json"):
                said = json.loads(path.read_text())
                self.assertTrue(all((Path(folder) / file).is_file() for file in said["scenes"].values()))

    def test_the_page_of_docs_lists_the_cases(self):
        from tests.hard import table

        text = table.DOCS.read_text()
        self.assertEqual(table.filled(text), text, "run tests/hard-cases.sh --table")
        self.assertIn("| `furnace-albedo-0.5` |", text)

    def play(self, folder, case):
        case.family = "Tests"
        case.write(folder)
        return suite.play(Stage(support.binary(), folder, case, "path"))

    def case(self, answer, fails=None):
        from tests.hard import furnace

        return Case(
            "planted",
            "A white ball",
            {"scene": lambda: furnace.white(s.diffuse(1))},
            answer,
            ("path",),
            size=8,
            iterations=2,
            seeds=4,
            fails=fails or {},
        )

    def test_the_gate_tells_known_failures_apart_and_none_passes_silently(self):
        right = answers.Value(1.0, "White.", bound=0.3, resolves=9)
        wrong = answers.Value(3.0, "Planted.", bound=0.3, resolves=9)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            states = {}
            for answer, fails in ((right, None), (wrong, None), (wrong, {"path": "why"}), (right, {"path": "why"})):
                result = self.play(folder, self.case(answer, fails))
                with contextlib.redirect_stdout(io.StringIO()) as said:
                    states[result.state] = suite.finish([result], folder, 1.0)
                bad = int(result.state in ("failed", "passed"))
                self.assertIn(f", {bad} failed, 1 s\n", said.getvalue())
            self.assertEqual(states, {"met": 0, "failed": 1, "known": 0, "passed": 1})
            shown = (folder / "index.html").read_text()
            self.assertIn("data:image/png;base64,", shown)
            self.assertIn("White.", shown)

    def test_refused_wants_an_error_that_names_the_fault(self):
        from tests.hard import geometry

        with tempfile.TemporaryDirectory() as name:
            for match, made, state in (
                ("finite|nan", lambda: geometry.broken("positions", np.nan), "met"),
                ("no such words", lambda: geometry.broken("positions", np.nan), "failed"),
                ("finite|nan", lambda: geometry.stage(None), "failed"),
            ):
                case = self.case(answers.Refused(match, "A guess would be silent."))
                case.scenes = {"scene": made}
                self.assertEqual(self.play(Path(name), case).state, state)


if __name__ == "__main__":
    unittest.main()
