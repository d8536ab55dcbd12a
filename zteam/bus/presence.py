"""Names on the bus: one live process a name, claimed so that of two that start together exactly one stays.

Equal liveliness tokens of two sessions cannot be told apart, so every token carries its session's id. The claim:
watch both kinds of token, declare a claim, wait, and give way to a living holder or to a claim that sorts first.
Without the wait two contenders both won in 31 of 40 tries, from 20 ms on in none; CLAIM_WAIT is five times that.
"""

import os
import socket
import threading
from collections.abc import Callable
from typing import Annotated

import msgspec
from msgspec.structs import replace

from zteam import names
from zteam.bus.bus import Bus, NoRequest
from zteam.bus.transport import Closeable, let_end
from zteam.clock import HOST_FACTOR, monotonic, to_seconds, wait_until, wall_ns
from zteam.errors import BusError, DuplicateNameError, log
from zteam.version import __version__

CLAIM_WAIT = 0.1 * HOST_FACTOR
"""Host seconds for the tokens of others to come."""
ASK_AGAIN = 1.0
"""Host seconds between two questions to other holders of the name. One question is for all of them, and one thread
asks, however many tokens come: any program may hold tokens."""


_Text = Annotated[str, msgspec.Meta(max_length=255)]
_Moment = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class ProcessInfo(msgspec.Struct):
    """Answer to `<name>/info`: which process this is, as it says. Nothing signals a process by this id."""

    name: _Text
    host: _Text
    pid: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]
    start: _Moment
    """Nanoseconds since the Unix epoch."""
    instance: _Text
    version: _Text = ""
    now: _Moment = 0
    """The host's clock when it answered, in nanoseconds since the Unix epoch."""
    is_users: bool = False
    """Whether it runs a `zteam.Node` of a user's own."""

    @property
    def age(self) -> float:
        """Seconds since its start, by its own host's clock."""
        return to_seconds((self.now or wall_ns()) - self.start)

    def is_older(self, start: int, instance: str) -> bool:
        """Whether of this process and another one this one keeps the name."""
        return (self.start, self.instance) < (start, instance)


def own_info(name: str, instance: str, start: int) -> ProcessInfo:
    return ProcessInfo(name, socket.gethostname(), os.getpid(), start, instance, __version__, wall_ns())


def find_processes(bus: Bus, name: str = "*", *, timeout: float = 2.0) -> list[ProcessInfo]:
    """The processes that answer under `name`, by default all, in the order of their names.

    An answer that names another process than its key is left out: the key is what access control protects.
    """
    found = bus.find(names.info_key(name), ProcessInfo, timeout=timeout)
    return [info for key, info in found if key == names.info_key(info.name)]


