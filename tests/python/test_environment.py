"""The program starts, and what scripts/setup.sh installs is what the program can use."""

import os
import subprocess
import sys
import unittest
import zipfile

import support

SCRIPT = support.ROOT / "scripts" / "setup_onnxruntime.py"


class Program(unittest.TestCase):
    def test_prints_its_version(self):
        done = support.run(["--version"], check=0)
        self.assertRegex(done.stdout, r"^caustique \d+\.\d+\.\d+")

    def test_an_unknown_option_is_a_wrong_command_line(self):
        done = support.run(["--no-such-option"], check=2)
        self.assertEqual(done.stdout, "")
        self.assertIn("--no-such-option", done.stderr)

    def test_support_reports_an_unexpected_exit_code(self):
        with self.assertRaisesRegex(AssertionError, "exit code 2, expected 0"):
            support.run(["--no-such-option"], check=0)


class OnnxRuntime(support.Scratch):
    def find(self, *args, **env):
        return subprocess.run(
            [sys.executable, SCRIPT, *args], capture_output=True, text=True, check=False, env={**os.environ, **env}
        )

    def test_a_usable_library_is_there(self):
        done = self.find()
        self.assertEqual(done.returncode, 0, done.stderr)
        version, path = done.stdout.split()
        self.assertGreaterEqual(tuple(map(int, version.split(".")[:2])), (1, 17))
        self.assertIn("libonnxruntime.so", path)

    def test_a_file_that_is_no_library_is_refused(self):
        wrong = self.dir / "libonnxruntime.so"
        wrong.write_bytes(b"no library")
        self.assertEqual(self.find(CAUSTIQUE_ONNXRUNTIME=str(wrong)).returncode, 1)

    def test_a_library_without_the_entry_point_is_refused(self):
        self.assertEqual(self.find(CAUSTIQUE_ONNXRUNTIME="libc.so.6").returncode, 1)

    def test_a_wheel_without_the_library_is_refused(self):
        wheel = self.dir / "wrong.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            archive.writestr("onnxruntime/readme.txt", "")
        done = self.find("unpack", str(wheel))
        self.assertEqual(done.returncode, 1)
        self.assertIn("one libonnxruntime.so expected", done.stderr)


if __name__ == "__main__":
    unittest.main()
