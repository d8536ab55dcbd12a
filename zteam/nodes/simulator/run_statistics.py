"""The simulator's own count of a run: distances, gaps, stalls, late steps and latencies since GO. No bus."""

import hashlib
import math
import struct
from collections import deque
from collections.abc import Iterable, Mapping

from zteam.clock import monotonic
from zteam.geometry import Pose2
from zteam.numbers import percentile
from zteam.services.simulator import Gap, Latency, RobotReport, SimReport

_POSE = struct.Struct("<3d")
_MAX_LATENCIES = 100_000
"""The newest that many commands are measured, so that a run of days does not grow."""


class _Track:
    """One robot's sums."""

    def __init__(self, pose: Pose2) -> None:
        self.pose = pose
        self.distance = 0.0
        self.stalls = 0
        self.stalled = False
        self.scans = 0
        self.late_steps = 0
        self.gap_sum = 0.0
        self.gap_max = 0.0
        self.gap_end = math.nan
        self.gap_count = 0


class RunStatistics:
    """Counts from `start` on; before that, nothing is counted."""

    def __init__(self, follows: Mapping[int, int], seed: int) -> None:
        self._follows = dict(follows)
        self._seed = seed
        self._tracks: dict[int, _Track] = {}
        self._latencies: deque[float] = deque(maxlen=_MAX_LATENCIES)
        self._trajectory = hashlib.sha256()
        self._started = 0.0
        self._counted = 0.0
        """Host times of the first and the last tick that was counted."""
        self._ticks = 0
        self.go_stamp: int | None = None
        self.external_commands = 0

    def start(self, go_stamp: int, poses: Mapping[int, Pose2]) -> None:
        """GO is out, holding from simulated time `go_stamp` (ns); the robots stand at `poses`."""
        self.go_stamp = go_stamp
        self._tracks = {robot_id: _Track(pose) for robot_id, pose in poses.items()}
        self._started = monotonic()

    def add_tick(self, poses: Mapping[int, Pose2], stalled: Iterable[int], scans: Mapping[int, int]) -> None:
        """The world stands at `poses` after a tick; `stalled` robots are blocked; `scans` were sent."""
        self._counted = monotonic()
        self._ticks += 1
        for _, pose in sorted(poses.items()):
            self._trajectory.update(_POSE.pack(*pose))
        blocked = set(stalled)
        for robot_id, pose in poses.items():
            track = self._tracks.setdefault(robot_id, _Track(pose))
            track.distance += math.hypot(pose.x - track.pose.x, pose.y - track.pose.y)
            track.pose = pose
            now_stalled = robot_id in blocked
            track.stalls += now_stalled and not track.stalled
            track.stalled = now_stalled
            track.scans += scans.get(robot_id, 0)
        for follower, leader in self._follows.items():
            if follower in poses and leader in poses:
                self._add_gap(self._tracks[follower], poses[follower], poses[leader])

    @staticmethod
    def _add_gap(track: _Track, a: Pose2, b: Pose2) -> None:
        gap = math.hypot(a.x - b.x, a.y - b.y)
        track.gap_sum += gap
        track.gap_max = max(track.gap_max, gap)
        track.gap_end = gap
        track.gap_count += 1

    def add_late_steps(self, robot_ids: Iterable[int]) -> None:
        """These robots' commands for the last tick had not come when the next began."""
        for robot_id in robot_ids:
            if robot_id in self._tracks:
                self._tracks[robot_id].late_steps += 1

    def add_latency(self, seconds: float) -> None:
        """A command came that long after its robot's scan was sent."""
        if self.go_stamp is not None:
            self._latencies.append(seconds)

    def report(self, now: int, finished: bool) -> SimReport:
        """The counts at simulated time `now` (ns)."""
        since_go = 0.0 if self.go_stamp is None else max(0, now - self.go_stamp) / 1e9
        wall = self._counted - self._started if self._ticks > 1 else 0.0
        return SimReport(
            sim_seconds=since_go,
            seed=self._seed,
            external_commands=self.external_commands,
            finished=finished,
            robots=[self._robot(robot_id) for robot_id in sorted(self._tracks)],
            latency_ms=self._latency(),
            ticks=self._ticks,
            wall_seconds=wall,
            trajectory_sha256=self.trajectory_sha256,
        )

    @property
    def trajectory_sha256(self) -> str:
        """Of x, y, yaw as little-endian 64-bit floats, by robot id, for every tick counted so far."""
        return self._trajectory.hexdigest()

    def _robot(self, robot_id: int) -> RobotReport:
        track = self._tracks[robot_id]
        gap = None
        if track.gap_count:
            gap = Gap(track.gap_sum / track.gap_count, track.gap_max, track.gap_end)
        return RobotReport(
            id=robot_id,
            follow=self._follows.get(robot_id),
            pose=(track.pose.x, track.pose.y, track.pose.yaw),
            distance_m=track.distance,
            stalls=track.stalls,
            gap_m=gap,
            scans=track.scans,
            late_steps=track.late_steps,
        )

    def _latency(self) -> Latency:
        milliseconds = [1e3 * seconds for seconds in self._latencies]
        return Latency(percentile(milliseconds, 0.5), percentile(milliseconds, 0.99), len(milliseconds))
