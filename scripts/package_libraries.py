#!/usr/bin/env python3
"""Copies Embree, Open Image Denoise, TBB and ONNX Runtime from Python wheels into a package, with their notices.

    package_libraries.py SYSTEM WHEELS LIBRARIES NOTICES

SYSTEM is one of those in LIBRARIES. WHEELS is a folder with the wheels of embreex, pyoidn and onnxruntime, and for
Windows of msvc-runtime. On Linux and Windows, Embree and Open Image Denoise share the newer one of their TBBs. On Linux
it gets a name of its own, so that another TBB in a process does not replace it, and each library finds the others in
its folder; this needs patchelf. On macOS nothing may be changed in a signed library, so each has its own TBB.
"""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TBB = "libtbb-caustique.so.12"
#: For each system and wheel: patterns of its libraries, and their names in the package (None: the name in the
#: wheel; FOLDER/: that name in a folder).
LIBRARIES = {
    "linux-x86_64": {
        "embreex": {r"embreex\.libs/libembree4-[0-9a-f]+\.so\.4": "libembree4.so.4"},
        "pyoidn": {
            r"pyoidn/oidn/lib/libOpenImageDenoise\.so\.\d+\.\d+\.\d+": None,
            r"pyoidn/oidn/lib/libOpenImageDenoise_core\.so\.\d+\.\d+\.\d+": None,
            r"pyoidn/oidn/lib/libOpenImageDenoise_device_cpu\.so\.\d+\.\d+\.\d+": None,
            r"pyoidn/oidn/lib/libtbb\.so\.12\.\d+": TBB,
        },
        "onnxruntime": {r"onnxruntime/capi/libonnxruntime\.so\.\d+\.\d+\.\d+": None},
    },
    # There are no wheels of Embree and Open Image Denoise.
    "linux-aarch64": {"onnxruntime": {r"onnxruntime/capi/libonnxruntime\.so\.\d+\.\d+\.\d+": None}},
    "windows-x86_64": {
        "embreex": {r"embreex\.libs/embree4\.dll": None, r"embreex\.libs/msvcp140-[0-9a-f]+\.dll": None},
        "pyoidn": {
            r"pyoidn/oidn/bin/OpenImageDenoise\.dll": None,
            r"pyoidn/oidn/bin/OpenImageDenoise_core\.dll": None,
            r"pyoidn/oidn/bin/OpenImageDenoise_device_cpu\.dll": None,
            r"pyoidn/oidn/bin/tbb12\.dll": None,
        },
        "onnxruntime": {r"onnxruntime/capi/onnxruntime\.dll": None},
        "msvc_runtime": {
            rf"msvc_runtime-[^/]*/data/Scripts/{name}\.dll": None
            for name in ("msvcp140", "msvcp140_1", "vcruntime140", "vcruntime140_1")},
    },
    "macos-aarch64": {
        "embreex": {r"embreex/\.dylibs/libembree4\.\d+\.dylib": None, r"embreex/\.dylibs/libtbb\.12\.\d+\.dylib": None},
        # Its libraries find each other in "../lib".
        "pyoidn": {
            r"pyoidn/oidn/lib/libOpenImageDenoise\.2\.dylib": "lib/",
            r"pyoidn/oidn/lib/libOpenImageDenoise_core\.\d+\.\d+\.\d+\.dylib": "lib/",
            r"pyoidn/oidn/lib/libOpenImageDenoise_device_cpu\.\d+\.\d+\.\d+\.dylib": "lib/",
            r"pyoidn/oidn/lib/libOpenImageDenoise_device_metal\.\d+\.\d+\.\d+\.dylib": "lib/",
            r"pyoidn/oidn/lib/libtbb\.12\.dylib": "lib/",
        },
        "onnxruntime": {r"onnxruntime/capi/libonnxruntime\.\d+\.\d+\.\d+\.dylib": None},
    },
}
#: Notices in the wheel of ONNX Runtime. Those of the others are in scripts/notices.
NOTICES = {"onnxruntime/LICENSE": "onnxruntime-licence.txt", "onnxruntime/ThirdPartyNotices.txt": "onnxruntime.txt"}
README = """\
caustique is under MIT or Apache-2.0, at your choice (LICENSE-MIT, LICENSE-APACHE). This package also contains

%s
The files in the last column hold the notices of the parts that they contain.
"""
#: The wheel of each part (None: it is in the program), and the line about it.
PARTS = (
    ("embreex", "Embree                Apache-2.0 (LICENSE-APACHE)     embree.txt"),
    ("pyoidn", "Open Image Denoise    Apache-2.0 (LICENSE-APACHE)     oidn.txt"),
    ("pyoidn", "oneTBB                Apache-2.0 (LICENSE-APACHE)     tbb.txt"),
    ("onnxruntime", "ONNX Runtime          MIT (onnxruntime-licence.txt)   onnxruntime.txt"),
    (None, "Rust libraries        each under its own licence      rust.txt"),
)
#: The end of that text.
CHANGES = {
    "linux": """\
File names and search paths in these libraries were changed, so that they find each other in this package; nothing else
was.
""",
    "windows": """\
The libraries are unchanged. msvcp140*.dll and vcruntime140*.dll are Microsoft's runtime of Visual C++, distributed as
its licence allows.
""",
    "macos": "The libraries are unchanged.\n",
}


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
    system = sys.argv[1]
    wheels, libraries, notices = map(Path, sys.argv[2:])
    libraries.mkdir(parents=True)
    notices.mkdir(parents=True)
    for package, wanted in LIBRARIES[system].items():
        with wheel_of(wheels, package) as archive:
            for pattern, name in wanted.items():
                member = member_of(archive, pattern)
                library = libraries / (f"{name or ''}{Path(member).name}" if (name or "/").endswith("/") else name)
                library.parent.mkdir(exist_ok=True)
                copy(archive, member, library)
                if system.startswith("linux"):
                    relocate(library)
            for member in NOTICES.keys() & set(archive.namelist()):
                copy(archive, member, notices / NOTICES[member])
    for source in [*ROOT.glob("scripts/notices/*.txt"), *ROOT.glob("LICENSE-*")]:
        shutil.copy(source, notices)
    parts = "".join(f"    {line}\n" for wheel, line in PARTS if wheel is None or wheel in LIBRARIES[system])
    (notices / "README.txt").write_text(README % parts + CHANGES[system.split("-")[0]], encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[1] not in LIBRARIES:
        sys.exit(__doc__)
    main()
