"""The simulator's queries as calls, for `zteam sim` and users' programs: its pace, its robots and its status."""

from collections.abc import Callable
from typing import TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import monotonic
from zteam.errors import BusError, UsageError
from zteam.services.simulator import (
    BOUNDARY_LIMIT,
    MAX_PLACE,
    MAX_SPEED,
    MAX_TICKS,
    MIN_SPEED,
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
    absence_text,
)

T = TypeVar("T")

ANSWER_LIMIT = 10.0
"""Host seconds for an answer that waits for nothing but a crowded machine."""
CHANGE_LIMIT = BOUNDARY_LIMIT + ANSWER_LIMIT
"""Host seconds for a change to the world, which waits for the tick at hand to end."""
SETTLE = 2.0
"""Host seconds that `pause` and `reset` wait for the tick at hand, which a participant may hold in lock-step."""
LOOK = 1.0
"""Host seconds between two reports on a long step's progress."""

_NO_SIMULATOR = (
    "no simulator is there: start one with 'zteam-sim WORLD' or 'zteam up' "
    "(or name its router and namespace with --connect and --namespace)"
)
_TIMED_OUT = "Timeout"
"""Zenoh's own word."""


class SimulatorClient:
    """The simulator's queries as calls. All raise BusError if no simulator is there, or with what it refuses."""

    def __init__(self, bus: Bus, answer_limit: float = ANSWER_LIMIT) -> None:
        """`answer_limit` is host seconds for an answer that waits for nothing in the world."""
        self._bus = bus
        self._answer_limit = answer_limit

    def _ask(
        self,
        service: str,
        reply_type: type[T],
        request: msgspec.Struct | None = None,
        timeout: float | None = None,
    ) -> T:
        timeout = self._answer_limit if timeout is None else timeout
        key = names.service_key(names.SIMULATOR, service)
        try:
            answers = self._bus.query(key, reply_type, request, timeout=timeout)
        except BusError as error:
            why = str(error).removeprefix(f"{key}: ")
            if why == _TIMED_OUT:
                why = f"the simulator does not answer within {timeout:g} s: see 'zteam doctor'"
            raise BusError(why) from None
        if not answers:
            raise BusError(_NO_SIMULATOR)
        return answers[0][1]

    def status(self) -> SimStatus:
        """The simulator's status."""
        return self._ask("status", SimStatus)

    def report(self) -> SimReport:
        """Its own count of the run from GO on."""
        return self._ask("report", SimReport)

    def repeat(self) -> SimStatus:
        """Have the last tick's data sent once more, between two ticks."""
        return self._ask("repeat", SimStatus, Change(), timeout=CHANGE_LIMIT)

    def pause(self) -> SimStatus:
        """Pause the world after the tick at hand. Waits for that tick, for SETTLE at most."""
        self._ask("pause", SimStatus, Change())
        return self.stand(SETTLE).status

    def resume(self) -> SimStatus:
        """Resume the world at the speed that was asked for."""
        return self._ask("resume", SimStatus, Change())

    def set_speed(self, speed: float | None) -> SimStatus:
        """Ask for simulated seconds a second of the host; None = as fast as possible."""
        if speed is not None and not MIN_SPEED <= speed <= MAX_SPEED:
            raise UsageError(f"speed {speed}: give simulated seconds a second from {MIN_SPEED:g} to {MAX_SPEED:g}")
        return self._ask("speed", SimStatus, SpeedRequest(speed))

    def stand(self, timeout: float) -> StandReply:
        """Whether the world stands still, at the latest after `timeout` host seconds (60 at most)."""
        return self._ask("stand", StandReply, StandRequest(timeout), timeout=timeout + ANSWER_LIMIT)

    def step(
        self,
        ticks: int = 1,
        *,
        patience: float | None = None,
        on_progress: Callable[[SimStatus], None] = lambda status: None,
    ) -> SimStatus:
        """Run so many ticks, however long they take; returns the status afterwards.

        It ends early, without an error, when the run is over, or when another client pauses or resumes the world.
        `on_progress(status)` is called about once a second. Raises BusError when one tick takes more than
        `patience` host seconds, with what holds it.
        """
        if not 1 <= ticks <= MAX_TICKS:
            raise UsageError(f"step {ticks}: give a number of ticks from 1 on")
        on_progress(self._ask("step", SimStatus, StepRequest(ticks, wait=False)))
        return self._wait_until_standing(patience, on_progress)

    def _wait_until_standing(self, patience: float | None, on_progress: Callable[[SimStatus], None]) -> SimStatus:
        look = LOOK if patience is None else min(LOOK, patience)
        tick, since = -1, monotonic()
        while True:
            reply = self.stand(look)
            status = reply.status
            if reply.stands or not status.paused:
                return status
            if status.tick != tick:
                tick, since = status.tick, monotonic()
            elif patience is not None and monotonic() - since >= patience:
                holder = f": waiting for {status.waiting_for}" if status.waiting_for else ""
                raise BusError(f"tick {tick} takes more than {patience:g} s{holder} (see 'zteam sim status')")
            on_progress(status)

    def reset(self) -> SimStatus:
        """Everything as at the start, time too; a world that was paused stands at its first tick."""
        status = self._ask("reset", SimStatus, Change(), timeout=CHANGE_LIMIT)
        return self.stand(SETTLE).status if status.paused else status

    def spawn(
        self,
        x: float,
        y: float,
        yaw: float = 0.0,
        *,
        model: str = "erratic",
        robot_id: int | None = None,
        force: bool = False,
    ) -> int:
        """Put a further robot at x, y (m), yaw (rad) in `map`; its id, the lowest that is free unless given.

        Raises BusError if it has no room there, in a wall or a robot or outside of the world, unless `force` is set.
        """
        _check_pose(x, y, yaw)
        request = SpawnRequest(x, y, yaw, model, robot_id, force=force)
        return self._ask("spawn", SpawnReply, request, timeout=CHANGE_LIMIT).id

    def remove(self, robot_id: int) -> SimStatus:
        """Take a robot out of the world."""
        return self._ask("remove", SimStatus, RemoveRequest(robot_id), timeout=CHANGE_LIMIT)

    def move(self, robot_id: int, x: float, y: float, yaw: float = 0.0, *, force: bool = False) -> SimStatus:
        """Lift a robot to x, y (m), yaw (rad) in `map`. Raises BusError if it has no room there, as `spawn` does."""
        _check_pose(x, y, yaw)
        return self._ask("move", SimStatus, MoveRequest(robot_id, x, y, yaw, force=force), timeout=CHANGE_LIMIT)


def _check_pose(x: float, y: float, yaw: float) -> None:
    # JSON has no NaN: it would arrive as something else.
    if not all(-MAX_PLACE <= number <= MAX_PLACE for number in (x, y, yaw)):
        raise UsageError(f"pose {x:g} {y:g} {yaw:g}: give finite numbers up to {MAX_PLACE:g}")


def absence_of(bus: Bus, robot_id: int) -> str:
    """What is said of a robot that the running simulator lacks; empty for others, and without a simulator."""
    try:
        answers = bus.query(names.service_key(names.SIMULATOR, "status"), SimStatus)
    except BusError:
        # It runs, but is busy or frozen.
        return ""
    worlds = [status.robots for _, status in answers if robot_id not in status.robots]
    return f"{names.robot_name(robot_id)} is {absence_text(robot_id, worlds[0])}" if worlds else ""
