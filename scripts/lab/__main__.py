"""Measures a figure: `scripts/lab.sh FIGURE [arguments]`. `--list` lists all figures, `FIGURE --help` the arguments.

A figure is a module of lab/figures with a function `main`. VENV names its virtual environment; ARGUMENTS and
`add_arguments` define its arguments (options.py). Stored figures are in results.jsonl (record.py).
"""

import ast
import importlib
import os
import sys
from pathlib import Path

from .options import parse
from .record import ROOT

FIGURES = {path.stem: path for path in sorted((Path(__file__).parent / "figures").glob("[!_]*.py"))}
DEFAULT_VENV = ".venv"


def summary(path):
    """The first sentence of a figure's docstring, read without importing the figure."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).split(". ")[0].rstrip(".")


def environment(path):
    """The virtual environment of a figure."""
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "VENV":
            return ast.literal_eval(statement.value)
    return DEFAULT_VENV


def interpreter(path):
    """The Python of a figure's virtual environment."""
    venv = environment(path)
    python = ROOT / venv / "bin" / "python"
    if not python.exists():
        sys.exit(
            f"lab: error: {path.stem} needs {venv}, which does not exist\nhint: run it by scripts/lab.sh, or create {venv}"
        )
    return python


def main(words):
    if not words or words[0] in ("--list", "-h", "--help"):
        print(__doc__.strip() if words[:1] != ["--list"] else "", end="\n\n" if words[:1] != ["--list"] else "")
        print("\n".join(f"{name:<18}{summary(path)}" for name, path in FIGURES.items()))
        return
    name, arguments = words[0], words[1:]
    if name not in FIGURES:
        sys.exit(f"lab: error: no figure '{name}'\nhint: one of: {', '.join(FIGURES)}")
    python = interpreter(FIGURES[name])
    if Path(sys.prefix).resolve() != python.parents[1].resolve():
        os.execv(python, [str(python), "-m", "lab", *words])
    figure = importlib.import_module(f".figures.{name}", __package__)
    parse(name, figure, arguments)
    code = figure.main()
    if "bpy" in sys.modules:
        # Blender as a module may hang while it shuts down.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code or 0)
    sys.exit(code)


if __name__ == "__main__":
    main(sys.argv[1:])
