"""Presence tokens, the same over Zenoh and in memory."""

import pytest

from support.log_capture import captured_log
from support.transports import Inbox, Sessions


def test_tokens_come_and_go(sessions: Sessions) -> None:
    """A watcher gets those that are there, of its own session too, and then each that comes or goes, in their order;
    closing a token twice does nothing."""
    holder, watcher = sessions(), sessions()
    inbox = Inbox()
    watcher.declare_token("a/w")
    holder.declare_token("c")
    watcher.watch_tokens(["a/*", "b"], inbox)
    inbox.wait_for(("a/w", True))
    first = holder.declare_token("a/x")
    inbox.wait_for(("a/x", True))
    holder.declare_token("b")
    inbox.wait_for(("b", True))
    first.close()
    first.close()
    inbox.wait_for(("a/x", False))
    again = holder.declare_token("a/x")
    inbox.wait_count(5)
    again.close()
    told = [("a/w", True), ("a/x", True), ("b", True), ("a/x", False), ("a/x", True), ("a/x", False)]
    assert inbox.wait_count(6) == told
    holder.close()
    assert inbox.wait_count(7) == [*told, ("b", False)]


# The tokens of zteam have their session's id in them, so one outside is never that of a node.
@pytest.mark.parametrize("sessions", ["memory", "zenoh"], indirect=True)
def test_equal_tokens_count_as_one(sessions: Sessions) -> None:
    """Two sessions with the same token: it comes with the first and goes with the last."""
    first, second, watcher = sessions(), sessions(), sessions()
    inbox, late = Inbox(), Inbox()
    watcher.watch_tokens(["*"], inbox)
    tokens = [first.declare_token("a"), second.declare_token("a")]
    second.declare_token("m1")
    inbox.wait_for(("m1", True))
    first.declare_token("m2")
    inbox.wait_for(("m2", True))
    watcher.watch_tokens(["a"], late)
    late.wait_for(("a", True))
    tokens[0].close()
    first.declare_token("m3")
    inbox.wait_for(("m3", True))
    assert [alive for key, alive in inbox.items if key == "a"] == [True]
    tokens[1].close()
    inbox.wait_for(("a", False))
    late.wait_for(("a", False))
    assert late.items == [("a", True), ("a", False)]
    assert [alive for key, alive in inbox.items if key == "a"] == [True, False]


@pytest.mark.parametrize("first", [True, False])
def test_an_error_in_a_watch_ends_nothing(sessions: Sessions, first: bool) -> None:
    """It is logged; neither the session with the token nor another watch sees it. A closed watch gets nothing."""
    holder, watcher = sessions(), sessions()
    inbox, failing, closed = Inbox(), Inbox(), Inbox()

    def fail(key: str, alive: bool) -> None:
        failing(key, alive)
        raise ValueError("a fault")

    with captured_log() as log:
        if first:
            holder.declare_token("a")
        watcher.watch_tokens(["*"], fail)
        watcher.watch_tokens(["*"], inbox)
        (watch,) = watcher.watch_tokens(["b"], closed)
        watch.close()
        watch.close()
        if not first:
            holder.declare_token("a")
        holder.declare_token("b")
        failing.wait_count(2)
        # Zenoh may tell a watch twice of a token that was there before it.
        inbox.wait_for(("a", True))
        inbox.wait_for(("b", True))
        log.wait_for("error in a callback of the bus")
    assert closed.items == []
