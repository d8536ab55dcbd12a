"""The typed bus on a bus in memory: latched keys, refusals, and queries that change something."""

import math
from collections.abc import Callable
from typing import ClassVar

import msgspec
import numpy as np
import pytest

from zteam.bus import Bus, Change, MemoryHub, NoRequest, payloads, receiving
from zteam.bus.memory import MemoryTransport
from zteam.bus.presence import own_info
from zteam.bus.transport import Closeable, RawSample, SampleHandler
from zteam.errors import BusError, UsageError
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
from zteam.names import info_key
from zteam.sim.occupancy_grid import MAX_CELLS


class Told(msgspec.Struct):
    """An answer."""

    count: int


class Counting(Change):
    """A request that counts up."""

    by: int = 1


class Service:
    """A process `box` with a count that `box/add` changes and `box/count` tells."""

    def __init__(self, hub: MemoryHub, start: int = 0) -> None:
        self.bus = hub.bus()
        self.count = 0
        info = own_info("box", self.bus.instance, start)
        self._served = [
            self.bus.serve(info_key("box"), NoRequest, lambda _: info),
            self.bus.serve("box/add", Counting, self._add),
            self.bus.serve("box/count", NoRequest, lambda _: Told(self.count)),
        ]

    def _add(self, request: Counting) -> Told:
        self.count += request.by
        return Told(self.count)

    def close(self) -> None:
        """The process ends."""
        for served in self._served:
            served.close()


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


def test_in_memory_all_receivers_share_one_message(hub: MemoryHub) -> None:
    """It is neither encoded nor the sender's own; late subscribers of a latched key get the same one."""
    heard: list[Float32] = []
    contents: list[bytes | Float32] = []
    for _ in range(2):
        hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message))
    hub.bus().subscribe_contents("a", Float32, lambda _, content: contents.append(content))
    publisher, sent = hub.bus().publisher("a", Float32, latched=True), Float32(0.1)
    publisher.put(sent)
    hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message), latched=True)
    assert len({id(message) for message in (*heard, *contents)}) == 1
    assert heard[0] is not sent
    assert heard[0].data == np.float32(0.1)


def test_in_memory_a_message_that_is_handed_over_is_not_copied(hub: MemoryHub) -> None:
    """Its receivers get the sender's own."""
    heard: list[Float32] = []
    for _ in range(2):
        hub.bus().subscribe("a", Float32, lambda _, message: heard.append(message))
    sent = Float32(0.5)
    hub.bus().publisher("a", Float32).hand_over(sent)
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


def test_a_change_without_an_instance_is_refused(hub: MemoryHub) -> None:
    """Whatever else it carries: the error says what to send and where to learn it, and nothing happens."""
    service, plain = Service(hub), MemoryTransport(hub)
    for payload in (b"", b"{}", b'{"by": 7}', b'{"instance": ""}'):
        replies = plain.get("**", payload, 1.0)
        assert sorted(reply.key for reply in replies if not reply.error) == ["box/count", "box/info"]
        (text,) = (reply.payload.decode() for reply in replies if reply.error)
        assert text.startswith(
            'box/add changes something and has to name the process it is meant for: send {"instance"'
        )
        assert "box/info" in text
    assert service.count == 0


def test_a_change_for_another_process_is_refused(hub: MemoryHub) -> None:
    """Such as for the one that held the name before."""
    service, plain = Service(hub), MemoryTransport(hub)
    (reply,) = plain.get("box/add", b'{"instance": "0123"}', 1.0)
    assert reply.error
    assert "is meant for another process: no process '0123' serves it" in reply.payload.decode()
    assert service.count == 0


def test_a_change_that_names_its_process_is_made(hub: MemoryHub) -> None:
    """A client in any language sends the id that `<name>/info` tells."""
    service, plain = Service(hub), MemoryTransport(hub)
    (info,) = plain.get("box/info", b"", 1.0)
    instance = msgspec.json.decode(info.payload)["instance"]
    (reply,) = plain.get("box/add", msgspec.json.encode({"instance": instance, "by": 2}), 1.0)
    assert (reply.error, service.count) == (False, 2)


def test_the_bus_names_the_process_by_itself(hub: MemoryHub) -> None:
    """It learns the id once, and again when the process was restarted."""
    first, asker, questions = Service(hub), hub.bus(), []
    hub.bus().serve("box/info", NoRequest, lambda _: questions.append(1) or own_info("box", first.bus.instance, 0))
    for count in (1, 2, 3):
        assert asker.ask("box/add", Told, Counting()) == Told(count)
    assert len(questions) == 1
    first.close()
    second = Service(hub, start=-1)
    assert asker.ask("box/add", Told, Counting(by=5)) == Told(5)
    assert asker.ask("box/add", Told, Counting()) == Told(6)
    assert (first.count, second.count) == (3, 6)


def test_a_change_that_reaches_no_process_has_no_answer(hub: MemoryHub) -> None:
    """As any other query has none."""
    assert hub.bus().query("box/add", Told, Counting()) == []
    service, asker = Service(hub), hub.bus()
    asker.ask("box/add", Told, Counting())
    service.close()
    assert asker.query("box/add", Told, Counting()) == []


def test_a_change_below_the_place_of_a_robot_names_the_process_there(hub: MemoryHub) -> None:
    """`robot_1/navigation/cancel` is of another process than `robot_1/set_parameters`: `info` lies beside each."""
    robot, navigation = hub.bus(), hub.bus()
    for place, bus in (("robot_1", robot), ("robot_1/navigation", navigation)):
        bus.serve(info_key(place), NoRequest, lambda _, bus=bus: own_info("box", bus.instance, 0))
        bus.serve(f"{place}/add", Counting, lambda _, place=place: Told(len(place)))
    asker = hub.bus()
    for place in ("robot_1/navigation", "robot_1"):
        assert asker.ask(f"{place}/add", Told, Counting()) == Told(len(place))


def test_a_given_instance_is_not_replaced(hub: MemoryHub) -> None:
    """A request that names a process is for that one only, and fails when it is gone."""
    Service(hub)
    with pytest.raises(BusError, match="meant for another process"):
        hub.bus().ask("box/add", Told, Counting(instance="0123"))


def test_the_largest_map_is_small_enough() -> None:
    """What a simulator publishes is not refused for its size."""
    largest = OccupancyGrid(info=MapMetaData(width=MAX_CELLS, height=1), data=np.zeros(MAX_CELLS, np.int8))
    assert len(encode(largest)) <= payloads.MAX_PAYLOAD


def test_a_message_of_another_type_is_refused(hub: MemoryHub) -> None:
    """Put refuses what is no message of the publisher's type: it names the key and both types."""
    publisher = hub.bus().publisher("robot_0/seen", Bool)
    for wrong, shown in ((MapMetaData(), "MapMetaData"), (True, "bool"), (None, "NoneType")):
        with pytest.raises(UsageError) as caught:
            publisher.put(wrong)  # type: ignore[arg-type]
        assert str(caught.value) == f"robot_0/seen carries Bool: put was given a {shown}"
