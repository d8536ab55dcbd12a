"""A replay by hand, on a bus in memory: one robot drives along x, a metre a second, ten ticks a second."""

from typing import Any

import numpy as np
from msgspec.structs import replace

from support.transforms import stamped
from zteam import names
from zteam.bus import Bus, Change, MemoryHub, NoRequest
from zteam.messages import (
    Header,
    LaserScan,
    Odometry,
    Path,
    PoseStamped,
    RobotState,
    RobotStatus,
    TFMessage,
    Twist,
    TwistWithCovariance,
    Vector3,
    time_from_ns,
)
from zteam.record.client import ReplayStatus, SeekRequest, SpeedRequest, StepRequest

TICK = 100_000_000
TICKS = 6000
PLANNED = 300
"""The tick from which on the robot has a plan and a laser."""


class FakeReplay:
    """It stands at the beginning; time goes on with `play` alone."""

    def __init__(self, hub: MemoryHub) -> None:
        self.hub = hub
        self.bus: Bus = hub.bus()
        self.status = ReplayStatus(
            "/home/runs/office.mcap", TICK, TICK * TICKS, TICK, 1, TICKS, 1.0, is_paused=True, is_loop=False,
            is_lockstep=True,
        )  # fmt: skip
        self.asked: list[tuple[str, Any]] = []
        """The changes that were asked for, with their values."""
        self.looks = 0
        """How often the status was asked for."""
        self._tf = self.bus.publisher(names.TF, TFMessage)
        self._static = self.bus.publisher(names.TF_STATIC, TFMessage, latched=True)
        self._plan = self.bus.publisher("robot_0/plan", Path, latched=True)
        self._scan = self.bus.publisher("robot_0/base_scan", LaserScan)
        self._odom = self.bus.publisher("robot_0/odom", Odometry)
        self._said = self.bus.publisher("robot_0/status", RobotStatus)
        self._static.put(TFMessage([
            stamped("map", "robot_0/odom", 0), stamped("robot_0/base_footprint", "robot_0/base_laser_link", 0, 0.2),
        ]))  # fmt: skip
        for name, kind, act in (
            ("pause", Change, lambda _: self._change(is_paused=True)),
            ("resume", Change, lambda _: self._change(is_paused=False)),
            ("seek", SeekRequest, lambda it: self._jump("seek", it.time, round(it.time * 1e9) // TICK)),
            ("step", StepRequest, lambda it: self._jump("step", it.ticks, self.status.tick + it.ticks)),
            ("speed", SpeedRequest, lambda it: self._change(speed=it.speed)),
        ):
            self.bus.serve(names.service_key(names.REPLAY, name), kind, act)
        self.bus.serve(names.service_key(names.REPLAY, "status"), NoRequest, self._tell)
        self._token = self.bus.declare_token(names.token_key(names.REPLAY, self.bus.instance))

    def _tell(self, _request: NoRequest) -> ReplayStatus:
        self.looks += 1
        return self.status

    def _change(self, **changes: Any) -> ReplayStatus:
        self.asked += changes.items()
        self.status = replace(self.status, **changes)
        return self.status

    def _jump(self, name: str, value: float, tick: int) -> ReplayStatus:
        self.asked.append((name, value))
        self.play(tick)
        return self.status

    def play(self, tick: int) -> None:
        """Publish the state of a tick."""
        tick = min(max(tick, 1), TICKS)
        stamp = tick * TICK
        header = Header(time_from_ns(stamp), "map")
        self.status = replace(self.status, tick=tick, now=stamp)
        if tick >= PLANNED:
            planned = Header(time_from_ns(PLANNED * TICK), "map")
            self._plan.put(Path(planned, [PoseStamped(planned), PoseStamped(planned)]))
            laser = Header(header.stamp, "robot_0/base_laser_link")
            self._scan.put(LaserScan(laser, -1.0, 1.0, 1.0, range_max=8.0, ranges=np.full(3, 2.0, np.float32)))
        speed = TwistWithCovariance(Twist(Vector3(tick / 10)))
        self._odom.put(Odometry(Header(header.stamp, "robot_0/odom"), "robot_0/base_footprint", twist=speed))
        self._said.put(RobotStatus(robot_id=0, state=RobotState.RUNNING, behavior="wander", speed=1.0))
        self._tf.put(TFMessage([stamped("robot_0/odom", "robot_0/base_footprint", stamp, stamp / 1e9)]))

    def end(self) -> None:
        """The process is gone."""
        self.bus.close()
