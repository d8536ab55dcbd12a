"""Paths of straight pieces by arc length, and the trail of a robot that leads (polylines.c): metres and radians."""

import math
from collections.abc import Iterable, Sequence
from struct import Struct

from zteam.kernels.binding import ffi, lib

Point = tuple[float, float]
Pose = tuple[float, float, float]
"""x, y, yaw."""
_read_two, _read_three = Struct("2d").unpack_from, Struct("3d").unpack_from
SAME, BACK_STEP = 0.25, 0.1
"""Metres between two points at which a way is at the same place again, and between two points of the way back."""
NO_POINT = "a path without a point has no place"


class Polyline:
    """Points joined by straight pieces. It grows at its end and can be dropped from its beginning.

    Places on it are arc lengths from its first point. They stay the same when its beginning is dropped. A place beyond
    an end is that end, one that is no number the first end; a point that is no number is not appended. Without a point
    there is no place: IndexError.
    """

    def __init__(self, points: Iterable[Point] = ()) -> None:
        self.line = ffi.gc(ffi.new("polyline *"), lib.free_points)
        """For C."""
        self._found = ffi.new("double[3]")
        self._read = ffi.buffer(self._found)
        for x, y in points:
            self.append(x, y)

    def __len__(self) -> int:
        return int(self.line.count)

    @property
    def start(self) -> float:
        """The place of its beginning: above 0 once something was dropped."""
        return self.line.start  # type: ignore[no-any-return]

    @property
    def end(self) -> float:
        """The place of its last point."""
        return self.line.end  # type: ignore[no-any-return]

    def append(self, x: float, y: float) -> None:
        """A point as far as 1 nm from the last one, at least, or none."""
        if not lib.append_point(self.line, x, y):
            raise MemoryError

    def drop_before(self, s: float) -> None:
        """Forget what lies before `s`, but for the last piece."""
        lib.drop_before(self.line, s)

    def cut_after(self, s: float) -> None:
        """Forget what lies behind `s`, which becomes its end."""
        lib.cut_after(self.line, s)

    def at(self, s: float) -> Pose:
        """The point at `s`, or the end nearest to it, and the direction there."""
        if not lib.find_pose(self.line, s, self._found):
            raise IndexError(NO_POINT)
        return _read_three(self._read)

    def point(self, s: float) -> Point:
        """The point at `s`, as `at`."""
        if not lib.find_pose(self.line, s, self._found):
            raise IndexError(NO_POINT)
        return _read_two(self._read)

    def near(self, point: Sequence[float], low: float = -math.inf, high: float = math.inf) -> tuple[float, float]:
        """The place from `low` to `high` nearest to (x, y, …), the first of equal ones, and the metres from there to it
        (infinite from a point that is no number)."""
        if not lib.find_nearest(self.line, point[0], point[1], low, high, self._found):
            raise IndexError(NO_POINT)
        return _read_two(self._read)

    def pursue(
        self, pose: Pose, s: float, ahead: float, speed: float, limits: tuple[float, float, float]
    ) -> tuple[float, float]:
        """The velocity (m/s, rad/s) that keeps a robot at `pose` to this path from its place `s` on.

        It drives to the point that is `ahead` (m) further on. There are limits of speed, turn rate, and acceleration to
        the side.
        """
        x, y, yaw = pose
        at = x, y, math.cos(yaw), math.sin(yaw)
        if not lib.pursue(self.line, at, s, ahead, speed, limits, self._found):
            raise IndexError(NO_POINT)
        return _read_two(self._read)

    def way_back(self, place: float) -> list[Point]:
        """From its end back to a place on it, without what it went twice."""
        back, at = [self.point(self.end)], self.end
        while at > place:
            at = lib.find_beside(self.line, *back[-1], SAME, place, at) - BACK_STEP
            back.append(self.point(at))
        return back


class LeaderTrail:
    """Where one leader has driven, as a follower saw it. It goes straight on before its beginning.

    The poses may be noisy and late. So the trail is not the poses themselves, whose zigzag would be longer than the
    way, but a smooth line through them, which ends a little behind the leader. How far the leader has come, and how
    fast it drives, is estimated (an alpha-beta filter).
    """

    def __init__(self) -> None:
        self._trail, self._found = ffi.new("trail *"), ffi.new("double[3]")
        self._read = ffi.buffer(self._found)
        self.stamp = 0
        """Of the leader's newest pose, ns."""
        self.place = 0.0
        """Where the leader is on its trail, as far as can be told."""
        self.speed = 0.0
        """Of the leader along its trail, m/s."""
        self.forget()

    def forget(self) -> None:
        """Begin anew with the next pose."""
        self.leader: Pose = math.inf, math.inf, 0.0
        """Its newest pose in map; infinitely far without one."""
        self.path = Polyline()
        """The trail up to a little behind the leader."""
        self._trail.path = self.path.line

    def begin(self, first: Pose, way: Iterable[Point], leader: Pose, stamp: int) -> None:
        """Begin anew with a way from `first` to this pose of the leader, of time `stamp` (ns)."""
        path, trail = Polyline([first[:2], *way, leader[:2]]), self._trail
        if not len(path):
            self.forget()
            return
        self.path, trail.path, trail.first, trail.leader = path, path.line, first, leader
        lib.begin_trail(trail)
        self.leader, self.stamp, self.place, self.speed = leader, stamp, path.end, 0.0

    def add(self, leader: Pose, stamp: int, keep: float) -> bool:
        """The leader's newest pose, of time `stamp` (ns). Forgets what lies more than `keep` metres behind.

        False if there is no last pose, or it cannot have driven on from there: begin anew.
        """
        added = lib.extend_trail(self._trail, *leader, (stamp - self.stamp) / 1e9, keep)
        if added > 0:
            self.leader, self.stamp = leader, stamp
            self.place, self.speed = self._trail.place, self._trail.speed
        return added >= 0  # type: ignore[no-any-return]

    def follow(
        self, own: Pose, place: float, length: float, ahead: Pose, apart: float, stamp: int, leader_stamp: int, now: int
    ) -> tuple[tuple[float, float, float], bool]:
        """How a robot at `own` and its `place` follows, `length` behind the leader. The robot ahead of it is `apart`
        away; times are in ns, and a stamp of 0 has none.

        The speed, how far it is behind where it belongs, and how far the robot ahead has driven away since its pose,
        which may be late; and whether that one comes past to its place.
        """
        x, y, _ = ahead
        comes_past = lib.follow_trail(
            self._trail, own, place, length, x, y, apart, stamp, leader_stamp, now, self._found
        )
        return _read_three(self._read), comes_past != 0

    def at(self, place: float, lateral: float = 0.0) -> Pose:
        """The pose that the leader had at this place, or so far to the left of it; extrapolated straight behind the
        beginning and ahead."""
        lib.find_trail_pose(self._trail, place, lateral, self._found)
        return _read_three(self._read)

    def curvature(self, place: float) -> float:
        """1/m, left positive."""
        return lib.trail_curvature(self._trail, place)  # type: ignore[no-any-return]
