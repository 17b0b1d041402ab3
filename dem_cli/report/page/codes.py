"""Numbers of frames packed into text that a page can carry: quantised to 8 or 16 bits, shuffled by byte, deflated, in base64.

Each array is a section of one blob, of one of these codes (player.js undoes them):

- linear: `low + q (high - low) / 65534`, q = 65535 for NaN; to within half a quantum of (high - low) / 65534
- log: sign in bit 15, `largest exp(SPAN (q - 32767) / 32766)` for q > 0, 0 for q = 0, NaN for 0x8000; to within LOG_ERROR of the value itself,
  and less than LEAST of the largest is 0
- angle: `q 2 pi / 65536`, whole turns left out
- root: 8 bits, `largest (q / 255)^2`; to within half a quantum of the square root
- raw: as it is

Sections with `delta` hold the difference to the frame before, modulo 2^16, which deflates well where little moves.
"""

from __future__ import annotations

import base64
import math
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.state import Floats

Words = npt.NDArray[np.uint16]
STEPS = 65534
LEAST = 1e-9
SPAN = -math.log(LEAST)
LOG_ERROR = math.expm1(0.5 * SPAN / 32766)
TURN = 2.0 * math.pi


def linear(values: Floats, low: float, high: float) -> Words:
    """Code of values; those beyond low and high are set to them."""
    width = high - low if high > low else 1.0
    with np.errstate(invalid="ignore"):
        q = np.rint(np.clip((values - low) / width, 0.0, 1.0) * STEPS)
    return np.where(np.isnan(q), 65535, q).astype(np.uint16)


def of_linear(q: Words, low: float, high: float) -> Floats:
    width = high - low if high > low else 1.0
    return np.where(q == 65535, np.nan, low + q.astype(float) * (width / STEPS))


def log(values: Floats, largest: float) -> Words:
    """Code of values of magnitude up to `largest`."""
    size = np.abs(values) / (largest if largest > 0.0 else 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        q = np.rint(32767 + np.log(np.minimum(size, 1.0)) / SPAN * 32766)
        q = np.where(q >= 1, q, 0)
        q = np.where((values < 0.0) & (q > 0), q + 32768, q)
    return np.where(np.isnan(values), 32768, q).astype(np.uint16)


def of_log(q: Words, largest: float) -> Floats:
    size = q & 0x7FFF
    found = np.where(size > 0, largest * np.exp(SPAN * (size.astype(float) - 32767) / 32766), 0.0)
    return np.where(q == 32768, np.nan, np.where(q > 32768, -found, found))


def angle(values: Floats) -> Words:
    return (np.rint(np.asarray(values) % TURN / TURN * 65536).astype(np.int64) % 65536).astype(np.uint16)


def of_angle(q: Words) -> Floats:
    return np.asarray(q.astype(float) * (TURN / 65536))


def root(values: Floats, largest: float) -> npt.NDArray[np.uint8]:
    """Code of values from 0 to `largest`."""
    share = np.clip(values / (largest if largest > 0.0 else 1.0), 0.0, 1.0)
    return np.rint(255.0 * np.sqrt(share)).astype(np.uint8)


def of_root(q: npt.NDArray[np.uint8], largest: float) -> Floats:
    return np.asarray(largest * (q.astype(float) / 255.0) ** 2)


class Packer:
    """Gathers sections; `text` is the blob in base64, `sections` says where each lies in it."""

    def __init__(self) -> None:
        self.sections: dict[str, dict[str, Any]] = {}
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, name: str, array: npt.NDArray[Any], *, delta: bool = False, **facts: Any) -> None:
        """array: uint8, uint16, uint32 or float32; of rows (of frames, mostly) or single numbers. facts: code and what it needs."""
        if delta:
            array = np.diff(array, axis=0, prepend=np.zeros_like(array[:1]))
        array = np.ascontiguousarray(array)
        kind = array.dtype.newbyteorder("<")
        width = kind.itemsize
        flat = array.astype(kind).ravel()
        # All first bytes, then all second ones: high bytes are often alike.
        content = flat.view(np.uint8).reshape(-1, width).T.tobytes() if len(flat) else b""
        self.sections[name] = {
            "type": kind.name, "offset": self._size, "count": len(flat), "row": len(flat) // max(len(array), 1), "rows": array.ndim > 1,
            "delta": delta, **facts,
        }  # fmt: skip
        self._parts.append(content)
        self._size += len(content)

    def text(self) -> str:
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode("ascii")


def unpack(text: str, sections: dict[str, dict[str, Any]]) -> dict[str, npt.NDArray[Any]]:
    """What the page's script does: sections by name, their quanta in the shape that they had, rows of rows flattened."""
    blob = zlib.decompress(base64.b64decode(text))
    found: dict[str, npt.NDArray[Any]] = {}
    for name, section in sections.items():
        kind = np.dtype(section["type"]).newbyteorder("<")
        size = section["count"] * kind.itemsize
        content = np.frombuffer(blob, np.uint8, size, section["offset"]).reshape(kind.itemsize, -1).T
        flat = np.ascontiguousarray(content).view(kind).ravel().astype(kind.newbyteorder("="))
        rows = flat.reshape(-1, max(section["row"], 1)) if section["rows"] else flat
        found[name] = np.cumsum(rows, axis=0, dtype=rows.dtype) if section["delta"] else rows
    return found
