"""The bridge of a team in one process, over two hubs: what the conformance tests of the bus do not say."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from support.limits import LIMIT
from support.lockstep_doubles import HarnessFactory, ScriptedParticipant
from support.transports import Inbox, ZenohTimes, wait_until_true
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.bus.memory import MemoryTransport
from zteam.bus.presence import Claim, ProcessInfo
from zteam.bus.transport import RawPublisher
from zteam.clock import later
from zteam.errors import DuplicateNameError
from zteam.messages import Done, Message, String, encode
from zteam.team.in_process.bridge import NodeSessions


class Wire(MemoryTransport):
    """A session outside that notes what it sends."""

    def __init__(self, hub: MemoryHub) -> None:
        super().__init__(hub)
        self.sent: list[bytes | Message] = []

    def declare_publisher(self, *arguments: Any, **more: Any) -> RawPublisher:
        publisher = super().declare_publisher(*arguments, **more)
        put = publisher.put

        def note(content: bytes | Message) -> None:
            self.sent.append(content)
            put(content)

        publisher.put = note  # type: ignore[method-assign]
        return publisher


class Place:
    """A hub in this process, and one outside."""

    def __init__(self) -> None:
        self.outside = MemoryHub()
        self.outside.timestamps = ZenohTimes()
        self.wire = Wire(self.outside)
        self.hub = NodeSessions(Bus(self.wire))


@pytest.fixture
def place() -> Iterator[Place]:
    """The two hubs."""
    made = Place()
    yield made
    made.hub.close()


def test_nothing_is_sent_that_nobody_hears_outside(place: Place) -> None:
    """A message goes outside once for two subscribers there, and not at all once they are gone."""
    publisher, inbox = place.hub.bus("sim").publisher("a", Done), Inbox()
    place.hub.bus("robot_0").subscribe("a", Done, Inbox())
    publisher.put(Done(tick=1))
    handles = [place.outside.bus().subscribe("a", Done, lambda _key, done: inbox(done.tick)) for _ in range(2)]
    publisher.put(Done(tick=2))
    for handle in handles:
        handle.close()
    publisher.put(Done(tick=3))
    assert place.wire.sent == [encode(Done(tick=2))]
    assert inbox.items == [2, 2]


def test_what_comes_from_outside_is_handled_in_the_thread_of_messages(place: Place) -> None:
    """The thread that puts outside, such as one of Zenoh's, waits for no node; the order is kept."""
    node, inbox, threads = place.hub.bus("sim"), Inbox(), set()
    free = threading.Event()

    def take(_key: str, done: Done) -> None:
        free.wait()
        threads.add(threading.current_thread().name)
        inbox(done.tick)

    node.subscribe("a", Done, take)
    publisher = place.outside.bus().publisher("a", Done)
    for tick in range(5):
        publisher.put(Done(tick=tick))
    assert inbox.items == []
    free.set()
    assert inbox.wait_count(5) == [0, 1, 2, 3, 4]
    assert threads == {"messages"}


def test_a_message_carries_its_nodes_id_outside_and_comes_back_to_no_node(place: Place) -> None:
    """Outside the source is the node's session; nodes get the message once, from the hub, latched ones too."""
    node, heard, outside = place.hub.bus("sim"), Inbox(), Inbox()
    place.outside.bus().subscribe_raw("a", lambda sample: outside(sample.source), latched=True)
    publisher = node.publisher("a", Done, latched=True)
    publisher.put(Done(tick=1))
    place.hub.bus("robot_0").subscribe("a", Done, lambda _key, done: heard(done.tick), latched=True)
    publisher.put(Done(tick=2))
    heard.wait_for(2)
    place.outside.bus().publisher("a", Done).put(Done(tick=3))
    assert heard.wait_for(3) == [1, 2, 3]
    assert outside.items[:2] == [node.instance] * 2


