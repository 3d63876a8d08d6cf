#!/usr/bin/env python3
"""Checks the package for macOS without a Mac: how its files are linked and signed.

    tests/macos.py PACKAGES     PACKAGES is the folder with the archive and the wheel of
                                scripts/package.sh --target macos-aarch64

Each file is for Apple silicon, and has a signature with the right digest of each page, without which macOS kills it. Its
libraries belong to macOS or are in the package. The program and the module are linked for macOS 11; the module takes
symbols of Python, and no others, from the process that loads it. The last line counts the checks.
"""

import hashlib
import struct
import sys
import tarfile
import zipfile
from pathlib import Path

ARM64 = 0x0100000C
MAGIC, FAT_MAGIC = 0xFEEDFACF, 0xCAFEBABE
LOAD_DYLIB, WEAK_DYLIB, REEXPORT_DYLIB = 0xC, 0x80000018, 0x8000001F
SYMTAB, CODE_SIGNATURE, BUILD_VERSION, MIN_VERSION = 0x2, 0x1D, 0x32, 0x24
DYLD_INFO, DYLD_INFO_ONLY, EXPORTS_TRIE = 0x22, 0x80000022, 0x80000033
EMBEDDED_SIGNATURE, CODE_DIRECTORY, SHA256 = 0xFADE0CC0, 0xFADE0C02, 2
#: In a symbol's type: bits of the debugger, and of where it is defined. The library of a symbol of the loading process.
DEBUGGER, PLACE, DYNAMIC_LOOKUP = 0xE0, 0x0E, 0xFE
#: A function of each library of the package that the program calls.
EXPORTS = {"libembree4": "_rtcNewDevice", "libOpenImageDenoise.": "_oidnNewDevice", "libonnxruntime": "_OrtGetApiBase",
           "_native": "_PyInit__native"}
#: The macOS for which the program and the module are linked.
OLDEST = (11, 0)


class Linked:
    """A program or library in the format Mach-O: `data` are the bytes of its file."""

    def __init__(self, data):
        if struct.unpack_from(">I", data)[0] == FAT_MAGIC:
            count = struct.unpack_from(">I", data, 4)[0]
            parts = [struct.unpack_from(">5I", data, 8 + 20 * index) for index in range(count)]
            data = next(data[at:at + size] for kind, _, at, size, _ in parts if kind == ARM64)
        magic, self.processor, _, _, count, _, _, _ = struct.unpack_from("<8I", data)
        if magic != MAGIC:
            raise ValueError("it is not linked for macOS")
        self.data, self.libraries, self.exports, self.looked_up, self.digests = data, [], set(), [], None
        at = 32
        for _ in range(count):
            command, size = struct.unpack_from("<2I", data, at)
            words = struct.unpack_from(f"<{min(size // 4, 12) - 2}I", data, at + 8)
            if command in (LOAD_DYLIB, WEAK_DYLIB, REEXPORT_DYLIB):
                self.libraries.append(self.text(at + words[0]))
            elif command in (BUILD_VERSION, MIN_VERSION):
                version = words[1] if command == BUILD_VERSION else words[0]
                self.oldest = (version >> 16, version >> 8 & 0xFF)
            elif command == SYMTAB:
                self.read_symbols(*words[:3])
            elif command in (DYLD_INFO, DYLD_INFO_ONLY) and words[9]:
                self.read_exports(words[8], words[8], "")
            elif command == EXPORTS_TRIE and words[1]:
                self.read_exports(words[0], words[0], "")
            elif command == CODE_SIGNATURE:
                self.digests = self.check_signature(words[0])
            at += size

    def text(self, at):
        """The text at an offset, up to a zero."""
        return self.data[at:self.data.index(b"\0", at)].decode()

    def read_symbols(self, at, count, names):
        """Keep the names of the symbols that the loading process must have."""
        for index in range(count):
            name, kind, _, described, _ = struct.unpack_from("<IBBHQ", self.data, at + 16 * index)
            if not kind & (DEBUGGER | PLACE) and described >> 8 == DYNAMIC_LOOKUP:
                self.looked_up.append(self.text(names + name))

    def number(self, at):
        """A number of variable length, and the offset behind it."""
        value = shift = 0
        while True:
            byte = self.data[at]
            value, shift, at = value | (byte & 0x7F) << shift, shift + 7, at + 1
            if byte < 0x80:
                return value, at

    def read_exports(self, trie, node, prefix):
        """Keep the names of exported symbols, which are a tree of prefixes."""
        size, at = self.number(node)
        if size:
            self.exports.add(prefix)
        at += size
        children, at = self.data[at], at + 1
        for _ in range(children):
            label = self.text(at)
            child, at = self.number(at + len(label) + 1)
            self.read_exports(trie, trie + child, prefix + label)

    def check_signature(self, at):
        """Whether the signature has the digest of each page."""
        magic, _, count = struct.unpack_from(">3I", self.data, at)
        starts = [struct.unpack_from(">2I", self.data, at + 12 + 8 * index)[1] + at for index in range(count)]
        found = [start for start in starts if struct.unpack_from(">I", self.data, start)[0] == CODE_DIRECTORY]
        if magic != EMBEDDED_SIGNATURE:
            return False
        for start in found:
            first, _, _, slots, limit = struct.unpack_from(">5I", self.data, start + 16)
            length, kind, _, power = struct.unpack_from(">4B", self.data, start + 36)
            if kind != SHA256:  # Older systems read another directory.
                continue
            pages = [self.data[page:min(page + (1 << power), limit)] for page in range(0, limit, 1 << power)]
            stored = [self.data[start + first + length * slot:][:length] for slot in range(slots)]
            return limit == at and [hashlib.sha256(page).digest()[:length] for page in pages] == stored
        return False


