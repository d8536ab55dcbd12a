"""What the participants of lock-step say on the bus: their presence and their answers, taken into the open tick.

An answer counts from the session that holds the name. A first answer may overtake its session's token.
"""

import logging
import threading
from collections.abc import Callable

from zteam import names
from zteam.clock import HOST_FACTOR
from zteam.messages import Done
from zteam.nodes.simulator.open_tick import OpenTick
from zteam.runtime.process_node import ProcessNode

log = logging.getLogger("zteam")

TOKEN_GRACE = 1.0 * HOST_FACTOR
"""Host seconds for the token of a session whose answer has come."""
_MOST_EARLY = 64
"""Sessions without a token that are remembered: a sender can invent sessions."""


class Answers:
    """Takes tokens and answers into `tick`, under `changed`, and notifies the thread that waits for them."""

    def __init__(
        self,
        node: ProcessNode,
        tick: OpenTick,
        changed: threading.Condition,
        on_command: Callable[[int], None],
        send_again: Callable[[], None],
    ) -> None:
        """`on_command(robot_id)` is called for an answer with a command; `send_again()` sends the tick once more."""
        self._counters = node.bus.counters
        self._tick = tick
        self._changed = changed
        self._on_command = on_command
        self._send_again = send_again
        self._early: dict[tuple[str, str], Done | None] = {}
        """The newest answer by name and session, of sessions that do not hold the name; None once it was refused."""
        node.bus.watch_link(self._on_link)
        node.bus.watch_tokens([names.tokens_key()], self._on_token)
        node.bus.subscribe_from(names.done_key(), Done, self._on_done)

    def _on_link(self, up: bool) -> None:
        # Without the link all tokens are gone, and with them all participants.
        if not up and self._tick.note_lost_link():
            log.error("the link to the router was lost in tick %d: its participants leave", self._tick.message.tick)

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is None or token[0] == names.SIMULATOR:
            return
        with self._changed:
            if alive and self._tick.note_return(*token):
                log.error("%s was cut off, or frozen for longer than its lease: it missed ticks", token[0])
            must_send = self._tick.take_token(*token, alive)
            early = self._early.pop(token, None) if alive else None
            if early is not None:
                self._take(*token, early)
            if must_send:
                self._send_again()
            self._changed.notify_all()

    def _on_done(self, key: str, done: Done, session: str) -> None:
        sender = names.split_done_key(key) or "", session
        with self._changed:
            if self._take(*sender, done):
                return
            if self._early.get(sender) is None:
                refused = [known for known, answer in self._early.items() if answer is None]
                if sender in refused or len(self._early) - len(refused) >= _MOST_EARLY:
                    self._refuse(*sender)
                    return
                if len(self._early) >= _MOST_EARLY:
                    del self._early[refused[0]]
                # Host time: an answer without a token is refused at host time, while the world is held.
                timer = threading.Timer(TOKEN_GRACE, self._expire, sender)  # noqa: TID251
                timer.name, timer.daemon = "early answer", True
                timer.start()
            self._early[sender] = done

    def _take(self, name: str, session: str, done: Done) -> bool:
        """Take an answer. False if its session does not hold `name`."""
        if not self._tick.take_done(name, session, done):
            return False
        robot_id = names.robot_id_of(name)
        if done.has_command and robot_id is not None:
            self._on_command(robot_id)
        if self._tick.needs_attention:
            self._changed.notify_all()
        return True

    def _expire(self, name: str, session: str) -> None:
        with self._changed:
            if self._early.get((name, session)) is not None:
                self._early[name, session] = None
                self._refuse(name, session)

    def _refuse(self, name: str, session: str) -> None:
        holder = self._tick.barrier.name_of(session)
        sender = f"{holder} (session {session})" if holder else f"session {session or 'unknown'}"
        self._counters.drop(names.done_key(name), f"{sender} does not hold the name {name}")