class Claim:
    """A claim on `name`: made at once, won by `win` after the wait; other start-up work fits in between."""

    def __init__(self, bus: Bus, name: str) -> None:
        self._bus = bus
        self.name = name
        self.start = wall_ns()
        self.info = own_info(name, bus.instance, self.start)
        self._instance = f"{self.start:020d}-{bus.instance}"
        self._changed = threading.Condition()
        self._alive: set[str] = set()
        self._claims: set[str] = set()
        self._unmet: set[str] = set()
        """Of `_alive`, those that have not answered yet to this holder of the name."""
        self._has_lost = False
        """Whether another token has ended since this process's answer was declared."""
        self._meeting: threading.Thread | None = None
        self._stop: Callable[[str], None] | None = None
        self._token: Closeable | None = None
        self._released = False
        self._server = bus.serve(
            names.info_key(name), NoRequest, lambda _: replace(self.info, now=wall_ns()), at_once=True
        )
        self.under_name: list[Closeable] = []
        """What else is published and answered under the name: it ends when the name is given back."""
        self._watches = bus.watch_tokens([names.tokens_key(name), names.claim_key(name, "*")], self._on_token)
        self._claim = bus.declare_token(names.claim_key(name, self._instance))
        self._since = monotonic()

    def _on_token(self, key: str, alive: bool) -> None:
        instance = key.rpartition("/")[2]
        known = self._alive if names.split_token_key(key) else self._claims
        if instance in {self._bus.instance, self._instance}:
            return
        with self._changed:
            (known.add if alive else known.discard)(instance)
            if known is self._alive:
                (self._unmet.add if alive else self._unmet.discard)(instance)
            self._has_lost |= not alive
            self._changed.notify_all()
            self._meet_aside()

    def win(self, stop: Callable[[str], None], on_win: Callable[[], None] = lambda: None) -> None:
        """Take the name. Raises DuplicateNameError that names the process that holds it.

        `on_win()` is called before other processes can see the token. `stop(reason)` is called later if a healed
        network shows an older holder: this process must then stop.
        """
        self._stop = stop
        rivals, earlier = self._find_rivals()
        if rivals or earlier:
            for handle in (self._server, self._claim, *self._watches):
                handle.close()
            raise DuplicateNameError(self._refusal(rivals))
        on_win()
        token = names.token_key(self.name, self._bus.instance)
        self._token = self._bus.declare_token(token)
        if self._bus.is_hidden(token):
            self.release()
            raise BusError(
                f"the router does not let this process be {self.name}: its certificate has another name, or is of "
                "another namespace"
            )
        self._claim.close()
        with self._changed:
            # A token that came since the look above was not compared with one of this process.
            self._has_lost = False
            self._meet_aside()

    def is_taken(self) -> bool:
        """Whether another process holds the name or claimed it earlier. Waits as long as `win`, which then does not."""
        return any(self._find_rivals())

    def _find_rivals(self) -> tuple[list[str], list[str]]:
        """Holders of the name, and earlier claims on it."""
        # On a crowded machine a token may come after the wait, an answer does not. Asking takes a part of the wait.
        older = {info.instance for info in self._others() if info.is_older(self.start, self._bus.instance)}
        with self._changed:
            remaining = CLAIM_WAIT - (monotonic() - self._since)
            wait_until(self._changed, lambda: bool(self._alive), max(0.0, remaining))
            return sorted(self._alive | older), [c for c in self._claims if c < self._instance]

    def _refusal(self, rivals: list[str]) -> str:
        # A query right after the holder's start may miss its answer.
        answers = (info for _ in range(2) for info in self._others())
        holder = next((info for info in answers if not rivals or info.instance in rivals), None)
        by = f" by process {holder.pid} on {holder.host}, for {holder.age:.0f} s" if holder is not None else ""
        return f"{self.name} is taken{by}: stop that one first, or use another id or --namespace"

    def _others(self) -> list[ProcessInfo]:
        """The other processes that answer under this name."""
        found = find_processes(self._bus, self.name, timeout=1.0)
        return [info for info in found if info.instance != self._bus.instance]

    def _must_meet(self) -> bool:
        """Whether there is something to do about other tokens of the name (under `_changed`)."""
        return bool(self._unmet or self._has_lost) and self._token is not None and not self._released

    def _meet_aside(self) -> None:
        """Under `_changed`."""
        if self._must_meet() and self._meeting is None:
            self._meeting = threading.Thread(target=self._meet_rivals, name="rival", daemon=True)
            self._meeting.start()

    def _meet_rivals(self) -> None:
        """Two holders, such as after a healed network: the one that started later gives way.

        A rival that does not answer is asked again as long as both hold the name.
        """
        while True:
            with self._changed:
                if not self._must_meet():
                    self._meeting = None
                    return
                if self._has_lost:
                    self._has_lost = False
                    self._server.renew()
                is_met = not self._unmet
            for rival in () if is_met else self._others():
                with self._changed:
                    is_new = rival.instance in self._unmet
                    self._unmet.discard(rival.instance)
                if is_new and rival.is_older(self.start, self._bus.instance) and self._stop:
                    reason = f"{self.name} is also held by process {rival.pid} on {rival.host}, which is older"
                    log.error("%s: stopping", reason)
                    self._stop(reason)
            with self._changed:
                wait_until(self._changed, lambda: self._released, ASK_AGAIN)

    def release(self) -> None:
        """Give the name back; the session may go on without it."""
        with self._changed:
            self._released, meeting = True, self._meeting
            self._changed.notify_all()
        let_end(meeting)
        for handle in (self._server, self._token, self._claim, *self._watches, *self.under_name):
            if handle:
                handle.close()
