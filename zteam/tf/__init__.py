"""The transform buffer and tree: they behave like tf2, without its faults. They do not use the bus."""

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
from zteam.tf.tree import FrameInfo, Rejection

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
