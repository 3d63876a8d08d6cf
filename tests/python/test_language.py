"""Plain words: code, comments and documents avoid words that only insiders of this project understand.

`python3 tests/python/test_language.py --report [FOLDER...]` counts the findings per folder and lists those of FOLDER.
"""

import re
import sys
import tempfile
import unittest
from collections import Counter
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
#: Folders and files with a common limit.
GROUPS = {
    "program": ("src", "ffi", "scripts", "docs", "README.md", "CONTRIBUTING.md"),
    "tests": ("tests",),
}
#: This file quotes the patterns.
SKIPPED = {"tests/python/test_language.py"}
#: Largest number of findings per group: of all SENTENCES together, and of sentences that begin with "What".
MAX_FINDINGS = 20
MAX_WHAT = 150

#: Kinds of text: doc comments and docstrings; all comments, docstrings and documents; other strings; code.
DOC, PROSE, STRING, CODE = "doc", "prose", "string", "code"


class Pattern(NamedTuple):
    """`expression` is searched in lines of these `kinds` of text. `instead` is the plain alternative."""

    name: str
    expression: re.Pattern
    kinds: tuple
    instead: str


def identifiers(*names):
    """A pattern for names in code, also as a part of a snake_case name."""
    return re.compile(rf"(?<![A-Za-z0-9])(?:{'|'.join(names)})(?![A-Za-z0-9])")


CANDIDATE = "candidate (compared by `auto`), technique (weighted by MIS) or method (chosen by the user)"
BEGINS, TOLD, SO_MANY, WAY, WHAT, IDENTIFIER = "begins without a noun", "told", "so many", "way", "What", "identifier"
#: The patterns that share MAX_FINDINGS.
SENTENCES = (BEGINS, TOLD, SO_MANY, WAY)
PATTERNS = (
    Pattern(
        BEGINS,
        re.compile(r"^(?:The same|Those|That of|Of)\b"),
        (DOC,),
        "name the thing: 'The bandwidths of ...', not 'Those of ...'",
    ),
    Pattern(
        TOLD,
        identifiers("told", "Told", "TOLD"),
        (PROSE, STRING, CODE),
        "estimated error, error estimate, error coverage; or given, asked, reported",
    ),
    Pattern(
        SO_MANY,
        re.compile(r"\b[Ss]o many\b(?! (?:[\w-]+ ){0,4}that\b)|(?<!times )\b[Aa]s many\b"),
        (PROSE, STRING),
        "name the quantity: '`samples` per pixel', 'at most `MAX_LEVELS` levels'",
    ),
    Pattern(
        WAY,
        re.compile(r"\b[Ww]ays? (?:to|of) (?:render|sampl|estimat|weigh|connect|gather)\w*"),
        (PROSE, STRING),
        CANDIDATE,
    ),
    Pattern(WAY, re.compile(r"\bStrategy\b|(?<!\w)(?:ways?|WAYS?)(?!\w)"), (CODE,), CANDIDATE),
    Pattern(
        IDENTIFIER,
        identifiers("Mark", "Comb", "Meets", "Watch", "Glow", "hue", "sight", "bodiless", "[Ss]urroundings", "dearer"),
        (CODE,),
        "the field's term, see the glossary in docs/architecture.md",
    ),
    Pattern(
        WHAT,
        re.compile(r"(?:^|[.:;] )(?:What|Whatever)\b(?![^.]*\?)"),
        (PROSE,),
        "a noun and an active verb: 'The observer rejects the scene', not 'What is looked at will not do'",
    ),
)
#: Right uses: (path, part of the line).
ALLOWED = {
    ("scripts/lab/figures/calibration.py", "told"),  # a key of stored figures, here and below
    ("scripts/lab/figures/target.py", "told"),
    ("scripts/lab/tables/accuracy_tables.py", "told"),
    ("src/image/tonemap.rs", "hue"),  # the hue of a colour
    ("scripts/lab/features/torture_textures.py", "hue_saturation"),  # Blender's node
}


class Finding(NamedTuple):
    """A line that matches a pattern."""

    pattern: Pattern
    path: str
    line: int
    text: str

    def __str__(self):
        return f"{self.path}:{self.line}: {self.pattern.name}: {self.text}\n    better: {self.pattern.instead}"


