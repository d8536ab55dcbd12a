"""The transform buffer in one process, compared with Debian's tf2_py if that can be imported."""

import importlib
import math
import random
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import msgspec

from zteam.clock import process_time
from zteam.messages import (
    Header,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    decode,
    encode,
    time_from_ns,
)
from zteam.tf import Buffer

_STEP = 20_000_000
_SECONDS = 10
_LOOKUPS, _ROUNDS = 5000, 7
_START = 1_000_000_000

Row = tuple[str, str, int, tuple[float, ...]]
"""parent, child, stamp in ns (0 = static); x, y, yaw."""


class BufferFigures(msgspec.Struct):
    """One tree: calls per second of one core. A ratio is tf2_py's time by ours, the median of alternating rounds."""

    robots: int
    set_per_s: float
    latest_per_s: float
    past_per_s: float
    set_ratio: float | None
    """None without tf2_py."""
    latest_ratio: float | None
    past_ratio: float | None


class ListenerFigures(msgspec.Struct):
    """The cost of receiving a large team's transforms: bundles decoded and stored, without the bus."""

    robots: int
    transforms_per_s: int
    core_share: float
    """Share of one core in real time."""
    samples: int
    """Samples in the buffer after `seconds` simulated seconds; they do not grow with time."""
    seconds: int


