"""Queries, the same over Zenoh and in memory."""

import threading
from typing import Any

import msgspec
import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import Bus, Change, Deferred, NoRequest, queries, transport
from zteam.errors import BusError, QueryTimeoutError

DEEP = 100_000
"""Levels of nested JSON."""


class Number(msgspec.Struct):
    """A request and an answer."""

    value: int = 0


class Add(Change):
    """A request that changes something."""

    by: int = 1


def serve(bus: Bus, key: str, value: int) -> Any:
    """Answer with a number."""
    return bus.serve(key, NoRequest, lambda _: Number(value))


def introduce(asker: Bus, *servers: Bus) -> None:
    """Wait until queries of `asker` reach what the servers have declared so far."""
    for server in servers:
        key = f"ready/{server.instance}"
        ready = server.serve(key, NoRequest, lambda _: NoRequest())
        wait_until_true(lambda key=key: bool(asker.query(key, NoRequest, timeout=LIMIT)))
        ready.close()


def raw_replies(bus: Bus, key: str, payload: bytes) -> list[tuple[str, bytes, bool]]:
    """What the transport brings back."""
    return [tuple(reply) for reply in bus.transport.get(key, payload, LIMIT)]


def test_a_request_and_its_answer(sessions: Sessions) -> None:
    """The handler gets the request, the asker the answer with its key."""
    server, asker = sessions(), sessions()
    server.serve("double", Number, lambda request: Number(2 * request.value))
    introduce(asker, server)
    assert asker.query("double", Number, Number(21)) == [("double", Number(42))]
    assert asker.ask("double", Number, Number(4)) == Number(8)


def test_a_session_can_ask_itself(sessions: Sessions) -> None:
    """Its own queries count as any other's."""
    bus = sessions()
    serve(bus, "a", 1)
    assert bus.ask("a", Number) == Number(1)


def test_all_servers_answer(sessions: Sessions) -> None:
    """By key, and each of two that serve the same key."""
    first, second, asker = sessions(), sessions(), sessions()
    serve(first, "b/x", 1)
    serve(second, "a/x", 2)
    serve(second, "b/x", 3)
    serve(second, "c/y", 4)
    introduce(asker, first, second)
    answers = asker.query("*/x", Number)
    assert [key for key, _ in answers] == ["a/x", "b/x", "b/x"]
    assert sorted(number.value for _, number in answers) == [1, 2, 3]


def test_a_query_without_a_server_has_no_answer(sessions: Sessions) -> None:
    """It comes back at once, and `ask` says what is missing."""
    asker = sessions()
    assert asker.query("nothing", Number, timeout=LIMIT) == []
    with pytest.raises(BusError, match="the query nothing"):
        asker.ask("nothing", Number, timeout=LIMIT)


def test_a_server_that_closed_does_not_answer(sessions: Sessions) -> None:
    """Closing it a second time does nothing."""
    server, asker = sessions(), sessions()
    served = serve(server, "a", 1)
    introduce(asker, server)
    asker.ask("a", Number)
    served.close()
    served.close()
    assert asker.query("a", Number) == []


def test_the_queries_of_a_closed_session_end(sessions: Sessions) -> None:
    """Nothing answers in its name."""
    server, asker = sessions(), sessions()
    serve(server, "a", 1)
    introduce(asker, server)
    asker.ask("a", Number)
    server.close()
    assert asker.query("a", Number) == []


def test_an_error_goes_to_the_asker_as_text(sessions: Sessions) -> None:
    """The handler's own words, after the key that was asked; nothing is logged."""
    server, asker = sessions(), sessions()

    def refuse(_: NoRequest) -> Number:
        raise BusError("not today")

    server.serve("a", NoRequest, refuse)
    introduce(asker, server)
    with captured_log() as log, pytest.raises(BusError) as caught:
        asker.ask("a", Number)
    assert str(caught.value) == "a: not today"
    assert log.lines == []


def test_a_fault_goes_to_the_asker_with_its_kind(sessions: Sessions) -> None:
    """What the handler did not mean to raise is named, and logged where it happened."""
    server, asker = sessions(), sessions()
    server.serve("a", NoRequest, lambda _: {}["missing"])
    introduce(asker, server)
    with captured_log() as log, pytest.raises(BusError) as caught:
        asker.ask("a", Number)
    assert str(caught.value) == "a: KeyError: 'missing'"
    assert any("error while answering the query a" in line for line in log.lines)
    with pytest.raises(BusError):
        asker.ask("a", Number)


