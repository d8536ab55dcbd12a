"""A node that keeps the true poses of all robots in every tick of a run in lock-step."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Bool, Odometry
from zteam.node.node import Node, run

NAME = "recorder"


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
        self._rows: dict[int, tuple[list[tuple[float, float, float]], list[bool]]] = {}
        """Poses and stalls of all robots, by time."""

    def body(self, node: Node) -> None:
        """Record until asked to stop."""
        node.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, self._take_pose, every_tick=True)
        node.subscribe(names.all_robots_key(names.STALL), Bool, self._take_stall)
        node.run(self._step)

    def rows(self) -> list[tuple[list[tuple[float, float, float]], list[bool]]]:
        """What was recorded, tick by tick; without what came before lock-step, when some robots had not spoken."""
        return [row for row in self._rows.values() if len(row[0]) == len(self._now)]

    def _take_pose(self, key: str, message: Odometry) -> None:
        p, q = message.pose.pose.position, message.pose.pose.orientation
        self._now[_robot_of(key)] = (p.x, p.y, yaw_from_quaternion(q.x, q.y, q.z, q.w))

    def _take_stall(self, key: str, message: Bool) -> None:
        self._blocked[_robot_of(key)] = message.data

    def _step(self, now: int) -> None:
        robots = sorted(self._now)
        self._rows[now] = [self._now[i] for i in robots], [self._blocked.get(i, False) for i in robots]


def make_tracks(rows: Sequence[tuple[Sequence[Any], Sequence[bool]]]) -> Tracks:
    """The tracks of recorded rows."""
    poses, stalled = zip(*rows, strict=True)
    return Tracks(np.array(poses, float), np.array(stalled, bool))


def _robot_of(key: str) -> int:
    target = names.split_robot_key(key)
    assert target is not None
    return target[0]


def read_tracks(path: Path) -> Tracks:
    """What a recorder's process has written."""
    return make_tracks(msgspec.json.decode(path.read_bytes()))


if __name__ == "__main__":
    recorder = Recorder()
    run(NAME, recorder.body)
    Path(sys.argv[1]).write_bytes(msgspec.json.encode(recorder.rows()))
