"""The typed bus on a bus in memory: latched keys and refusals."""

import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np
import pytest

from zteam.bus import Bus, MemoryHub, receiving, transport
from zteam.bus.memory import MemoryTransport
from zteam.bus.transport import Closeable, RawSample, SampleHandler
from zteam.errors import UsageError
from zteam.messages import (
    Bool,
    Float32,
    MapMetaData,
    Message,
    OccupancyGrid,
    Point,
    Pose,
    bool_,
    encode,
    encoding_of,
)
from zteam.simulator.world.placing import MAX_MAP_CELLS


class Wire(MemoryTransport):
    """A session that hears what the test gives it, with any time stamp."""

    def __init__(self, hub: MemoryHub) -> None:
        super().__init__(hub)
        self.hear: Callable[[RawSample], None]

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, from_others: bool = False
    ) -> Closeable:
        self.hear = handler
        return super().declare_subscriber(key_expr, handler, latched)


def test_a_latched_key_beyond_the_limit_passes_over_older_values(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many keys there are, an older value of a known one is passed over."""
    monkeypatch.setattr(receiving, "MAX_KEYS", 2)
    wire, heard = Wire(hub), []
    Bus(wire).subscribe("*", Bool, lambda key, _: heard.append(key), latched=True)
    for key, stamp in (("a", 1), ("b", 1), ("a", 3), ("a", 2), ("b", 2), ("b", 1), ("c", 1)):
        wire.hear(RawSample(key, encode(Bool(True)), encoding_of(Bool), stamp, "x"))
    assert heard == ["a", "b", "a", "b", "c"]


def test_in_memory_a_message_is_copied_unless_it_is_given_away(hub: MemoryHub) -> None:
    """Receivers, late subscribers of a latched key among them, get what the bytes of a message say that is put, and the
    very message that its sender gives away."""
    heard: list[Float32] = []
    for _ in range(2):
        hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message))
    publisher, sent, given = hub.bus().publisher("a", Float32, latched=True), Float32(0.1), Float32(0.5)
    publisher.put(sent)
    sent.data = 7.0
    hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message), latched=True)
    assert [message.data for message in heard] == [np.float32(0.1)] * 3
    publisher.put_owned(given)
    assert len(heard) == 6
    assert all(message is given for message in heard[3:])


@pytest.mark.usefixtures("own_types")
def test_in_memory_a_type_that_was_defined_anew_is_decoded(hub: MemoryHub) -> None:
    """A publisher of the old class reaches a subscriber of the new one, which gets a message of its own class."""

    def define() -> type[Message]:
        class Lamp(Message):
            ros_type: ClassVar[str] = "my_msgs/msg/Lamp"
            on: bool_ = False

        return Lamp

    old, new = define(), define()
    heard: list[Message] = []
    listener = hub.bus()
    listener.subscribe("lamp", new, lambda _, message: heard.append(message))
    hub.bus().publisher("lamp", old).put(old(True))  # type: ignore[call-arg]
    assert [type(message) for message in heard] == [new]
    assert heard == [new(True)]  # type: ignore[call-arg]
    assert listener.counters.snapshot()["lamp"].received == 1


def test_in_memory_a_number_that_is_not_finite_is_dropped_by_each_receiver(hub: MemoryHub) -> None:
    """The sender learns nothing of it; the receiver counts it with the reason that it would have had for the bytes."""
    receiver, heard = hub.bus(), []
    receiver.subscribe("a", Pose, lambda _, pose: heard.append(pose))
    hub.bus().publisher("a", Pose).put(Pose(Point(x=math.nan)))
    count = receiver.counters.snapshot()["a"]
    assert (heard, count.received, count.dropped) == ([], 0, 1)
    assert count.last_drop_reason == "a number is not finite"


def test_the_largest_map_is_small_enough() -> None:
    """What a simulator publishes is not refused for its size; a cell has one byte."""
    smallest, small = (encode(OccupancyGrid(data=np.zeros(cells, np.int8))) for cells in (1, 1001))
    assert len(small) == len(smallest) + 1000
    assert len(small) + MAX_MAP_CELLS <= transport.MAX_PAYLOAD


def test_a_message_of_another_type_is_refused(hub: MemoryHub) -> None:
    """Put refuses what is no message of the publisher's type."""
    publisher = hub.bus().publisher("robot_0/seen", Bool)
    for wrong in (MapMetaData(), True, None):
        with pytest.raises(UsageError, match="robot_0/seen carries Bool"):
            publisher.put(wrong)  # type: ignore[arg-type]
