"""A robot is stopped and released: the queries of what commands it, and of the simulator, which holds its body.

While it is stopped, each of them commands zero velocity, whatever the robot was to do. A process that begins finds out
from the others whether its robot is stopped, so that this outlasts the end of each of them.
"""

import threading
from collections.abc import Callable
from functools import partial
from typing import ClassVar

import msgspec

from zteam import names
from zteam.bus import Bus, Change, NoRequest
from zteam.bus.transport import Closeable, Held
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import log

STOPS = {names.ENGAGE: True, names.RELEASE: False}
"""The topics of the queries that stop a robot, and release it: whether it is stopped then."""
STOPPED = "stopped (zteam stop --release)"
"""Why a robot stands that is stopped."""
LEARN_LIMIT = 0.5 * HOST_FACTOR
"""Host seconds for the others to answer a process that begins; it commands nothing before."""


class EngageRequest(Change):
    """Stop the robot. One query on the wildcard stops all robots: none has to be found first."""

    wildcard: ClassVar[str] = names.all_robots_key(names.ENGAGE)


class ReleaseRequest(Change):
    """Release the robot: it goes on with what it was about."""


class StopReply(msgspec.Struct):
    """Whether the robot is stopped now, by one of the processes that stop it."""

    by: str
    """The name of the process."""
    is_stopped: bool
    is_known: bool = True
    """False: the process has just begun, and does not know yet."""


def serve_stop(
    bus: Bus, robot_id: int, by: str, is_stopped: Callable[[], bool | None], change: Callable[[bool], None]
) -> list[Held[Closeable]]:
    """Answer a robot's three queries as one of the processes that stop it. If another one that answers too has ended,
    declare them anew (`renew`).

    `by` is the process's name; `is_stopped()` is None while that is not known; `change(stopped)` is called on a thread
    of the bus.
    """
    key = partial(names.robot_key, robot_id)

    def tell(_request: NoRequest) -> StopReply:
        stopped = is_stopped()
        return StopReply(by, bool(stopped), stopped is not None)

    def on_request(stopped: bool, _request: Change) -> StopReply:
        change(stopped)
        return StopReply(by, stopped)

    return [
        bus.serve(key(names.STOP), NoRequest, tell),
        bus.serve(key(names.ENGAGE), EngageRequest, partial(on_request, True)),
        bus.serve(key(names.RELEASE), ReleaseRequest, partial(on_request, False)),
    ]


def ask_stopped(bus: Bus, robot: str) -> list[tuple[int, StopReply]]:
    """Robot and answer of each process that stops `robot_N`, or with ALL_ROBOTS any robot, and knows what holds."""
    answers: list[tuple[str, StopReply]] = []
    for _ in range(3):
        begin = monotonic()
        answers = bus.find(names.service_key(robot, names.STOP), StopReply, timeout=LEARN_LIMIT)
        # It ends with the last answer. One that takes all its time lacks one.
        if monotonic() - begin < LEARN_LIMIT:
            break
    targets = ((names.split_robot_key(key), reply) for key, reply in answers)
    return [(target[0], reply) for target, reply in targets if target is not None and reply.is_known]


class StopSwitch:
    """Whether robot `robot_id` is stopped, for the process that commands it."""

    def __init__(
        self,
        bus: Bus,
        robot_id: int,
        on_change: Callable[[], None] = lambda: None,
        is_told: Callable[[], bool] = lambda: False,
    ) -> None:
        """`on_change()` is called on a thread of the bus when a query has changed it. While `is_told()`, queries change
        nothing: in lock-step the simulator, which answers them too, puts them into the next tick."""
        self._bus, self._name, self._on_change, self._is_told = bus, names.robot_name(robot_id), on_change, is_told
        self._lock = threading.Lock()
        self._was_told = False
        """Whether a query has set it: what others knew before does not count then."""
        self.is_stopped = False
        self.is_known = False
        """Whether it is known what holds: nothing is to be commanded before."""
        self._served = serve_stop(
            bus, robot_id, self._name, lambda: self.is_stopped if self.is_known else None, self._on_query
        )
        self._watches = bus.watch_tokens([names.tokens_key(names.SIMULATOR)], self._on_simulator)

    def _on_simulator(self, _key: str, alive: bool) -> None:
        for each in () if alive else self._served:
            each.renew()

    def _on_query(self, stopped: bool) -> None:
        if not self._is_told():
            self.change(stopped)

    def change(self, stopped: bool) -> None:
        """Stop the robot, or release it."""
        with self._lock:
            self._was_told, changed = True, stopped != self.is_stopped
            self.is_stopped, self.is_known = stopped, True
        if changed:
            log.info("stopped: it stands until 'zteam stop --release'" if stopped else "released: it goes on")
            self._on_change()

    def close(self) -> None:
        """Answer no more."""
        for each in (*self._watches, *self._served):
            each.close()

    def learn(self) -> None:
        """Find out at the begin, when this process answers already, whether the robot is stopped. It waits.

        The simulator has its body and knows. Where there is none, what holds for a teammate holds for the robot too.
        """
        own = [reply for _, reply in ask_stopped(self._bus, self._name) if reply.by != self._name]
        others = own or [reply for _, reply in ask_stopped(self._bus, names.ALL_ROBOTS) if reply.by != self._name]
        with self._lock:
            if not self._was_told:
                self.is_stopped = any(reply.is_stopped for reply in others)
            self.is_known = True
            if self.is_stopped and not self._was_told:
                log.info("begins stopped, as %s: 'zteam stop --release'", "it was" if own else "its teammates are")
