"""Queries, the same over Zenoh and in memory."""

import threading
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import Bus, Change, Deferred, NoRequest, transport
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
    """The handler gets the request, the asker the answer with its key; an empty request is one without fields. A
    session may ask itself. Without a server the empty answer comes at once, and `ask` reports that."""
    server, asker = sessions(), sessions()
    server.serve("double", Number, lambda request: Number(2 * request.value))
    introduce(asker, server)
    assert asker.query("double", Number, Number(21)) == [("double", Number(42))]
    assert raw_replies(asker, "double", b"") == [("double", b'{"value":0}', False)]
    assert server.ask("double", Number, Number(4)) == Number(8)
    assert asker.query("nothing", Number, timeout=LIMIT) == []
    with pytest.raises(BusError, match="the query nothing"):
        asker.ask("nothing", Number, timeout=LIMIT)


def test_all_servers_answer_until_they_close(sessions: Sessions) -> None:
    """By key, and each of two that serve the same key; closing one a second time does nothing."""
    first, second, asker = sessions(), sessions(), sessions()
    serve(first, "b/x", 1)
    closed = [serve(second, key, number) for number, key in enumerate(("a/x", "b/x"), 2)]
    serve(second, "c/y", 4)
    introduce(asker, first, second)
    answers = asker.query("*/x", Number)
    assert [key for key, _ in answers] == ["a/x", "b/x", "b/x"]
    assert sorted(number.value for _, number in answers) == [1, 2, 3]
    for served in closed:
        served.close()
        served.close()
    assert asker.query("*/x", Number) == [("b/x", Number(1))]
    second.close()
    assert asker.query("**", Number) == [("b/x", Number(1))]


def refuse() -> Number:
    """A handler's own error."""
    raise BusError("not today")


@pytest.mark.parametrize(
    ("handler", "text", "is_logged"),
    [
        (lambda _: refuse(), "not today", False),
        (lambda _: Deferred(refuse), "not today", False),
        (lambda _: {}["missing"], "KeyError: 'missing'", True),
    ],
    ids=["an error", "a deferred one", "a fault"],
)
def test_an_error_goes_to_the_asker_as_text(
    sessions: Sessions, handler: Callable[[NoRequest], Any], text: str, is_logged: bool
) -> None:
    """After the key that was asked, as an error carries no key of its own. What the handler did not mean to raise is
    logged where it happened. It does not spoil the answers of others."""
    server, asker = sessions(), sessions()
    server.serve("a/x", NoRequest, handler)
    introduce(asker, server)
    with captured_log() as log:
        for key in ("a/x", "a/*"):
            with pytest.raises(BusError) as caught:
                asker.query(key, Number)
            assert str(caught.value) == f"{key}: {text}"
    assert any("error while answering the query a/x" in line for line in log.lines) is is_logged
    assert is_logged or log.lines == []
    assert asker.find("a/x", Number) == []
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


# The limit of a session outside is set when the bridge is opened.
@pytest.mark.parametrize("sessions", ["memory", "zenoh"], indirect=True)
def test_too_many_deferred_answers_are_refused(sessions: Sessions, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has a thread, so there is a limit; later queries are answered again."""
    monkeypatch.setattr(transport, "MAX_DEFERRED", 1)
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
    wait_until_true(lambda: asker.find("slow", Number, timeout=LIMIT) != [])


def test_a_query_times_out(sessions: Sessions) -> None:
    """A server that does not finish in time costs its asker the time-out and an error, but no answer of others."""
    server, asker, end = sessions(), sessions(), threading.Event()
    server.serve("a/slow", NoRequest, lambda _: Deferred(lambda: end.wait(LIMIT) and Number(1)))
    serve(server, "a/fast", 2)
    introduce(asker, server)
    try:
        with pytest.raises(QueryTimeoutError):
            asker.ask("a/slow", Number, timeout=0.1)
        # On a busy machine the fast one may need longer, too.
        assert any(asker.query("a/*", Number, timeout=patience) == [("a/fast", Number(2))] for patience in (0.5, LIMIT))
    finally:
        end.set()


def test_a_change_is_asked_for_by_its_key_alone(sessions: Sessions) -> None:
    """By a wildcard nothing changes, whatever the request carries, and the refusal says how to ask; other queries
    answer. By its key it is made, also for a client that sends more than the request knows."""
    server, asker, added = sessions(), sessions(), Inbox()
    server.serve("box/add", Add, lambda request: added(request.by) or Number(request.by))
    serve(server, "box/add/last", 2)
    introduce(asker, server)
    for asked in ("**", "box/*", "*/add", "box/a$*", "box/add/**"):
        for payload in (b"", b'{"by": 7}', b"no JSON"):
            text = f"box/add changes something: ask for it by this key, not by the wildcard {asked}"
            assert ("", text.encode(), True) in raw_replies(asker, asked, payload)
    assert added.items == []
    assert "box/add" not in server.counters.snapshot()
    assert asker.ask("box/add", Number, Add(by=2)) == Number(2)
    assert raw_replies(asker, "box/add", b'{"by": 3, "instance": "0123"}') == [("box/add", b'{"value":3}', False)]
    assert added.items == [2, 3]


@pytest.mark.parametrize(
    ("payload", "text"),
    [
        (b'{"x":' * DEEP, "it is nested too deeply"),
        (b"[" * DEEP, ""),
        (b'{"value":' + b"[" * DEEP, ""),
        (b"no JSON", "JSON is malformed"),
        (b'{"value": "text"}', "Expected `int`, got `str`"),
        (b'{"value": "\xff"}', ""),
        (b'{"x": "' + b"y" * 1_000_000 + b'"}', "its 1000009 bytes are more than 900000"),
    ],
    ids=["deep", "deep list", "deep value", "no JSON", "another type", "no UTF-8", "large"],
)
def test_what_cannot_be_read_is_refused_in_one_line(
    sessions: Sessions, payload: bytes, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A request gets an error and one count, an answer is an error of its key; there is no traceback."""
    monkeypatch.setattr(transport, "MAX_PAYLOAD", 900_000)
    server, asker = sessions(), sessions()
    server.serve("a", Number, lambda request: request)
    server.transport.declare_queryable("odd", lambda *_: payload)
    introduce(asker, server)
    with captured_log() as log:
        ((_, answer, error),) = raw_replies(asker, "a", payload)
        with pytest.raises(BusError, match=r"^odd: unreadable answer: ") as caught:
            asker.ask("odd", Number)
    assert error
    assert answer.startswith(b"bad request: ")
    assert text in answer.decode()
    assert text in str(caught.value)
    assert len(answer) < 200
    assert server.counters.snapshot()["a"].dropped == 1
    assert [len(line.splitlines()) for line in log.lines] == [1]
