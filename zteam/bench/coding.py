"""Encoding and decoding of the most frequent messages."""

from collections.abc import Callable
from statistics import median

import msgspec
import numpy as np

from zteam.clock import process_time
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

_ROUNDS, _CALLS = 7, 2000


class CodecFigures(msgspec.Struct):
    """Size of one message type, and median microseconds per call."""

    type: str
    bytes: int
    encode_us: float
    decode_us: float


def measure_codec() -> list[CodecFigures]:
    """Figures of a 1081-beam scan, a Twist, an Odometry and a message of four transforms."""
    transform = TransformStamped(Header(Time(1, 2), "robot_0/odom"), "robot_0/base_footprint")
    samples: list[Message] = [
        LaserScan(ranges=np.ones(1081, np.float32)),
        Twist(),
        Odometry(child_frame_id="robot_0/base_footprint"),
        TFMessage([transform] * 4),
    ]
    return [_measure(sample) for sample in samples]


def _measure(message: Message) -> CodecFigures:
    payload, kind = encode(message), type(message)
    return CodecFigures(
        kind.ros_type, len(payload), _median_us(lambda: encode(message)), _median_us(lambda: decode(kind, payload))
    )


def _median_us(call: Callable[[], object]) -> float:
    rounds = []
    for _ in range(_ROUNDS):
        begin = process_time()
        for _ in range(_CALLS):
            call()
        rounds.append(1e6 * (process_time() - begin) / _CALLS)
    return round(median(rounds), 3)
