"""Tests scripts that count test results, and the laboratory's stored figures."""

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import unittest
from unittest import mock

import support

from lab import record
from lab.__main__ import FIGURES, environment
from lab.figures import tables
from lab.options import parser
from lab.tables import Figures
from lab.tables.markdown import digits
from lab.tables.stored import Missing

COUNTS = support.ROOT / "tests" / "test_counts.awk"
TIMES = support.ROOT / "tests" / "test_times.awk"
LAB = [sys.executable, "-m", "lab"]


def awk(program, log):
    command = [shutil.which("awk"), "-f", program]
    return subprocess.run(command, input=log, capture_output=True, text=True, check=True).stdout


def counts(log):
    return tuple(map(int, awk(COUNTS, log).split()))


class Counts(unittest.TestCase):
    def test_cargo_results_add_up(self):
        log = (
            "test result: ok. 12 passed; 0 failed; 1 ignored; 0 measured; 3 filtered out; finished in 0.12s\n"
            "test result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s\n"
        )
        self.assertEqual(counts(log), (16, 2, 1))

    def test_tests_of_the_long_form_are_not_skipped_tests(self):
        log = (
            "test furnaces::box ... ok <1.250s>\ntest media::fog ... ignored, long\ntest media::mist ... ignored\n"
            "test result: ok. 1 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out; finished in 1.25s\n"
        )
        self.assertEqual(counts(log), (1, 0, 1))

    def test_times_of_rust_and_python_tests(self):
        log = "test furnaces::box ... ok <12.345s>\n.\ntest_cli.Exits.test_usage: 3.2 s\n.\ntest result: ok.\nRan 1 test in 1.0s\n"
        self.assertEqual(awk(TIMES, log), "12.3 furnaces::box\n3.2 test_cli.Exits.test_usage\n")

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


#: Runs nothing: reports a passed test, or fails.
STUB = """#!/bin/sh
case "$0 $*" in *"$FAILING"*) exit 1 ;; esac
echo "test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.01s"
"""


class Parts(support.Scratch):
    """Runs scripts/test.sh with stubs of all programs, of which one fails."""

    def summary(self, failing):
        """Exit code, and the verdict of each part by its name."""
        folder = self.dir
        for name in ("scripts/test.sh", "tests/test_counts.awk", "tests/test_times.awk"):
            (folder / name).parent.mkdir(exist_ok=True)
            shutil.copy(support.ROOT / name, folder / name)
        (folder / "scripts/setup.sh").write_text("ROOT=$PWD\nsetup() { :; }\n")
        pythons = [f".venv{which}/bin/python" for which in ("", "-bpy", "-usd", "-python")]
        for name in ("bin/cargo", "bin/rustc", "scripts/python.sh", "tests/hard-cases.sh", *pythons):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(STUB)
            (folder / name).chmod(0o755)
        known = {**os.environ, "FAILING": failing, "PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}
        done = subprocess.run(["scripts/test.sh"], cwd=folder, env=known, capture_output=True, text=True, check=False)
        lines = re.findall(r"^(ok|FAILED|not run) +(.*?)(?:  +|$)", done.stdout, re.MULTILINE)
        return done.returncode, {name: verdict for verdict, name in lines}, done.stdout.splitlines()[-1]

    def test_all_parts_pass(self):
        code, verdicts, last = self.summary("nothing")
        self.assertEqual((code, last), (0, f"{list(verdicts.values()).count('ok')} passed, 0 failed"))

    def test_a_failing_part_hides_no_other(self):
        for failing, part in [("clippy --locked", "cargo clippy"), ("usd_", "Python with USD"), ("--lib", "cargo test")]:
            code, verdicts, last = self.summary(failing)
            self.assertEqual(code, 1, failing)
            self.assertRegex(last, r"\d passed, 1 failed")
            self.assertEqual(verdicts.pop(part), "FAILED")
            for name in ("cargo fmt", "cargo doc", "Python", "Hard cases", "Python package"):
                self.assertEqual(verdicts[name], "ok", failing)

    def test_parts_that_need_a_failed_one_do_not_run(self):
        code, verdicts, _ = self.summary("python.sh")
        self.assertEqual((code, verdicts["Python wheel"], verdicts["Python package"]), (1, "FAILED", "not run"))
        code, verdicts, last = self.summary("cargo build")
        self.assertEqual((code, last), (1, "1 passed, 1 failed"))
        self.assertEqual((verdicts["all other parts"], len(verdicts)), ("not run", 3))


class Blender(unittest.TestCase):
    def test_without_bpy_the_remedy_is_printed(self):
        for name in ("compositor", "export"):
            path = support.ROOT / "scripts" / "blender" / f"{name}.py"
            done = subprocess.run([sys.executable, path, "a", "b"], capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stdout), (1, ""))
            self.assertRegex(done.stderr, r"^error: No module named 'bpy'\nhint: run this in Blender .*\n$")


    def test_setup_installs_bpy_alone(self):
        """Without Rust: its mode needs a Python and Blender's module, and nothing of the program."""
        script = 'PATH=/usr/bin:/bin; . scripts/setup.sh; for need in $(compgen -A function need_); do eval "$need() { echo $need; }"; done; setup bpy'
        done = subprocess.run(["bash", "-c", script], cwd=support.ROOT, capture_output=True, text=True, check=True)
        self.assertEqual(done.stdout.split(), ["need_python", "need_venv_module", "need_bpy"])


