"""The program starts, and it can use the libraries that scripts/setup.sh installs."""

import os
import subprocess
import sys
import unittest
import zipfile

import support

SCRIPT = support.ROOT / "scripts" / "setup_library.py"


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


class Library(support.Scratch):
    """Common tests of scripts/setup_library.py; subclasses name the library."""

    def find(self, *args, **env):
        command = [sys.executable, SCRIPT, *args]
        return subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **env})


class Script(Library):
    def test_an_unknown_library_or_a_wrong_command_line_is_refused(self):
        for args in ([], ["embree"], ["oidn", "unpack"], ["oidn", "pack", "wheel"], ["unpack", "wheel"]):
            done = self.find(*args)
            self.assertEqual((done.returncode, done.stdout), (1, ""))
            self.assertIn("setup_library.py onnxruntime|oidn", done.stderr)


class Each:
    def test_a_usable_library_is_there(self):
        done = self.find(self.name)
        self.assertEqual(done.returncode, 0, done.stderr)
        version, path = done.stdout.split()
        self.assertGreaterEqual(tuple(map(int, version.split(".")[:2])), self.oldest)
        self.assertIn(self.file, path)

    def test_a_file_that_is_no_library_is_refused(self):
        wrong = self.dir / self.file
        wrong.write_bytes(b"no library")
        self.assertEqual(self.find(self.name, **{self.variable: str(wrong)}).returncode, 1)

    def test_a_library_without_the_entry_point_is_refused(self):
        self.assertEqual(self.find(self.name, **{self.variable: "libc.so.6"}).returncode, 1)

    def test_a_wheel_without_the_library_is_refused(self):
        wheel = self.dir / "wrong.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            archive.writestr("package/readme.txt", "")
        done = self.find(self.name, "unpack", str(wheel))
        self.assertEqual(done.returncode, 1)
        self.assertIn(f"one {self.file} expected", done.stderr)


class OnnxRuntime(Each, Library):
    name, variable, file, oldest = "onnxruntime", "CAUSTIQUE_ONNXRUNTIME", "libonnxruntime.so", (1, 17)


class OpenImageDenoise(Each, Library):
    name, variable, file, oldest = "oidn", "CAUSTIQUE_OIDN", "libOpenImageDenoise.so", (2, 0)

    def test_a_wheel_that_lacks_a_file_the_library_loads_is_refused(self):
        wheel = self.dir / "wrong.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            for name in ("libOpenImageDenoise", "libOpenImageDenoise_core", "libOpenImageDenoise_device_cpu"):
                archive.writestr(f"package/lib/{name}.so.2.5.1", "")
        done = self.find(self.name, "unpack", str(wheel))
        self.assertEqual(done.returncode, 1)
        self.assertIn("one libtbb.so expected, found []", done.stderr)


if __name__ == "__main__":
    unittest.main()
