"""The ticks of lock-step, from a simulator that has said that it works in lock-step, and from no other sender.

Any process can put a tick on the bus, and one tick is enough to stop a robot in real time: it would wait for the next.
So `sim/status` is asked once for each simulator, when its presence token comes, and only its session's ticks count.
"""

import logging
import threading
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from zteam import names
from zteam.bus.transport import Closeable
from zteam.errors import BusError
from zteam.messages import Tick
from zteam.runtime.node import Node

log = logging.getLogger("zteam")

GRACE = 1.0
"""Host seconds for a simulator's token and answer to come, which its first tick may overtake."""


class _Mode(msgspec.Struct):
    """What counts here of the answer to `sim/status`."""

    lockstep: bool = False
    instance: str = ""
    """Session of the simulator that answers."""


class _Early(NamedTuple):
    source: str
    tick: Tick


class Ticks:
    """Calls `take(tick)` under `node.changed` for each tick of a simulator in lock-step."""

    def __init__(self, node: Node, take: Callable[[Tick], None]) -> None:
        self._node = node
        self._take = take
        self._lockstep: dict[str, bool | None] = {}
        """Of each living simulator, by session: whether it works in lock-step; None until it has said so."""
        self._early: _Early | None = None
        """The newest tick of a session that is not known to be a simulator in lock-step."""
        self._settling = False
        self._asking = 0
        """Questions that are under way."""
        self._input: Closeable | None = None
        node.bus.watch_tokens([names.tokens_key(names.SIMULATOR)], self._on_token)
        self.listen()

    def listen(self) -> None:
        """Hear ticks; nothing if they are heard already."""
        if self._input is None:
            self._input = self._node.bus.subscribe_from(names.TICK, Tick, self._on_tick)

    def deafen(self) -> None:
        """Hear no ticks until `listen`."""
        if self._input is not None:
            self._input.close()
            self._input = None

    def count_of(self, session: str) -> bool:
        """Whether this session is a simulator in lock-step."""
        return self._lockstep.get(session) is True

    def doubt(self) -> None:
        """Ask every simulator again before its next tick counts."""
        self._lockstep = dict.fromkeys(self._lockstep)

    @property
    def expected(self) -> bool:
        """Whether a simulator in lock-step is there, or one that has not said yet whether it is."""
        return self._asking > 0 or self._early is not None or True in self._lockstep.values()

    def _on_token(self, key: str, alive: bool) -> None:
        # Tokens have a thread of their own, which may wait for an answer.
        instance = key.rpartition("/")[2]
        with self._node.changed:
            if alive:
                self._lockstep[instance] = None
            else:
                self._lockstep.pop(instance, None)
        if alive:
            self._ask(instance)

    def _ask(self, instance: str) -> None:
        """Ask the simulator of this session, and take the tick that came before the answer. Not for handlers."""
        with self._node.changed:
            self._asking += 1
        answers: list[tuple[str, _Mode]] = []
        try:
            answers = self._node.bus.query(names.service_key(names.SIMULATOR, "status"), _Mode)
        except BusError as error:
            log.debug("%s", error)
        modes = [mode for _, mode in answers if mode.instance in ("", instance)]
        with self._node.changed:
            self._asking -= 1
            self._node.changed.notify_all()
            if not modes or instance not in self._lockstep:
                return
            self._lockstep[instance] = any(mode.lockstep for mode in modes)
            early = self._early
            if early is not None and early.source == instance and self._lockstep[instance]:
                self._early = None
                self._take(early.tick)

    def _on_tick(self, _key: str, tick: Tick, source: str) -> None:
        with self._node.lock:
            if self._lockstep.get(source):
                self._take(tick)
                return
            # Its token, or the answer, may be on its way.
            self._early = _Early(source, tick)
            if not self._settling:
                self._settling = True
                threading.Thread(target=self._settle, name="ticks", daemon=True).start()

    def _settle(self) -> None:
        """Find out what to do with a tick of a session that is not known as a simulator in lock-step."""
        node = self._node
        with node.changed:
            node.changed.wait_until(lambda: self._early is None or self._owes_an_answer or node.stopping, GRACE)
            instance = self._early.source if self._early is not None and self._owes_an_answer else None
        if instance is not None:
            # It did not answer when it came.
            self._ask(instance)
        with node.changed:
            self._settling = False
            early, self._early = self._early, None
            if early is not None and not self._lockstep.get(early.source, False) and not node.stopping:
                node.bus.counters.drop(names.TICK, "no simulator in lock-step sent it, so it does not count")

    @property
    def _owes_an_answer(self) -> bool:
        """Whether the tick that came early is of a simulator that did not answer, and is not being asked."""
        early = self._early
        return early is not None and not self._asking and self._lockstep.get(early.source, False) is None
