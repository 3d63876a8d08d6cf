"""Finds the program and asks for its version, its options and its missing libraries."""

import functools
import importlib.util
import json
import os
import re
import shutil
import subprocess

from .fault import Fault

#: The oldest version whose command line is compatible with the add-on.
OLDEST = (0, 2, 0)
HOW_TO_GET_IT = ("install the extension that contains the program, or clone the repository of caustique, run "
                 "./scripts/demo.sh there, and choose target/release/caustique in the add-on's preferences")
_MAX_SECONDS = 60  # for an answer of the program


def find(chosen):
    """The path of the program: `chosen` in the preferences, else the one in the extension's wheel, else `caustique` on
    the PATH. Raises a Fault if it is too old."""
    path = os.path.expanduser(chosen) if chosen else _packaged() or shutil.which("caustique")
    if path is None:
        raise Fault("the program caustique is neither in the extension nor on the PATH", HOW_TO_GET_IT)
    if not os.path.isfile(path) or not os.access(path, os.X_OK):
        raise Fault(f"{path} is not a program", HOW_TO_GET_IT)
    found = version(path)
    if found < OLDEST:
        raise Fault(f"{path} is version {dotted(found)}, and the add-on needs {dotted(OLDEST)} or newer",
                    "update the repository, build it with 'cargo build --release', and choose the new program")
    return path


def _packaged():
    """The path of the program in the Python package `caustique`, which Blender installs from the extension's wheel; None
    without that package."""
    package = importlib.util.find_spec("caustique")
    for folder in (package and package.submodule_search_locations) or ():
        path = os.path.join(folder, "bin", "caustique.exe" if os.name == "nt" else "caustique")
        if os.path.isfile(path):
            if not os.access(path, os.X_OK):
                # Blender extracts wheels without permissions.
                os.chmod(path, 0o755)
            return path
    return None


def dotted(numbers):
    """A version as text, such as 1.2.3."""
    return ".".join(map(str, numbers))


def version(path):
    """The version of the program at `path`: three numbers."""
    said = _ask(path, "--version").stdout
    numbers = re.match(r"caustique (\d+)\.(\d+)\.(\d+)\S*(?: \(commit \S+\))?$", said, re.MULTILINE)
    if numbers is None:
        raise Fault(f"{path} does not answer as caustique does", HOW_TO_GET_IT)
    return tuple(map(int, numbers.groups()))


def options(path):
    """The options of the `render` command of the program at `path`, such as "--preview"."""
    return set(re.findall(r"--[a-z][a-z-]*", _ask(path, "render", "--help").stdout))


def missing_libraries(path):
    """A Fault for each library that the program cannot load; the add-on needs neither USD nor another Blender."""
    said = json.loads(_ask(path, "doctor", "--json").stdout)
    return [Fault(f"{name}: {found['cause']}", found.get("hint") or "") for name, found in said.items()
            if name not in {"usd", "blender"} and isinstance(found, dict) and not found["found"]]


def clear_cache():
    """Clear the cached answers, because a library may have been installed since."""
    _answer.cache_clear()


def _ask(path, *arguments):
    """The program's answer to these arguments, cached until its file changes."""
    return _answer(path, os.stat(path).st_mtime_ns, arguments)


@functools.lru_cache(maxsize=16)
def _answer(path, _changed, arguments):
    try:
        return subprocess.run([path, *arguments], capture_output=True, text=True, timeout=_MAX_SECONDS, check=False,
                              stdin=subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Fault(f"{path} does not run: {error}", HOW_TO_GET_IT) from error
