"""The count of a run since GO: distances, gaps, stalls, late steps, latencies, the time of its ticks. No bus."""

import hashlib
import math
import threading
from collections import deque
from collections.abc import Collection, Iterable, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from zteam.clock import monotonic
from zteam.config.numbers import percentile
from zteam.geometry import Pose2
from zteam.simulator.client import Gap, Latency, RobotReport, Timing

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Ints = NDArray[np.int_]

Phase = Literal["wait", "physics", "sensors", "publish", "idle"]
"""Of a tick, as in `Timing`."""
_MAX_LATENCIES = 100_000
"""Only the newest latencies are kept."""
_FIRST_LATE_TICK = 2
"""Ticks after that of GO from which on a missing command is late. GO may arrive after the scans of two ticks, so
before that a robot may rightly have sent no command."""

_COUNTS = ("stalls", "scans", "late_steps", "late_commands")
_SUMS = np.dtype(
    [
        ("pose", "<f8", 3),
        ("stalled", "?"),
        *((name, "<f8") for name in ("distance_m", "gap_sum", "gap_max", "gap_end")),
        *((name, "<i8") for name in (*_COUNTS, "gap_count")),
    ]
)
"""One robot's pose (x, y, yaw), and its sums; the distance is that of its path in ticks."""


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
        self._rows: dict[int, int] = {}
        """Robot id -> row of the sums; a robot that has left keeps it."""
        self._sums = np.zeros(0, _SUMS)
        self._present: tuple[int, ...] | None = None
        """The robots of the last tick; None before the first one."""
        self._latencies = deque[float](maxlen=_MAX_LATENCIES)
        self._trajectory = hashlib.sha256()
        self._started = 0.0
        self._counted = 0.0
        """Host times of `start` and of the last tick that was counted."""

    def start(self, go_stamp: int, tick: int, ids: Iterable[int], poses: Floats) -> None:
        """Count from tick `tick` on, in which robots are at `poses`. GO holds from simulated time `go_stamp` (ns)."""
        self.go_stamp = go_stamp
        self._first_late_tick = tick + _FIRST_LATE_TICK
        with self._lock:
            self._note_robots(tuple(ids), _wrapped(poses))
        self._started = monotonic()

    def _note_robots(self, ids: tuple[int, ...], poses: Floats) -> None:
        new = np.array([robot_id not in self._rows for robot_id in ids], bool)
        for robot_id in ids:
            self._rows.setdefault(robot_id, len(self._rows))
        added = np.zeros(int(new.sum()), _SUMS)
        added["pose"] = poses[new]
        self._sums = np.concatenate((self._sums, added))
        self._present = ids
        pairs = [pair for pair in self._follows.items() if set(pair) <= set(ids)]
        self._at = np.array([self._rows[robot_id] for robot_id in ids], int)
        self._followers, self._leaders = (
            np.array([(self._rows[follower], self._rows[leader]) for follower, leader in pairs], int).reshape(-1, 2).T
        )

    def set_down(self, robot_id: int, pose: Pose2) -> None:
        """A robot was put at a pose, between two ticks: the way there is not driven."""
        with self._lock:
            if robot_id in self._rows:
                self._sums["pose"][self._rows[robot_id]] = pose

    def add_tick(self, ids: Collection[int], poses: Floats, stalled: Flags, scans: Mapping[int, int]) -> None:
        """Count a tick: robots (ascending) are at `poses` (rows x, y, yaw), are blocked or not, and sent `scans`."""
        self._counted = monotonic()
        poses = _wrapped(poses)
        with self._lock:
            self.ticks += 1
            if tuple(ids) != self._present:
                self._note_robots(tuple(ids), poses)
            self._trajectory.update(poses.tobytes())
            sums, at = self._sums, self._at
            x, y, _ = (poses - sums["pose"][at]).T
            sums["distance_m"][at] += np.hypot(x, y)
            sums["stalls"][at] += stalled & ~sums["stalled"][at]
            sums["scans"][at] += [scans.get(robot_id, 0) for robot_id in ids]
            sums["pose"][at], sums["stalled"][at] = poses, stalled
            if len(self._followers):
                self._add_gaps(sums, self._followers, self._leaders)

    def _add_gaps(self, sums: NDArray[Any], followers: Ints, leaders: Ints) -> None:
        x, y, _ = (sums["pose"][followers] - sums["pose"][leaders]).T
        gaps = np.hypot(x, y)
        sums["gap_sum"][followers] += gaps
        sums["gap_max"][followers] = np.maximum(sums["gap_max"][followers], gaps)
        sums["gap_end"][followers] = gaps
        sums["gap_count"][followers] += 1

    def add_late_steps(self, tick: int, robot_ids: Iterable[int]) -> None:
        """Count a late step for each of these robots: its command for `tick` had not come when the next tick began."""
        if self.go_stamp is None or tick < self._first_late_tick:
            return
        with self._lock:
            self._sums["late_steps"][[self._rows[i] for i in robot_ids if i in self._rows]] += 1

    def add_late_command(self, robot_id: int) -> None:
        """Count a command that came too late to be obeyed."""
        if self.go_stamp is not None and robot_id in self._rows:
            with self._lock:
                self._sums["late_commands"][self._rows[robot_id]] += 1

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
            sums, rows = self._sums.copy(), sorted(self._rows.items())
        return [
            RobotReport(
                id=robot_id,
                follow=self._follows.get(robot_id),
                pose=Pose2(*own["pose"].tolist()),
                distance_m=float(own["distance_m"]),
                gap_m=_gap(own),
                **{name: int(own[name]) for name in _COUNTS},
            )
            for robot_id, own in ((robot_id, sums[row]) for robot_id, row in rows)
        ]

    def latency(self) -> Latency:
        """Milliseconds from a robot's scan to its command."""
        milliseconds = [1e3 * seconds for seconds in self._latencies.copy()]
        return Latency(percentile(milliseconds, 0.5), percentile(milliseconds, 0.99), len(milliseconds))


