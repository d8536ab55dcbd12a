"""What comes from outside in lock-step: the simulator takes it, for all, and the next tick carries it.

A message is from outside if its session takes no part. Which session that is, the simulator alone decides: participants
drop what comes from any that is not listed (`zteam.node.screen`). So a run depends on nothing but its ticks.
"""

import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable
from itertools import count
from typing import NamedTuple

import msgspec
import numpy as np

from zteam import names
from zteam.bus import Bus
from zteam.bus.bus import LATCHED
from zteam.bus.transport import RawSample, matches
from zteam.messages import Input
from zteam.messages.message import CDR
from zteam.messages.topics import is_own
from zteam.simulator.recorded_ticks import RecordedTick

MAX_BYTES = 1 << 20
"""Of the inputs of a tick; the rest follows in the next ones. A larger one is refused."""
_MOST, _MOST_OF_KEY = 2000, 1000
"""Messages that wait, of all keys and of one: a world may stand still while others send."""


class _Waiting(NamedTuple):
    """What has come, for the next tick."""

    source: str
    """Its session; empty for what the simulator, or a participant, has taken itself."""
    input: Input
    """Without a number."""
    slot: str
    """What it replaces for processes that join later: empty if they need not have it."""

    def is_read(self, reads: list[str]) -> bool:
        """Whether it is a request, which may be for any process, or one of these key expressions has its key."""
        return self.input.type == Input.REQUEST or any(matches(each, self.input.key) for each in reads)


class Outside:
    """Bus threads bring what comes; the main loop takes it."""

    def __init__(self, bus: Bus, on_latched: Callable[[], object]) -> None:
        """`on_latched()` is called when a latched input has come."""
        self._bus, self._on_latched = bus, on_latched
        self._lock = threading.Lock()
        self._inside = frozenset({bus.instance})
        """The sessions that take part, or have asked to: what they send comes to its readers as it is."""
        self._reads: set[str] = set()
        """The keys, and the wildcards, that participants read."""
        self._wildcards: list[str] = []
        """Those of them that are wildcards."""
        self._subscribed: list[tuple[str, bool]] = []
        """Key expressions, and whether latched."""
        self._waiting: deque[_Waiting] = deque()
        self._count = Counter[str]()
        """Of what waits, by key."""
        self._newest: dict[str, _Waiting] = {}
        """What was carried, and comes again for a process that joins: by slot."""
        self._numbers = count(1)

    def read(self, reads: Iterable[str]) -> None:
        """A participant reads these key expressions (`Bus.reads`)."""
        for each in reads:
            key_expr, latched = each.removesuffix(LATCHED), each.endswith(LATCHED)
            if is_own(key_expr):
                # Each message would wake the simulator.
                continue
            with self._lock:
                if names.is_wildcard(key_expr) and key_expr not in self._reads:
                    self._wildcards.append(key_expr)
                self._reads.add(key_expr)
                target = names.split_robot_key(key_expr)
                # Each robot reads the same topics: one subscription serves all.
                place = key_expr if target is None else names.all_robots_key(target[1]), latched
                if place in self._subscribed:
                    continue
                self._subscribed.append(place)
            self._bus.subscribe_raw(place[0], self._receiver(*place), latched=latched, from_others=True)

    def _receiver(self, key_expr: str, latched: bool) -> Callable[[RawSample], None]:
        def receive(sample: RawSample) -> None:
            if sample.source in self._inside or names.is_wildcard(sample.key):
                return
            with self._lock:
                is_read = sample.key in self._reads or any(matches(each, sample.key) for each in self._wildcards)
                # Several may have the key: a latched one takes it, else the first.
                takers = sorted(self._subscribed, key=lambda place: not place[1])
                takes = is_read and (key_expr, latched) == next(each for each in takers if matches(each[0], sample.key))
            if takes:
                kind = sample.encoding.removeprefix(CDR) if sample.encoding.startswith(CDR) else ""
                # A message is no request, whatever its sender names it.
                kind = "" if kind == Input.REQUEST else kind
                self.add(sample.key, sample.payload, kind, source=sample.source, slot=sample.key if latched else "")

        return receive

    def add(self, key: str, data: bytes, kind: str = Input.REQUEST, *, source: str = "", slot: str = "") -> None:
        """Put a message or a request into the next tick. A process that joins later gets the newest one of a `slot`."""
        self._bus.counters.of(key).received += 1
        if len(data) > MAX_BYTES:
            text = f"from outside lock-step, its {len(data)} bytes are more than {MAX_BYTES}: let its process take part"
            self._bus.counters.drop(key, text)
            return
        with self._lock:
            is_full = len(self._waiting) >= _MOST or self._count[key] >= _MOST_OF_KEY
            if not is_full:
                self._count[key] += 1
                content = Input(0, key, kind, np.frombuffer(data, np.uint8))
                self._waiting.append(_Waiting(source, content, slot))
        if is_full:
            self._bus.counters.drop(key, "too many messages from outside wait for the next tick already")
        elif slot:
            self._on_latched()

    def has(self, session: str) -> bool:
        """Whether this session is outside."""
        return session not in self._inside

    def admit(self, session: str) -> None:
        """This session asks to take part: from now on it is not outside."""
        if session not in self._inside:
            with self._lock:
                self._inside |= {session}

    def part_with(self, session: str) -> None:
        """This session takes no part any more: it has ended."""
        with self._lock:
            self._inside -= {session}

    def recorded(self, tick: int) -> RecordedTick | None:
        """What a tick was in the run that is run again; None in any other run."""
        return None

    def coming(self, tick: int) -> list[Input]:
        """What is to change the world before this tick is opened: nothing, as queries have changed it already."""
        return []

    def take(self, joined: Iterable[str], tick: int, *, is_first: bool) -> tuple[list[Input], list[Input]]:
        """The inputs of the tick that is opened: those that come again for its new participants, and the new ones.

        `tick` is its number, and `joined` are the key expressions that the new participants read. The first tick
        (`is_first`), which may be opened several times, carries latched inputs alone, and each time all of them.
        """
        reads = [each.removesuffix(LATCHED) for each in joined]
        if not (reads or is_first or self._waiting):
            return [], []
        with self._lock:
            self._newest = {slot: each for slot, each in self._newest.items() if each.source not in self._inside}
            again = [each.input for each in self._newest.values() if is_first or (reads and each.is_read(reads))]
            taken, later, size = list[_Waiting](), list[_Waiting](), 0
            while self._waiting and size <= MAX_BYTES:
                each = self._waiting.popleft()
                if each.source in self._inside:
                    continue
                if is_first and not each.slot:
                    later.append(each)
                    continue
                size += each.input.data.nbytes
                if size > MAX_BYTES:
                    later.append(each)
                    continue
                taken.append(each._replace(input=msgspec.structs.replace(each.input, number=next(self._numbers))))
            self._waiting.extendleft(reversed(later))
            self._count = Counter(each.input.key for each in self._waiting)
            for each in taken:
                if each.slot:
                    self._newest.pop(each.slot, None)
                    self._newest[each.slot] = each
        return again, [each.input for each in taken]

    def start_anew(self) -> None:
        """The world is at its start: numbers begin anew, and what was latched comes again."""
        with self._lock:
            self._numbers = count(1)
            self._waiting.extendleft(reversed(self._newest.values()))
            self._newest.clear()
