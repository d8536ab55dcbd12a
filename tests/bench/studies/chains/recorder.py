"""A node that keeps the true poses of all robots: in every tick of lock-step, and every 0.1 s of real time."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Bool, Odometry, RobotStatus
from zteam.node.node import Node, run

NAME = "tracks"


class Moment(msgspec.Struct, array_like=True):
    """One row of what was recorded; robots by id."""

    now: int
    """Simulated ns."""
    poses: list[tuple[float, float, float]]
    """x, y, yaw in `map`."""
    stalled: list[bool]
    """Whether a robot had a command to move and was blocked."""
    followed: dict[int, int] = {}
    """The robot that each one follows, -1 = none; without robots that have not published a status yet."""
    waits: dict[int, int] = {}
    """The robot for which each one waits, in the same way."""


class Tracks(NamedTuple):
    """Where the robots were."""

    poses: NDArray[np.float64]
    """(ticks, robots, 3): x, y, yaw in `map`; robots by id."""
    stalled: NDArray[np.bool_]
    """(ticks, robots): whether a robot had a command to move and was blocked."""


class Recorder:
    """Give its `body` to `run_team` as a node, or to `zteam.run`; it has the tracks afterwards."""

    def __init__(self) -> None:
        self._now: dict[int, tuple[float, float, float]] = {}
        self._blocked: dict[int, bool] = {}
        self._followed: dict[int, int] = {}
        self._waits: dict[int, int] = {}
        self._rows: dict[int, Moment] = {}
        """By time."""

    def body(self, node: Node) -> None:
        """Record until asked to stop."""
        node.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, self._take_pose, every_tick=True)
        node.subscribe(names.all_robots_key(names.STALL), Bool, self._take_stall)
        node.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._take_status)
        node.run(self._step)

    def rows(self) -> list[Moment]:
        """What was recorded, by time; without the first moments, in which no pose of some robots had come yet."""
        return [row for row in self._rows.values() if len(row.poses) == len(self._now)]

    def _take_pose(self, key: str, message: Odometry) -> None:
        p, q = message.pose.pose.position, message.pose.pose.orientation
        self._now[_robot_of(key)] = (p.x, p.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))

    def _take_stall(self, key: str, message: Bool) -> None:
        self._blocked[_robot_of(key)] = message.data

    def _take_status(self, _key: str, status: RobotStatus) -> None:
        self._followed[status.robot_id] = status.followed
        self._waits[status.robot_id] = status.waits_for

    def _step(self, now: int) -> None:
        robots = sorted(self._now)
        poses, stalled = [self._now[i] for i in robots], [self._blocked.get(i, False) for i in robots]
        self._rows[now] = Moment(now, poses, stalled, self._followed.copy(), self._waits.copy())


def make_tracks(rows: Sequence[Moment]) -> Tracks:
    """The tracks of recorded rows."""
    return Tracks(np.array([row.poses for row in rows], float), np.array([row.stalled for row in rows], bool))


def _robot_of(key: str) -> int:
    target = names.split_robot_key(key)
    assert target is not None
    return target[0]


if __name__ == "__main__":
    recorder = Recorder()
    run(NAME, recorder.body)
    Path(sys.argv[1]).write_bytes(msgspec.json.encode(recorder.rows()))
