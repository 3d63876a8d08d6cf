"""Build the zip of the Blender add-on: an add-on for Blender 3.4, an extension for 4.2 and newer.

    python3 scripts/blender/package.py OUT.zip [--wheel WHEEL]

The zip holds one folder: the add-on, the exporter that it runs in a second Blender process, and the licences. With a
wheel of scripts/package.sh it also holds the program and its libraries, which Blender 4.2 and newer install with it,
and is for the system of the wheel alone.
"""

import argparse
import modulefinder
import os
import zipfile

_HERE = os.path.dirname(os.path.realpath(__file__))
_ROOT = os.path.dirname(os.path.dirname(_HERE))
_NAME = "caustique"
_MANIFEST = "blender_manifest.toml"
#: Blender's names of the platforms, by the begin of a wheel's platform.
_PLATFORMS = {"manylinux": "linux-x64", "win": "windows-x64", "macosx": "macos-arm64"}
_DAY = (1980, 1, 1, 0, 0, 0)  # a constant time, so that equal files give equal zips; the earliest that zip supports


def contents():
    """The contents of the zip: {name in the zip: source file}."""
    addon = os.path.join(_HERE, "caustique_addon")
    files = {name: os.path.join(addon, name) for name in os.listdir(addon) if name.endswith((".py", ".toml", ".json"))}
    presets = os.path.join(addon, "presets")
    files.update((f"presets/{name}", os.path.join(presets, name)) for name in os.listdir(presets) if name.endswith(".py"))
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


def build(path, wheel=None):
    """Write the zip to `path`, with a wheel that contains the program if `wheel` names one."""
    files = {name: _read(source) for name, source in contents().items()}
    if wheel is not None:
        name = os.path.basename(wheel)
        manifest = f"{_NAME}/{_MANIFEST}"
        # A key after the table [permissions] would belong to that table.
        begin = next(begin for begin in _PLATFORMS if name.split("-")[-1].startswith(begin))
        files[manifest] = f'wheels = ["./wheels/{name}"]\nplatforms = ["{_PLATFORMS[begin]}"]\n'.encode() + files[manifest]
        files[f"{_NAME}/wheels/{name}"] = _read(wheel)
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            # A wheel is compressed already.
            packing = zipfile.ZIP_STORED if name.endswith(".whl") else zipfile.ZIP_DEFLATED
            archive.writestr(zipfile.ZipInfo(name, _DAY), data, packing)


def _read(path):
    with open(path, "rb") as file:
        return file.read()


def main():
    """Parse the command line and write the zip."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", metavar="OUT.zip")
    parser.add_argument("--wheel", help="a wheel of scripts/package.sh")
    arguments = parser.parse_args()
    if not arguments.out.endswith(".zip"):
        parser.error("the output must end in .zip")
    build(arguments.out, arguments.wheel)


if __name__ == "__main__":
    main()