class Requirements(unittest.TestCase):
    def test_all_are_pinned_by_hash(self):
        """Each requirement and its dependencies are in the pinned file (scripts/lock.sh)."""
        folder = support.ROOT / "scripts"
        installed = sorted([*folder.glob("requirements-*.txt"), folder / "lab" / "train" / "requirements.txt"])
        self.assertGreater(len(installed), 8)
        for path in installed:
            lines = path.read_text().replace("\\\n", "").splitlines()
            pinned = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
            for line in pinned:
                self.assertRegex(line, r"^[\w.-]+(\[\w]+\])?==\S+( ; .*?)? +--hash=sha256:[0-9a-f]{64}", path.name)
            asked = path.with_suffix(".in")
            for line in asked.read_text().splitlines() if asked.exists() else ():
                pin = re.match(r"([\w.-]+==[\w.]+)", line)
                if pin:
                    self.assertTrue(any(one.lower().startswith(pin[1].lower()) for one in pinned), f"{path.name}: {line}")


class Record(support.Scratch):
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

    def test_corrected_and_not_are_two_figures(self):
        file = self.dir / "results.jsonl"
        with mock.patch.object(record, "commit", lambda: "a" * 40):
            for corrected in (True, False):
                record.record("mitsuba", {"scene": "wide", "corrected": corrected}, file)
        self.assertEqual(len(file.read_text().splitlines()), 2)

    def test_a_tree_that_no_commit_has_stores_nothing(self):
        file = self.dir / "results.jsonl"
        with mock.patch.object(record, "commit", lambda: "a" * 40 + "-dirty"), mock.patch("sys.stderr"):
            record.record("rays", {"mrays": 3.5}, file)
        self.assertFalse(file.exists())

    def test_a_script_that_no_commit_has_makes_the_tree_dirty(self):
        def git(*args):
            subprocess.run(["git", "-C", self.dir, *args], check=True, capture_output=True)

        git("init")
        for folder in ("scripts/lab", "docs"):
            (self.dir / folder).mkdir(parents=True)
        (self.dir / "scripts" / "lab" / "old.py").touch()
        git("add", ".")
        git("-c", "user.name=a", "-c", "user.email=a@b.c", "commit", "-m", "A script.")
        results = self.dir / "scripts" / "lab" / "results.jsonl"
        with mock.patch.object(record, "ROOT", self.dir), mock.patch.object(record, "RESULTS", results):
            (self.dir / "docs" / "note.md").touch()
            self.assertRegex(record.commit(), "^[0-9a-f]{40}$")
            (self.dir / "scripts" / "lab" / "new.py").touch()
            self.assertRegex(record.commit(), "^[0-9a-f]{40}-dirty$")

    def test_a_value_that_is_not_a_number_is_refused(self):
        file = self.dir / "results.jsonl"
        with self.assertRaises(ValueError):
            record.record("rays", {"mrays": float("nan")}, file)
        self.assertFalse(file.exists())


class Laboratory(unittest.TestCase):
    def test_every_figure_has_arguments_that_are_known_and_a_function_main(self):
        for name, path in FIGURES.items():
            if environment(path) != ".venv":
                continue
            with self.subTest(name):
                figure = importlib.import_module(f"lab.figures.{name}")
                self.assertTrue(callable(figure.main))
                self.assertIn(f"scripts/lab.sh {name}", parser(name, figure, short=False).format_help())

    def test_defaults_and_arguments_are_read(self):
        finished = importlib.import_module("lab.figures.finished")
        read = parser("finished", finished, short=False).parse_args(["--budgets", "1,2.5", "--scenes", "pool"])
        self.assertEqual((read.budgets, read.scenes, read.width, read.seeds), ([1.0, 2.5], ["pool"], 320, 1))
        short = parser("finished", finished, short=True).parse_args(["--short"])
        self.assertEqual((short.width, short.budgets), (240, [10.0]))

    def test_an_unknown_figure_is_named(self):
        env = {**os.environ, "PYTHONPATH": str(support.ROOT / "scripts")}
        done = subprocess.run([*LAB, "nothing"], capture_output=True, text=True, check=False, env=env)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertRegex(done.stderr, "^lab: error: no figure 'nothing'\nhint: one of: auto, .*\n$")


