"""How queries are answered, whatever the transport: errors as text, and slow answers on threads of their own."""

import logging
import threading
from collections.abc import Callable

from zteam.bus.transport import Reply
from zteam.errors import ZteamError

log = logging.getLogger("zteam.bus")

MAX_DEFERRED = 64
"""Deferred answers of a session at once; each has a thread."""

Finish = Callable[[], bytes]


def make_answer(key: str, make: Callable[[], bytes | Finish]) -> Reply | Finish:
    """The reply to a query on `key`, or the call that takes its time to make it.

    The text of a ZteamError goes to the asker as it is. Any other exception is a fault: it is logged here, and the
    asker gets its type and text.
    """
    try:
        made = make()
    except ZteamError as error:
        return error_reply(str(error))
    except Exception as error:
        log.exception("error while answering the query %s", key)
        return error_reply(f"{type(error).__name__}: {error}")
    return made if callable(made) else Reply(key, made, False)


def error_reply(text: str) -> Reply:
    """A reply that carries an error; as in Zenoh, it has no key."""
    return Reply("", text.encode(), True)


class DeferredAnswers:
    """The deferred answers of one session."""

    def __init__(self) -> None:
        self._free = threading.BoundedSemaphore(MAX_DEFERRED)

    def start(self, key: str, finish: Finish, send: Callable[[Reply], None]) -> None:
        """Make an answer on a new thread and `send` it; if too many are waiting, send an error at once."""
        if not self._free.acquire(blocking=False):
            send(error_reply(f"more than {MAX_DEFERRED} queries are waiting: ask again later"))
            return

        def work() -> None:
            try:
                reply = make_answer(key, finish)
                assert isinstance(reply, Reply)
                send(reply)
            finally:
                self._free.release()

        threading.Thread(target=work, name="deferred answer", daemon=True).start()
