"""The container of a glTF file: its JSON, its buffers, and the arrays that accessors make of them."""

import base64
import binascii
import json
import struct
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ..errors import InputError
from .pieces import beside, contents

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", b"JSON", b"BIN\0"
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class Gltf:
    """A glTF file's JSON with its buffers read and bounds checked."""

    def __init__(self, path: Path, notes: list[tuple[str, str]]):
        """Read the container; buffers are read when they are asked for.

        Args:
            path: .gltf or .glb; either may hold either.
            notes: gains what is odd, as (what, why).

        Raises:
            InputError: the file is cut short, or no glTF 2.
        """
        self.path = path
        data = contents(path)
        self._binary: bytes | None = None
        text = self._chunks(data, notes) if data[:4] == MAGIC else data
        try:
            document = json.loads(text.decode("utf-8-sig"))
        except (UnicodeDecodeError, ValueError, RecursionError) as error:
            raise InputError(f"{path}: expected glTF's JSON, found {' '.join(str(error).split())[:80]}") from None
        if not isinstance(document, dict):
            raise InputError(f"{path}: expected a JSON object, found {type(document).__name__}")
        self.document = document
        asset = document.get("asset")
        version = str(asset.get("version", "")) if isinstance(asset, dict) else ""
        if not version.startswith("2."):
            raise InputError(f"{path}: expected glTF of version 2, found version {version[:20]!r}")
        self._buffers: dict[int, memoryview] = {}
        self._file_bytes = len(data)

    def _chunks(self, data: bytes, notes: list[tuple[str, str]]) -> bytes:
        """The JSON of a binary file; keeps its binary chunk."""
        if len(data) < 20:
            raise InputError(f"{self.path}: expected a glTF header of 20 bytes, found {len(data)}")
        version, length = struct.unpack_from("<2I", data, 4)
        if version != 2:
            raise InputError(f"{self.path}: expected glTF of version 2, found version {version}")
        if length > len(data):
            raise InputError(f"{self.path}: expected {length:,} bytes, found the end of the file at {len(data):,}")
        if length < len(data):
            notes.append((f"{len(data) - length} bytes", "after the end of the glTF: ignored"))
        text, at = None, 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<I4s", data, at)
            if at + 8 + size > length:
                raise InputError(f"{self.path}: expected a chunk of {size:,} bytes, found {length - at - 8:,}")
            chunk = data[at + 8 : at + 8 + size]
            if text is None and kind == JSON_CHUNK:
                text = chunk
            elif text is not None and self._binary is None and kind == BINARY_CHUNK:
                self._binary = chunk
            at += 8 + size + -size % 4
        if text is None:
            raise InputError(f"{self.path}: expected a chunk of JSON, found none")
        return text

    def listed(self, name: str) -> list:
        """A list at the top of the document; empty where there is none."""
        found = self.document.get(name, [])
        return found if isinstance(found, list) else self._fail(f"a list of {name}", type(found).__name__)

    def item(self, name: str, index: object) -> dict:
        """One object of a list, by index.

        Raises:
            InputError: there is none.
        """
        entries = self.listed(name)
        if type(index) is not int or not 0 <= index < len(entries):
            self._fail(f"one of {len(entries)} {name}", f"number {str(index)[:40]}")
        return entries[index] if isinstance(entries[index], dict) else self._fail(f"an object in {name}", "another")

    def _fail(self, expected: str, found: str) -> None:
        raise InputError(f"{self.path}: expected {expected}, found {found}")

    def _count(self, where: dict, key: str, default: int | None = None) -> int:
        """A whole number from 0 on."""
        value = where.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if type(value) is not int or value < 0:
            self._fail(f"a whole number as {key}", str(value)[:40])
        return value

    def _buffer(self, index: int) -> memoryview:
        if index not in self._buffers:
            self._buffers[index] = memoryview(self._load(self.item("buffers", index), index))
        return self._buffers[index]

    def _load(self, buffer: dict, index: int) -> bytes:
        size, uri = self._count(buffer, "byteLength"), buffer.get("uri")
        if uri is None:
            data = self._binary if index == 0 else None
            if data is None:
                packed = [name for name in MESHOPT if name in extensions(buffer)]
                why = f"only what {packed[0]} packs" if packed else "no uri and no binary chunk"
                self._fail(f"data in buffer {index}", why)
        elif not isinstance(uri, str):
            self._fail(f"a text as uri of buffer {index}", type(uri).__name__)
        elif uri[:5].lower() == "data:":
            head, _, body = uri.partition(",")
            try:
                data = base64.b64decode(unquote(body)) if head.endswith(";base64") else unquote(body).encode("latin-1")
            except (binascii.Error, ValueError):
                self._fail(f"base64 in buffer {index}", "something else")
        else:
            found = beside(self.path, unquote(uri)) or beside(self.path, uri)
            if found is None:
                self._fail(f"the buffer {uri[:80]!r} beside it", "nothing there")
            data = contents(found)
            self._file_bytes += len(data)
        if len(data) < size:
            self._fail(f"{size:,} bytes in buffer {index}", f"{len(data):,}")
        return data[:size]

    def view(self, index: object) -> tuple[memoryview, int]:
        """Bytes of a buffer view, and its stride, 0 where it states none."""
        view = self.item("bufferViews", index)
        offset, size = self._count(view, "byteOffset", 0), self._count(view, "byteLength")
        data = self._buffer(self._count(view, "buffer"))
        if offset + size > len(data):
            self._fail(f"{size:,} bytes at {offset:,} of a buffer (view {index})", f"its end at {len(data):,}")
        return data[offset : offset + size], self._count(view, "byteStride", 0)

    def accessor(self, index: object, *, raw: bool = False) -> np.ndarray:
        """Elements of an accessor, shape (count, width): float64 with normalized integers as shares, or as stored.

        Raises:
            InputError: it is not there, or reaches past the end of its buffer view.
        """
        accessor = self.item("accessors", index)
        count, kind = self._count(accessor, "count"), accessor.get("componentType")
        width = WIDTHS.get(accessor.get("type")) if isinstance(accessor.get("type"), str) else None
        if width is None or type(kind) is not int or kind not in COMPONENTS:
            self._fail(f"numbers or vectors in accessor {index}", f"{accessor.get('type')} of {kind}"[:60])
        dtype = np.dtype(COMPONENTS[kind])
        if "bufferView" in accessor:
            offset = self._count(accessor, "byteOffset", 0)
            values = self._elements(accessor["bufferView"], offset, count, width, dtype, f"accessor {index}")
        else:
            # Zeros take no room in the file, so its size is all there is to tell a count from an accident.
            if count > self._file_bytes:
                self._fail(f"as many values as {self._file_bytes:,} bytes may hold in accessor {index}", f"{count:,}")
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._with_sparse(accessor["sparse"], values, index)
        return values if raw else _shares(values) if accessor.get("normalized") is True else values.astype(np.float64)

    def _elements(self, view: object, offset: int, count: int, width: int, dtype: np.dtype, where: str) -> np.ndarray:
        data, stride = self.view(view)
        size = width * dtype.itemsize
        stride = stride or size
        if stride < size:
            self._fail(f"a stride of at least {size} in {where}", str(stride))
        if count and offset + stride * (count - 1) + size > len(data):
            self._fail(f"{count:,} elements in {where}", f"the end of view {view} at {len(data):,} bytes")
        if not count:
            return np.zeros((0, width), dtype)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize)).copy()

    def _with_sparse(self, sparse: dict, values: np.ndarray, index: object) -> np.ndarray:
        count, where = self._count(sparse, "count"), f"sparse accessor {index}"
        places, changes = sparse["indices"], sparse["values"]
        kind = places.get("componentType")
        if type(kind) is not int or kind not in (5121, 5123, 5125):
            self._fail(f"unsigned indices in {where}", str(kind)[:40])
        offset = self._count(places, "byteOffset", 0)
        at = self._elements(places.get("bufferView"), offset, count, 1, np.dtype(COMPONENTS[kind]), where)[:, 0]
        if count and at.max() >= len(values):
            self._fail(f"indices below {len(values):,} in {where}", f"{at.max():,}")
        offset = self._count(changes, "byteOffset", 0)
        values[at] = self._elements(changes.get("bufferView"), offset, count, values.shape[1], values.dtype, where)
        return values


def extensions(part: dict) -> dict:
    """The extensions of a part of the document, by name."""
    found = part.get("extensions", {})
    return found if isinstance(found, dict) else {}


def _shares(values: np.ndarray) -> np.ndarray:
    """Normalized integers as numbers from 0, or -1, to 1."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)
