"""The simulator's queries: looking at a run, its pace, and changes to the world, which are made between two ticks."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from zteam import names
from zteam.bus import Change, Deferred, NoRequest
from zteam.clock import monotonic, wait_until
from zteam.errors import BusError, ZteamError
from zteam.nodes.simulator.pacing import Pacer
from zteam.runtime.node import Node
from zteam.services.simulator import (
    BOUNDARY_LIMIT,
    FinishReply,
    FinishRequest,
    MoveRequest,
    RemoveRequest,
    SimReport,
    SimStatus,
    SpawnReply,
    SpawnRequest,
    SpeedRequest,
    StandReply,
    StandRequest,
    StepRequest,
)

T = TypeVar("T")


_LONGEST_WAIT = 3600.0
"""Host seconds of one wait for the next tick; a condition takes no time-out of centuries."""


class SimulationControl(Protocol):
    """What can be asked of the simulator; all but `status` and `report` in its main loop only."""

    def status(self) -> SimStatus:
        """How it stands."""

    def report(self) -> SimReport:
        """The counts of the run."""

    def repeat(self) -> None:
        """Send the last tick's data once more."""

    def reset(self) -> None:
        """Back to the start."""

    def spawn(self, request: SpawnRequest) -> int:
        """A further robot; its id."""

    def remove(self, robot_id: int) -> None:
        """One robot less."""

    def move(self, request: MoveRequest) -> None:
        """Lift a robot."""


class _Pending:
    """Something to do between two ticks, and what came of it."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self._made = threading.Event()
        self._result: Any = None
        self._error: ZteamError | None = None

    def make(self) -> None:
        try:
            self._result = self._make()
        except ZteamError as error:
            self._error = error
        self._made.set()

    def result(self) -> Any:
        if not self._made.wait(BOUNDARY_LIMIT):
            raise BusError(f"the tick at hand did not end within {BOUNDARY_LIMIT:g} s: see 'zteam sim status'")
        if self._error is not None:
            raise self._error
        return self._result


class Control:
    """Serves the queries, and says when the next tick may begin."""

    def __init__(self, node: Node, world: SimulationControl, pacer: Pacer) -> None:
        self._node = node
        self._world = world
        self._pacer = pacer
        self._changes: deque[_Pending] = deque()
        self._standing = False
        """Whether the main loop waits here with nothing to do."""
        self._begins_anew = False
        """After a reset the first tick is sent even if the world stands still: nobody would know of it otherwise."""
        self._over = threading.Condition(threading.RLock())
        """Guards `finished` and `_standing`, and tells of them."""
        self.finished = False
        """Whether the time asked for with `--for` is over."""
        now, later = self._serve_now, self._serve_change
        now("status", NoRequest, lambda _: self._status())
        now("report", NoRequest, lambda _: world.report())
        now("pause", Change, lambda _: self._pace(pacer.pause))
        now("resume", Change, lambda _: self._pace(pacer.resume))
        now("speed", SpeedRequest, lambda request: self._pace(lambda: pacer.set_speed(request.speed)))
        now("step", StepRequest, self._step)
        now("stand", StandRequest, lambda request: Deferred(lambda: self._wait_for_standing(request)))
        now("finish", FinishRequest, lambda request: Deferred(lambda: self._wait_for_finish(request)))
        later("repeat", Change, lambda _: self._status_after(world.repeat))
        later("reset", Change, self._reset)
        later("spawn", SpawnRequest, lambda request: SpawnReply(world.spawn(request)))
        later("remove", RemoveRequest, lambda request: self._status_after(lambda: world.remove(request.id)))
        later("move", MoveRequest, lambda request: self._status_after(lambda: world.move(request)))

    def _serve_now(self, service: str, request_type: Any, answer: Callable[[Any], Any]) -> None:
        self._node.bus.serve(names.service_key(names.SIMULATOR, service), request_type, answer)

    def _serve_change(self, service: str, request_type: Any, make: Callable[[Any], Any]) -> None:
        def answer(request: Any) -> Deferred:
            change = _Pending(lambda: make(request))
            with self._node.changed:
                self._changes.append(change)
                self._node.changed.notify_all()
            return Deferred(change.result)

        self._serve_now(service, request_type, answer)

    def _status(self) -> SimStatus:
        status = self._world.status()
        status.finished, status.instance = self.finished, self._node.bus.instance
        return status

    def _status_after(self, make: Callable[[], None]) -> SimStatus:
        make()
        return self._status()

    def _reset(self, _request: Change) -> SimStatus:
        self._world.reset()
        with self._over:
            self.finished = False
        self._begins_anew = True
        return self._status()

    def _pace(self, change: Callable[[], None]) -> SimStatus:
        with self._node.changed:
            change()
            self._node.changed.notify_all()
        return self._status()

    def _step(self, request: StepRequest) -> SimStatus | Deferred:
        if self.finished:
            raise BusError("the run is over: 'zteam sim reset' starts it again")
        with self._over:
            self._standing = False
            self._pacer.step(request.ticks)
        self._node.wake()
        return Deferred(self._wait_until_standing) if request.wait else self._status()

    def _wait_until_standing(self) -> SimStatus:
        with self._over:
            # However many steps: somebody who gives up asking has gone, and this thread ends with the process. A world
            # that somebody else lets go on will not stand.
            while self._pacer.paused and not (self._standing or self._node.stopping):
                self._over.wait(1.0)
        return self._status()

    def _wait_for_standing(self, request: StandRequest) -> StandReply:
        with self._over:
            wait_until(self._over, lambda: self._stands or self._node.stopping, request.timeout)
            stands = self._stands
        return StandReply(stands, self._status())

    @property
    def _stands(self) -> bool:
        # The main loop may not have seen yet that it is to go on.
        return self._standing and self._remaining() is None

    def _wait_for_finish(self, request: FinishRequest) -> FinishReply:
        with self._over:
            wait_until(self._over, lambda: self.finished or self._node.stopping, request.timeout)
            return FinishReply(self.finished)

    def finish(self) -> None:
        """The time asked for is over: the world stands still."""
        with self._over:
            self.finished = True
            self._pacer.steps = 0
            self._over.notify_all()

    def wait_for_turn(self) -> bool:
        """Until the next tick is due, with changes to the world made meanwhile; False when asked to stop."""
        while not self._node.stopping:
            while self._changes:
                self._changes.popleft().make()
            with self._over:
                remaining = self._remaining()
                self._standing = remaining is None
                if self._standing:
                    self._over.notify_all()
            if remaining == 0.0:
                self._begins_anew = False
                return True
            due = None if remaining is None else monotonic() + remaining
            limit = _LONGEST_WAIT if remaining is None else min(remaining, _LONGEST_WAIT)
            self._node.wait(lambda until=due: self._wanted(until), limit)  # type: ignore[misc]
        return False

    def _remaining(self) -> float | None:
        if self._begins_anew:
            return 0.0
        return None if self.finished else self._pacer.remaining(monotonic())

    def _wanted(self, due: float | None) -> bool:
        if self._changes or (due is not None and monotonic() >= due):
            return True
        remaining = self._remaining()
        # A world that was paused before its next tick was due, or before it began to step, is to be said to stand.
        return remaining == 0.0 or (remaining is None) != self._standing
