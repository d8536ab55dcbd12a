"""Types of std_msgs, builtin_interfaces, rosgraph_msgs and rcl_interfaces, as in ROS 2 Jazzy."""

from typing import ClassVar

import msgspec

from zteam.clock import NS_PER_S
from zteam.messages.message import Message, bool_, float32, float64, int32, uint8, uint32


class Time(Message):
    """A point in time."""

    ros_type: ClassVar[str] = "builtin_interfaces/msg/Time"
    sec: int32 = 0
    nanosec: uint32 = 0


class Duration(Message):
    """A span of time."""

    ros_type: ClassVar[str] = "builtin_interfaces/msg/Duration"
    sec: int32 = 0
    nanosec: uint32 = 0


class Header(Message):
    """When and in which frame a message holds."""

    stamp: Time = msgspec.field(default_factory=Time)
    frame_id: str = ""


class Stamped(Message):
    """Base of messages that begin with a header; no type of its own."""

    ros_type: ClassVar[str] = ""
    header: Header = msgspec.field(default_factory=Header)


class Bool(Message):
    """A truth value."""

    data: bool_ = False


class Int32(Message):
    """A whole number."""

    data: int32 = 0


class Float32(Message):
    """A number."""

    data: float32 = 0.0


class Float64(Message):
    """A number."""

    data: float64 = 0.0


class String(Message):
    """A text."""

    data: str = ""


class ColorRGBA(Message):
    """A colour; channels 0 to 1."""

    r: float32 = 0.0
    g: float32 = 0.0
    b: float32 = 0.0
    a: float32 = 1.0


class Clock(Message):
    """Simulated time."""

    ros_type: ClassVar[str] = "rosgraph_msgs/msg/Clock"
    clock: Time = msgspec.field(default_factory=Time)


class Log(Message):
    """A line of a process's log; `level` is one of LogLevel, `name` the process."""

    ros_type: ClassVar[str] = "rcl_interfaces/msg/Log"
    stamp: Time = msgspec.field(default_factory=Time)
    level: uint8 = 0
    name: str = ""
    msg: str = ""
    file: str = ""
    function: str = ""
    line: uint32 = 0


class LogLevel:
    """Values of Log.level."""

    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


def time_from_ns(nanoseconds: int) -> Time:
    """A stamp from integer nanoseconds."""
    return Time(nanoseconds // NS_PER_S, nanoseconds % NS_PER_S)


def ns_from_time(time: Time) -> int:
    """Integer nanoseconds from a stamp."""
    return time.sec * NS_PER_S + time.nanosec
