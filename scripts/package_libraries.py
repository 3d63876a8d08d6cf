#!/usr/bin/env python3
"""Copies Embree, Open Image Denoise, TBB and ONNX Runtime from Python wheels into a package, with their notices.

    package_libraries.py WHEELS LIBRARIES NOTICES

WHEELS is a folder with the wheels of embreex, pyoidn and onnxruntime. Embree and Open Image Denoise share the newer one
of their TBBs. It gets a name of its own, so that another TBB in a process does not replace it, and each library finds
the others in its folder. Needs patchelf.
"""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TBB = "libtbb-caustique.so.12"
#: For each wheel: patterns of its libraries, and their names in the package (None: the name in the wheel).
LIBRARIES = {
    "embreex": {r"embreex\.libs/libembree4-[0-9a-f]+\.so\.4": "libembree4.so.4"},
    "pyoidn": {
        r"pyoidn/oidn/lib/libOpenImageDenoise\.so\.\d+\.\d+\.\d+": None,
        r"pyoidn/oidn/lib/libOpenImageDenoise_core\.so\.\d+\.\d+\.\d+": None,
        r"pyoidn/oidn/lib/libOpenImageDenoise_device_cpu\.so\.\d+\.\d+\.\d+": None,
        r"pyoidn/oidn/lib/libtbb\.so\.12\.\d+": TBB,
    },
    "onnxruntime": {r"onnxruntime/capi/libonnxruntime\.so\.\d+\.\d+\.\d+": None},
}
#: Notices in the wheel of ONNX Runtime. Those of the others are in scripts/notices.
NOTICES = {"onnxruntime/LICENSE": "onnxruntime-licence.txt", "onnxruntime/ThirdPartyNotices.txt": "onnxruntime.txt"}
README = """\
caustique is under MIT or Apache-2.0, at your choice (LICENSE-MIT, LICENSE-APACHE). This package also contains

    Embree                Apache-2.0 (LICENSE-APACHE)     embree.txt
    Open Image Denoise    Apache-2.0 (LICENSE-APACHE)     oidn.txt
    oneTBB                Apache-2.0 (LICENSE-APACHE)     tbb.txt
    ONNX Runtime          MIT (onnxruntime-licence.txt)   onnxruntime.txt
    Rust libraries        each under its own licence      rust.txt

The files in the last column hold the notices of the parts that they contain. File names and search paths in these
libraries were changed, so that they find each other in this package; nothing else was.
"""


def run(*words):
    """Run patchelf and return what it prints."""
    return subprocess.run(["patchelf", *map(str, words)], check=True, capture_output=True, text=True).stdout


def wheel_of(wheels, name):
    """The only wheel of a package in a folder, open."""
    found = list(wheels.glob(f"{name}-*.whl"))
    if len(found) != 1:
        sys.exit(f"{wheels}: one wheel of {name} expected, found {found}")
    return zipfile.ZipFile(found[0])


def member_of(archive, pattern):
    """The only file in a wheel whose name matches."""
    found = [name for name in archive.namelist() if re.fullmatch(pattern, name)]
    if len(found) != 1:
        sys.exit(f"{archive.filename}: one {pattern} expected, found {found}")
    return found[0]


def copy(archive, member, target):
    """Copy a file of a wheel."""
    with archive.open(member) as source, target.open("wb") as sink:
        shutil.copyfileobj(source, sink)


def relocate(library):
    """Make a library find the others in its folder, under their names there."""
    if library.name in (TBB, "libembree4.so.4"):
        run("--set-soname", library.name, library)
    for needed in run("--print-needed", library).split():
        if needed.startswith("libtbb"):
            run("--replace-needed", needed, TBB, library)
    run("--force-rpath", "--set-rpath", "$ORIGIN", library)


def main():
    wheels, libraries, notices = map(Path, sys.argv[1:])
    libraries.mkdir(parents=True)
    notices.mkdir(parents=True)
    for package, wanted in LIBRARIES.items():
        with wheel_of(wheels, package) as archive:
            for pattern, name in wanted.items():
                member = member_of(archive, pattern)
                library = libraries / (name or Path(member).name)
                copy(archive, member, library)
                relocate(library)
            for member in NOTICES.keys() & set(archive.namelist()):
                copy(archive, member, notices / NOTICES[member])
    for source in [*ROOT.glob("scripts/notices/*.txt"), *ROOT.glob("LICENSE-*")]:
        shutil.copy(source, notices)
    (notices / "README.txt").write_text(README, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main()
