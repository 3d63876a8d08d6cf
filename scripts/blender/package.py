"""Build the zip of the Blender add-on: an add-on for Blender 3.4, an extension for 4.2 and newer.

    python3 scripts/blender/package.py OUT.zip

The zip holds one folder: the add-on, the exporter that it runs in a second Blender process, and the licences.
"""

import modulefinder
import os
import sys
import zipfile

_HERE = os.path.dirname(os.path.realpath(__file__))
_ROOT = os.path.dirname(os.path.dirname(_HERE))
_NAME = "caustique"
_DAY = (1980, 1, 1, 0, 0, 0)  # a constant time, so that equal files give equal zips; the earliest that zip supports


def contents():
    """The contents of the zip: {name in the zip: source file}."""
    addon = os.path.join(_HERE, "caustique_addon")
    files = {name: os.path.join(addon, name) for name in os.listdir(addon) if name.endswith((".py", ".toml", ".json"))}
    files.update((f"exporter/{os.path.basename(source)}", source) for source in _exporter())
    files.update((name, os.path.join(_ROOT, name)) for name in ("LICENSE-MIT", "LICENSE-APACHE"))
    return {f"{_NAME}/{name}": files[name] for name in sorted(files)}


def _exporter():
    """export.py and the scripts that it imports, at load time or later."""
    script = os.path.join(_HERE, "export.py")
    finder = modulefinder.ModuleFinder([_HERE])
    finder.run_script(script)
    beside = (found.__file__ for found in finder.modules.values())
    return {script, *(source for source in beside if source is not None)}  # built-in modules have no file


def build(path):
    """Write the zip to `path`."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, source in contents().items():
            with open(source, "rb") as file:
                archive.writestr(zipfile.ZipInfo(name, _DAY), file.read(), zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    if len(sys.argv) != 2 or not sys.argv[1].endswith(".zip"):
        sys.exit("usage: package.py OUT.zip")
    build(sys.argv[1])
