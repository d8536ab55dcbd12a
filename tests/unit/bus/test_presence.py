"""Names on a bus in memory: which of two processes stays, whatever the order in which they see each other."""

import os
import threading

import pytest
from msgspec.structs import replace

from support.limits import LIMIT
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.bus import presence as module
from zteam.bus.presence import Claim, ProcessInfo, own_info
from zteam.bus.transport import Closeable, QueryHandler
from zteam.errors import DuplicateNameError, QueryTimeoutError

NAME = "robot_1"


class Rival:
    """Another process that holds the name, on a session of its own; it started at `start`."""

    def __init__(self, hub: MemoryHub, start: int, failures: int = 0) -> None:
        """It answers with an error `failures` times before it answers with its info."""
        self.bus: Bus = hub.bus()
        self._info = replace(own_info(NAME, self.bus.instance, start), pid=4711)
        self._failures = failures

    def _answer(self, _: NoRequest) -> ProcessInfo:
        if self._failures:
            self._failures -= 1
            raise QueryTimeoutError("a key: no answer in time", "no answer in time")
        return self._info

    def show(self) -> None:
        """Answer, and show the token."""
        self.bus.serve(names.info_key(NAME), NoRequest, self._answer)
        self.bus.declare_token(names.token_key(NAME, self.bus.instance))


class Meeting:
    """The rival that a claim gave way to."""

    def __init__(self) -> None:
        self._met = threading.Event()
        self.reasons: list[str] = []

    def __call__(self, reason: str) -> None:
        self.reasons.append(reason)
        self._met.set()

    def wait(self) -> None:
        """Until it gave way."""
        assert self._met.wait(LIMIT)


def test_a_holder_is_found_whose_token_comes_late(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """A claim that has seen no token when its wait ends gives way to the process that answers under the name."""
    holder, late = Claim(hub.bus(), NAME), hub.bus()
    holder.win(Meeting())
    monkeypatch.setattr(late, "watch_tokens", lambda *_: [])
    with pytest.raises(DuplicateNameError, match="taken by process"):
        Claim(late, NAME).win(Meeting())
    holder.release()


@pytest.mark.parametrize("failures", [0, 2])
def test_a_rival_between_the_look_and_the_own_token_is_met(
    hub: MemoryHub, failures: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A token that comes after the claim has looked, and before its own token is there, is seen: the later one gives
    way. A rival that fails to answer is asked again, so there are no two holders."""
    monkeypatch.setattr(module, "ASK_AGAIN", 0.01)
    rival, meeting = Rival(hub, start=1, failures=failures), Meeting()
    claim = Claim(hub.bus(), NAME)
    claim.win(meeting, on_win=rival.show)
    meeting.wait()
    assert ["process 4711 on" in reason for reason in meeting.reasons] == [True]
    claim.release()


def test_the_older_one_of_two_holders_stays(hub: MemoryHub) -> None:
    """A rival that started later is met and asked, and the claim does not give way."""
    answered = threading.Event()
    rival, meeting = Rival(hub, start=2**62), Meeting()
    claim = Claim(hub.bus(), NAME)
    rival.bus.serve(names.info_key(NAME), NoRequest, lambda _: answered.set() or rival._info)
    claim.win(meeting, on_win=rival.show)
    assert answered.wait(LIMIT)
    for thread in threading.enumerate():
        if thread.name == "rival":
            thread.join(LIMIT)
    assert meeting.reasons == []
    claim.release()


@pytest.mark.gate
def test_tokens_make_no_threads_and_hide_no_holder(hub: MemoryHub) -> None:
    """Three thousand tokens of the name that nobody answers for, which end again: one thread asks, with one question
    for all of them. A second process is refused by the name of the true holder, and an older one is met."""
    holder, flood, asked, meeting = hub.bus(), hub.bus(), list[str](), Meeting()
    get, before = holder.transport.get, set(threading.enumerate())
    claim = Claim(holder, NAME)
    claim.win(meeting)
    holder.transport.get = lambda key, *rest: asked.append(key) or get(key, *rest)  # type: ignore[method-assign, func-returns-value]
    tokens = [flood.declare_token(names.token_key(NAME, f"z{number}")) for number in range(3000)]
    assert len(set(threading.enumerate()) - before) <= 1
    with pytest.raises(DuplicateNameError, match=f"taken by process {os.getpid()}"):
        Claim(hub.bus(), NAME).win(Meeting())
    for token in tokens[:2000]:
        token.close()
    rival = Rival(hub, start=1)
    rival.show()
    meeting.wait()
    assert ["process 4711 on" in reason for reason in meeting.reasons] == [True]
    assert len(set(threading.enumerate()) - before) <= 1
    claim.release()
    assert not set(threading.enumerate()) - before
    # A second's wait is between two questions, and the test takes a few.
    assert len(asked) < 100


def test_a_holder_declares_its_answer_anew_when_another_claim_has_ended(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Linked routers may have forgotten it: Zenoh's do, at the next loss of their link."""
    holder, declared = hub.bus(), threading.Event()
    claim = Claim(holder, NAME)
    claim.win(Meeting())
    declare = holder.transport.declare_queryable

    def spy(key: str, handler: QueryHandler) -> Closeable:
        made = declare(key, handler)
        if key == names.info_key(NAME):
            declared.set()
        return made

    monkeypatch.setattr(holder.transport, "declare_queryable", spy)
    with pytest.raises(DuplicateNameError):
        Claim(hub.bus(), NAME).win(Meeting())
    assert declared.wait(LIMIT)
    assert [info.pid for _, info in hub.bus().query(names.info_key(NAME), ProcessInfo)] == [os.getpid()]