class Tables(support.Scratch):
    def stored(self, *rows):
        """Figures from a file with these rows of values and commit."""
        machine = {"cpu": "a processor", "cores": 2, "memory_gib": 8.0, "system": "a system"}
        file = self.dir / "results.jsonl"
        with file.open("w", encoding="utf-8") as out:
            for values, commit in rows:
                row = {"name": "rays", "values": values, "commit": commit, "date": "2026-01-02T03:04:05Z"}
                out.write(json.dumps({**row, "machine": machine}) + "\n")
        return Figures(file=file)

    def test_tables_of_the_documents_equal_the_stored_figures(self):
        for page in tables.PAGES:
            with self.subTest(page.name):
                text = page.read_text(encoding="utf-8")
                self.assertEqual(tables.filled(text), text, "run scripts/lab.sh tables")

    def test_a_changed_number_of_any_table_is_noticed(self):
        found = 0
        for page in tables.PAGES:
            for block in tables.BLOCK.finditer(page.read_text(encoding="utf-8")):
                lines = block[0].splitlines()
                # Below the head and its rule.
                row = [index for index, line in enumerate(lines) if line.startswith("|")][2]
                lines[row] = re.sub(r"\d(?=\D*$)", lambda digit: str((int(digit[0]) + 1) % 10), lines[row])
                changed = "\n".join(lines)
                with self.subTest(f"{page.name}: {block[2]}"):
                    self.assertNotEqual(changed, block[0])
                    self.assertEqual(tables.filled(changed), block[0])
                found += 1
        self.assertGreater(found, 8)

    def test_no_measured_table_is_typed(self):
        for name in ("measurements.md", "accuracy.md", "negative-results.md"):
            text = (support.ROOT / "docs" / "lab" / name).read_text(encoding="utf-8")
            typed = [line for line in tables.BLOCK.sub("", text).splitlines() if line.startswith("|")]
            self.assertEqual(typed, [], name)

    def test_every_table_stands_in_a_page(self):
        text = "".join(page.read_text(encoding="utf-8") for page in tables.PAGES)
        self.assertEqual({block[2] for block in tables.BLOCK.finditer(text)}, set(tables.KINDS))

    def test_missing_figures_and_unknown_tables_are_named(self):
        for text, said in [
            ("<!-- table: peers nowhere -->\n<!-- end -->", "'peers'.*'nowhere'"),
            ("<!-- table: none -->\n<!-- end -->", "no table 'none'"),
        ]:
            with self.subTest(text), self.assertRaisesRegex(Missing, said):
                tables.filled(text)

    def test_a_source_has_commit_date_and_machine(self):
        pool, torus = ({"scene": "pool"}, "a" * 40), ({"scene": "torus"}, "b" * 40)
        figures = self.stored(pool)
        figures.all("rays")
        self.assertEqual(
            figures.source(), "Measured at commit aaaaaaaaaa, 2026-01-02, 2 cores of a processor, 8 GiB, a system.\n"
        )
        figures = self.stored(torus, pool)
        self.assertEqual([values["scene"] for values in figures.all("rays")], ["pool", "torus"])
        lines = sorted(figures.source().replace("\n  ", " ").splitlines())
        self.assertEqual(len(lines), 2)
        self.assertRegex(lines[0], r"^- pool: commit a{10}, .* a system\.$")
        self.assertRegex(lines[1], r"^- torus: commit b{10}, ")

    def test_one_figure_is_one(self):
        figures = self.stored(({"scene": "pool"}, "a" * 40), ({"scene": "torus"}, "a" * 40))
        self.assertEqual(figures.one("rays", scene="pool"), {"scene": "pool"})
        with self.assertRaisesRegex(Missing, "2 figures 'rays'"):
            figures.one("rays")

    def test_numbers_keep_two_digits(self):
        texts = [digits(value) for value in (None, 0.0309, 0.03, 1.0, 11.3, 7e-5)]
        self.assertEqual(texts, ["-", "0.031", "0.030", "1.0", "11", "7.0e-05"])


if __name__ == "__main__":
    unittest.main()
