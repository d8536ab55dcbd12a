"""The transform buffer and tree: they behave like tf2, without its faults. They do not use the bus."""

from zteam.transforms.buffer import Buffer
from zteam.transforms.errors import (
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
from zteam.transforms.tree import FrameInfo, Rejection

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