@pytest.mark.parametrize("first_is_outside", [False, True])
def test_one_name_has_one_holder_on_both_sides(place: Place, first_is_outside: bool) -> None:
    """The second claim on a name is refused, and the refusal names the holder on the other side."""
    buses = [place.hub.bus("robot_0"), place.outside.bus()]
    first, second = reversed(buses) if first_is_outside else buses
    held = Claim(first, "robot_0")
    held.win(lambda _info: None)
    with pytest.raises(DuplicateNameError, match=r"robot_0 is taken by process \d+ on "):
        Claim(second, "robot_0").win(lambda _info: None)
    assert second.ask(names.info_key("robot_0"), ProcessInfo).instance == first.instance
    gone = Inbox()
    second.watch_tokens([names.tokens_key("*")], lambda _key, alive: gone(alive))
    held.release()
    gone.wait_for(False)


def test_a_closed_session_leaves_nothing_outside(place: Place) -> None:
    """Publishers, subscribers, queries and tokens of a node end outside with its session."""
    node, looking, tokens = place.hub.bus("robot_0"), place.outside.bus(), Inbox()
    node.publisher("a", Done, latched=True).put(Done())
    node.subscribe("b", Done, Inbox())
    node.serve("robot_0/info", NoRequest, lambda _: NoRequest())
    node.declare_token("robot_0/alive/x")
    looking.watch_tokens(["**"], tokens)
    assert {d.key for d in looking.declarations()} == {"a", "b"}
    assert {d.session for d in looking.declarations()} == {node.instance}
    node.close()
    assert tokens.items == [("robot_0/alive/x", True), ("robot_0/alive/x", False)]
    assert looking.declarations() == []
    assert looking.query("robot_0/info", NoRequest) == []
    late = Inbox()
    looking.subscribe("a", Done, late, latched=True)
    assert late.items == []


def test_a_process_that_is_gone_outside_is_gone_for_the_nodes(place: Place) -> None:
    """Its token comes and goes on the hub, also for a node that opens later."""
    there, inbox, late = place.outside.bus(), Inbox(), Inbox()
    place.hub.bus("sim").watch_tokens(["**"], inbox)
    there.declare_token("crowd/alive/x")
    inbox.wait_for(("crowd/alive/x", True))
    place.hub.bus("monitor").watch_tokens(["**"], late)
    late.wait_for(("crowd/alive/x", True))
    there.close()
    inbox.wait_for(("crowd/alive/x", False))
    wait_until_true(lambda: late.items[-1] == ("crowd/alive/x", False))


def test_a_tick_carries_what_came_before_it_opens(place: Place) -> None:
    """Also what still waits for its handler, while the thread of messages is busy."""
    harnesses, begun, free = HarnessFactory(place.outside), threading.Event(), threading.Event()

    def take(_key: str, _done: Done) -> None:
        begun.set()
        assert free.wait(LIMIT)

    try:
        harness = harnesses(bus=place.hub.bus("sim"))
        ScriptedParticipant(place.outside, "robot_0", bus=place.hub.bus("robot_0")).appear()
        harness.open(1)
        assert harness.wait()
        harness.lockstep.outside.read(["chat"])
        place.hub.bus("monitor").subscribe("a", Done, take)
        outside = place.outside.bus()
        outside.publisher("a", Done).put(Done())
        assert begun.wait(LIMIT)
        outside.publisher("chat", String).put(String("hello"))
        later(0.05, free.set, "free")
        harness.open(2)
        assert [each.key for each in harness.lockstep.tick.message.inputs] == ["chat"]
    finally:
        harnesses.close()


def test_answers_from_outside_count_with_a_token_alone(place: Place) -> None:
    """A process outside takes part beside a node; one without the token of that node is refused."""
    harnesses = HarnessFactory(place.outside)
    try:
        harness = harnesses(bus=place.hub.bus("sim"))
        node = ScriptedParticipant(place.outside, "robot_0", bus=place.hub.bus("robot_0")).appear()
        ScriptedParticipant(place.outside, "planner").appear()
        harness.open(1)
        assert harness.wait()
        wait_until_true(
            lambda: {*harness.lockstep.tick.joining, *harness.lockstep.tick.members} == {"planner", "robot_0"}
        )
        node.awake = False
        harness.open(2)
        harness.begin()
        place.outside.bus().publisher(names.done_key("robot_0"), Done).put(Done(0, 2))
        wait_until_true(lambda: harness.node.bus.counters.snapshot()["robot_0/done"].dropped == 1)
        assert harness.holds
        node.answer()
        assert harness.end()
        assert harness.lockstep.tick.members == ["planner", "robot_0"]
    finally:
        harnesses.close()
