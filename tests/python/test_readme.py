"""Tests the README and docs/: commands run as written, links and options exist, and lines are short."""

import json
import re
import shlex
import subprocess
import unittest

import support
import lab.options

README = support.ROOT / "README.md"
DOCS = sorted((support.ROOT / "docs").rglob("*.md"))
PAGES = [README, *DOCS]
SERVER = support.ROOT / "docs" / "server.md"
PROGRAM = "target/release/caustique"
#: Scripts that set everything up: they exist, but run too long for a test.
WHOLE = ("./scripts/demo.sh", "./scripts/test.sh", "./scripts/python.sh", "./scripts/package.sh")
#: Scripts that need Blender.
EXPORTER = "scripts/blender/export.py"
#: Blender as a Python module, where scripts/setup.sh test has installed it.
BLENDER = ".venv-bpy/bin/python"
# It needs Blender, and is run by blender_compositor.py, too.
COMPOSITOR = "scripts/blender/compositor.py"
MOST_LINES = 200
WIDEST = 120


def split(page):
    """Lines of a page outside and inside of code blocks, each with its number from 1."""
    prose, code, inside = [], [], False
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("```"):
            inside = not inside
        else:
            (code if inside else prose).append((number, line))
    return prose, code


def commands(page):
    """Command lines in the code blocks of a page, without formulas and printed tables."""
    starts = (PROGRAM + " ", "python3 scripts/", BLENDER + " scripts/", "./scripts/", "blender ")
    return [line for _, line in split(page)[1] if line.startswith(starts)]


def prose(page):
    return "\n".join(line for _, line in split(page)[0])


def without_code(text):
    return re.sub(r"`[^`]*`", "", text)


def anchors(page):
    """The anchors of a page's headings, as on GitHub."""
    found = set()
    for _, line in split(page)[0]:
        heading = re.match(r"#+ (.*)", line)
        if heading:
            slug = re.sub(r"[^\w\- ]", "", heading[1].strip().lower()).replace(" ", "-")
            count = 0
            while (name := f"{slug}-{count}" if count else slug) in found:
                count += 1
            found.add(name)
    return found


def shortened(command):
    """A command shortened to seconds, by limits of time and iterations and the width of pictures."""
    command = re.sub(r"--time \S+", "--time 1", command)
    command = re.sub(r"--iterations \S+", "--iterations 4", command)
    found = re.match(rf"{PROGRAM} (render|plan|converge)\b", command)
    if found and found[1] == "converge":
        command = command.replace("--time 1", "--time 0.3")
    if found and "--help" not in command:
        command, widths = re.subn(r"--width \S+", "--width 32", command)
        if not widths:
            command += " --width 32"
        if "--target-error" in command:
            command += " --iterations 8"
        elif found[1] == "render" and "--time" not in command and "--iterations" not in command:
            command += " --iterations 4"
    return command


class Commands(support.Scratch):
    """Runs commands in a folder that looks like the repository after scripts/demo.sh."""

    def setUp(self):
        super().setUp()
        for name in ("scenes", "scripts", ".venv-bpy"):
            (self.dir / name).symlink_to(support.ROOT / name)
        (self.dir / PROGRAM).parent.mkdir(parents=True)
        (self.dir / PROGRAM).symlink_to(support.binary().resolve())
        (self.dir / "out").mkdir()
        demo = ["render", support.scene("pool"), "-o", "out/demo.exr", "--png", "out/demo.png", "--width", 32]
        support.run([*demo, "--iterations", 8, "--progress", "none"], check=0, cwd=self.dir)

    def run_all(self, page):
        for command in commands(page):
            with self.subTest(command):
                words = shlex.split(command)
                if words[0] in WHOLE:
                    path = support.ROOT / words[0]
                    self.assertTrue(path.is_file() and path.stat().st_mode & 0o111, f"{path} is not executable")
                elif EXPORTER in words:
                    self.assertTrue((support.ROOT / EXPORTER).is_file())
                    # A copy of a scene replaces the export.
                    (self.dir / words[-1]).write_bytes(support.scene("blocks").read_bytes())
                elif any(word.endswith(".blend") for word in words) and COMPOSITOR not in words:
                    # blender_render.py tests these commands, which need Blender.
                    self.assertIn(words[1], ("render", "plan", "info"))
                elif "--with" in words:
                    # Other renderers are not installed where tests run; test_peers.py tests their drivers.
                    self.assertTrue((support.ROOT / "scripts" / "compare" / "setup.sh").is_file())
                elif COMPOSITOR in words and not (support.ROOT / BLENDER).exists():
                    self.assertTrue((support.ROOT / COMPOSITOR).is_file())
                else:
                    done = subprocess.run(
                        ["bash", "-c", shortened(command)], cwd=self.dir, capture_output=True, text=True, timeout=300, check=False
                    )
                    self.assertEqual(done.returncode, 0, f"{shortened(command)}\n{done.stdout}{done.stderr}")

    def test_commands_of_the_readme_run_as_written(self):
        self.assertGreater(len(commands(README)), 5)
        self.run_all(README)

    def test_every_line_of_the_readmes_code_is_a_command(self):
        lines = [line for _, line in split(README)[1] if line.strip()]
        self.assertEqual(lines, commands(README))

    def test_commands_of_the_documentation_run(self):
        for page in DOCS:
            self.run_all(page)


