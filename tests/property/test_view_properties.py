"""The view's wire, for whatever comes."""

import math
import socket

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.view.frames import decode_frame
from support.examples import examples
from support.limits import LIMIT
from support.web_view import open_view
from zteam.bus import MemoryHub
from zteam.errors import DecodeError
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan
from zteam.view import frames
from zteam.view.commands import spread
from zteam.view.composing import number_at
from zteam.view.requests import decode_request

coordinates = st.floats(-300.0, 300.0)
poses = st.builds(Pose2, coordinates, coordinates, st.floats(-math.pi, math.pi))
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=8), inner, max_size=5),
    max_leaves=20,
)
OPS = ["hello", "ack", "look", "watch", "goal", "take", "drive", "step", "speed", "spawn", "move"]
FIELDS = ["seq", "robot", "robots", "x", "y", "yaw", "viewport", "layers", "beams", "topic", "field", "linear", "ticks"]


@given(st.dictionaries(st.integers(0, 9999), poses, max_size=50))
def test_poses_arrive_within_half_a_step(robots: dict[int, Pose2]) -> None:
    """Every pose within 300 m of the origin comes back to half a centimetre and half a ten-thousandth of a radian."""
    _, ((_, _, _, body),) = decode_frame(frames.encode_frame(1, 0, 0.0, 0.0, [frames.encode_poses(robots)]))
    x0, y0, step = np.frombuffer(body, "<f4", 3).astype(float)
    count = int(np.frombuffer(body, "<u4", 1, 12)[0])
    ids = np.frombuffer(body, "<u2", count, 16).tolist()
    begin = 16 + 2 * count + 2 * (count % 2)
    numbers = np.frombuffer(body, "<i2", 3 * count, begin).reshape(3, count)
    assert ids == list(robots)
    for column, pose in zip(numbers.T.tolist(), robots.values(), strict=True):
        assert abs(x0 + step * column[0] - pose.x) < 0.0051
        assert abs(y0 + step * column[1] - pose.y) < 0.0051
        assert abs(normalize_angle(column[2] * 1e-4 - pose.yaw)) < 0.6e-4


@given(
    st.lists(st.floats(width=32, allow_nan=True, allow_infinity=True), max_size=300),
    st.integers(1, 400),
    st.floats(0.5, 100.0),
)
def test_any_ranges_become_a_scan(ranges: list[float], beams: int, range_max: float) -> None:
    """No value, however odd, is an error; what is in range comes back to half a step."""
    scan = LaserScan(range_min=0.1, range_max=range_max, ranges=np.array(ranges, np.float32))
    body = frames.encode_scan(0, 0, scan, Pose2(0.0, 0.0, 0.0), beams)[8:]
    count = int(np.frombuffer(body, "<u2", 1, 2)[0])
    step = float(np.frombuffer(body, "<f4", 1, 28)[0])
    stride = max(1, math.ceil(len(ranges) / beams))
    kept = np.array(ranges, np.float32)[::stride]
    steps = np.frombuffer(body, "<u2", count, 32)
    assert count == len(kept) <= beams
    for value, told in zip(kept.tolist(), steps.tolist(), strict=True):
        is_too_far = range_max * (1.0 + 1e-6) < value < math.inf
        if is_too_far or not value >= np.float32(0.1):
            assert told == frames.INVALID
        elif value >= np.float32(range_max):
            assert told == frames.NO_RETURN
        else:
            assert abs(told * step - value) <= 0.51 * step + 1e-5


@examples(1000)
@given(st.sampled_from(OPS), st.dictionaries(st.sampled_from(FIELDS), json_values, max_size=8))
def test_requests_with_any_fields_are_taken_or_refused(op: str, fields: dict[str, object]) -> None:
    """Nearly right requests are the hardest."""
    try:
        decode_request(msgspec.json.encode({"op": op, **fields}))
    except DecodeError:
        pass


@given(st.text(max_size=40))
def test_any_path_leads_to_a_number_or_nowhere(path: str) -> None:
    """A field that a message lacks is none, and no path raises."""
    assert number_at(LaserScan(ranges=np.ones(3, np.float32)), path) is None or path


@given(poses, st.dictionaries(st.integers(0, 99), poses, min_size=1, max_size=12), st.integers(0, 2**31))
def test_each_robot_gets_a_goal_of_its_own(goal: Pose2, robots: dict[int, Pose2], walls: int) -> None:
    """However the walls lie, no two robots are sent to one place."""
    goals = spread(goal, robots, lambda x, y: hash((round(x, 3), round(y, 3), walls)) % 3 > 0)
    assert goals.keys() == robots.keys()
    assert len({(round(each.x, 6), round(each.y, 6)) for each in goals.values()}) == len(robots)


_PARTS = (
    b"page", b"js", b"main.js", b"layout.json", b"ws", b"..", b"%2e%2e", b"%00.js", b"%ed%a0%80.js", b"%ff", b"%",
    b"x" * 256 + b".js", b"a/" * 2000 + b"a.js", b"?", b"#", b"*", b"", b"http://127.0.0.1", b"\xe9.js",
)  # fmt: skip
"""Parts of a request's target, and what stands in none."""


def test_no_path_is_an_error_of_the_server(caplog: pytest.LogCaptureFixture) -> None:
    """Whatever a client asks for: an answer below 500, no traceback in the log, and the next client is served."""
    with open_view(MemoryHub().bus()) as view:

        @examples(500)
        @given(st.sampled_from([b"/", b"/page/"]), st.lists(st.sampled_from(_PARTS) | st.binary(max_size=8)))
        def ask(begin: bytes, parts: list[bytes]) -> None:
            target = (begin + b"/".join(parts)).replace(b"\r", b"").replace(b"\n", b"")
            with socket.create_connection(("127.0.0.1", view.port), LIMIT) as client:
                client.sendall(b"GET %b HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n" % target)
                version, status = client.makefile("rb").readline().split(b" ")[:2]
            assert (version, status < b"500") == (b"HTTP/1.1", True)

        ask()
        assert view.get("/").status == 200
    assert not [record for record in caplog.records if record.exc_info]