def faults(name, file, names):
    """What is wrong with the file `name`, in a package that holds libraries of these `names`."""
    if file.processor != ARM64:
        yield "it is not for Apple silicon"
    if not file.digests:
        yield "its signature is missing or wrong"
    for library in file.libraries:
        is_own = library.startswith("@") and library.rsplit("/", 1)[1] in names
        if not is_own and not library.startswith(("/usr/lib/", "/System/Library/")):
            yield f"it needs {library}, which is neither in macOS nor in the package"
    ours = name.startswith(("caustique", "_native"))
    if ours and file.oldest > OLDEST:
        yield f"it needs macOS {file.oldest}"
    wrong = [symbol for symbol in file.looked_up if not (name.startswith("_native") and symbol.startswith(("_Py", "__Py")))]
    if ours and wrong:
        yield f"no library has {wrong}"
    for begin, symbol in EXPORTS.items():
        if name.startswith(begin) and symbol not in file.exports:
            yield f"it does not export {symbol}"


def contents(path):
    """The programs and libraries of a package: pairs of name and bytes."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    else:
        with tarfile.open(path) as archive:
            members = [(one.name, archive.extractfile(one).read()) for one in archive if one.isfile()]
    return {name: data for name, data in members if name.endswith(("/bin/caustique", ".so", ".dylib"))}


def main():
    folder, passed, failed = Path(sys.argv[1]), 0, 0
    for pattern, count in (("caustique-*-macos-aarch64.tar.gz", 1), ("caustique-*-macosx_13_0_arm64.whl", 2)):
        (path,) = folder.glob(pattern)
        files = {Path(name).name: Linked(data) for name, data in contents(path).items()}
        own = [name for name in files if name.startswith(("caustique", "_native"))]
        if len(own) != count or not all(any(name.startswith(begin) for name in files) for begin in list(EXPORTS)[:3]):
            sys.exit(f"{path}: the program, the module or a library is missing: {sorted(files)}")
        for name, file in files.items():
            wrong = list(faults(name, file, files))
            print(f"{path.suffix} {name}: macOS {file.oldest[0]}.{file.oldest[1]}, {len(file.data) >> 10} KiB, "
                  f"{len(file.exports)} exports; {'; '.join(wrong) or 'sound'}")
            passed, failed = passed + (not wrong), failed + bool(wrong)
            # A planted error: a byte of the first page is changed.
            changed = Linked(file.data[:2000] + bytes([file.data[2000] ^ 1]) + file.data[2001:])
            if changed.digests:
                sys.exit(f"{name}: the check of signatures accepts a changed file")
    print(f"{passed} passed, {failed} failed")
    sys.exit(failed > 0)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main()