def test_an_error_on_a_wildcard_names_what_was_asked(sessions: Sessions) -> None:
    """An error carries no key of its own."""
    server, asker = sessions(), sessions()
    server.transport.declare_queryable("a/x", lambda *_: 1 / 0)
    introduce(asker, server)
    assert raw_replies(asker, "a/*", b"") == [("", b"ZeroDivisionError: division by zero", True)]
    with pytest.raises(BusError, match=r"^a/\*: ZeroDivisionError"):
        asker.query("a/*", Number)


def test_good_answers_count_beside_errors(sessions: Sessions) -> None:
    """One server that fails does not spoil the others' answers."""
    server, asker = sessions(), sessions()
    server.transport.declare_queryable("a/x", lambda *_: 1 / 0)
    serve(server, "a/y", 2)
    introduce(asker, server)
    assert asker.query("a/*", Number) == [("a/y", Number(2))]


def test_a_deferred_answer_comes_when_it_is_finished(sessions: Sessions) -> None:
    """It is made on a thread of its own; other queries of the same key are answered meanwhile."""
    server, asker, answers = sessions(), sessions(), Inbox()
    go, makers = threading.Event(), Inbox()

    def finish() -> Number:
        makers(threading.current_thread())
        assert go.wait(LIMIT)
        return Number(1)

    server.serve("slow", Number, lambda request: Number(2) if request.value else Deferred(finish))
    introduce(asker, server)
    waiting = threading.Thread(target=lambda: answers(asker.ask("slow", Number, timeout=LIMIT)), daemon=True)
    waiting.start()
    (maker,) = makers.wait_count(1)
    assert maker not in {waiting, threading.main_thread()}
    assert asker.ask("slow", Number, Number(1)) == Number(2)
    assert answers.items == []
    go.set()
    assert answers.wait_count(1) == [Number(1)]
    waiting.join(LIMIT)


def test_an_error_of_a_deferred_answer_goes_to_the_asker(sessions: Sessions) -> None:
    """As that of a handler does."""
    server, asker = sessions(), sessions()

    def refuse() -> Number:
        raise BusError("too late")

    server.serve("a", NoRequest, lambda _: Deferred(refuse))
    introduce(asker, server)
    with pytest.raises(BusError, match=r"^a: too late$"):
        asker.ask("a", Number, timeout=LIMIT)


