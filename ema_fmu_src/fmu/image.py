"""model.png of an FMU, its icon in a block diagram: motor, gear and control surface, and the name of the twin.

The shapes are signed distances, so that edges are smooth and no graphics library is needed.
"""

import struct
import zlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .font import GLYPHS

Field = NDArray[np.float64]
WIDTH, HEIGHT = 400, 240
INK, BODY, SHAFT, SURFACE = (0.12, 0.16, 0.22), (0.18, 0.42, 0.71), (0.45, 0.50, 0.57), (0.90, 0.55, 0.16)
SQUARE, MARGIN, TOP = 10, 20, 145
"""Of the name [pixel]: size of its squares, free space at both sides, upper edge."""


def _box(x: Field, y: Field, left: float, top: float, right: float, bottom: float, radius: float) -> Field:
    """Signed distance [pixel] to a rectangle with corners of radius `radius`."""
    dx = np.abs(x - 0.5 * (left + right)) - 0.5 * (right - left) + radius
    dy = np.abs(y - 0.5 * (top + bottom)) - 0.5 * (bottom - top) + radius
    outside = np.sqrt(np.maximum(dx, 0.0) ** 2 + np.maximum(dy, 0.0) ** 2)
    return outside + np.minimum(np.maximum(dx, dy), 0.0) - radius


def _gear(x: Field, y: Field, cx: float, cy: float, radius: float, teeth: int) -> Field:
    """Approximate signed distance [pixel] to a gear wheel."""
    angle = np.arctan2(y - cy, x - cx) * teeth
    return np.hypot(x - cx, y - cy) - radius - 0.12 * radius * np.clip(3.0 * np.cos(angle), -1.0, 1.0)


def _wing(x: Field, y: Field, cx: float, cy: float, length: float, tilt: float) -> Field:
    """Approximate signed distance [pixel] to a tapered surface, turned by `tilt` [rad] about its leading edge."""
    along = (x - cx) * np.cos(tilt) + (y - cy) * np.sin(tilt)
    across = -(x - cx) * np.sin(tilt) + (y - cy) * np.cos(tilt)
    half = 15.0 * (1.0 - np.clip(along / length, 0.0, 1.0)) + 1.5
    return np.maximum(np.abs(across) - half, np.maximum(-along - 12.0, along - length))


def _squares(name: str) -> Iterator[tuple[int, int, int]]:
    """Left edge, upper edge and size [pixel] of each square of the text `name`; a long text has smaller squares."""
    glyphs = [GLYPHS[letter] for letter in name.upper()]
    columns = sum(len(rows[0]) + 1 for rows in glyphs) - 1
    size = min(SQUARE, (WIDTH - 2 * MARGIN) // columns)
    left = (WIDTH - size * columns) // 2
    for rows in glyphs:
        for row, squares in enumerate(rows):
            for column, square in enumerate(squares):
                if square == "#":
                    yield left + size * column, TOP + size * row, size
        left += size * (len(rows[0]) + 1)


def png(name: str) -> bytes:
    """The picture of the twin `name` as PNG, 400 x 240 pixels, transparent outside the block.

    KeyError for a character that the font does not have.
    """
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    rgb = np.ones((HEIGHT, WIDTH, 3))

    def cover(distance: Field) -> Field:
        return np.clip(0.5 - distance, 0.0, 1.0)

    def paint(distance: Field, colour: tuple[float, float, float]) -> None:
        share = cover(distance)[..., None]
        rgb[:] = (1.0 - share) * rgb + share * np.array(colour)

    def outlined(distance: Field, colour: tuple[float, float, float]) -> None:
        paint(distance - 2.0, INK)
        paint(distance, colour)

    def block(inset: float) -> Field:
        return _box(x, y, inset, inset, WIDTH - inset, HEIGHT - inset, 18.0 - inset)

    paint(block(2.0), INK)
    paint(block(5.0), (0.98, 0.98, 0.97))
    outlined(_box(x, y, 122, 74, 178, 84, 2), SHAFT)
    outlined(_box(x, y, 34, 50, 130, 108, 9), BODY)
    for fin in range(48, 122, 14):
        paint(_box(x, y, fin, 58, fin + 5, 100, 2.5), (0.72, 0.83, 0.94))
    outlined(_gear(x, y, 196, 79, 24, 10), SHAFT)
    outlined(_gear(x, y, 246, 79, 24, 10), SHAFT)
    for cx in (196.0, 246.0):
        paint(np.hypot(x - cx, y - 79) - 6.0, INK)
    outlined(_wing(x, y, 292, 79, 76, 0.28), SURFACE)
    paint(np.hypot(x - 292, y - 79) - 5.0, INK)
    for left, top, size in _squares(name):
        paint(_box(x, y, left, top, left + size, top + size, 0.0), INK)
    alpha = cover(block(2.0))[..., None]
    return _encode(np.rint(255.0 * np.concatenate([rgb, alpha], axis=2)).astype(np.uint8))


def _encode(pixels: NDArray[np.uint8]) -> bytes:
    """Pixels of shape (height, width, 4) as PNG (RFC 2083)."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 9)) + chunk(b"IEND", b"")
    )
