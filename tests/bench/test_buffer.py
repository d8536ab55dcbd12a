"""The transform buffer, beside tf2_py where that can be imported (docs/benchmarks.md).

Debian's tf2_py is found with PYTHONPATH. Ten seconds of a team: odom -> base_footprint at 50 Hz, the rest is static.
"""

import importlib
import math
import random
import warnings
from collections.abc import Callable
from typing import Any

import pytest

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

STEP, START, SECONDS, LOOKUPS = 20_000_000, 1_000_000_000, 10, 5000
ROBOTS = 4
PAIR = "robot_0/base_footprint", "robot_3/base_laser_link"
"""A follower looks up the same pair all the time: its leader in its own frame."""

Row = tuple[str, str, int, tuple[float, float, float]]
"""Parent, child, stamp in ns (0: static); x, y and yaw."""
Rows = list[Row]


def make_rows() -> Rows:
    """Each robot with its own offset of time."""
    pick, rows = random.Random(1), list[Row]()
    for i in range(ROBOTS):
        own, late = f"robot_{i}", pick.randrange(1, STEP)
        rows.append(("map", f"{own}/odom", 0, (float(i), -2.0, 0.5)))
        rows.append((f"{own}/base_footprint", f"{own}/base_link", 0, (0.0, 0.0, 0.0)))
        rows.append((f"{own}/base_link", f"{own}/base_laser_link", 0, (0.05, 0.0, 0.0)))
        for k in range(SECONDS * 10**9 // STEP):
            pose = (0.01 * k, 0.0, 0.3 * math.sin(k))
            rows.append((f"{own}/odom", f"{own}/base_footprint", START + k * STEP + late, pose))
    return sorted(rows, key=lambda row: row[2])


def draw_times() -> list[int]:
    """Times in the past, ns."""
    pick = random.Random(2)
    return [pick.randrange(START + 200_000_000, START + SECONDS * 10**9 - STEP) for _ in range(LOOKUPS)]


class Ours:
    """zteam's buffer."""

    new = Buffer

    @staticmethod
    def message(row: Row) -> Any:
        """One transform as it takes them."""
        parent, child, stamp, (x, y, yaw) = row
        rotation = Quaternion(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
        return TransformStamped(Header(time_from_ns(stamp), parent), child, Transform(Vector3(x, y, 0.0), rotation))

    @staticmethod
    def ask(buffer: Any) -> Callable[[str, str, Any], Any]:
        """Its look-up."""
        return buffer.lookup_transform  # type: ignore[no-any-return]

    time = staticmethod(lambda ns: ns)


class Tf2:
    """Debian's."""

    def __init__(self) -> None:
        with warnings.catch_warnings():
            # ROS 1's modules warn on new Python versions.
            warnings.simplefilter("ignore")
            self._tf2, self._genpy, self._ros = (
                importlib.import_module(name) for name in ("tf2_py", "genpy", "geometry_msgs.msg")
            )

    def new(self) -> Any:
        """An empty buffer."""
        return self._tf2.BufferCore(self._genpy.Duration(SECONDS))

    def message(self, row: Row) -> Any:
        """One transform as it takes them."""
        parent, child, stamp, (x, y, yaw) = row
        message = self._ros.TransformStamped()
        message.header.frame_id, message.child_frame_id = parent, child
        message.header.stamp = self.time(stamp)
        message.transform.translation.x, message.transform.translation.y = x, y
        message.transform.rotation.z, message.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        return message

    @staticmethod
    def ask(buffer: Any) -> Callable[[str, str, Any], Any]:
        """Its look-up."""
        return buffer.lookup_transform_core  # type: ignore[no-any-return]

    def time(self, ns: int) -> Any:
        """A time as it takes them."""
        return self._genpy.Time(*divmod(ns, 10**9))


@pytest.fixture(params=["zteam", "tf2"])
def side(request: pytest.FixtureRequest) -> Any:
    """The one that is measured; tf2 is skipped where it cannot be imported."""
    if request.param == "zteam":
        return Ours()
    try:
        return Tf2()
    except ImportError:
        pytest.skip("Debian's python3-tf2 cannot be imported")


def fill(buffer: Any, messages: list[tuple[Any, bool]]) -> Any:
    """Set all transforms."""
    for message, is_static in messages:
        (buffer.set_transform_static if is_static else buffer.set_transform)(message, "bench")
    return buffer


def filled(side: Any) -> Any:
    """A buffer with all of them."""
    return fill(side.new(), [(side.message(row), row[2] == 0) for row in make_rows()])


def test_set(benchmark: Any, side: Any) -> None:
    """All transforms are set, and the pair is connected."""
    messages = [(side.message(row), row[2] == 0) for row in make_rows()]
    buffer = benchmark(lambda: fill(side.new(), messages))
    assert side.ask(buffer)(*PAIR, side.time(0)).child_frame_id == PAIR[1]


def test_latest(benchmark: Any, side: Any) -> None:
    """The newest transform of the pair, time after time."""
    ask, now = side.ask(filled(side)), side.time(0)
    found = benchmark(lambda: [ask(*PAIR, now) for _ in range(LOOKUPS)])
    assert found[-1].child_frame_id == PAIR[1]


def test_past(benchmark: Any, side: Any) -> None:
    """A transform of the past, between two samples."""
    ask, times = side.ask(filled(side)), [side.time(ns) for ns in draw_times()]
    found = benchmark(lambda: [ask(*PAIR, time) for time in times])
    assert len(found) == LOOKUPS


def test_listening_to_100_robots(benchmark: Any) -> None:
    """A bundle of 400 moving frames, decoded and stored, in each of 50 ticks; samples do not grow with time."""
    identity = Transform(Vector3(1.0, 2.0, 0.0), Quaternion())
    edges = [(f"robot_{i}/f{k}", f"robot_{i}/f{k + 1}") for i in range(100) for k in range(4)]
    bundles = [
        encode(TFMessage([TransformStamped(Header(time_from_ns(START + t * STEP), p), c, identity) for p, c in edges]))
        for t in range(50)
    ]

    def listen() -> Buffer:
        buffer = Buffer()
        for bundle in bundles:
            buffer.set_transforms(decode(TFMessage, bundle).transforms, "tf")
        return buffer

    assert sum(info.samples for info in benchmark(listen).frames().values()) == 50 * len(edges)
