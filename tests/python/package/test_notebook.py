"""The notebook runs, and what it prints and draws is what its text says."""

import re
import unittest

import nbclient
import nbformat
from shared import ROOT

NOTEBOOK = ROOT / "docs" / "convergence.ipynb"


def kinds(notebook):
    """The outputs of each cell by their kinds."""
    of = lambda output: (output["output_type"], sorted(output.get("data", {})))
    return [[of(output) for output in cell.get("outputs", [])] for cell in notebook.cells]


class Notebook(unittest.TestCase):
    def test_it_runs_and_shows_what_it_says(self):
        notebook = nbformat.read(NOTEBOOK, 4)
        kept = kinds(notebook)
        nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
        self.assertEqual(kept, kinds(notebook), "the notebook is kept with the outputs of its cells")
        outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        text = "".join(output.get("text", "") for output in outputs if output.get("name") == "stdout")
        said = "".join(output.get("text", "") for output in outputs if output.get("name") == "stderr")
        self.assertNotIn("SceneWarning", said)
        self.assertEqual(sum("image/png" in output.get("data", {}) for output in outputs), 2)
        slopes = {run: (float(measured), float(theory)) for run, measured, theory in
                  re.findall(r"(\w+): measured (\S+), theory (\S+)", text)}
        theories = {run: theory for run, (_, theory) in slopes.items()}
        self.assertEqual(theories, {"path": -1.0, "sppm": -0.67, "vcm": -0.5})
        # The error of merging methods falls at least as fast as theory predicts, and little faster than independent
        # noise.
        for run in ("sppm", "vcm"):
            self.assertLess(slopes[run][0], slopes[run][1], run)
            self.assertGreater(slopes[run][0], -1.6, run)


if __name__ == "__main__":
    unittest.main()
