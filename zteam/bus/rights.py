"""What the router's access control drops: Zenoh does not report it, so a process with a certificate finds it out."""

import logging
import secrets
import threading
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from typing import NamedTuple

import zenoh

from zteam.bus.options import ROUTER_ANSWER, BusOptions, client_config, open_session
from zteam.bus.transport import Transport, let_end, zenoh_text
from zteam.clock import HOST_FACTOR, monotonic, pause, wait_until
from zteam.errors import BusError
from zteam.names import ANSWERS, checked_key, right_key

log = logging.getLogger("zteam.bus")

_SEEN_WITHIN = 5.0 * HOST_FACTOR
"""Host seconds for a token to reach another session."""
_SEEN_PERIOD = 0.05
"""Host seconds between two looks for a token."""
_GATHERED = 0.3
"""Host seconds from a declaration to the look: a process makes most of its declarations together."""
_MAX_USES = 4096
"""Declarations of a process that are looked at; what it declares beyond is not."""
_AT_ONCE = 256
"""Declarations in one look."""


class Use(NamedTuple):
    """What a process does with a key."""

    key: str
    verb: str
    """PUBLISHES or ANSWERS."""


class RightCheck:
    """What a session may do, by its certificate.

    For each use of a key it holds a token that needs the same right, and another session with the same certificate
    looks for it. A last token, which every certificate may hold, shows that those before it have reached the router.
    """

    def __init__(self, transport: Transport, options: BusOptions) -> None:
        self._transport, self._options = transport, options
        self._changed = threading.Condition()
        self._known: set[Use] = set()
        """Those that were looked at, or are about to be."""
        self._waiting: list[Use] = []
        self._refused: set[Use] = set()
        self._thread: threading.Thread | None = None
        self._closed = False

    def refuses(self, use: Use) -> bool:
        """Whether a look has found that the router drops this."""
        return use in self._refused

    def is_hidden(self, token: str) -> bool:
        """Whether a token of this session is kept from all others. Then the process ends, so nothing more is said."""
        if self._find_hidden([token]):
            self._closed = True
        return self._closed

    def check(self, uses: Sequence[Use]) -> None:
        """Raise BusError for the first of these that the router drops."""
        refused = self._look(uses)
        if refused:
            raise BusError(self._text(refused[0]))
        with self._changed:
            self._known.update(uses)

    def check_later(self, use: Use) -> None:
        """Log an error, soon and on a thread of its own, if the router drops this."""
        with self._changed:
            if use not in self._known and len(self._known) < _MAX_USES:
                self._known.add(use)
                self._begin([use])

    def check_again(self, uses: Iterable[Use]) -> None:
        """As `check_later`, also of what was looked at before: the router has new settings, perhaps."""
        with self._changed:
            self._begin([use for use in uses if use in self._known])

    def _begin(self, uses: Iterable[Use]) -> None:
        self._waiting += uses
        if self._thread is None and self._waiting and not self._closed:
            self._thread = threading.Thread(target=self._work, name="rights", daemon=True)
            self._thread.start()

    def _work(self) -> None:
        while True:
            with self._changed:
                wait_until(self._changed, lambda: self._closed, _GATHERED)
                uses = list(dict.fromkeys(self._waiting[:_AT_ONCE]))
                del self._waiting[:_AT_ONCE]
                if not uses or self._closed:
                    self._thread = None
                    return
            try:
                refused = self._look(uses)
            except BusError as error:
                # The session was closed meanwhile.
                log.debug("rights: %s", error)
                continue
            with self._changed:
                new = [use for use in refused if use not in self._refused]
                self._refused = (self._refused - set(uses)) | set(refused)
            for use in new:
                log.error("%s", self._text(use))

    def _look(self, uses: Sequence[Use]) -> list[Use]:
        """Those that the router drops. One look may meet a link that was just lost and is back, so it takes two."""
        left = list(uses)
        for _ in range(2):
            tokens = {right_key(use.key, use.verb, self._transport.instance): use for use in left}
            if not tokens:
                break
            with ExitStack() as ends:
                for token in tokens:
                    ends.callback(self._transport.declare_token(token).close)
                left = [tokens[token] for token in self._find_hidden(list(tokens))]
        return left

    def _find_hidden(self, tokens: Sequence[str]) -> list[str]:
        """Those of this session's tokens that no other session sees, none where the router is lost meanwhile."""
        # Random: no other session can have declared it before.
        last = checked_key(self._transport.instance, secrets.token_hex(8))
        held, deadline = self._transport.declare_token(last), monotonic() + _SEEN_WITHIN
        try:
            with open_session(client_config(self._options), "usual") as other:
                left = list(tokens)
                while left and not self._closed:
                    # Looked for before the others: if it is there, so are they.
                    is_certain = _sees(other, last)
                    left = [token for token in left if not _sees(other, token)]
                    if is_certain or monotonic() > deadline:
                        return left
                    pause(_SEEN_PERIOD)
        except zenoh.ZError as error:
            log.debug("token: %s", zenoh_text(error))
        finally:
            held.close()
        return []

    def _text(self, use: Use) -> str:
        from zteam.bus.tls import own_identity

        tls = self._options.tls
        name = own_identity(tls)[0].rpartition(".")[0] if tls is not None else ""
        way_out = f"'zteam certs explain {name or 'NAME'}' lists what it may"
        what, verb = ("hides the query", "answer") if use.verb == ANSWERS else ("drops", "publish")
        return f"the router {what} {use.key}: this process's certificate may not {verb} it: {way_out}"

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        let_end(self._thread)


def _sees(session: zenoh.Session, token: str) -> bool:
    return any(reply.ok is not None for reply in session.liveliness().get(token, timeout=ROUTER_ANSWER))
