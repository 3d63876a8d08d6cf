"""Build the add-on for Blender: one zip for 3.4 (Preferences > Add-ons > Install) and for 4.2 and newer (Install from Disk).

    python3 scripts/blender/package.py OUT.zip

The zip holds one folder: the add-on, the exporter that it runs in a Blender of its own, and the licences.
"""

import os
import sys
import zipfile

_HERE = os.path.dirname(os.path.abspath(__file__))
_ROOT = os.path.dirname(os.path.dirname(_HERE))
_NAME = "caustique"
#: Scripts beside the exporter that it does not import.
_NOT_EXPORTER = {"build.py", "package.py"}
_DAY = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can name: the same files give the same zip


def contents():
    """What the zip holds: names in it, and the files they come from."""
    files = {}
    for folder, names, inside in (
        (os.path.join(_HERE, "caustique_addon"), None, ""),
        (_HERE, None, "exporter"),
        (_ROOT, ("LICENSE-MIT", "LICENSE-APACHE"), ""),
    ):
        for name in sorted(names or os.listdir(folder)):
            if names or name.endswith((".py", ".toml")) and name not in _NOT_EXPORTER:
                files["/".join(filter(None, (_NAME, inside, name)))] = os.path.join(folder, name)
    return files


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
