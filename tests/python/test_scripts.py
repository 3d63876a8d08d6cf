"""The scripts count results as they should, and record figures as one JSON object a line."""

import json
import shutil
import subprocess
import sys
import unittest
from unittest import mock

import support

sys.path.insert(0, str(support.ROOT / "scripts" / "figures"))
sys.path.insert(0, str(support.ROOT / "scripts"))
import record  # noqa: E402
import tables  # noqa: E402

COUNTS = support.ROOT / "scripts" / "test_counts.awk"
RECORD = support.ROOT / "scripts" / "figures" / "record.py"
TABLES = support.ROOT / "scripts" / "tables.py"


def counts(log):
    awk = shutil.which("awk")
    done = subprocess.run([awk, "-f", COUNTS], input=log, capture_output=True, text=True, check=True)
    return tuple(map(int, done.stdout.split()))


class Counts(unittest.TestCase):
    def test_cargo_results_add_up(self):
        log = (
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.12s\n"
            "test result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s\n"
        )
        self.assertEqual(counts(log), (16, 2, 1))

    def test_unittest_results(self):
        for last, expected in [
            ("OK", (9, 0, 0)),
            ("OK (skipped=2)", (7, 0, 2)),
            ("OK (expected failures=2)", (9, 0, 0)),
            ("FAILED (failures=1, errors=2, skipped=3, expected failures=1)", (3, 3, 3)),
            ("FAILED (unexpected successes=1)", (8, 1, 0)),
        ]:
            with self.subTest(last):
                self.assertEqual(counts(f"noise\nRan 9 tests in 0.1s\n\n{last}\n"), expected)

    def test_an_error_outside_any_test_counts(self):
        self.assertEqual(counts("Ran 0 tests in 0.0s\n\nFAILED (errors=1)\n"), (0, 1, 0))

    def test_nothing_is_nothing(self):
        self.assertEqual(counts("OK, and passed; words alone\n"), (0, 0, 0))
        self.assertEqual(counts("Ran 0 tests in 0.0s\n\nNO TESTS RAN\n"), (0, 0, 0))


class Record(support.Scratch):
    def record(self, *args):
        return subprocess.run(
            [sys.executable, RECORD, "--file", self.dir / "results.jsonl", *args],
            capture_output=True,
            text=True,
            check=False,
        )

    def test_the_last_of_a_figure_is_kept_with_commit_and_machine(self):
        file = self.dir / "results.jsonl"
        with mock.patch.object(record, "commit", lambda: "a" * 40):
            for rays, scene in ((3.5, "torus"), (5, "pool"), (4, "torus")):
                record.record("rays", {"mrays": rays, "scene": scene}, file)
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        self.assertEqual([(line["values"]["mrays"], line["values"]["scene"]) for line in lines], [(5, "pool"), (4, "torus")])
        for line in lines:
            self.assertEqual((line["name"], line["commit"]), ("rays", "a" * 40))
            self.assertRegex(line["date"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
            self.assertGreaterEqual(line["machine"]["cores"], 1)
            self.assertTrue(line["machine"]["cpu"])

    def test_a_tree_that_no_commit_has_stores_nothing(self):
        file = self.dir / "results.jsonl"
        with mock.patch.object(record, "commit", lambda: "a" * 40 + "-dirty"), mock.patch("sys.stderr"):
            record.record("rays", {"mrays": 3.5}, file)
        self.assertFalse(file.exists())

    def test_a_value_without_a_name_is_refused(self):
        done = self.record("rays", "3.5")
        self.assertEqual(done.returncode, 2)
        self.assertIn("3.5", done.stderr)
        self.assertFalse((self.dir / "results.jsonl").exists())

    def test_a_value_that_is_not_a_number_is_refused(self):
        done = self.record("rays", "mrays=NaN")
        self.assertEqual(done.returncode, 2)


class Tables(unittest.TestCase):
    def test_the_documents_tables_are_what_is_stored(self):
        done = subprocess.run([sys.executable, TABLES, "--check"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_changed_table_is_noticed(self):
        text = tables.DOCUMENT.read_text(encoding="utf-8")
        changed = text.replace("| bath | ", "| bath | 1e-9 ", 1)
        self.assertNotEqual(changed, text)
        self.assertEqual(tables.filled(changed), text)


if __name__ == "__main__":
    unittest.main()
