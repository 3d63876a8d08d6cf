"""Draws lines for a reading test: doc comments with their line of code, and sentences of the pages for users.

Two readers who do not know the project mark each item as clear at first reading (c), guessed in part (g) or lost (l).
They see the printed lines and nothing else. Draw anew, with another seed, for each test.
"""

import ast
import random
import re

from ..options import options
from ..record import ROOT

ARGUMENTS = {"seed": 1}
COMMENTS, SENTENCES = 20, 10
#: Pages of docs/ for developers, which the drawn sentences leave out.
DEVELOPERS_PAGES = {"architecture.md", "researchers.md", "theory.md"}
MIN_WORDS = 5


def rust_comments(path):
    """Each doc comment (`///`) of a Rust file with the line of code that it describes."""
    comment = []
    for line in path.read_text(encoding="utf-8").split("\n"):
        text = line.strip()
        if text.startswith("///"):
            comment.append(text)
        elif comment and not text.startswith("#["):
            yield "\n".join([*comment, text])
            comment = []


def python_docstrings(path):
    """Each docstring of a function or class of a Python file, below its first line of code."""
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)) and ast.get_docstring(node):
            yield f'{text.splitlines()[node.lineno - 1].strip()}\n    """{ast.get_docstring(node)}"""'


def sentences(path):
    """The sentences of a page, without headings, tables and code blocks."""
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for paragraph in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", text):
        paragraph = " ".join(paragraph.split())
        if not re.match(r"[#|<!]", paragraph):
            paragraph = re.sub(r"\]\([^)]*\)", "]", re.sub(r"^(?:[-*]|\d+\.) ", "", paragraph))
            yield from (one for one in re.split(r"(?<=[.?!]) (?=[A-Z`\[])", paragraph) if len(one.split()) >= MIN_WORDS)


def comments():
    """All doc comments of src and ffi, and docstrings of scripts, without those of tests."""
    rust = [path for place in ("src", "ffi") for path in sorted((ROOT / place).rglob("*.rs"))]
    rust = [path for path in rust if not {"tests", "target"} & set(path.parts) and path.stem != "tests"]
    python = sorted((ROOT / "scripts").rglob("*.py"))
    return [item for path in rust for item in rust_comments(path)] + [
        item for path in python for item in python_docstrings(path)
    ]


def main():
    draw = random.Random(options.seed)
    pages = [ROOT / "README.md", *(p for p in sorted((ROOT / "docs").glob("*.md")) if p.name not in DEVELOPERS_PAGES)]
    drawn = [
        *draw.sample(comments(), COMMENTS),
        *draw.sample([sentence for page in pages for sentence in sentences(page)], SENTENCES),
    ]
    for number, item in enumerate(drawn, 1):
        print(f"{number}.\n{item}\n")