#: Comments, strings and characters of Rust.
RUST = re.compile(
    r"(?P<comment>//[^\n]*|/\*.*?\*/)|(?P<string>b?r(?P<hashes>#*)\".*?\"(?P=hashes)|b?\"(?:\\.|[^\"\\])*\")"
    r"|b?'(?:\\.|[^'\\])'",
    re.DOTALL,
)
#: Comments and strings of Python.
PYTHON = re.compile(
    r"(?P<comment>#[^\n]*)|(?P<string>\b[rbfRBF]{0,2}(?:\"\"\".*?\"\"\"|'''.*?'''|\"(?:\\.|[^\"\\\n])*\"|"
    r"'(?:\\.|[^'\\\n])*')|(?:\"\"\".*?\"\"\"|'''.*?'''|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'))",
    re.DOTALL,
)
#: Comments of shell scripts, awk and requirements.
SHELL = re.compile(r"(?P<comment>(?:^|(?<=\s))#[^\n]*)(?P<string>)", re.MULTILINE)
SYNTAX = {".rs": RUST, ".py": PYTHON, ".pyi": PYTHON, ".sh": SHELL, ".awk": SHELL, ".toml": SHELL, ".in": SHELL}
#: The beginning of a comment or docstring, with the bullet of a list.
LEADER = re.compile(r"^\s*(?:///|//!|//|/?\*+/?|#[:!]?|[rbf]?(?:\"\"\"|'''))?\s*(?:[-*] )?")


def document_lines(text):
    """The lines of a Markdown document without headings, code and addresses: (kinds, number, text)."""
    in_code = False
    for number, line in enumerate(text.split("\n"), 1):
        if line.lstrip().startswith("```"):
            in_code = not in_code
        elif not in_code and not line.startswith("#"):
            yield (PROSE,), number, LEADER.sub("", re.sub(r"`[^`]*`|\]\([^)]*\)", "`", line))


def source_lines(text, syntax):
    """The lines of comments, strings and code: (kinds, number, text without leaders)."""
    code, end, number = [], 0, 1
    for match in syntax.finditer(text):
        before, token = text[end : match.start()], match[0]
        number += before.count("\n")
        end = match.end()
        code += [before, " ", "\n" * token.count("\n")]
        if match["comment"]:
            kinds = (DOC, PROSE) if token.startswith(("///", "//!", "#:")) else (PROSE,)
        elif match["string"]:
            first = not text[text.rfind("\n", 0, match.start()) + 1 : match.start()].strip()
            kinds = (DOC, PROSE) if syntax is PYTHON and first and token.startswith('"""') else (STRING,)
        else:
            kinds = ()
        lines = token.split("\n") if kinds else ()
        yield from ((kinds, number + at, LEADER.sub("", line)) for at, line in enumerate(lines))
        number += token.count("\n")
    code.append(text[end:])
    yield from (((CODE,), at, line.strip()) for at, line in enumerate("".join(code).split("\n"), 1))


def search(path, name):
    """The findings in a file. `name`: its path relative to the project."""
    text = path.read_text(encoding="utf-8")
    lines = document_lines(text) if path.suffix == ".md" else source_lines(text, SYNTAX[path.suffix])
    for kinds, number, line in lines:
        for pattern in PATTERNS:
            if any(kind in pattern.kinds for kind in kinds) and pattern.expression.search(line):
                if not any(name == place and part in line for place, part in ALLOWED):
                    yield Finding(pattern, name, number, line)


def findings(places):
    """The findings in folders and files of the project."""
    for place in places:
        paths = [ROOT / place] if (ROOT / place).is_file() else sorted((ROOT / place).rglob("*"))
        for path in paths:
            name = path.relative_to(ROOT).as_posix()
            if path.suffix in {*SYNTAX, ".md"} and name not in SKIPPED and path.is_file():
                yield from search(path, name)


