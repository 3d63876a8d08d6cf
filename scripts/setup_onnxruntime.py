#!/usr/bin/env python3
"""Finds a shared library of ONNX Runtime that the program can use, or unpacks one from a wheel.

Prints "VERSION PATH" and exits 0 when a library of at least version 1.17 loads; exits 1 otherwise. The search order is
the program's own: $CAUSTIQUE_ONNXRUNTIME, the loader's search path, .deps/onnxruntime.

    setup_onnxruntime.py                 find
    setup_onnxruntime.py unpack WHEEL    put the wheel's library into .deps/onnxruntime, then find
"""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UNPACKED = ROOT / ".deps" / "onnxruntime"
# The interface that the program asks for (the crate's feature `api-17`).
OLDEST = (1, 17)


class ApiBase(ctypes.Structure):
    """OrtApiBase of onnxruntime_c_api.h: two function pointers."""

    _fields_ = [
        ("get_api", ctypes.c_void_p),
        ("get_version_string", ctypes.CFUNCTYPE(ctypes.c_char_p)),
    ]


def candidates():
    """Paths and sonames to try, the program's order."""
    named = os.environ.get("CAUSTIQUE_ONNXRUNTIME")
    if named:
        return [named]
    found = ["libonnxruntime.so", "libonnxruntime.so.1"]
    ldconfig = shutil.which("ldconfig", path=os.environ.get("PATH", "") + ":/sbin:/usr/sbin")
    if ldconfig:
        cache = subprocess.run([ldconfig, "-p"], capture_output=True, text=True, check=False).stdout
        found += re.findall(r"=> (\S*/libonnxruntime\.so\S*)", cache)
    found += sorted(str(path) for path in UNPACKED.glob("libonnxruntime.so*"))
    return found


def version(library):
    """The version that the library reports, or None if it does not load."""
    try:
        base = ctypes.CDLL(library).OrtGetApiBase
    except (OSError, AttributeError):
        return None
    base.restype = ctypes.POINTER(ApiBase)
    return base().contents.get_version_string().decode()


def find():
    """The first usable library as (version, path), or None."""
    for library in candidates():
        text = version(library)
        if text is None:
            continue
        if tuple(int(part) for part in text.split(".")[:2]) >= OLDEST:
            return text, library
        print(f"{library}: ONNX Runtime {text} is older than {OLDEST[0]}.{OLDEST[1]}", file=sys.stderr)
    return None


def unpack(wheel):
    """Copies libonnxruntime.so.X.Y.Z from the wheel and links libonnxruntime.so to it."""
    with zipfile.ZipFile(wheel) as archive:
        inside = [n for n in archive.namelist() if re.fullmatch(r".*/libonnxruntime\.so\.[0-9.]+", n)]
        if len(inside) != 1:
            sys.exit(f"{wheel}: one libonnxruntime.so expected, found {inside}")
        UNPACKED.mkdir(parents=True, exist_ok=True)
        target = UNPACKED / Path(inside[0]).name
        partial = target.with_name(".partial")
        with archive.open(inside[0]) as source, open(partial, "wb") as sink:
            shutil.copyfileobj(source, sink)
    partial.replace(target)
    link = UNPACKED / "libonnxruntime.so"
    link.unlink(missing_ok=True)
    link.symlink_to(target.name)


def main():
    if len(sys.argv) == 3 and sys.argv[1] == "unpack":
        unpack(sys.argv[2])
    elif len(sys.argv) != 1:
        sys.exit(__doc__)
    found = find()
    if not found:
        sys.exit(1)
    print(*found)


if __name__ == "__main__":
    main()
