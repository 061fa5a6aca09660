"""Data with arrays in files: JSON for everything else, and one binary file for the arrays."""

from typing import Any

import numpy as np

_KEY, _TYPES = "array", ("<f8", "<i8", "|b1")


def pack(data: Any) -> tuple[Any, bytes]:
    """Split data into JSON, {"array": [first byte, type, shape]}, and little-endian bytes for `unpack`."""
    found: list[bytes] = []
    end = 0

    def plain(entry):
        nonlocal end
        if isinstance(entry, dict):
            return {key: plain(value) for key, value in entry.items()}
        if isinstance(entry, list | tuple):
            return [plain(value) for value in entry]
        if not isinstance(entry, np.ndarray):
            return entry
        kind = {"f": "<f8", "i": "<i8", "u": "<i8", "b": "|b1"}[entry.dtype.kind]
        found.append(entry.astype(kind).tobytes())
        offset, end = end, end + len(found[-1])
        return {_KEY: [offset, kind, list(entry.shape)]}
    return plain(data), b"".join(found)


def unpack(data: Any, content: bytes) -> Any:
    """Return the data of `pack` with read-only arrays; an unknown type or place is a ValueError."""
    if isinstance(data, list):
        return [unpack(value, content) for value in data]
    if not isinstance(data, dict):
        return data
    if data.keys() != {_KEY}:
        return {key: unpack(value, content) for key, value in data.items()}
    first, kind, shape = data[_KEY]
    if kind not in _TYPES:
        raise ValueError(f"no array is of the type {kind!r}")
    return np.frombuffer(content, kind, int(np.prod(shape, dtype=int)), first).reshape(shape)