class Language(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.found = {group: list(findings(places)) for group, places in GROUPS.items()}

    def check(self, names, most):
        """Each group has at most `most` findings of these patterns."""
        for group, found in self.found.items():
            lines = [str(finding) for finding in found if finding.pattern.name in names]
            with self.subTest(group):
                self.assertLessEqual(len(lines), most, "\n".join(["", *lines]))

    def test_sentences_name_their_subjects_and_quantities(self):
        self.check(SENTENCES, MAX_FINDINGS)

    def test_identifiers_are_terms_of_the_field(self):
        self.check((IDENTIFIER,), 0)

    def test_allowed_lines_exist(self):
        for path, part in ALLOWED:
            self.assertIn(part, (ROOT / path).read_text(encoding="utf-8"), path)

    def test_few_sentences_begin_with_what(self):
        self.check((WHAT,), MAX_WHAT)


class Patterns(unittest.TestCase):
    """Planted lines are found, and ordinary English is not."""

    PLANTED = (
        (BEGINS, "a.rs", "  /// Those of a vertex.", "/// Of a path.", "//! The same, later.", "/// That of a light."),
        (BEGINS, "a.py", 'def f():\n    """The same, later."""', "#: Of a path.\nN = 1", '"""\nThose of a path.\n"""'),
        (TOLD, "a.rs", "let told = 1;", "// The error told.", "fn told_error() {}", 'let s = "it is told";'),
        (TOLD, "a.md", "The error told is small."),
        (TOLD, "a.sh", "x=1 # the error told"),
        (TOLD, "a.py", "told = 1", "s = f'it is told'"),
        (SO_MANY, "a.rs", "/// Stops after so many.", "// As many as there are.", 'let s = r#"of so many pixels"#;'),
        (SO_MANY, "a.md", "It takes as many samples as pixels."),
        (SO_MANY, "a.py", 'def f():\n    """Stops after so many iterations."""'),
        (WAY, "a.rs", "/// A way to render.", "let way = 1;", "struct Strategy;", "const WAYS: u32 = 1;"),
        (WAY, "a.py", "for way in ways:\n    pass"),
        (IDENTIFIER, "a.rs", "struct Mark;", "let sight = 1;", "fn with_hue() {}", "impl Watch for A {}"),
        (WHAT, "a.rs", "/// What a pixel holds.", "// Whatever is left.", "/// A pixel. What it holds."),
        (WHAT, "a.md", "What is lost is named.", "- Whatever is lost."),
        (WHAT, "a.sh", "# What is missing"),
        (WHAT, "a.py", 'def f():\n    """What is left."""'),
    )
    ORDINARY = {
        "a.rs": "// By the way, half-way there: there is no way back.\n/// Seen the other way round.\n"
        "/// There are so many small lights that the tree is deep.\n/// Offers `what`.\nlet two_way = '\"';\n"
        "let mark = 1; // untold\nlet url = \"https://example.org/what\";\n/// Which of those it takes.\n",
        "a.md": "# What is a caustic?\n\nWhat is a caustic? Light.\n```\nWhat told so many\n```\n`told` is a name.\n"
        "Four times as many paths.\n",
        "a.py": '"""Compares what is left."""\n\nNAME = "Those are strings"\n',
    }

    def search(self, name, text):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            path.write_text(text, encoding="utf-8")
            return [(finding.pattern.name, finding.line) for finding in search(path, name)]

    def test_planted_lines_are_found(self):
        self.assertEqual({pattern for pattern, *_ in self.PLANTED}, {pattern.name for pattern in PATTERNS})
        for pattern, name, *texts in self.PLANTED:
            for text in texts:
                with self.subTest(pattern, file=name, text=text):
                    self.assertIn(pattern, [found for found, _ in self.search(name, f"\n{text}\n")])

    def test_ordinary_english_is_not_found(self):
        for name, text in self.ORDINARY.items():
            with self.subTest(name):
                self.assertEqual(self.search(name, text), [])

    def test_a_finding_names_the_file_the_line_the_pattern_and_the_alternative(self):
        text = str(Finding(PATTERNS[1], "src/a.rs", 7, "The error told."))
        self.assertEqual(text, f"src/a.rs:7: told: The error told.\n    better: {PATTERNS[1].instead}")


def report(places):
    """Print the number of findings per folder, and the findings below `places`."""
    counts, found = {}, [finding for group in GROUPS.values() for finding in findings(group)]
    for finding in found:
        counts.setdefault("/".join(Path(finding.path).parts[:2]), Counter())[finding.pattern.name] += 1
    for folder, patterns in sorted(counts.items()):
        print(f"{folder:<24}" + ", ".join(f"{name}: {count}" for name, count in sorted(patterns.items())))
    print(f"{'all':<24}" + ", ".join(f"{k}: {v}" for k, v in sorted(sum(counts.values(), Counter()).items())))
    for finding in found:
        if finding.path.startswith(places):
            print(finding)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--report"]:
        report(tuple(sys.argv[2:]) or ("no folder",))
    else:
        unittest.main()
