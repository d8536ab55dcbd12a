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
from zteam.simulator.core.occupancy_grid import MAX_CELLS


class Wire(MemoryTransport):
    """A session that hears what the test gives it, with any time stamp."""

    def __init__(self, hub: MemoryHub) -> None:
        super().__init__(hub)
        self.hear: Callable[[RawSample], None]

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        self.hear = handler
        return super().declare_subscriber(key_expr, handler, latched, stamped)


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


def test_in_memory_a_message_that_is_put_stays_the_senders_own(hub: MemoryHub) -> None:
    """Receivers, late subscribers of a latched key among them, get what its bytes say."""
    heard: list[Float32] = []
    hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message))
    publisher, sent = hub.bus().publisher("a", Float32, latched=True), Float32(0.1)
    publisher.put(sent)
    sent.data = 7.0
    hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message), latched=True)
    assert [message.data for message in heard] == [np.float32(0.1)] * 2


def test_in_memory_a_message_that_is_handed_over_is_not_copied(hub: MemoryHub) -> None:
    """Its receivers get the sender's own."""
    heard: list[Float32] = []
    for _ in range(2):
        hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message))
    sent = Float32(0.5)
    hub.bus().publisher("a", Float32).put_owned(sent)
    assert len(heard) == 2
    assert all(message is sent for message in heard)


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


def test_in_memory_a_message_gets_bytes_where_a_reader_asks(hub: MemoryHub) -> None:
    """A subscriber of undecoded samples reads the same bytes as from another process."""
    samples: list[RawSample] = []
    hub.bus().subscribe_raw("a", samples.append)
    hub.bus().publisher("a", Bool).put(Bool(True))
    assert samples[0].payload == encode(Bool(True))


def test_in_memory_a_number_that_is_not_finite_is_dropped_by_each_receiver(hub: MemoryHub) -> None:
    """The sender learns nothing of it; the receiver counts it with the reason that it would have had for the bytes."""
    receiver, heard = hub.bus(), []
    receiver.subscribe("a", Pose, lambda _, pose: heard.append(pose))
    hub.bus().publisher("a", Pose).put(Pose(Point(x=math.nan)))
    count = receiver.counters.snapshot()["a"]
    assert (heard, count.received, count.dropped) == ([], 0, 1)
    assert count.last_drop_reason == "a number is not finite"


def test_subscribers_may_come_and_go_between_two_messages(hub: MemoryHub) -> None:
    """A publisher in memory notices it at the next message."""
    publisher, heard = hub.bus().publisher("a", Bool), []
    for count in (0, 1, 0, 2):
        handles = [hub.bus().subscribe("*", Bool, lambda key, _: heard.append(key)) for _ in range(count)]
        assert publisher.has_subscribers == bool(count)
        publisher.put(Bool(True))
        assert heard == ["a"] * count
        heard.clear()
        for handle in handles:
            handle.close()


def test_the_largest_map_is_small_enough() -> None:
    """What a simulator publishes is not refused for its size."""
    largest = OccupancyGrid(info=MapMetaData(width=MAX_CELLS, height=1), data=np.zeros(MAX_CELLS, np.int8))
    assert len(encode(largest)) <= transport.MAX_PAYLOAD


def test_a_message_of_another_type_is_refused(hub: MemoryHub) -> None:
    """Put refuses what is no message of the publisher's type: it names the key and both types."""
    publisher = hub.bus().publisher("robot_0/seen", Bool)
    for wrong, shown in ((MapMetaData(), "MapMetaData"), (True, "bool"), (None, "NoneType")):
        with pytest.raises(UsageError) as caught:
            publisher.put(wrong)  # type: ignore[arg-type]
        assert str(caught.value) == f"robot_0/seen carries Bool: put was given a {shown}"
