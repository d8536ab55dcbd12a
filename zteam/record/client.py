"""The queries of a replay (`replay/status`, `replay/seek`, …): requests and replies, and as calls for programs."""

from typing import Annotated

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.errors import BusError, QueryError

MIN_SPEED, MAX_SPEED = 1e-3, 1e3
"""Recorded seconds a second of the host."""
ANSWER_LIMIT = 10.0
"""Host seconds for an answer."""


Time = Annotated[float, msgspec.Meta(ge=-1e10, le=1e10)]
Ticks = Annotated[int, msgspec.Meta(ge=-(2**40), le=2**40)]
Speed = Annotated[float, msgspec.Meta(ge=MIN_SPEED, le=MAX_SPEED)]


class SeekRequest(Change):
    """`replay/seek`: go to this time of the recording, in seconds, as `start`, `end` and `now` of the status have it in
    nanoseconds. A time outside of the recording is its start or its end."""

    time: Time


class StepRequest(Change):
    """`replay/step`: so many ticks on, or back if it is negative; then it stands."""

    ticks: Ticks = 1


class SpeedRequest(Change):
    """`replay/speed`: recorded seconds a second of the host."""

    speed: Speed


class ReplayStatus(msgspec.Struct):
    """Answer to all queries of a replay.

    Times are nanoseconds of the recording: simulated, or the host's where there was no simulator. They go on where a
    world was put back to its start.
    """

    file: str
    start: int
    end: int
    now: int
    tick: int
    """The number of the tick, from 1 on; a tenth of a second is one where the recording has none."""
    ticks: int
    """How many there are."""
    speed: float
    """Recorded seconds a second of the host."""
    is_paused: bool
    """Whether it stands, as it does at its end."""
    is_loop: bool
    is_lockstep: bool
    """Whether the run was in lock-step."""


class ReplayClient:
    """The queries of a replay as calls. All raise BusError if no replay is there, or with what it refuses."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def _ask(self, service: str, request: msgspec.Struct | None = None) -> ReplayStatus:
        key = names.service_key(names.REPLAY, service)
        try:
            answers = self._bus.query(key, ReplayStatus, request, timeout=ANSWER_LIMIT)
        except QueryError as error:
            raise BusError(error.why) from None
        if not answers:
            raise BusError("no replay is there: start one with 'zteam replay FILE'")
        return answers[0][1]

    def status(self) -> ReplayStatus:
        return self._ask("status")

    def pause(self) -> ReplayStatus:
        return self._ask("pause", Change())

    def resume(self) -> ReplayStatus:
        """Go on; at the end, from the start."""
        return self._ask("resume", Change())

    def seek(self, time_s: float) -> ReplayStatus:
        """Go to this time, in seconds. Returns when all that is known of it was published."""
        return self._ask("seek", SeekRequest(time=time_s))

    def step(self, ticks: int = 1) -> ReplayStatus:
        """Go so many ticks on, or back if negative, and stand there."""
        return self._ask("step", StepRequest(ticks=ticks))

    def set_speed(self, factor: float) -> ReplayStatus:
        """Replay so many recorded seconds a second of the host."""
        return self._ask("speed", SpeedRequest(speed=factor))
