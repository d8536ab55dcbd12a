"""A watch of presence tokens that holds although the news of a token's end is lost."""

import logging
from collections.abc import Callable, Iterable
from functools import partial

import zenoh

from zteam.bus.transport import TokenHandler
from zteam.bus.zenoh_callbacks import Aside, call
from zteam.bus.zenoh_publisher import Declared
from zteam.clock import monotonic

log = logging.getLogger("zteam.bus")

LOOK_PERIOD = 30.0
"""Host seconds without news after which all tokens are looked at."""
_PATIENCE = 5.0
"""Host seconds for the router's answer."""


class TokenWatch(Declared):
    """Tells a handler of tokens that are there, come or go. `take` and `look` are called on one thread."""

    def __init__(
        self, session: zenoh.Session, key_expr: str, handler: TokenHandler, forget: Callable[[Declared], None]
    ) -> None:
        self._session = session
        self._key_expr = key_expr
        self._handler = handler
        self._alive: set[str] = set()
        self._missing: set[str] = set()
        """Those that were alive, and that the last look did not find."""
        super().__init__(None, forget)

    def declare(self, thread: Aside) -> None:
        """Watch; the handler is called on `thread`. Raises zenoh.ZError."""

        def on_token(sample: zenoh.Sample) -> None:
            self.take(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        liveliness = self._session.liveliness()
        self._entity = liveliness.declare_subscriber(self._key_expr, thread.callback(on_token), history=True)

    def take(self, key: str, alive: bool) -> None:
        """A token came or went."""
        (self._alive.add if alive else self._alive.discard)(key)
        self._handler(key, alive)

    def look(self) -> None:
        """Take those as gone that two answers of the router in a row did not have."""
        begin = monotonic()
        try:
            replies = self._session.liveliness().get(self._key_expr, timeout=_PATIENCE)
            there = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        except zenoh.ZError as error:
            log.debug("tokens: %s", error)
            return
        # An answer may be empty though tokens are there (1 of 60 sessions just after its start), or come too late.
        if not there & self._alive or monotonic() - begin >= _PATIENCE:
            return
        missing = self._alive - there
        for key in sorted(missing & self._missing):
            log.debug("the end of %s was not told", key)
            call(partial(self.take, alive=False), key)
        self._missing = missing


def look_at_tokens(declared: Iterable[Declared]) -> None:
    """Let each watch among a session's declarations look."""
    for one in list(declared):
        if isinstance(one, TokenWatch):
            one.look()