# The limit of a session outside is set when the bridge is opened.
@pytest.mark.parametrize("sessions", ["memory", "zenoh"], indirect=True)
def test_too_many_deferred_answers_are_refused(sessions: Sessions, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has a thread, so there is a limit; later queries are answered again."""
    monkeypatch.setattr(queries, "MAX_DEFERRED", 1)
    server, asker = sessions(), sessions()
    end, started, answers = threading.Event(), Inbox(), Inbox()
    server.serve("slow", NoRequest, lambda _: Deferred(lambda: started(1) or (end.wait(LIMIT) and Number(1))))
    introduce(asker, server)
    waiting = threading.Thread(target=lambda: answers(asker.ask("slow", Number, timeout=LIMIT)), daemon=True)
    waiting.start()
    started.wait_count(1)
    with pytest.raises(BusError, match=r"^slow: more than 1 queries are waiting"):
        asker.ask("slow", Number, timeout=LIMIT)
    end.set()
    waiting.join(LIMIT)
    assert answers.items == [Number(1)]


def test_a_query_times_out(sessions: Sessions) -> None:
    """A server that does not finish in time costs its asker the time-out and an error."""
    server, asker = sessions(), sessions()
    end = threading.Event()
    server.serve("slow", NoRequest, lambda _: Deferred(lambda: end.wait(LIMIT) and Number(1)))
    introduce(asker, server)
    try:
        with pytest.raises(QueryTimeoutError):
            asker.ask("slow", Number, timeout=0.1)
    finally:
        end.set()


def test_a_time_out_keeps_the_answers_that_came(sessions: Sessions) -> None:
    """One slow server does not take the others' answers away."""
    server, asker = sessions(), sessions()
    end = threading.Event()
    server.serve("a/slow", NoRequest, lambda _: Deferred(lambda: end.wait(LIMIT) and Number(1)))
    serve(server, "a/fast", 2)
    introduce(asker, server)
    try:
        # On a busy machine the fast one may need longer, too.
        assert any(asker.query("a/*", Number, timeout=patience) == [("a/fast", Number(2))] for patience in (0.5, LIMIT))
    finally:
        end.set()


@pytest.mark.parametrize("asked", ["**", "box/*", "*/add", "box/a$*", "box/add/**"])
def test_a_change_asked_by_a_wildcard_is_refused(sessions: Sessions, asked: str) -> None:
    """Whatever the request carries nothing changes, and the refusal says how to ask; other queries answer."""
    server, asker, added = sessions(), sessions(), Inbox()
    server.serve("box/add", Add, lambda request: added(request.by) or Number(1))
    serve(server, "box/add/last", 2)
    introduce(asker, server)
    for payload in (b"", b"{}", b'{"by": 7}', b"no JSON"):
        replies = [reply for reply in raw_replies(asker, asked, payload) if reply[2]]
        text = f"box/add changes something: ask for it by this key, not by the wildcard {asked}"
        assert ("", text.encode(), True) in replies
    assert added.items == []
    assert "box/add" not in server.counters.snapshot()


def test_a_change_asked_by_its_key_is_made(sessions: Sessions) -> None:
    """By the bus, and by a client that sends more than the request knows, such as the session id of other versions."""
    server, asker, added = sessions(), sessions(), Inbox()
    server.serve("box/add", Add, lambda request: added(request.by) or Number(request.by))
    introduce(asker, server)
    assert asker.ask("box/add", Number, Add(by=2)) == Number(2)
    assert raw_replies(asker, "box/add", b'{"by": 3, "instance": "0123"}') == [("box/add", b'{"value":3}', False)]
    assert added.items == [2, 3]


@pytest.mark.parametrize("text", ['{"x":' * DEEP, "[" * DEEP, '{"value":' + "[" * DEEP])
def test_deeply_nested_json_is_refused_in_one_line(sessions: Sessions, text: str) -> None:
    """A request of any depth gets an error and one count; there is no traceback."""
    server, asker = sessions(), sessions()
    server.serve("a", Number, lambda request: request)
    introduce(asker, server)
    with captured_log() as log:
        ((_, answer, error),) = raw_replies(asker, "a", text.encode())
    assert error
    assert answer.startswith(b"bad request: ")
    assert len(answer) < 200
    assert server.counters.snapshot()["a"].dropped == 1
    assert [len(line.splitlines()) for line in log.lines] == [1]


@pytest.mark.parametrize("answer", [b"[" * DEEP, b"", b"no JSON", b'{"value": "text"}', b"\xff"])
def test_an_unreadable_answer_is_an_error(sessions: Sessions, answer: bytes) -> None:
    """Another process may answer anything."""
    server, asker = sessions(), sessions()
    server.transport.declare_queryable("odd", lambda *_: answer)
    introduce(asker, server)
    with pytest.raises(BusError, match=r"^odd: unreadable answer: "):
        asker.ask("odd", Number)


def test_an_empty_request_is_one_without_fields(sessions: Sessions) -> None:
    """A client in any language may leave the payload out."""
    server, asker = sessions(), sessions()
    server.serve("a", Number, lambda request: request)
    introduce(asker, server)
    assert raw_replies(asker, "a", b"") == [("a", b'{"value":0}', False)]


def test_an_oversized_request_is_not_decoded(sessions: Sessions, monkeypatch: pytest.MonkeyPatch) -> None:
    """It gets an error and one count."""
    monkeypatch.setattr(transport, "MAX_PAYLOAD", 100)
    server, asker = sessions(), sessions()
    serve(server, "a", 1)
    introduce(asker, server)
    (reply,) = raw_replies(asker, "a", b'{"x": "' + b"y" * 100 + b'"}')
    assert reply == ("", b"bad request: its 109 bytes are more than 100", True)
    assert server.counters.snapshot()["a"].dropped == 1


def test_an_oversized_answer_is_not_decoded(sessions: Sessions, monkeypatch: pytest.MonkeyPatch) -> None:
    """The asker gets an error that says so."""
    monkeypatch.setattr(transport, "MAX_PAYLOAD", 100)
    server, asker = sessions(), sessions()
    server.transport.declare_queryable("a", lambda *_: b" " * 200)
    introduce(asker, server)
    with pytest.raises(BusError, match="its 200 bytes are more than 100"):
        asker.ask("a", Number)
