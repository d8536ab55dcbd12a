"""The queries of `zteam replay` (`replay/status`, `replay/seek`, …): requests and replies, and calls for programs."""

from typing import Annotated

import msgspec

from zteam import names
from zteam.bus import Bus, Change

Time = Annotated[float, msgspec.Meta(ge=-1e10, le=1e10)]
Speed = Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
Ticks = Annotated[int, msgspec.Meta(ge=-1_000_000_000, le=1_000_000_000)]


class SeekRequest(Change):
    """`replay/seek`: show the state of a time of the recording, in seconds as `now` counts."""

    time: Time


class StepRequest(Change):
    """`replay/step`: go on by so many ticks, or back, and stand still there."""

    ticks: Ticks = 1


class SpeedRequest(Change):
    """`replay/speed`: seconds of the recording a second of the host."""

    speed: Speed


class ReplayStatus(msgspec.Struct):
    """Answer to `replay/status` and to all changes."""

    file: str
    start: int
    """Nanoseconds of the recording's own time, as the next two."""
    end: int
    now: int
    tick: int
    ticks: int
    """All of the recording."""
    speed: float
    is_paused: bool
    is_loop: bool
    is_lockstep: bool


class ReplayClient:
    """Calls of the running replay. Each raises BusError without one, and if it refuses."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def _ask(self, service: str, request: msgspec.Struct | None) -> ReplayStatus:
        return self._bus.ask(names.service_key(names.REPLAY, service), ReplayStatus, request)

    def status(self) -> ReplayStatus:
        return self._ask("status", None)

    def pause(self) -> ReplayStatus:
        return self._ask("pause", Change())

    def resume(self) -> ReplayStatus:
        return self._ask("resume", Change())

    def seek(self, time_s: float) -> ReplayStatus:
        return self._ask("seek", SeekRequest(time=time_s))

    def step(self, ticks: int = 1) -> ReplayStatus:
        return self._ask("step", StepRequest(ticks=ticks))

    def set_speed(self, factor: float) -> ReplayStatus:
        return self._ask("speed", SpeedRequest(speed=factor))
