"""zteam.world.bitmap: which cells of an image are occupied."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from zteam.errors import WorldError
from zteam.world.bitmap import occupied_box, read_bitmap, rectangles

LEVELS = np.array([[0, 127, 128], [205, 255, 1]], np.uint8)
OCCUPIED = [[False, False, True], [True, True, False]]
"""`LEVELS` with row 0 at the bottom."""


def occupied(path: Path) -> list[list[bool]]:
    return read_bitmap(path).tolist()  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", ["a.png", "a.bmp", "a.pgm", "a.gif"])
def test_gray_images_of_every_lossless_format(tmp_path: Path, name: str) -> None:
    """127 is occupied, 128 and map_server's unknown 205 are free; the image's last row becomes row 0."""
    Image.fromarray(LEVELS).save(tmp_path / name)
    assert occupied(tmp_path / name) == OCCUPIED


def test_jpeg(tmp_path: Path) -> None:
    """A JPEG of even areas is read like the others."""
    Image.fromarray(np.repeat(np.array([[0], [255]], np.uint8), 8, axis=0).repeat(16, axis=1)).save(tmp_path / "a.jpg")
    grid = read_bitmap(tmp_path / "a.jpg")
    assert grid.shape == (16, 16)
    assert not grid[:8].any()
    assert grid[8:].all()


def test_ascii_pgm_and_its_depth(tmp_path: Path) -> None:
    """A P2 file's values are scaled by its own maximum: 7 of 15 is dark, 8 of 15 is not."""
    (tmp_path / "a.pgm").write_text("P2\n# a comment\n2 1\n15\n7 8\n")
    assert occupied(tmp_path / "a.pgm") == [[True, False]]


def test_sixteen_bits_a_sample(tmp_path: Path) -> None:
    """Deep images are judged by their upper byte: 0x7fff is dark, 0x8000 is not."""
    samples = np.array([[0x7FFF, 0x8000]], np.uint16)
    Image.fromarray(samples).save(tmp_path / "a.png")
    (tmp_path / "a.pgm").write_bytes(b"P5 2 1 65535\n" + samples.astype(">u2").tobytes())
    assert occupied(tmp_path / "a.png") == [[True, False]]
    assert occupied(tmp_path / "a.pgm") == [[True, False]]


def test_only_the_first_channel_counts(tmp_path: Path) -> None:
    """Red decides, green, blue and alpha do not: blue is occupied, transparent black too, yellow is free."""
    pixels = np.array([[[0, 0, 255, 255], [255, 255, 0, 255], [0, 0, 0, 0], [255, 255, 255, 0]]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    assert occupied(tmp_path / "a.png") == [[True, False, True, False]]


def test_palettes_and_bits(tmp_path: Path) -> None:
    """An indexed image is judged by its colours, not its indices; a 1-bit image by black and white."""
    indexed = Image.fromarray(np.array([[0, 1]], np.uint8)).convert("P")
    indexed.putpalette([255, 0, 0, 0, 255, 255])
    indexed.save(tmp_path / "p.png")
    Image.fromarray(np.array([[True, False]])).save(tmp_path / "1.png")
    assert occupied(tmp_path / "p.png") == [[False, True]]
    assert occupied(tmp_path / "1.png") == [[False, True]]


def test_what_is_no_image_is_an_error(tmp_path: Path) -> None:
    """Text and an image cut short are WorldErrors that name the file."""
    (tmp_path / "a.png").write_text("no image")
    with pytest.raises(WorldError, match=r"a\.png is not a PGM, PNG, BMP, JPEG or GIF"):
        read_bitmap(tmp_path / "a.png")
    Image.fromarray(np.zeros((64, 64), np.uint8)).save(tmp_path / "b.bmp")
    (tmp_path / "b.bmp").write_bytes((tmp_path / "b.bmp").read_bytes()[:500])
    with pytest.raises(WorldError, match=r"cannot read bitmap .*b\.bmp"):
        read_bitmap(tmp_path / "b.bmp")


@pytest.mark.parametrize("side", [8001, 9500, 60_000])
def test_a_bomb_is_refused_before_it_is_decoded(tmp_path: Path, side: int) -> None:
    """A tiny PNG that claims more than 64 million pixels is refused, below and above Pillow's own bounds."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    )
    with pytest.raises(WorldError, match="more than 64000000 pixels"):
        read_bitmap(tmp_path / "a.png")


def test_the_box_of_occupied_cells() -> None:
    """The box is half open, and there is none around nothing."""
    grid = np.zeros((6, 8), bool)
    assert occupied_box(grid) is None
    grid[2, 3] = grid[4, 7] = True
    assert occupied_box(grid) == (2, 5, 3, 8)


def test_rectangles_cover_the_cells_exactly() -> None:
    """Runs that repeat in the next row join; a hole stays a hole."""
    grid = np.array([[1, 1, 1], [1, 0, 1], [1, 0, 1], [1, 1, 1]], bool)
    assert rectangles(grid, 4) == [(0, 1, 0, 3), (1, 3, 0, 1), (1, 3, 2, 3), (3, 4, 0, 3)]
    assert rectangles(grid, 3) is None