class Server(unittest.TestCase):
    def test_the_example_runs_as_written(self):
        text = "\n".join(line for _, line in split(SERVER)[1] if line.startswith(("{", " "))).strip()
        said = []
        while text:
            command, end = json.JSONDecoder().raw_decode(text)
            said.append(json.dumps(command) + "\n")
            text = text[end:].strip()
        self.assertGreater(len(said), 2)
        command = [support.binary(), "serve", "--threads", "1"]
        with subprocess.Popen(command, cwd=support.ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
            server.stdin.write("".join(said).encode())
            server.stdin.flush()
            events = []
            while not {"edited", "error"} & set(events):
                answer = json.loads(server.stdout.readline())
                events.append(answer["event"])
                server.stdout.read(answer.get("bytes", 0))
            server.stdin.close()
        self.assertEqual((events[:2], events[-1]), (["ready", "loaded"], "edited"), answer)


class Text(unittest.TestCase):
    def test_the_readme_is_short(self):
        self.assertLessEqual(len(README.read_text(encoding="utf-8").splitlines()), MOST_LINES)

    def test_lines_are_short(self):
        for page in PAGES:
            outside, inside = split(page)
            for number, line in outside + (inside if page == README else []):
                if not line.startswith("|"):
                    self.assertLessEqual(len(line), WIDEST, f"{page.name}:{number}")

    def test_links_lead_somewhere(self):
        for page in PAGES:
            for link in re.findall(r"\]\(([^)\s]+)\)", without_code(prose(page))):
                if re.match(r"[a-z]+:", link):
                    continue
                name, _, anchor = link.partition("#")
                target = page.parent / name if name else page
                with self.subTest(f"{page.name}: {link}"):
                    self.assertTrue(target.exists())
                    if anchor:
                        self.assertIn(anchor, anchors(target))

    def test_every_page_of_the_documentation_is_linked_from_the_readme(self):
        index = support.ROOT / "docs" / "lab" / "README.md"
        for page in DOCS:
            of_lab = page.parent == index.parent and page != index
            text, folder = prose(index if of_lab else README), index.parent if of_lab else support.ROOT
            self.assertIn(f"({page.relative_to(folder)}", text)

    def test_options_that_are_named_exist(self):
        names = ("render", "plan", "finish", "merge", "compare", "converge", "info", "serve", "doctor")
        known = "".join(support.run([*words, "--help"], check=0).stdout for words in ([], *([name] for name in names)))
        for script in ("scripts/blender/export.py", "scripts/farm/ray_render.py", "scripts/farm/slurm.sh", "tests/hard/run.py"):
            known += (support.ROOT / script).read_text(encoding="utf-8")
        known += "".join(f"--{name.replace('_', '-')} " for name in (*lab.options.KNOWN, "short"))
        known = set(re.findall(r"--[a-z][a-z-]*", known))
        for page in PAGES:
            if page.name in ("measurements.md", "architecture.md"):  # They name options of cargo and of scripts, too.
                continue
            for code in re.findall(r"`([^`]*)`", prose(page)):
                for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", code):
                    self.assertIn(option, known, f"{page.name}: {code}")

    def test_files_that_are_named_exist(self):
        for page in PAGES:
            for name in re.findall(r"`((?:src|scripts|tests|scenes|docs|ffi)/[\w./-]+)`", prose(page)):
                self.assertTrue((support.ROOT / name).exists(), f"{page.name}: {name}")


if __name__ == "__main__":
    unittest.main()
