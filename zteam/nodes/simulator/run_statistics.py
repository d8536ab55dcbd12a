"""The simulator's count of a run since GO: distances, gaps, stalls, late steps, latencies. No bus."""

import hashlib
import math
import struct
from collections import deque
from collections.abc import Iterable, Mapping

from zteam.clock import monotonic
from zteam.geometry import Pose2
from zteam.numbers import percentile
from zteam.services.simulator import Gap, Latency, RobotReport

_POSE = struct.Struct("<3d")
_MAX_LATENCIES = 100_000
"""Only the newest latencies are kept, so that the memory of a run of days does not grow."""
_FIRST_LATE_TICK = 2
"""Ticks after that of GO from which on a missing command is late. GO may arrive after the scans of two ticks, so
before that a robot may rightly have sent no command."""


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

    def add_tick(self, pose: Pose2, stalled: bool, scans: int) -> None:
        self.distance += math.hypot(pose.x - self.pose.x, pose.y - self.pose.y)
        self.pose = pose
        self.stalls += stalled and not self.stalled
        self.stalled = stalled
        self.scans += scans

    def add_gap(self, leader: Pose2) -> None:
        gap = math.hypot(self.pose.x - leader.x, self.pose.y - leader.y)
        self.gap_sum += gap
        self.gap_max = max(self.gap_max, gap)
        self.gap_end = gap
        self.gap_count += 1

    def gap(self) -> Gap | None:
        return Gap(self.gap_sum / self.gap_count, self.gap_max, self.gap_end) if self.gap_count else None


class RunStatistics:
    """Counts from `start` on; before that it ignores what it is told."""

    def __init__(self, follows: Mapping[int, int]) -> None:
        """`follows` has the pairs whose gap is measured: follower -> leader."""
        self._follows = dict(follows)
        self.start_anew()

    def start_anew(self) -> None:
        """Forget the run."""
        self.go_stamp: int | None = None
        """Simulated time (ns) from which GO holds; None before `start`."""
        self.ticks = 0
        """Ticks counted."""
        self.external_commands = 0
        """Commands that did not come from the process that holds the robot's name."""
        self._first_late_tick = 0
        self._tracks: dict[int, _Track] = {}
        self._latencies: deque[float] = deque(maxlen=_MAX_LATENCIES)
        self._trajectory = hashlib.sha256()
        self._started = 0.0
        self._counted = 0.0
        """Host times of `start` and of the last tick that was counted."""

    def start(self, go_stamp: int, tick: int, poses: Mapping[int, Pose2]) -> None:
        """Count from tick `tick` on, in which robots are at `poses`. GO holds from simulated time `go_stamp` (ns)."""
        self.go_stamp = go_stamp
        self._first_late_tick = tick + _FIRST_LATE_TICK
        self._tracks = {robot_id: _Track(pose) for robot_id, pose in poses.items()}
        self._started = monotonic()

    def add_tick(self, poses: Mapping[int, Pose2], stalled: Iterable[int], scans: Mapping[int, int]) -> None:
        """Count a tick: robots are at `poses`, those in `stalled` are blocked, and so many `scans` were sent."""
        self._counted = monotonic()
        self.ticks += 1
        for _, pose in sorted(poses.items()):
            self._trajectory.update(_POSE.pack(*pose))
        blocked = set(stalled)
        for robot_id, pose in poses.items():
            track = self._tracks.setdefault(robot_id, _Track(pose))
            track.add_tick(pose, robot_id in blocked, scans.get(robot_id, 0))
        for follower, leader in self._follows.items():
            if follower in poses and leader in poses:
                self._tracks[follower].add_gap(poses[leader])

    def add_late_steps(self, tick: int, robot_ids: Iterable[int]) -> None:
        """Count a late step for each of these robots: its command for `tick` had not come when the next tick began."""
        if self.go_stamp is None or tick < self._first_late_tick:
            return
        for robot_id in robot_ids:
            if robot_id in self._tracks:
                self._tracks[robot_id].late_steps += 1

    def add_latency(self, seconds: float) -> None:
        """Count a command that came this long after its robot's scan was sent."""
        if self.go_stamp is not None:
            self._latencies.append(seconds)

    def add_external_command(self) -> None:
        """Count a command that did not come from the process that holds the robot's name."""
        self.external_commands += self.go_stamp is not None

    @property
    def wall_seconds(self) -> float:
        """Host time from the first counted tick to the last; 0 with fewer than two."""
        return self._counted - self._started if self.ticks > 1 else 0.0

    @property
    def trajectory_sha256(self) -> str:
        """Of x, y, yaw as little-endian 64-bit floats, by robot id, for every tick counted so far."""
        return self._trajectory.hexdigest()

    def robots(self) -> list[RobotReport]:
        """What each robot did, by id."""
        return [
            RobotReport(
                id=robot_id,
                follow=self._follows.get(robot_id),
                pose=(track.pose.x, track.pose.y, track.pose.yaw),
                distance_m=track.distance,
                stalls=track.stalls,
                gap_m=track.gap(),
                scans=track.scans,
                late_steps=track.late_steps,
            )
            for robot_id, track in sorted(self._tracks.items())
        ]

    def latency(self) -> Latency:
        """Milliseconds from a robot's scan to its command."""
        milliseconds = [1e3 * seconds for seconds in self._latencies]
        return Latency(percentile(milliseconds, 0.5), percentile(milliseconds, 0.99), len(milliseconds))
