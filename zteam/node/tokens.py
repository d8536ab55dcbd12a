"""Which processes are there, and which have commanded a robot of late."""

import threading
from collections import defaultdict
from collections.abc import Callable

from zteam.bus import Bus
from zteam.clock import later, monotonic
from zteam.errors import BusError, log

GRACE = 0.25
"""Host seconds that a vanished token is held back."""
RETURN_GRACE = 2.0
"""Host seconds after the router's return for all processes to find it; they wait up to 0.5 s between attempts."""
RECENT = 5.0
"""Host seconds after its last command for which a session is still a writer."""
_MOST = 64
"""Sessions of a robot that are remembered: a sender can invent them."""


class TokenSet(dict[str, set[str]]):
    """Instances (sessions) alive, by process name. Pure: fed with presence tokens; the caller holds a lock."""

    def __init__(self) -> None:
        super().__init__()
        self._names: dict[str, set[str]] = {}
        """By instance."""

    def take(self, name: str, instance: str, alive: bool) -> bool:
        """A token came or went; True if with it the name got its first holder or lost its last one."""
        was_held = name in self
        for table, one, other in ((self, name, instance), (self._names, instance, name)):
            found = table.setdefault(one, set())
            (found.add if alive else found.discard)(other)
            if not found:
                del table[one]
        return (name in self) != was_held

    def instances(self, name: str) -> frozenset[str]:
        """The sessions that hold this name."""
        return frozenset(self.get(name, ()))

    def names_of(self, instance: str) -> frozenset[str]:
        """The names that this session holds: a navigation of several robots has one for each."""
        return frozenset(self._names.get(instance, ()))

    def name_of(self, instance: str) -> str | None:
        """The first of the names that this session holds; None if it holds none."""
        return min(self._names.get(instance, ()), default=None)


class TokenLossFilter:
    """Tokens that vanished, held back until it is clear whether the process ended or the router.

    When the router goes, all tokens vanish within milliseconds of the link, before or after it; when it is back they
    come back one by one, as their processes find it again. Only a token that stays away with the link up is a loss.
    Pure: fed with tokens, the link and the host's time in seconds.
    """

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._up = True
        self._quiet_until = float("-inf")

    def on_token(self, key: str, alive: bool, now: float) -> None:
        """A token came or went."""
        if alive:
            self._since.pop(key, None)
        else:
            self._since.setdefault(key, now)

    def on_link(self, up: bool, now: float) -> None:
        """The router was lost or is back."""
        self._up = up
        if up:
            self._quiet_until = now + RETURN_GRACE

    def trusted(self, now: float) -> bool:
        """Whether silence and missing tokens mean anything now."""
        return self._up and now >= self._quiet_until

    def due_in(self, now: float) -> float | None:
        """Host seconds until `take_due` may find the next one; None while nothing is held back, or the link is lost."""
        if not self._up or not self._since:
            return None
        return max(0.0, min(self._since.values()) + GRACE - now, self._quiet_until - now)

    def take_due(self, now: float, grace: float = GRACE) -> list[str]:
        """Keys of the tokens that are lost for good; each is returned once.

        Set `grace` to 0 if the link is known to hold, such as by a request that came over it.
        """
        if not self.trusted(now):
            return []
        due = [key for key, since in self._since.items() if now - since >= grace]
        for key in due:
            del self._since[key]
        return due


class CertainTokens:
    """Calls `callback(key, alive)` for tokens: at once when one comes, and for a loss when it is certain.

    Zenoh reports the lost tokens before the lost link. So a loss is held back until it is clear which of them it was.
    Each call is over before the next one.
    """

    def __init__(self, bus: Bus, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        self._callback = callback
        self._losses = TokenLossFilter()
        self._lock = threading.RLock()
        self._waits = False
        """Whether a timer runs: one serves all tokens that are held back."""
        bus.watch_link(self._on_link)
        bus.watch_tokens([key_expr], self._on_token)

    def _on_token(self, key: str, alive: bool) -> None:
        with self._lock:
            self._losses.on_token(key, alive, monotonic())
            if alive:
                self._callback(key, True)
            self._look_later()

    def _on_link(self, up: bool) -> None:
        with self._lock:
            self._losses.on_link(up, monotonic())
            self._look_later()

    def _look_later(self) -> None:
        seconds = None if self._waits else self._losses.due_in(monotonic())
        if seconds is not None:
            self._waits = True
            # Host time: the world may be held for the process that is gone.
            later(seconds, self._look_again, "tokens")

    def _look_again(self) -> None:
        with self._lock:
            self._waits = False
            self.look()
            self._look_later()

    def look(self, grace: float = GRACE) -> None:
        """Report the losses that are certain after `grace` host seconds (as `TokenLossFilter.take_due`)."""
        with self._lock:
            for key in self._losses.take_due(monotonic(), grace):
                try:
                    self._callback(key, False)
                except BusError as error:
                    # The session was closed meanwhile.
                    log.debug("%s", error)


class Writers:
    """The sessions that command each robot. Pure."""

    def __init__(self) -> None:
        self._heard: defaultdict[int, dict[str, float]] = defaultdict(dict)
        """The last host time, by robot and session."""

    def take(self, robot_id: int, session: str, now: float) -> None:
        """A command of the robot came from `session` at host time `now`."""
        heard = self._heard[robot_id]
        if session in heard or len(heard) < _MOST:
            heard[session] = now

    def recent(self, now: float) -> dict[int, set[str]]:
        """The sessions that were heard of late, by robot."""
        for robot_id, heard in self._heard.items():
            self._heard[robot_id] = {session: at for session, at in heard.items() if now - at <= RECENT}
        return {robot_id: {*heard} for robot_id, heard in self._heard.items() if heard}
