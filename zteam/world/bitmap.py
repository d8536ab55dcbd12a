"""Bitmaps as floors: which cells are occupied, and which part of the image counts."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from zteam.errors import WorldError

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

MAX_PIXELS = 64_000_000
DARK = 127
"""A pixel is occupied if its first channel is not above this: Stage's fixed threshold; map_server's 205 is free."""

_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "GIF")
_BYTE_MODES = ("L", "LA", "RGB", "RGBA")

Grid = NDArray[np.bool_]
Box = tuple[int, int, int, int]


def read_bitmap(path: Path) -> Grid:
    """Occupied cells of an image, (rows, columns) with row 0 at the bottom; alpha does not count.

    Raises WorldError, without a place, on what is not a PGM, PNG, BMP, JPEG or GIF, or has too many pixels.
    """
    return np.ascontiguousarray(_read_channels(path)[::-1, :, 0] <= DARK)


def read_levels(path: Path) -> NDArray[np.float32]:
    """Mean of the colour channels, 0 to 255; rows are as in `read_bitmap`."""
    return np.asarray(_read_channels(path)[::-1, :, :3].mean(axis=2, dtype=np.float32))


def _read_channels(path: Path) -> NDArray[Any]:
    """(rows, columns, channels), 0 to 255, the uppermost row first; without alpha."""
    from PIL import Image, UnidentifiedImageError  # only a world with a bitmap pays for it

    too_large = WorldError(f"bitmap {path} has more than {MAX_PIXELS} pixels: it is refused")
    try:
        with warnings.catch_warnings():
            # Pillow warns at a bound of its own, above ours.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            # Else a format that the file's name does not tell makes Pillow import all it has, 50 of them.
            Image.preinit()
            with Image.open(path, formats=_FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise too_large
                return _channels(image)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        raise too_large from None
    except UnidentifiedImageError:
        raise WorldError(f"bitmap {path} is not a PGM, PNG, BMP, JPEG or GIF image") from None
    except WorldError:
        raise
    except Exception as error:  # decoders raise all kinds of exceptions on a broken file
        raise WorldError(f"cannot read bitmap {path}: {error!s:.200}") from None


def _channels(image: "Picture") -> NDArray[Any]:
    if image.mode.startswith("I"):  # 16 bits a sample
        return (np.asarray(image) >> 8)[:, :, None]
    values = np.asarray(image if image.mode in _BYTE_MODES else image.convert("RGB"))
    if values.ndim == 2:
        return values[:, :, None]
    return values[:, :, : 1 if image.mode == "LA" else 3]


def occupied_box(occupied: Grid) -> Box | None:
    """Smallest box around the occupied cells, half open: (first row, end row, first column, end column)."""
    rows = np.flatnonzero(occupied.any(axis=1))
    if rows.size == 0:
        return None
    columns = np.flatnonzero(occupied.any(axis=0))
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def rectangles(occupied: Grid, limit: int) -> list[Box] | None:
    """Disjoint boxes that cover the occupied cells: each row's runs, joined with equal runs of the rows above.

    None if there are more than `limit`.
    """
    steps = np.diff(occupied, axis=1, prepend=False, append=False)
    rows, columns = np.nonzero(steps)
    if rows.size > 2 * limit * len(occupied):
        return None
    runs_of: list[set[tuple[int, int]]] = [set() for _ in range(len(occupied) + 1)]
    for row, start, end in zip(rows[::2].tolist(), columns[::2].tolist(), columns[1::2].tolist(), strict=True):
        runs_of[row].add((start, end))
    done: list[Box] = []
    growing: dict[tuple[int, int], int] = {}
    for row, runs in enumerate(runs_of):
        done.extend((growing.pop(run), row, *run) for run in growing.keys() - runs)
        growing.update(dict.fromkeys(runs - growing.keys(), row))
        if len(done) > limit:
            return None
    return sorted(done)
