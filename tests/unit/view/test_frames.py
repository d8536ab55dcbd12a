"""The view's binary frames, read as the page reads them."""

import json
import math
import struct
import zlib

import numpy as np
import pytest

from studies.view.frames import Frame, decode_frame
from zteam.geometry import Pose2
from zteam.messages import LaserScan
from zteam.view import frames

HEADER = Frame(7, 12, 1.2, 0.003)


def only_block(block: bytes) -> tuple[int, int, int, bytes]:
    """The one block of a frame that holds it."""
    header, blocks = decode_frame(frames.encode_frame(*HEADER, [block]))
    assert header == HEADER
    (found,) = blocks
    return found


def meta_of(body: bytes) -> tuple[dict[str, object], bytes]:
    """The meta data at the beginning of a body, and what follows."""
    (length,) = struct.unpack_from("<H", body)
    return json.loads(body[2 : 2 + length]), body[2 + length :]


def test_the_header_has_32_bytes_and_blocks_begin_at_multiples_of_8() -> None:
    """A page reads numbers in place, so every block is padded to eight bytes."""
    blocks = [frames.encode_doc("team", b"{}"), frames.encode_doc("log", b"[1,2,3]")]
    data = frames.encode_frame(*HEADER, blocks)
    assert data[:8] == struct.pack("<BBHI", 1, 1, 2, 7)
    assert all(len(block) % 8 == 0 for block in blocks)
    assert len(data) == 32 + sum(map(len, blocks))
    # A stamp before the beginning of time is in no tick.
    assert frames.encode_frame(1, -5, -0.5, 0.0, blocks)[8:16] == bytes(8)


def test_poses_of_the_simulator_are_marked() -> None:
    """The page draws robots hollow whose poses are the ground truth."""
    assert only_block(frames.encode_poses({0: Pose2(0.0, 0.0, 0.0)}, truth=True))[1] == frames.FROM_TRUTH


def test_a_scan_is_thinned_and_tells_what_it_did_not_see() -> None:
    """No return is 65535, an invalid range 65534, and the increment grows as beams are left out."""
    ranges = np.array([1.0, 9.0, math.inf, 9.0, math.nan, 9.0, 0.01, 9.0, 30.0], np.float32)
    scan = LaserScan(angle_min=-1.0, angle_increment=0.125, range_min=0.05, range_max=30.0, ranges=ranges)
    kind, _, owner, body = only_block(frames.encode_scan(4, 1, scan, Pose2(1.0, 2.0, 0.25), beams=5))
    assert (kind, owner) == (frames.SCAN, 4)
    index, count, *floats = struct.unpack_from("<HH7f", body)
    assert (index, count) == (1, 5)
    assert floats == pytest.approx([1.0, 2.0, 0.25, -1.0, 0.25, 30.0, 0.002])
    assert np.frombuffer(body, "<u2", 5, 32).tolist() == [500, 0xFFFF, 0xFFFE, 0xFFFE, 0xFFFF]


@pytest.mark.parametrize("number", [3e38, 1e300, -math.inf, math.nan])
def test_a_scan_of_any_numbers_is_encoded(number: float) -> None:
    """What a laser says of itself, and where it is, ends no page."""
    scan = LaserScan(angle_min=number, angle_increment=number, range_max=number, ranges=np.ones(9, np.float32))
    assert only_block(frames.encode_scan(0, 0, scan, Pose2(number, 0.0, 0.0), 1))[0] == frames.SCAN


def test_a_far_sighted_laser_has_larger_steps() -> None:
    """A range of 200 m fits into 16 bits."""
    scan = LaserScan(range_max=200.0, ranges=np.array([150.0], np.float32))
    body = only_block(frames.encode_scan(0, 0, scan, Pose2(0.0, 0.0, 0.0), 1))[3]
    step, steps = struct.unpack_from("<fH", body, 28)
    assert step * steps == pytest.approx(150.0, abs=0.003)


def test_a_tile_is_deflated_under_its_place() -> None:
    """The page inflates it and finds the cells row by row."""
    cells = np.arange(-1, 5, dtype=np.int8).reshape(2, 3)
    kind, _, _, body = only_block(frames.encode_tile({"key": "map", "tile": [0, 0, 3, 2]}, cells))
    meta, rest = meta_of(body)
    assert (kind, meta) == (frames.GRID, {"key": "map", "tile": [0, 0, 3, 2]})
    assert zlib.decompress(rest) == cells.tobytes()


@pytest.mark.parametrize("key", ["a", "ab", "abc", "abcd"])
def test_numbers_behind_names_of_any_length_are_aligned(key: str) -> None:
    """Paths and poses begin at a multiple of four, samples at one of eight, counted from the body's start."""
    path = only_block(frames.encode_path(key, np.array([[1.0, 2.0]])))[3]
    samples = only_block(frames.encode_samples(key, "x", np.array([[1.0, 2.0]])))[3]
    assert np.frombuffer(path[-8:], "<f4").tolist() == [1.0, 2.0]
    assert len(path) % 4 == 0
    assert np.frombuffer(samples[-16:], "<f8").tolist() == [1.0, 2.0]
    assert len(samples) % 8 == 0


def test_tiles_cover_a_grid() -> None:
    """Each cell is in one tile, and no tile is larger than 256 cells."""
    seen = np.zeros((300, 520), int)
    for column, row, width, height in frames.tiles_of(520, 300):
        assert max(width, height) <= frames.TILE
        seen[row : row + height, column : column + width] += 1
    assert (seen == 1).all()
