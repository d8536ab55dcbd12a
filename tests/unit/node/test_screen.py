"""Whose messages count as they come, in lock-step."""

from threading import RLock

from zteam.bus.receiving import Receiver
from zteam.bus.transport import RawSample, SampleHandler
from zteam.messages import String, encode, encoding_of
from zteam.node.screen import FROM_TICK, Screen


class Desk:
    """A receiver with its screen, and what it has handled."""

    def __init__(self) -> None:
        self.received, self.simulators, self.heard = Receiver(), {"sim"}, list[str]()
        self.screen = Screen(self.received, RLock(), self.simulators)
        self.live: SampleHandler = self.received.messages(String, self._on_message)
        self.latched: SampleHandler = self.received.messages(String, self._on_message, latched=True)

    def _on_message(self, _key: str, message: String) -> None:
        self.heard.append(message.data)

    def hear(self, source: str, text: str, handler: SampleHandler | None = None) -> None:
        """A message of a session comes."""
        (handler or self.live)(RawSample("chat", encode(String(text)), encoding_of(String), source=source))

    def take(self) -> list[str]:
        """What was handled since the last call."""
        taken, self.heard[:] = [*self.heard], []
        return taken


def test_without_ticks_all_count() -> None:
    """Also after the last one, with what has waited."""
    desk = Desk()
    desk.hear("a", "before")
    desk.screen.open(["b"])
    desk.hear("a", "within")
    desk.hear("a", "kept", desk.latched)
    assert desk.take() == ["before"]
    desk.screen.forget()
    desk.hear("a", "after")
    assert sorted(desk.take()) == ["after", "kept", "within"]


def test_what_is_listed_counts() -> None:
    """And the simulator's, and what a tick carries. Others' waits for the next tick, which may list them."""
    desk = Desk()
    desk.screen.open(["a"])
    for source in ("a", "sim", FROM_TICK, "b", "", "c"):
        desk.hear(source, source)
    assert desk.take() == ["a", "sim", FROM_TICK]
    assert desk.screen.open(["a", "b"]) == ["chat", "chat"]
    assert desk.take() == ["b"]
    desk.screen.open(["a", "b", "c"])
    assert desk.take() == []


def test_the_newest_latched_message_waits_until_its_session_is_listed() -> None:
    """However many ticks that takes."""
    desk = Desk()
    desk.screen.open(["a"])
    for text in ("old", "new"):
        desk.hear("b", text, desk.latched)
    desk.screen.open(["a"])
    desk.screen.open(["a", "b"])
    assert desk.take() == ["new"]


def test_a_flood_takes_little_memory() -> None:
    """A thousand messages wait, or a megabyte of them: the newest."""
    desk = Desk()
    desk.screen.open(["a"])
    for number in range(1500):
        desk.hear("b", str(number))
    desk.screen.open(["a", "b"])
    assert desk.take() == [str(number) for number in range(500, 1500)]
    for number in range(9):
        desk.hear("c", str(number) * 300_000)
    desk.screen.open(["c"])
    assert [text[0] for text in desk.take()] == ["6", "7", "8"]
