"""The wheel needs what it asks for and nothing else: it renders in an environment of its own (scripts/python.sh)."""

import json
import subprocess
import tempfile
import unittest
from pathlib import Path

from shared import ROOT, TORUS

PYTHON = ROOT / ".venv-wheel" / "bin" / "python"
RENDER = f"""
import caustique, numpy
image = caustique.Scene({str(TORUS)!r}).render(method="path", iterations=2, width=16, height=8, finish=False)
image.save("torus.exr")
again = caustique.read("torus.exr")
assert numpy.array_equal(image.picture, again.picture) and image.picture.max() > 0
print(caustique.__file__)
"""


class Alone(unittest.TestCase):
    def test_it_has_numpy_and_nothing_else(self):
        output = subprocess.run([PYTHON, "-m", "pip", "list", "--format=json"], capture_output=True, text=True, check=True)
        names = {package["name"] for package in json.loads(output.stdout)}
        self.assertEqual(names - {"pip", "setuptools"}, {"caustique", "numpy"})

    def test_it_holds_its_licences(self):
        code = "import importlib.metadata as m; print(*(f.read_text() for f in m.files('caustique') if 'LICENSE' in f.name))"
        output = subprocess.run([PYTHON, "-I", "-c", code], capture_output=True, text=True, check=True).stdout
        for name in ("LICENSE-MIT", "LICENSE-APACHE"):
            self.assertIn((ROOT / name).read_text(), output)

    def test_its_command_runs_the_program(self):
        for command in ([PYTHON.parent / "caustique"], [PYTHON, "-I", "-m", "caustique"]):
            done = subprocess.run([*command, "plan", TORUS, "--width", "16"], capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stdout.splitlines()[0].split(":")[0]), (0, str(TORUS)), done.stderr)

    def test_it_renders_far_from_its_sources(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([PYTHON, "-I", "-c", RENDER], cwd=folder, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(str(ROOT / ".venv-wheel"), str(Path(done.stdout.strip())))


if __name__ == "__main__":
    unittest.main()
