"""The simulator's count of a run since GO: distances, gaps, stalls, late steps, latencies. No bus."""

import hashlib
import math
import threading
from collections import deque
from collections.abc import Collection, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from zteam.clock import monotonic
from zteam.geometry import Pose2
from zteam.numbers import percentile
from zteam.services.simulator import Gap, Latency, RobotReport

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_BLOCK = 256
"""Ticks that are kept until they are summed up together: a tick itself then costs a few microseconds."""
_MAX_LATENCIES = 100_000
"""Only the newest latencies are kept, so that the memory of a run of days does not grow."""
_FIRST_LATE_TICK = 2
"""Ticks after that of GO from which on a missing command is late. GO may arrive after the scans of two ticks, so
before that a robot may rightly have sent no command."""


class _Track:
    """One robot's sums."""

    def __init__(self, pose: Floats) -> None:
        self.pose = pose
        """x, y, yaw."""
        self.distance = 0.0
        self.stalls = 0
        self.stalled = False
        self.scans = 0
        self.late_steps = 0
        self.gap_sum = 0.0
        self.gap_max = 0.0
        self.gap_end = math.nan
        self.gap_count = 0

    def add_ticks(self, poses: Floats, stalled: Flags, scans: int) -> None:
        x, y, _ = np.vstack((self.pose, poses)).T
        self.distance = _add(self.distance, np.hypot(np.diff(x), np.diff(y)))
        self.pose = poses[-1].copy()
        self.stalls += int(np.count_nonzero(stalled & ~np.append(self.stalled, stalled[:-1])))
        self.stalled = bool(stalled[-1])
        self.scans += scans * len(poses)

    def add_gaps(self, poses: Floats, leader: Floats) -> None:
        x, y, _ = (poses - leader).T
        gaps = np.hypot(x, y)
        self.gap_sum = _add(self.gap_sum, gaps)
        self.gap_max = max(self.gap_max, float(gaps.max()))
        self.gap_end = float(gaps[-1])
        self.gap_count += len(gaps)

    def gap(self) -> Gap | None:
        return Gap(self.gap_sum / self.gap_count, self.gap_max, self.gap_end) if self.gap_count else None


def _add(total: float, terms: Floats) -> float:
    """The sum, one term after the other: it must not depend on how many are added at a time."""
    return float(np.cumsum(np.append(total, terms))[-1])


def _wrap(poses: Floats) -> None:
    """Bring the yaws (..., 3) into (-pi, pi], as `normalize_angle` does to the last bit."""
    yaw = np.fmod(poses[..., 2], math.tau)
    yaw = np.where(yaw > math.pi, yaw - math.tau, yaw)
    poses[..., 2] = np.where(yaw <= -math.pi, yaw + math.tau, yaw)


class _Block:
    """Ticks that are not summed up yet, all of the same robots with the same number of scans in a tick."""

    def __init__(self, ids: tuple[int, ...], scans: Mapping[int, int]) -> None:
        self.ids, self.scans = ids, scans
        self.poses = np.empty((_BLOCK, len(ids), 3), "<f8")
        self.stalled = np.empty((_BLOCK, len(ids)), bool)
        self.ticks = 0


class RunStatistics:
    """Counts from `start` on; before that it ignores what it is told. Any thread may ask."""

    def __init__(self, follows: Mapping[int, int]) -> None:
        """`follows` has the pairs whose gap is measured: follower -> leader."""
        self._follows = dict(follows)
        self._lock = threading.Lock()
        """Guards what ticks are summed up to."""
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
        self._block = _Block((), {})
        self._latencies: deque[float] = deque(maxlen=_MAX_LATENCIES)
        self._trajectory = hashlib.sha256()
        self._started = 0.0
        self._counted = 0.0
        """Host times of `start` and of the last tick that was counted."""

    def start(self, go_stamp: int, tick: int, ids: Iterable[int], poses: Floats) -> None:
        """Count from tick `tick` on, in which robots are at `poses`. GO holds from simulated time `go_stamp` (ns)."""
        self.go_stamp = go_stamp
        self._first_late_tick = tick + _FIRST_LATE_TICK
        self._tracks = {}
        self._begin_tracks(ids, poses)
        self._started = monotonic()

    def _begin_tracks(self, ids: Iterable[int], poses: Floats) -> None:
        places = poses.copy()
        _wrap(places)
        for robot_id, pose in zip(ids, places, strict=True):
            self._tracks.setdefault(robot_id, _Track(pose))

    def add_tick(self, ids: Collection[int], poses: Floats, stalled: Flags, scans: Mapping[int, int]) -> None:
        """Count a tick: robots (ascending) are at `poses` (rows x, y, yaw), are blocked or not, and sent `scans`."""
        self._counted = monotonic()
        with self._lock:
            self.ticks += 1
            block = self._block
            if block.ticks == _BLOCK or block.ids != tuple(ids) or block.scans != scans:
                self._sum_up()
                block = self._block = _Block(tuple(ids), scans)
                self._begin_tracks(ids, poses)
            block.poses[block.ticks], block.stalled[block.ticks] = poses, stalled
            block.ticks += 1

    def _sum_up(self) -> None:
        block, count = self._block, self._block.ticks
        poses, stalled, block.ticks = block.poses[:count], block.stalled[:count], 0
        if not count:
            return
        _wrap(poses)
        self._trajectory.update(poses.tobytes())
        for i, robot_id in enumerate(block.ids):
            self._tracks[robot_id].add_ticks(poses[:, i], stalled[:, i], block.scans.get(robot_id, 0))
        places = {robot_id: i for i, robot_id in enumerate(block.ids)}
        for follower, leader in self._follows.items():
            if follower in places and leader in places:
                self._tracks[follower].add_gaps(poses[:, places[follower]], poses[:, places[leader]])

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
        with self._lock:
            self._sum_up()
            return self._trajectory.hexdigest()

    def robots(self) -> list[RobotReport]:
        """What each robot did, by id."""
        with self._lock:
            self._sum_up()
            return [
                RobotReport(
                    id=robot_id,
                    follow=self._follows.get(robot_id),
                    pose=Pose2(*track.pose.tolist()),
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
        # A copy is made in one piece: commands go on coming meanwhile.
        milliseconds = [1e3 * seconds for seconds in self._latencies.copy()]
        return Latency(percentile(milliseconds, 0.5), percentile(milliseconds, 0.99), len(milliseconds))