def measure_listener(robots: int = 100, frames: int = 4, seconds: int = 600) -> ListenerFigures:
    """Measure a team in which every robot publishes `frames` moving frames at 50 Hz, in one bundle per tick."""
    buffer, spent = Buffer(), 0.0
    identity = Transform(Vector3(1.0, 2.0, 0.0), Quaternion())
    edges = [(f"robot_{i}/f{k}", f"robot_{i}/f{k + 1}") for i in range(robots) for k in range(frames)]
    for tick in range(seconds * 10**9 // _STEP):
        header_stamp = time_from_ns(_START + tick * _STEP)
        bundle = encode(TFMessage([TransformStamped(Header(header_stamp, p), c, identity) for p, c in edges]))
        begin = process_time()
        for transform in decode(TFMessage, bundle).transforms:
            buffer.set_transform(transform, "tf")
        spent += process_time() - begin
    samples = sum(info.samples for info in buffer.frames().values())
    return ListenerFigures(robots, len(edges) * 10**9 // _STEP, spent / seconds, samples, seconds)


def _tree(robots: int) -> list[Row]:
    """Ten seconds of a team: odom -> base_footprint at 50 Hz, each robot with its own offset; the rest is static."""
    pick, rows = random.Random(1), []
    for i in range(robots):
        own = f"robot_{i}"
        rows.append(("map", f"{own}/odom", 0, (float(i), -2.0, 0.5)))
        rows.append((f"{own}/base_footprint", f"{own}/base_link", 0, (0.0, 0.0, 0.0)))
        rows.append((f"{own}/base_link", f"{own}/base_laser_link", 0, (0.05, 0.0, 0.0)))
        late = pick.randrange(1, _STEP)
        rows += [
            (
                f"{own}/odom",
                f"{own}/base_footprint",
                _START + k * _STEP + late,
                (0.01 * k, 0.0, 0.3 * math.sin(k)),
            )
            for k in range(_SECONDS * 10**9 // _STEP)
        ]
    return sorted(rows, key=lambda row: row[2])


def measure_buffers(robots: int, tf2_path: Path | None) -> BufferFigures:
    """Measure the buffers with the tree of `robots` robots."""
    rows = _tree(robots)
    pick = random.Random(2)
    first, last = _START + 200_000_000, _START + _SECONDS * 10**9 - _STEP
    times = [pick.randrange(first, last) for _ in range(_LOOKUPS)]
    # A follower looks up the same pair all the time: its leader in its own frame.
    pairs = [("robot_0/base_footprint", f"robot_{min(3, robots - 1)}/base_laser_link")] * _LOOKUPS
    ours = _prepare_ours(rows, pairs, times)
    theirs = _prepare_tf2(rows, pairs, times, tf2_path)
    spent: list[list[tuple[float, float]]] = [[], [], []]
    for _ in range(_ROUNDS):
        for kind in range(3):
            mine = _time(ours[kind])
            spent[kind].append((mine, _time(theirs[kind]) if theirs else 0.0))
    counts = len(rows), _LOOKUPS, _LOOKUPS
    rates = [count / median(mine for mine, _ in s) for count, s in zip(counts, spent, strict=True)]
    ratios = [median(other / mine for mine, other in s) if theirs else None for s in spent]
    return BufferFigures(robots, *rates, *ratios)


def _time(action: Callable[[], None]) -> float:
    begin = process_time()
    action()
    return process_time() - begin


def _yaw(yaw: float) -> tuple[float, float]:
    return math.sin(0.5 * yaw), math.cos(0.5 * yaw)


Actions = tuple[Callable[[], None], Callable[[], None], Callable[[], None]]


def _prepare_ours(rows: list[Any], pairs: list[tuple[str, str]], times: list[int]) -> Actions:
    messages = []
    for parent, child, stamp, (x, y, yaw) in rows:
        z, w = _yaw(yaw)
        transform = Transform(Vector3(x, y, 0.0), Quaternion(0.0, 0.0, z, w))
        messages.append((TransformStamped(Header(time_from_ns(stamp), parent), child, transform), stamp == 0))
    filled = Buffer()

    def fill(buffer: Buffer) -> None:
        _fill(messages, buffer.set_transform, buffer.set_transform_static)

    fill(filled)
    latest, past = _askers(filled.lookup_transform, pairs, 0, times)
    return lambda: fill(Buffer()), latest, past


def _fill(messages: list[tuple[Any, bool]], put: Callable[..., Any], put_static: Callable[..., Any]) -> None:
    for message, static in messages:
        if static:
            put_static(message, "bench")
        else:
            put(message, "bench")


def _askers(
    look_up: Callable[..., Any], pairs: list[tuple[str, str]], now: Any, times: list[Any]
) -> tuple[Callable[[], None], Callable[[], None]]:
    def latest() -> None:
        for target, source in pairs:
            look_up(target, source, now)

    def past() -> None:
        for (target, source), time in zip(pairs, times, strict=True):
            look_up(target, source, time)

    return latest, past


def _prepare_tf2(
    rows: list[Any], pairs: list[tuple[str, str]], times: list[int], tf2_path: Path | None
) -> Actions | None:
    if tf2_path is not None:
        sys.path.append(str(tf2_path))
    try:
        with warnings.catch_warnings():
            # ROS 1's modules warn on new Python versions.
            warnings.simplefilter("ignore")
            tf2, genpy, ros = (importlib.import_module(name) for name in ("tf2_py", "genpy", "geometry_msgs.msg"))
    except ImportError:
        return None
    messages = []
    for parent, child, stamp, (x, y, yaw) in rows:
        message = ros.TransformStamped()
        message.header.frame_id, message.child_frame_id = parent, child
        message.header.stamp = genpy.Time(*divmod(stamp, 10**9))
        message.transform.translation.x, message.transform.translation.y = x, y
        message.transform.rotation.z, message.transform.rotation.w = _yaw(yaw)
        messages.append((message, stamp == 0))
    filled, now = tf2.BufferCore(genpy.Duration(_SECONDS)), genpy.Time()
    asked = [genpy.Time(*divmod(time, 10**9)) for time in times]

    def fill(buffer: Any) -> None:
        _fill(messages, buffer.set_transform, buffer.set_transform_static)

    fill(filled)
    latest, past = _askers(filled.lookup_transform_core, pairs, now, asked)
    return lambda: fill(tf2.BufferCore(genpy.Duration(_SECONDS))), latest, past
