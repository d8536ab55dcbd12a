"""Encoding and decoding of the most frequent messages (docs/benchmarks.md)."""

from typing import Any

import numpy as np
import pytest

from zteam.messages import (
    Header,
    LaserScan,
    Message,
    Odometry,
    TFMessage,
    Time,
    TransformStamped,
    Twist,
    decode,
    encode,
)

TRANSFORM = TransformStamped(Header(Time(1, 2), "robot_0/odom"), "robot_0/base_footprint")
SAMPLES: list[Message] = [
    LaserScan(ranges=np.ones(1081, np.float32)),
    Twist(),
    Odometry(child_frame_id="robot_0/base_footprint"),
    TFMessage([TRANSFORM] * 4),
]
each = pytest.mark.parametrize("message", SAMPLES, ids=lambda message: type(message).__name__)


@each
def test_encode(benchmark: Any, message: Message) -> None:
    """A message becomes the bytes that it has alone."""
    assert benchmark(encode, message) == encode(message)


@each
def test_decode(benchmark: Any, message: Message) -> None:
    """Bytes become the message that has them."""
    payload = encode(message)
    assert encode(benchmark(decode, type(message), payload)) == payload
