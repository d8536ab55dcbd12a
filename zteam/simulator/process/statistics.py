"""The count of a run since GO: distances, gaps, stalls, late steps, latencies, the time of its ticks. No bus."""

import hashlib
import math
import threading
from collections import Counter, defaultdict, deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain, compress
from typing import Literal

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from zteam.clock import monotonic
from zteam.config.numbers import percentile
from zteam.geometry import Pose2, normalize_angle
from zteam.simulator.client import Gap, Latency, RobotReport, Timing

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

Phase = Literal["wait", "physics", "sensors", "publish", "idle"]
"""Of a tick, as in `Timing`."""
_PHASES = Timing.__struct_fields__
_MAX_LATENCIES = 100_000
"""Only the newest latencies are kept."""
_FIRST_LATE_TICK = 2
"""Ticks after that of GO from which on a missing command is late. GO may arrive after the scans of two ticks, so
before that a robot may rightly have sent no command."""


class RunStatistics:
    """Counts from `start` on; before that it ignores what it is told. Any thread may ask."""

    def __init__(self, follows: Mapping[int, int]) -> None:
        """`follows` has the pairs whose gap is measured: follower -> leader."""
        self._follows = dict(follows)
        self._lock = threading.Lock()
        """Guards the sums."""
        self.start_anew()

    def start_anew(self) -> None:
        self.go_stamp: int | None = None
        """Simulated time (ns) from which GO holds; None before `start`."""
        self.ticks = 0
        """Ticks counted."""
        self.external_commands = 0
        """Commands that did not come from the process that holds the robot's name."""
        self._first_late_tick = 0
        self._robots: dict[int, RobotReport] = {}
        """By id; a robot that has left keeps its own. The means of their gaps are sums until they are reported."""
        self._gap_ticks = Counter[int]()
        """By follower."""
        self._stalled: set[int] = set()
        self._latencies = deque[float](maxlen=_MAX_LATENCIES)
        self._trajectory = hashlib.sha256()
        self._started = 0.0
        self._counted = 0.0
        """Host times of `start` and of the last tick that was counted."""

    def start(self, go_stamp: int, tick: int, ids: Collection[int], poses: Floats) -> None:
        """Count from tick `tick` on, in which robots are at `poses`. GO holds from simulated time `go_stamp` (ns)."""
        self.go_stamp = go_stamp
        self._first_late_tick = tick + _FIRST_LATE_TICK
        with self._lock:
            self._find_robots(ids, _poses_of(poses))
        self._started = monotonic()

    def _find_robots(self, ids: Collection[int], poses: Sequence[Pose2]) -> list[RobotReport]:
        """What is known of these robots; those that are new stand at their `poses`."""
        for robot_id, pose in zip(ids, poses, strict=True):
            if robot_id not in self._robots:
                leader = self._follows.get(robot_id)
                self._robots[robot_id] = RobotReport(robot_id, leader, pose, 0.0, 0, None, 0, 0)
        return [self._robots[robot_id] for robot_id in ids]

    def set_down(self, robot_id: int, pose: Pose2) -> None:
        """A robot was put at a pose, between two ticks: the way there is not driven."""
        with self._lock:
            if robot_id in self._robots:
                self._robots[robot_id].pose = pose

    def add_tick(self, ids: Collection[int], poses: Floats, stalled: Flags, scans: Mapping[int, int]) -> None:
        """Count a tick: robots (ascending) are at `poses` (rows x, y, yaw), are blocked or not, and sent `scans`."""
        self._counted = monotonic()
        now = _poses_of(poses)
        with self._lock:
            self.ticks += 1
            self._trajectory.update(np.fromiter(chain(*now), "<f8").tobytes())
            for robot, pose in zip(self._find_robots(ids, now), now, strict=True):
                robot.distance_m += math.dist(robot.pose[:2], pose[:2])
                robot.scans += scans.get(robot.id, 0)
                robot.pose = pose
            now_stalled = {*compress(ids, stalled.tolist())}
            for robot_id in now_stalled - self._stalled:
                self._robots[robot_id].stalls += 1
            self._stalled = now_stalled
            for robot_id, leader_id in self._follows.items():
                if robot_id in ids and leader_id in ids:
                    follower, leader = self._robots[robot_id], self._robots[leader_id]
                    gap, before = math.dist(follower.pose[:2], leader.pose[:2]), follower.gap_m or Gap(0.0, 0.0, 0.0)
                    follower.gap_m = Gap(before.mean + gap, max(before.max, gap), gap)
                    self._gap_ticks[robot_id] += 1

    def add_late_steps(self, tick: int, robot_ids: Iterable[int]) -> None:
        """Count a late step for each of these robots: its command for `tick` had not come when the next tick began."""
        if self.go_stamp is None or tick < self._first_late_tick:
            return
        with self._lock:
            for robot_id in robot_ids:
                if robot_id in self._robots:
                    self._robots[robot_id].late_steps += 1

    def add_late_command(self, robot_id: int) -> None:
        """Count a command that came too late to be obeyed."""
        with self._lock:
            if robot_id in self._robots:
                self._robots[robot_id].late_commands += 1

    def add_latency(self, seconds: float) -> None:
        """Count a command that came this long after its robot's scan was sent."""
        if self.go_stamp is not None:
            self._latencies.append(seconds)

    def add_external_command(self) -> None:
        self.external_commands += self.go_stamp is not None

    @property
    def wall_seconds(self) -> float:
        """Host time from the first counted tick to the last; 0 with fewer than two."""
        return self._counted - self._started if self.ticks > 1 else 0.0

    @property
    def trajectory_sha256(self) -> str:
        """Of x, y, yaw as little-endian 64-bit floats, by robot id, for every tick counted so far."""
        with self._lock:
            return self._trajectory.hexdigest()

    def robots(self) -> list[RobotReport]:
        with self._lock:
            found = [replace(self._robots[robot_id]) for robot_id in sorted(self._robots)]
            for robot in found:
                if (gap := robot.gap_m) is not None:
                    robot.gap_m = Gap(gap.mean / self._gap_ticks[robot.id], gap.max, gap.end)
        return found

    def latency(self) -> Latency:
        """Milliseconds from a robot's scan to its command."""
        milliseconds = [1e3 * seconds for seconds in self._latencies.copy()]
        return Latency(percentile(milliseconds, 0.5), percentile(milliseconds, 0.99), len(milliseconds))


