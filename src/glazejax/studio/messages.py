"""Messages as bytes: a header of JSON, then numbers in single precision.

Layout: 4 bytes, the header's length (little endian); the header, UTF-8, padded by blanks so that
numbers start at a multiple of 4; then the arrays that its ``arrays`` lists as [name, shape],
float32, little endian. A text message is a header without arrays.
"""

import json
import math
import struct
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

JsonObject: TypeAlias = dict[str, Any]
"""An object as JSON has it."""

MOST_BYTES = 24 << 20
"""Of one message: a dropped file and some more."""
MOST_FILE = 16 << 20
"""Of a dropped file."""

Arrays = Mapping[str, Float[np.ndarray, "..."]]


def pack(header: Mapping[str, Any], arrays: Arrays | None = None) -> bytes:
    """A message as bytes."""
    listed = [[name, list(np.shape(array))] for name, array in (arrays or {}).items()]
    head = json.dumps({**header, "arrays": listed}, ensure_ascii=False).encode()
    # A browser reads numbers only from a multiple of their size on.
    head += b" " * (-len(head) % 4)
    blocks = [np.ascontiguousarray(array, "<f4").tobytes() for array in (arrays or {}).values()]
    return b"".join([struct.pack("<I", len(head)), head, *blocks])


def unpack(message: bytes | str) -> tuple[JsonObject, Arrays, bytes]:
    """Header, arrays, and what follows them, such as a file's content.

    Raises:
        ValueError: the message is not of this form, or larger than `MOST_BYTES`.
    """
    if len(message) > MOST_BYTES:
        raise ValueError(
            f"a message of {len(message) >> 20} MB is more than the {MOST_BYTES >> 20} MB that "
            "are read"
        )
    if isinstance(message, str):
        return _header(message), {}, b""
    if len(message) < 4:
        raise ValueError("a message is too short to be one")
    (length,) = struct.unpack_from("<I", message)
    if length > len(message) - 4:
        raise ValueError("a message ends within its header")
    header = _header(bytes(message[4 : 4 + length]))
    at = 4 + length
    arrays = {}
    listed = header.pop("arrays", [])
    limit = 32
    if not isinstance(listed, list) or len(listed) > limit:
        raise ValueError(f"a message lists its arrays, {limit} at most")
    for entry in listed:
        name, shape = _entry(entry)
        # An array must lie within the message before it is made.
        size = 4 * math.prod(shape)
        if at + size > len(message):
            raise ValueError(f"a message ends within its array {name!r}")
        arrays[name] = np.frombuffer(message, "<f4", math.prod(shape), at).reshape(shape)
        at += size
    return header, arrays, bytes(message[at:])


def _header(text: bytes | str) -> JsonObject:
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("a message is not JSON") from None
    if not isinstance(header, dict) or not isinstance(header.get("type"), str):
        raise ValueError('a message must be an object with a "type"')
    return header


def _entry(entry: Any) -> tuple[str, tuple[int, ...]]:
    match entry:
        case [str(name), [*shape]] if len(shape) <= 4 and all(
            type(n) is int and 0 <= n < 1 << 24 for n in shape
        ):
            return name, tuple(shape)
    raise ValueError("a message's arrays are each a name and a shape")
