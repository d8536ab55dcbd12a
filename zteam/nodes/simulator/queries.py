"""The simulator's queries `sim/…`: status and report, the pace, and changes of the world, made between two ticks."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from zteam import names
from zteam.bus import Change, Deferred, NoRequest
from zteam.errors import BusError
from zteam.nodes.simulator.pacing import Pacer
from zteam.nodes.simulator.turns import Turns
from zteam.nodes.simulator.world_changes import WorldChanges
from zteam.runtime.process_node import ProcessNode
from zteam.services.scans import ScansRequest
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


class Queries:
    """Serves `sim/…`. A bus thread runs each query; the main loop makes the changes, through `turns`."""

    def __init__(
        self,
        node: ProcessNode,
        pacer: Pacer,
        turns: Turns,
        world: WorldChanges,
        status: Callable[[], SimStatus],
        report: Callable[[], SimReport],
    ) -> None:
        self._bus, self._turns, self._world, self._status = node.bus, turns, world, status
        self._serve("status", NoRequest, lambda _: status())
        self._serve("report", NoRequest, lambda _: report())
        self._serve("pause", Change, lambda _: self._set_pace(pacer.pause))
        self._serve("resume", Change, lambda _: self._set_pace(pacer.resume))
        self._serve("speed", SpeedRequest, lambda request: self._set_pace(lambda: pacer.set_speed(request.speed)))
        self._serve("step", StepRequest, self._step)
        self._serve("stand", StandRequest, lambda request: Deferred(lambda: self._stand(request)))
        self._serve("finish", FinishRequest, lambda request: Deferred(lambda: self._finish(request)))
        self._serve_change("repeat", Change, lambda _: self._status_after(world.repeat))
        # Nothing changes, but only between two ticks does what was sent stay as it is.
        self._serve_change("scans", ScansRequest, lambda request: world.scans(request.robots))
        self._serve_change("reset", Change, lambda _: self._status_after(self._reset))
        self._serve_change("spawn", SpawnRequest, lambda request: SpawnReply(world.spawn(request)))
        self._serve_change(
            "remove", RemoveRequest, lambda request: self._status_after(lambda: world.remove(request.id))
        )
        self._serve_change("move", MoveRequest, lambda request: self._status_after(lambda: world.move(request)))

    def _serve(self, service: str, request_type: Any, answer: Callable[[Any], Any]) -> None:
        self._bus.serve(names.service_key(names.SIMULATOR, service), request_type, answer)

    def _serve_change(self, service: str, request_type: Any, make: Callable[[Any], Any]) -> None:
        def answer(request: Any) -> Deferred:
            future = self._turns.submit(lambda: make(request))
            return Deferred(lambda: _result_of(future))

        self._serve(service, request_type, answer)

    def _status_after(self, change: Callable[[], None]) -> SimStatus:
        change()
        return self._status()

    def _reset(self) -> None:
        self._world.reset()
        self._turns.begin_anew()

    def _set_pace(self, change: Callable[[], None]) -> SimStatus:
        self._turns.set_pace(change)
        return self._status()

    def _step(self, request: StepRequest) -> SimStatus | Deferred:
        if self._turns.finished:
            raise BusError("the run is over: 'zteam sim reset' starts it again")
        self._turns.step(request.ticks)
        return Deferred(lambda: self._status_after(self._turns.wait_for_steps)) if request.wait else self._status()

    def _stand(self, request: StandRequest) -> StandReply:
        return StandReply(self._turns.wait_until_standing(request.timeout), self._status())

    def _finish(self, request: FinishRequest) -> FinishReply:
        return FinishReply(self._turns.wait_until_finished(request.timeout))


def _result_of(change: Future[T]) -> T:
    """The result of a change. Raises its ZteamError, or BusError if the open tick does not end in time."""
    try:
        return change.result(BOUNDARY_LIMIT)
    except TimeoutError:
        text = f"the tick at hand did not end within {BOUNDARY_LIMIT:g} s: see 'zteam sim status'"
        raise BusError(text) from None
