"""What a Zenoh session declares, and publishers that know whether they have subscribers."""

import logging
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from zteam.messages import Message, encode

log = logging.getLogger("zteam.bus")


class Declared:
    """A Zenoh declaration; undeclaring it twice, or after the session's end, does nothing."""

    def __init__(self, entity: Any, forget: Callable[["Declared"], None]) -> None:
        self._entity = entity
        self._forget = forget

    def close(self) -> None:
        entity, self._entity = self._entity, None
        if entity is not None:
            self._forget(self)
            try:
                entity.undeclare()
            except zenoh.ZError as error:
                log.debug("undeclare: %s", error)


class ZenohPublisher(Declared):
    """Puts payloads on one key."""

    def __init__(
        self,
        entity: Any,
        forget: Callable[[Declared], None],
        latched: bool,
        on_matching: Callable[[], None],
        stamp: Callable[[], zenoh.Timestamp | None] = lambda: None,
    ) -> None:
        """`on_matching()` is called after `has_subscribers` may have changed.

        `stamp()` makes the timestamps of samples; the session does without it.
        """
        super().__init__(entity, forget)
        self._matching = True
        self._latched = latched
        self._stamp = stamp
        self._changed = on_matching
        if not latched:
            # A listener instead of a question for each message: every call into Zenoh releases the interpreter lock.
            self._lock, self._told = threading.Lock(), False
            callback: Any = zenoh.handlers.Callback(self._on_matching, indirect=False)
            self._listener = entity.declare_matching_listener(callback)
            now = entity.matching_status.matching
            with self._lock:
                # The listener's word is newer than the answer.
                if not self._told:
                    self._matching = now

    @property
    def has_subscribers(self) -> bool:
        return self._matching and self._entity is not None

    def find_subscribers(self) -> bool:
        # Zenoh calls the listener in a task of its own, which may come late.
        entity = self._entity
        return entity is not None and (self._latched or bool(entity.matching_status.matching))

    def _on_matching(self, status: Any) -> None:
        with self._lock:
            self._matching, self._told = status.matching, True
        self._changed()

    def put(self, payload: bytes) -> None:
        entity = self._entity
        if entity is None:
            return
        try:
            entity.put(payload, timestamp=self._stamp())
        except zenoh.ZError as error:
            log.debug("put: the message is dropped: %s", error)

    def put_message(self, message: Message) -> None:
        self.put(encode(message))

    def hand_over(self, message: Message) -> None:
        self.put(encode(message))


def stamping_as(session: zenoh.Session, source: str) -> Callable[[], zenoh.Timestamp]:
    """Makes timestamps with the time of `session` and the id `source`."""
    # As Zenoh writes its ids: the last byte comes first.
    name = zenoh.TimestampId(bytes.fromhex(source)[::-1])
    return lambda: zenoh.Timestamp(session.new_timestamp().get_time_as_ntp64(), name)
