"""The binary frames of the view, wire version 1 (docs/view.md). Pure: numbers in, bytes out. All is little endian.

A frame is a header and blocks. Each block begins at a multiple of eight, so that a page reads its numbers in place.
"""

import json
import math
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan
from zteam.messages.laser import read_ranges

KIND, VERSION = 1, 1
POSES, SCAN, DOC, GRID, PATH, POSE_ARRAY, SAMPLES = range(1, 8)
"""Types of blocks."""
TEAM = 0xFFFF
"""In the place of a robot's id: the block is of no single robot."""
FROM_TRUTH = 1
"""Flag of POSES: the poses are the simulator's ground truth, not of the transforms."""

POSITION_STEP = 0.01
"""Metres of one step of a pose's x and y, unless the robots are more than 655 m apart."""
YAW_STEP = 1e-4
"""Radians of one step of a pose's yaw."""
RANGE_STEP = 0.002
"""Metres of one step of a range, unless the laser sees farther than 131 m."""
NO_RETURN, INVALID = 0xFFFF, 0xFFFE
MAX_STEPS = 0xFFFD
"""Of a range."""
TILE = 256
"""Cells of a grid's tile along each side, at most."""

_HEADER = struct.Struct("<BBHIQdd")
_BLOCK = struct.Struct("<BBHI")
_POSES = struct.Struct("<fffI")
_SCAN = struct.Struct("<HH7f")
_LENGTH = struct.Struct("<H")


def encode_frame(number: int, tick: int, stamp: float, age: float, blocks: Sequence[bytes]) -> bytes:
    """A frame of these blocks, each as the functions below make it.

    `stamp` (s) is of the clock that the team lives on; `age`: host seconds from the newest pose until it was sent.
    """
    header = _HEADER.pack(KIND, VERSION, len(blocks), number & 0xFFFFFFFF, max(0, tick), stamp, age)
    return b"".join((header, *blocks))


def _block(kind: int, body: bytes, owner: int = TEAM, flags: int = 0) -> bytes:
    return b"".join((_BLOCK.pack(kind, flags, owner, len(body)), body, bytes(-len(body) % 8)))


def encode_poses(poses: Mapping[int, Pose2], *, truth: bool = False) -> bytes:
    """Poses in `map` by robot id."""
    ids = np.fromiter(poses, np.uint16, len(poses))
    numbers = np.array(list(poses.values()), np.float64).reshape(-1, 3)
    low, high = (numbers[:, :2].min(0), numbers[:, :2].max(0)) if len(poses) else (np.zeros(2), np.zeros(2))
    origin = ((low + high) / 2).astype(np.float32)
    step = np.float32(max(POSITION_STEP, float((high - low).max()) / 65000))
    placed = np.clip(np.rint((numbers[:, :2] - origin) / step), -32767, 32767).astype("<i2")
    turns = np.rint([normalize_angle(yaw) / YAW_STEP for yaw in numbers[:, 2]]).astype("<i2")
    parts = (
        _POSES.pack(*origin.tolist(), float(step), len(poses)),
        ids.astype("<u2").tobytes(),
        bytes(len(poses) % 2 * 2),
        placed[:, 0].tobytes(),
        placed[:, 1].tobytes(),
        turns.tobytes(),
    )
    return _block(POSES, b"".join(parts), flags=FROM_TRUTH if truth else 0)


def encode_scan(robot_id: int, index: int, scan: LaserScan, sensor: Pose2, beams: int) -> bytes:
    """A scan of a robot's `index`-th laser, thinned to at most `beams` of its beams.

    `sensor` is the laser's pose in `map` when it saw this.
    """
    stride = max(1, math.ceil(len(scan.ranges) / max(1, beams)))
    distances = read_ranges(scan.ranges[::stride], scan.range_min, scan.range_max).distances
    step = RANGE_STEP
    if math.isfinite(scan.range_max):
        step = max(step, scan.range_max / MAX_STEPS)
    floats = np.array((*sensor, scan.angle_min, scan.angle_increment * stride, scan.range_max, step))
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.minimum(np.rint(distances / np.float32(step)), MAX_STEPS)
        head = _SCAN.pack(index, len(steps), *floats.astype(np.float32).tolist())
    found = np.where(distances > 0.0, steps, INVALID).astype("<u2")
    found[distances >= step * MAX_STEPS] = NO_RETURN
    return _block(SCAN, head + found.tobytes(), owner=robot_id)


def encode_doc(name: str, document: bytes) -> bytes:
    return _block(DOC, _text(name) + document)


def encode_tile(meta: Mapping[str, Any], cells: NDArray[np.int8]) -> bytes:
    """A tile of a grid, row 0 at the lowest y; `meta` says where it lies."""
    return _block(GRID, _meta(meta) + zlib.compress(cells.tobytes(), 1))


def encode_path(key: str, points: NDArray[np.float64]) -> bytes:
    """Points in `map`, in metres: the first two columns."""
    return _numbers(PATH, {"key": key}, points[:, :2], "<f4")


def encode_pose_array(key: str, poses: NDArray[np.float64]) -> bytes:
    """Poses (n, 3) in `map`: metres and radians."""
    return _numbers(POSE_ARRAY, {"key": key}, poses, "<f4")


def encode_samples(topic: str, field: str, pairs: NDArray[np.float64]) -> bytes:
    """Pairs (n, 2) of time in seconds and value."""
    return _numbers(SAMPLES, {"topic": topic, "field": field}, pairs, "<f8")


def _numbers(kind: int, meta: Mapping[str, Any], numbers: NDArray[np.float64], form: str) -> bytes:
    head, encoded = _meta(meta), numbers.astype(form)
    return _block(kind, head + bytes(-len(head) % encoded.itemsize) + encoded.tobytes())


def _meta(meta: Mapping[str, Any]) -> bytes:
    return _text(json.dumps(meta, separators=(",", ":")))


def _text(text: str) -> bytes:
    encoded = text.encode()
    return _LENGTH.pack(len(encoded)) + encoded


def tiles_of(width: int, height: int) -> Iterator[tuple[int, int, int, int]]:
    """Column, row, width and height of each tile of a grid, in cells."""
    for row in range(0, height, TILE):
        for column in range(0, width, TILE):
            yield column, row, min(TILE, width - column), min(TILE, height - row)
