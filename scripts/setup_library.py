#!/usr/bin/env python3
"""Finds a shared library that the program loads at run time, or unpacks one from a wheel.

Prints "VERSION PATH" and exits with 0 if a library of a supported version loads, else with 1. The search order is the
program's: the environment variable, the loader's search path, the folder in .deps.

    setup_library.py onnxruntime|oidn                 find
    setup_library.py onnxruntime|oidn unpack WHEEL    copy the needed files of the wheel to .deps, then find
"""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from collections.abc import Callable

ROOT = Path(__file__).resolve().parent.parent


class ApiBase(ctypes.Structure):
    """OrtApiBase of onnxruntime_c_api.h: two function pointers."""

    _fields_ = [
        ("get_api", ctypes.c_void_p),
        ("get_version_string", ctypes.CFUNCTYPE(ctypes.c_char_p)),
    ]


def onnxruntime_version(library):
    base = library.OrtGetApiBase
    base.restype = ctypes.POINTER(ApiBase)
    return base().contents.get_version_string().decode()


def oidn_version(library):
    """The version from a CPU device, which also tests that the library's other files load."""
    new, get, release = library.oidnNewDevice, library.oidnGetDeviceInt, library.oidnReleaseDevice
    new.restype, new.argtypes = ctypes.c_void_p, [ctypes.c_int]
    get.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
    release.argtypes = [ctypes.c_void_p]
    device = new(1)
    if not device:
        return None
    parts = [get(device, b"version" + part) for part in (b"Major", b"Minor", b"Patch")]
    release(device)
    # Major versions after 2 may have another interface.
    return ".".join(map(str, parts)) if parts[0] <= 2 else None


@dataclass
class Library:
    title: str
    variable: str
    # Names for the loader, best first.
    names: list[str]
    # Prefix of the names of all files of this library.
    stem: str
    folder: Path
    oldest: tuple[int, int]
    # Returns the version that an open library reports.
    version: Callable[[ctypes.CDLL], str | None]
    # Needed files of the wheel: (name, suffix of its path there). First the library, then the files that it loads.
    inside: list[tuple[str, str]]


LIBRARIES = {
    "onnxruntime": Library(
        title="ONNX Runtime",
        variable="CAUSTIQUE_ONNXRUNTIME",
        names=["libonnxruntime.so", "libonnxruntime.so.1"],
        stem="libonnxruntime.so",
        folder=ROOT / ".deps" / "onnxruntime",
        # The program's interface version (the crate's feature `api-17`).
        oldest=(1, 17),
        version=onnxruntime_version,
        inside=[("libonnxruntime.so", r"\.[0-9.]+")],
    ),
    "oidn": Library(
        title="Open Image Denoise",
        variable="CAUSTIQUE_OIDN",
        names=["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"],
        stem="libOpenImageDenoise.so",
        # Its files search for each other in ../lib relative to their folder, so the folder's name matters.
        folder=ROOT / ".deps" / "oidn" / "lib",
        oldest=(2, 0),
        version=oidn_version,
        inside=[
            ("libOpenImageDenoise.so", r"\.\d+\.\d+\.\d+"),
            ("libOpenImageDenoise_core.so", r"\.\d+\.\d+\.\d+"),
            ("libOpenImageDenoise_device_cpu.so", r"\.\d+\.\d+\.\d+"),
            ("libtbb.so", r"\.\d+"),
        ],
    ),
}


def candidates(wanted):
    """Paths and sonames to try, in the program's order."""
    named = os.environ.get(wanted.variable)
    if named:
        return [named]
    found = list(wanted.names)
    ldconfig = shutil.which("ldconfig", path=os.environ.get("PATH", "") + ":/sbin:/usr/sbin")
    if ldconfig:
        cache = subprocess.run([ldconfig, "-p"], capture_output=True, text=True, check=False).stdout
        found += re.findall(rf"=> (\S*/{re.escape(wanted.stem)}\S*)", cache)
    found += sorted(str(path) for path in wanted.folder.glob(f"{wanted.stem}*"))
    return found


def version(wanted, library):
    """The version that the library reports, or None if it does not load."""
    try:
        return wanted.version(ctypes.CDLL(library))
    except (OSError, AttributeError):
        return None


def find(wanted):
    """The first usable library as (version, path), or None."""
    for library in candidates(wanted):
        text = version(wanted, library)
        if text is None:
            continue
        if tuple(int(part) for part in text.split(".")[:2]) >= wanted.oldest:
            return text, library
        oldest = ".".join(map(str, wanted.oldest))
        print(f"{library}: {wanted.title} {text} is older than {oldest}", file=sys.stderr)
    return None


def unpack(wanted, wheel):
    """Copy the needed files from the wheel, and link the library's names to its file."""
    with zipfile.ZipFile(wheel) as archive:
        members = []
        for name, number in wanted.inside:
            matching = [n for n in archive.namelist() if re.fullmatch(f".*/{re.escape(name)}{number}", n)]
            if len(matching) != 1:
                sys.exit(f"{wheel}: one {name} expected, found {matching}")
            members += matching
        wanted.folder.mkdir(parents=True, exist_ok=True)
        partial = wanted.folder / ".partial"
        # Copy the library last: if it exists, all files that it needs exist, too.
        for member in reversed(members):
            with archive.open(member) as source, open(partial, "wb") as sink:
                shutil.copyfileobj(source, sink)
            partial.replace(wanted.folder / Path(member).name)
    for name in {wanted.stem, wanted.names[0]}:
        link = wanted.folder / name
        link.unlink(missing_ok=True)
        link.symlink_to(Path(members[0]).name)


def main():
    arguments = sys.argv[1:]
    wanted = LIBRARIES.get(arguments[0]) if arguments else None
    if wanted and len(arguments) == 3 and arguments[1] == "unpack":
        unpack(wanted, arguments[2])
    elif not wanted or len(arguments) != 1:
        sys.exit(__doc__)
    found = find(wanted)
    if not found:
        sys.exit(1)
    print(*found)


if __name__ == "__main__":
    main()