def _poses_of(rows: Floats) -> list[Pose2]:
    return [Pose2(x, y, normalize_angle(yaw)) for x, y, yaw in rows.tolist()]


class TickProfile:
    """The host's time by phase: of the last whole tick, and of all whole ticks since `start`."""

    def __init__(self) -> None:
        self._last = defaultdict[str, float](float)
        self.start()

    def start(self) -> None:
        """Sum from here on."""
        self._since = monotonic()
        self._open, self._sums = defaultdict[str, float](float), defaultdict[str, float](float)
        self._ticks = 0

    def end(self, phase: Phase) -> None:
        """Add the time since the last call to this phase."""
        now = monotonic()
        self._open[phase] += now - self._since
        self._since = now

    def end_tick(self) -> None:
        self._last, self._open = self._open, defaultdict(float)
        for phase, seconds in self._last.items():
            self._sums[phase] += seconds
        self._ticks += 1

    def timing(self) -> Timing:
        return Timing(**{phase: 1e3 * self._sums[phase] / max(1, self._ticks) for phase in _PHASES})

    def last_text(self) -> str:
        """The last tick in words, without its idle time."""
        parts = [(phase, self._last[phase]) for phase in _PHASES if phase != "idle" and self._last[phase] >= 5e-5]
        return ", ".join(f"{phase} {1e3 * s:.1f} ms" for phase, s in parts)
