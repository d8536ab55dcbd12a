"""What comes from outside in lock-step: which of it ticks carry, in which order, and how much."""

from collections.abc import Callable

import pytest

from zteam.bus import Bus, MemoryHub
from zteam.messages import Input, String, encode
from zteam.simulator.process.outside import MAX_BYTES, Outside

Take = Callable[..., list[tuple[int, str]]]


class Desk:
    """The simulator's half, and a session outside."""

    def __init__(self, hub: MemoryHub) -> None:
        self.bus, self.stranger = hub.bus(), hub.bus()
        self.latched = 0
        self.outside = Outside(self.bus, self._on_latched)

    def _on_latched(self) -> None:
        self.latched += 1

    def say(self, key: str, text: str, bus: Bus | None = None, *, latched: bool = False) -> None:
        """Publish a text from outside, or from another session."""
        (bus or self.stranger).publisher(key, String, latched=latched).put(String(text))

    def take(self, *joined: str, is_first: bool = False) -> list[tuple[int, str]]:
        """Numbers and keys of the inputs of a tick; those that come again first."""
        again, new = self.outside.take(joined, 1, is_first=is_first)
        return [(each.number, each.key) for each in (*again, *new)]


@pytest.fixture
def desk(hub: MemoryHub) -> Desk:
    """Nobody reads anything yet."""
    return Desk(hub)


def test_what_is_read_is_carried_once(desk: Desk) -> None:
    """Also where several subscriptions have its key; what no participant reads is not carried, and what the simulator
    itself sends is not from outside."""
    desk.outside.read(["chat", "robot_0/word", "robot_$*/word", "robot_1/word?latched"])
    for key in ("chat", "robot_0/word", "robot_1/word", "robot_2/word", "unread"):
        desk.say(key, "hello")
        desk.say(key, "hello", desk.bus)
    assert desk.take() == [(1, "chat"), (2, "robot_0/word"), (3, "robot_1/word"), (4, "robot_2/word")]
    assert desk.take() == []


def test_the_content_is_what_was_sent(desk: Desk) -> None:
    """Byte for byte, with its type. Only what the simulator puts in itself is a request, whatever a sender names its
    message."""
    desk.outside.read(["chat"])
    desk.say("chat", "hello")
    for encoding in ("text/plain", "application/cdr;request"):
        desk.stranger.transport.declare_publisher("chat", encoding, False).put(b"stop")
    desk.outside.add("sim/move", b"{}")
    _, (chat, plain, sly, move) = desk.outside.take((), 1, is_first=False)
    assert (chat.type, chat.data.tobytes()) == (String.ros_type, encode(String("hello")))
    assert (plain.type, sly.type, sly.data.tobytes()) == ("", "", b"stop")
    assert (move.type, move.data.tobytes()) == (Input.REQUEST, b"{}")


def test_who_takes_part_is_not_outside(desk: Desk, hub: MemoryHub) -> None:
    """From its first answer to the end of its process; what it sent before is not carried either."""
    member = hub.bus()
    desk.outside.read(["chat"])
    desk.say("chat", "early", member)
    desk.outside.admit(member.instance)
    desk.say("chat", "inside", member)
    assert desk.take() == []
    desk.outside.part_with(member.instance)
    desk.say("chat", "late", member)
    assert desk.take() == [(1, "chat")]


def test_a_tick_has_a_most(desk: Desk) -> None:
    """What does not fit follows in order; what fits into no tick is refused, and so is the thousand-and-first of a
    key."""
    desk.outside.read(["chat", "word"])
    for _ in range(3):
        desk.say("chat", "x" * (MAX_BYTES // 2 - 100))
    desk.say("word", "y" * MAX_BYTES)
    assert [len(desk.take()) for _ in range(3)] == [2, 1, 0]
    for _ in range(1002):
        desk.say("word", "z")
    assert len(desk.take()) == 1000
    assert desk.bus.counters.snapshot()["word"].dropped == 3


def test_what_is_latched_comes_again_for_those_that_join(desk: Desk) -> None:
    """The newest of each key that they read, under its old number. The first tick, which may be opened again, has all
    of it each time, and nothing else: the rest follows in the second."""
    desk.outside.read(["motto?latched", "chat"])
    desk.say("chat", "hello")
    desk.say("motto", "old", latched=True)
    desk.say("motto", "new", latched=True)
    assert desk.latched == 2
    assert desk.take(is_first=True) == [(1, "motto"), (2, "motto")]
    assert desk.take(is_first=True) == [(2, "motto")]
    assert desk.take() == [(3, "chat")]
    assert desk.take("motto?latched") == [(2, "motto")]
    assert desk.take("chat") == []
    desk.outside.start_anew()
    assert desk.take() == [(1, "motto")]