def _gap(own: Any) -> Gap | None:
    count = int(own["gap_count"])
    return Gap(float(own["gap_sum"]) / count, float(own["gap_max"]), float(own["gap_end"])) if count else None


def _wrapped(poses: Floats) -> Floats:
    """A copy with yaws in (-pi, pi], as `normalize_angle` makes them to the last bit."""
    poses = np.array(poses, "<f8")
    yaw = np.fmod(poses[:, 2], math.tau)
    yaw = np.where(yaw > math.pi, yaw - math.tau, yaw)
    poses[:, 2] = np.where(yaw <= -math.pi, yaw + math.tau, yaw)
    return poses


class TickProfile:
    """The host's time by phase: of the last whole tick, and of all whole ticks since `start`."""

    def __init__(self) -> None:
        self._last = _no_time()
        self.start()

    def start(self) -> None:
        """Sum from here on."""
        self._since = monotonic()
        self._open, self._sums, self._ticks = _no_time(), _no_time(), 0

    def end(self, phase: Phase) -> None:
        """Add the time since the last call to this phase."""
        now = monotonic()
        self._open[phase] += now - self._since
        self._since = now

    def end_tick(self) -> None:
        self._last, self._open = self._open, _no_time()
        self._sums = {phase: seconds + self._last[phase] for phase, seconds in self._sums.items()}
        self._ticks += 1

    def timing(self) -> Timing:
        return Timing(**{phase: 1e3 * seconds / max(1, self._ticks) for phase, seconds in self._sums.items()})

    def last_text(self) -> str:
        """The last tick in words, without its idle time."""
        parts = [(phase, s) for phase, s in self._last.items() if phase != "idle" and s >= 5e-5]
        return ", ".join(f"{phase} {1e3 * s:.1f} ms" for phase, s in parts)


def _no_time() -> dict[str, float]:
    return dict.fromkeys(Timing.__struct_fields__, 0.0)
