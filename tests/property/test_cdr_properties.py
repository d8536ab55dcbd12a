"""The codec agrees with rosbags and `share`, refuses wrong bytes, and reads parts of a TFMessage like the whole."""

import tracemalloc
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import astuple
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from support.examples import examples
from support.strategies import messages
from zteam.errors import DecodeError
from zteam.messages import Message, all_types, decode, encode

_ZTEAM_MSGS = {
    "zteam_msgs/msg/RobotStatus": "std_msgs/Header header\nint32 robot_id\nbool is_ready\nuint8 state\n"
    "uint32 epoch\nstring text\nstring behavior\nstring driver\nstring reason\nint32 leader\nfloat64 speed\n"
    "int32 follows\nint32 turns\nfloat64 gap\nbool is_stopped\n"
    "int32 waits_for\nint32 blocked_by\nuint8 goal_state\n",
    "zteam_msgs/msg/BaseInfo": "string model\nstring drive\ngeometry_msgs/Polygon footprint\nfloat64 max_vel_x\n"
    "float64 min_vel_x\nfloat64 max_vel_theta\nfloat64 acc_lim_x\nfloat64 decel_lim_x\nfloat64 acc_lim_theta\n"
    "float64 max_vel_y\nfloat64 acc_lim_y\nfloat64 decel_lim_reverse\nfloat64 wheelbase\n",
    "zteam_msgs/msg/NavigationStatus": "std_msgs/Header header\nuint8 state\ngeometry_msgs/PoseStamped goal\n"
    "float64 distance_remaining\nbuiltin_interfaces/Duration estimated_time_remaining\nint32 recoveries\nstring text\n",
    "zteam_msgs/msg/TeamStatus": "std_msgs/Header header\nuint8 state\nuint32 epoch\nbuiltin_interfaces/Time go_stamp\n"
    "int32 team_size\nint32[] ready\nint32[] missing\nint32[] lost\nstring waiting_for\n",
    "zteam_msgs/msg/Fiducial": "int32 id\nfloat32 range\nfloat32 bearing\nfloat32 orientation\n",
    "zteam_msgs/msg/Fiducials": "std_msgs/Header header\nzteam_msgs/Fiducial[] fiducials\n",
    "zteam_msgs/msg/Bumper": "std_msgs/Header header\nbool[] pressed\n",
    "zteam_msgs/msg/Blob": "std_msgs/ColorRGBA color\nstring name\nfloat32 bearing\nfloat32 width\nfloat32 range\n",
    "zteam_msgs/msg/Blobs": "std_msgs/Header header\nzteam_msgs/Blob[] blobs\n",
    "zteam_msgs/msg/Tick": "builtin_interfaces/Time stamp\nuint32 epoch\nuint64 tick\nint32[] robots\n"
    "string[] participants\nstring[] sessions\nuint32 sent\nzteam_msgs/Input[] inputs\n",
    "zteam_msgs/msg/Done": "uint32 epoch\nuint64 tick\nbool has_command\ngeometry_msgs/Twist command\n"
    "uint32 sent\nstring[] reads\nzteam_msgs/Input[] inputs\n",
    "zteam_msgs/msg/Input": "uint64 number\nstring key\nstring type\nuint8[] data\n",
}
# Without those that other tests register when they are imported.
_TYPES = sorted(name for name in all_types() if not name.startswith("test_msgs/"))


@cache
def _store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    added: dict[str, Any] = {}
    for name, text in _ZTEAM_MSGS.items():
        added.update(get_types_from_msg(text, name))
    store.register(added)
    return store


def _to_rosbags(message: Any) -> Any:
    if isinstance(message, Message):
        fields = {name: _to_rosbags(getattr(message, name)) for name in message.__struct_fields__}
        return _store().types[type(message).ros_type](**fields)
    if isinstance(message, list):
        return [_to_rosbags(item) for item in message]
    return message


@pytest.mark.few(27)
@pytest.mark.parametrize("ros_type", _TYPES)
@given(data=st.data())
@examples(40)
def test_bytes_equal_those_of_rosbags(ros_type: str, data: st.DataObject) -> None:
    """Each message is encoded to the same bytes as by rosbags, and these decode to the same message."""
    message = data.draw(messages(all_types()[ros_type]))
    theirs = bytes(_store().serialize_cdr(_to_rosbags(message), ros_type))
    assert encode(message) == theirs
    assert decode(type(message), theirs) == message


def _state(value: Any) -> Any:
    """Everything that a message holds, with the type and the bits of each part."""
    if isinstance(value, Message):
        return type(value), [_state(part) for part in astuple(value)]
    if isinstance(value, list):
        return [_state(item) for item in value]
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape, value.tobytes(), value.flags.writeable
    return type(value), value.hex() if isinstance(value, float) else value


@pytest.mark.few(12)
@pytest.mark.parametrize("ros_type", _TYPES)
@given(data=st.data())
@examples(20)
def test_big_endian_bytes_of_rosbags_decode(ros_type: str, data: st.DataObject) -> None:
    """A big-endian payload gives the same message as a little-endian one."""
    message = data.draw(messages(all_types()[ros_type]))
    theirs = bytes(_store().serialize_cdr(_to_rosbags(message), ros_type, little_endian=False))
    assert decode(type(message), theirs) == message


@pytest.mark.few(12)
@pytest.mark.parametrize("ros_type", _TYPES)
@given(data=st.data())
@examples(30)
def test_damaged_messages_raise_only_the_codecs_error(ros_type: str, data: st.DataObject) -> None:
    """A valid payload with any bytes overwritten or cut off either decodes or raises DecodeError."""
    kind = all_types()[ros_type]
    payload = bytearray(encode(data.draw(messages(kind))))
    for _ in range(data.draw(st.integers(0, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.sampled_from([0, 1, 127, 128, 255]))
    cut = data.draw(st.integers(0, len(payload)))
    try:
        decode(kind, bytes(payload[:cut]))
    except DecodeError:
        pass


@pytest.mark.parametrize("ros_type", _TYPES)
def test_a_cut_message_is_refused(ros_type: str) -> None:
    """Every proper prefix of an encoded message raises DecodeError, but for one that was whole once: its type has new
    fields at its end."""
    kind = all_types()[ros_type]
    payload = encode(kind())
    once = len(payload) if kind.earlier is None else len(encode(kind.earlier()))
    for cut in {*range(len(payload))} - {*range(once, once + 4)}:
        with pytest.raises(DecodeError):
            decode(kind, payload[:cut])


@pytest.mark.parametrize("ros_type", _TYPES)
def test_absurd_lengths_allocate_nothing(ros_type: str) -> None:
    """A short payload that claims 2³² − 1 elements is refused before memory is allocated for them."""
    kind = all_types()[ros_type]
    payload = b"\0\1\0\0" + b"\xff" * 4096
    tracemalloc.start()
    try:
        with pytest.raises(DecodeError):
            decode(kind, payload)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()


def test_sequences_are_views_of_the_payload() -> None:
    """A scan's ranges are read without copying."""
    from zteam.messages import LaserScan

    payload = encode(LaserScan(ranges=np.arange(1081, dtype=np.float32)))
    ranges = decode(LaserScan, payload).ranges
    assert np.shares_memory(ranges, np.frombuffer(payload, np.uint8))
