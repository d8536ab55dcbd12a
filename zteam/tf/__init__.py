"""The transform buffer and tree: tf2's contract without its faults. No bus."""

from zteam.tf.buffer import Buffer
from zteam.tf.errors import (
    BackwardExtrapolationException,
    ConnectivityException,
    ExtrapolationException,
    ForwardExtrapolationException,
    InvalidArgumentException,
    LookupException,
    NoDataForExtrapolationException,
    TimeoutException,
    TransformException,
)
from zteam.tf.time_cache import FrameInfo
from zteam.tf.validation import Rejection

__all__ = [
    "BackwardExtrapolationException",
    "Buffer",
    "ConnectivityException",
    "ExtrapolationException",
    "ForwardExtrapolationException",
    "FrameInfo",
    "InvalidArgumentException",
    "LookupException",
    "NoDataForExtrapolationException",
    "Rejection",
    "TimeoutException",
    "TransformException",
]
