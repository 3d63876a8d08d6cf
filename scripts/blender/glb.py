"""Reads and writes the two chunks of a binary glTF file (glTF 2.0, section 4.4): a JSON document and a buffer."""

import json
import struct

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


def read(path):
    """Return (document, buffer) of the .glb at `path`; the buffer is b"" if the file has none."""
    with open(path, "rb") as file:
        data = file.read()
    magic, version, length = struct.unpack_from("<III", data)
    if magic != _MAGIC or version != 2 or length > len(data):
        raise ValueError(f"{path}: not a complete binary glTF 2.0 file")
    document, buffer, at = None, b"", 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8:at + 8 + size]
        if kind == _JSON:
            document = json.loads(chunk)
        elif kind == _BIN:
            buffer = chunk
        at += 8 + size
    if document is None:
        raise ValueError(f"{path}: has no JSON chunk")
    return document, buffer


def write(path, document, buffer):
    """Write `document` and `buffer` as one .glb; the format requires chunks padded to four bytes."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text
    if buffer:
        chunks += struct.pack("<II", len(buffer), _BIN) + buffer
    with open(path, "wb") as file:
        file.write(struct.pack("<III", _MAGIC, 2, 12 + len(chunks)) + chunks)


def add_view(document, buffer, data, index=None):
    """Append `data` to `buffer` (a bytearray), with a new buffer view or in place of the one at `index`. Returns the view's
    index."""
    buffer += b"\0" * (-len(buffer) % 4)
    views = document.setdefault("bufferViews", [])
    view = {"buffer": 0, "byteOffset": len(buffer), "byteLength": len(data)}
    buffer += data
    document.setdefault("buffers", [{}])[0]["byteLength"] = len(buffer)
    if index is None:
        views.append(view)
        return len(views) - 1
    views[index] = view
    return index
