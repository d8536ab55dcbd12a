"""Maps as map_server writes and reads them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from zteam.config.map_files import Mode
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.maps import read_map, write_map

SHADES = np.array([[0, 50, 100, 127], [180, 205, 254, 255]], np.uint8)


def write(folder: Path, pixels: np.ndarray, text: str = "", suffix: str = ".pgm") -> Path:
    """A map file of these pixels."""
    Image.fromarray(pixels).save(folder / f"m{suffix}")
    path = folder / "m.yaml"
    path.write_text(f"image: m{suffix}\nresolution: 0.1\norigin: [1.0, 2.0, 0.5]\n{text}")
    return path


@pytest.mark.parametrize(
    ("text", "cells"),
    [
        ("", [[-1, 0, 0, 0], [100, 100, -1, -1]]),
        ("occupied_thresh: 0.65\nfree_thresh: 0.196", [[-1, -1, 0, 0], [100, 100, -1, -1]]),
        ("negate: 1", [[100, 100, 100, 100], [0, 0, -1, -1]]),
        ("mode: scale\noccupied_thresh: 1.0\nfree_thresh: 0.0", [[29, 20, 0, 0], [100, 80, 61, 50]]),
        ("mode: scale", [[11, 0, 0, 0], [100, 100, 89, 63]]),
        ("mode: raw", [[-1, -1, -1, -1], [0, 50, 100, -1]]),
    ],
)
def test_modes_are_map_servers(tmp_path: Path, text: str, cells: list[list[int]]) -> None:
    """trinary, scale and raw, thresholds and negate; the last row of the picture comes first."""
    grid = read_map(write(tmp_path, SHADES, text))
    assert grid.cells.tolist() == cells
    assert grid.frame[2:] == (0.1, Pose2(1.0, 2.0, 0.5))


def test_transparent_pixels_are_unknown_in_scale(tmp_path: Path) -> None:
    """As map_server has it; colours count by their mean."""
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[0, :, 3] = 255, 0, 255
    pixels[0, 2, :3] = 255, 255, 255
    assert read_map(write(tmp_path, pixels, "mode: scale", ".png")).cells.tolist() == [[100, -1, 0]]


@pytest.mark.parametrize(("mode", "suffix"), [("trinary", None), ("trinary", ".png"), ("scale", None), ("raw", None)])
def test_what_is_written_is_read_again(tmp_path: Path, mode: Mode, suffix: str | None) -> None:
    """All values in scale and raw, and the three kinds of cells in trinary."""
    values = np.array([-1, 0, 100] * 34, np.int8) if mode == "trinary" else np.arange(-1, 101, dtype=np.int8)
    grid = make_map(values.reshape(17, 6), 0.05, Pose2(-3.5, 0.25, 0.125))
    paths = write_map(grid, tmp_path / "office.yaml", mode=mode, suffix=suffix)
    assert all(path.exists() for path in paths)
    again = read_map(paths[0])
    assert again.frame == grid.frame
    assert np.array_equal(again.cells, grid.cells)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("mode: shades", "mode"),
        ("resolution: 0", "resolution"),
        ("resolution: .nan", "resolution"),
        ("free_thresh: 0.7", "free_thresh"),
        ("origin: [1, 2]", "origin"),
        ("origin: [1, 2, true]", "origin"),
        ("negate: 2", "negate"),
        ("image: nothing.pgm", "nothing.pgm"),
        ("image: [1]", "image"),
        ("occupied_thresh: much", "occupied_thresh"),
        ("a: [", "YAML"),
    ],
)
def test_a_bad_map_is_one_line_that_names_the_key(tmp_path: Path, text: str, why: str) -> None:
    """A later key of the file replaces an earlier one."""
    with pytest.raises(UsageError, match=why) as caught:
        read_map(write(tmp_path, SHADES, text))
    assert "\n" not in str(caught.value)


def test_files_that_are_no_maps_are_refused(tmp_path: Path) -> None:
    """No file, no table, a damaged picture; a name or picture that cannot be written."""
    with pytest.raises(UsageError, match="cannot read"):
        read_map(tmp_path / "none.yaml")
    (tmp_path / "list.yaml").write_text("- 1")
    with pytest.raises(UsageError, match="a table is expected"):
        read_map(tmp_path / "list.yaml")
    path = write(tmp_path, SHADES)
    (tmp_path / "m.pgm").write_bytes(b"P5 9 9 255\n")
    with pytest.raises(UsageError, match="image"):
        read_map(path)
    grid = make_map(np.zeros((2, 2), np.int8), 0.1)
    for name, suffix, mode in (("m.txt", ".pgm", "trinary"), ("m.yaml", ".jpg", "raw"), ("m.yaml", ".pgm", "scale")):
        with pytest.raises(UsageError):
            write_map(grid, tmp_path / name, mode=mode, suffix=suffix)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="cannot write"):
        write_map(grid, tmp_path / "none" / "m.yaml")


def test_an_array_that_is_no_map_is_refused() -> None:
    """Rows and columns, at least one of each, and a resolution above 0."""
    for shape, resolution in (((0, 3), 0.1), ((3,), 0.1), ((2, 2), 0.0), ((2, 2), float("nan"))):
        with pytest.raises(ValueError, match="map"):
            make_map(np.zeros(shape, np.int8), resolution)
