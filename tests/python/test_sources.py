"""Tests the project's Python: lints, no import cycles, unique module names."""

import ast
import re
import subprocess
import sys
import unittest
from collections import Counter
from pathlib import Path

import support

SCRIPTS = support.ROOT / "scripts"
#: Scripts that Blender or an isolated Python (-I) starts without their folder on the search path.
STARTED_ELSEWHERE = {
    "blender/export_blend.py",
    "blender/build.py",
    "blender/caustique_addon/export_job.py",
    "blender/export.py",
    "usd/convert.py",
}


def sources():
    """The Python files below scripts."""
    return sorted(path for path in SCRIPTS.rglob("*.py") if "__pycache__" not in path.parts)


def imported(path, module_level=True):
    """All possible paths of a file's imports. `module_level`: only imports outside of functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    if module_level:
        inside = {id(n) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for n in ast.walk(f)}
        nodes = [node for node in nodes if id(node) not in inside]
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ([path.parent, *alias.name.split(".")] for alias in node.names)
        elif node.level:
            folder = path.parents[node.level - 1]
            parts = node.module.split(".") if node.module else []
            if parts:
                yield [folder, *parts]
            yield from ([folder, *parts, alias.name] for alias in node.names)
        else:
            yield [path.parent, *node.module.split(".")]


def graph(paths, module_level=False):
    """The imports among `paths`: {file: imported files}."""
    names = {}
    for path in paths:
        names.setdefault(path.stem, path)
    found = {}
    for path in paths:
        found[path] = set()
        for folder, *parts in imported(path, module_level):
            near = Path(folder, *parts).with_suffix(".py")
            package = Path(folder, *parts, "__init__.py")
            targets = [
                one
                for one in (near, package, names.get(parts[-1]) if parts and len(parts) == 1 else None)
                if one in paths
            ]
            found[path].update(one for one in targets[:1] if one != path)
    return found


def circles(edges):
    """The cycles of a graph, as lists of files."""
    found, done = [], set()

    def walk(file, trail):
        if file in trail:
            found.append([*trail[trail.index(file) :], file])
        elif file not in done:
            for other in sorted(edges[file]):
                walk(other, [*trail, file])
            done.add(file)

    for file in edges:
        walk(file, [])
    return found


def without_remedy(source):
    """Lines of the calls of `warn` and `say` in Python whose text has no semicolon. Texts in variables are not seen."""
    tree = ast.parse(source)
    named = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    lines = []
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        name = getattr(call.func, "attr", getattr(call.func, "id", "")).lstrip("_")
        place = {"say": 0, "warn": 1}.get(name, len(call.args))
        if place >= len(call.args):
            continue
        message = call.args[place]
        parts = [message, *(named[n.id] for n in ast.walk(message) if isinstance(n, ast.Name) and n.id in named)]
        texts = [n.value for part in parts for n in ast.walk(part) if isinstance(n, ast.Constant)]
        text = "".join(value for value in texts if isinstance(value, str))
        if text and ";" not in text:
            lines.append(call.lineno)
    return lines


class Sources(unittest.TestCase):
    def test_lints_pass(self):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", "check", "--no-cache", support.ROOT],
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_the_crate_has_what_a_library_needs_and_is_small(self):
        """Registries refuse crates above 10 MB, packed; these files are not packed yet."""
        listed = subprocess.run(
            ["cargo", "package", "--list", "--allow-dirty", "--package", "caustique"],
            cwd=support.ROOT,
            check=True,
            capture_output=True,
            text=True,
        )
        files = [support.ROOT / name for name in listed.stdout.splitlines()]
        self.assertLess(sum(file.stat().st_size for file in files if file.exists()), 8e6)
        self.assertIn(support.ROOT / "examples" / "picture.rs", files)
        for source in (support.ROOT / "src").rglob("*.rs"):
            for name in re.findall(r'include_(?:str|bytes)!\(\s*"([^"]+)"', source.read_text(encoding="utf-8")):
                self.assertIn((source.parent / name).resolve(), files, source)

    def test_all_files_state_one_version(self):
        def text(name):
            return (support.ROOT / name).read_text(encoding="utf-8")

        version = re.search(r'^version = "([\d.]+)"', text("Cargo.toml"), re.MULTILINE)[1]
        addon = "scripts/blender/caustique_addon/"
        self.assertEqual(set(re.findall(r'path = .*version = "([\d.]+)"', text("Cargo.toml"))), {version})
        self.assertIn(f"\nversion: {version}\n", text("CITATION.cff"))
        self.assertIn(f'\nversion = "{version}"\n', text(addon + "blender_manifest.toml"))
        self.assertIn(f'"version": ({version.replace(".", ", ")}),', text(addon + "__init__.py"))
        for page in ("README.md", "docs/install.md", "docs/python.md"):
            self.assertEqual(set(re.findall(r"caustique-(\d+\.\d+\.\d+)", text(page))) - {version}, set(), page)

    def test_no_lint_is_silenced_and_no_script_changes_the_search_path(self):
        for path in sources():
            text, name = path.read_text(encoding="utf-8"), str(path.relative_to(SCRIPTS))
            self.assertNotIn("# noqa", text, name)
            if name not in STARTED_ELSEWHERE:
                self.assertIsNone(re.search(r"sys\.path(\.| *\+?=|\[.*\] *=)", text), name)

    def test_no_scripts_import_each_other_in_a_circle(self):
        named = [[str(path.relative_to(SCRIPTS)) for path in circle] for circle in circles(graph(sources()))]
        self.assertEqual(named, [])

    def test_a_circle_is_found(self):
        a, b, c = (Path(name) for name in "abc")
        self.assertEqual(circles({a: {b}, b: {c}, c: {b}}), [[b, c, b]])
        self.assertEqual(circles({a: {b, c}, b: {c}, c: set()}), [])

    def test_imports_of_scripts_are_followed(self):
        edges = graph(sources())
        names = {
            str(path.relative_to(SCRIPTS)): {str(o.relative_to(SCRIPTS)) for o in of} for path, of in edges.items()
        }
        self.assertIn("usd/faults.py", names["usd/convert.py"])
        self.assertIn("lab/commands.py", names["lab/figures/auto.py"])
        self.assertIn("compare/peers/plain_scene.py", names["lab/twins.py"])

    def test_names_of_modules_are_unique(self):
        # Blender runs presets, and nothing imports them.
        modules = [path for path in sources() if path.parent.name != "presets"]
        counts = Counter(path.stem for path in modules if not path.stem.startswith("__"))
        self.assertEqual([name for name, count in counts.items() if count > 1], [])

    def test_every_warning_of_the_exporter_has_a_remedy(self):
        """A warning names an object, what differs, and after a semicolon what the artist can do."""
        self.assertEqual(without_remedy('warn(where, f"its {lens} is not carried: it is round")'), [1])
        self.assertEqual(without_remedy('TEXT = "it is lost"\nself.say(TEXT)'), [2])
        self.assertEqual(without_remedy('warn(where, "it is lost; " "apply it")\nwarn(where, what)'), [])
        for path in sorted((SCRIPTS / "blender").glob("*.py")):
            with self.subTest(path.name):
                self.assertEqual(without_remedy(path.read_text(encoding="utf-8")), [])


if __name__ == "__main__":
    unittest.main()
