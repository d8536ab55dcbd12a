"""What one robot knows in a step: what its behaviour and its safety layer go by; and its laser scan, read with care.

`zteam.messages.laser` tells what a range means. A beam that says nothing is neither an obstacle nor free.
"""

import math
from collections.abc import Callable, Mapping, Sequence, Set
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.counter_random import uniform
from zteam.geometry import Point2, Pose2
from zteam.kernels import view as kernels
from zteam.kernels.transforms import NOT_KNOWN, gather_poses
from zteam.messages import LaserScan, Odometry
from zteam.messages.base import DEFAULT_BASE, Base

SILENT_AFTER = 2.0
"""Seconds without a status (they come at 1 Hz) after which a teammate is silent: simulated in lock-step, else the
host's."""
Floats = NDArray[np.float64]
FindPose = Callable[..., tuple[Pose2, int] | None]
"""`find_pose(target_frame, source_frame, time=0)`: target_from_source at a time (ns), or the newest with 0, and its
stamp (ns; 0 where nothing between the two frames moves), or None where the look-up failed."""


class Teammate(NamedTuple):
    """Another robot of the team."""

    robot_id: int
    pose: Pose2
    """In the own base frame."""
    age: float
    """Seconds between now and the stamp of its pose."""
    base: Base

    def along(self, heading: float) -> tuple[float, float]:
        """Metres to it along a heading (rad) from the own base, and to the left of that."""
        return Pose2(0.0, 0.0, heading).locate(self.pose.x, self.pose.y)


class TeamPoses(dict[int, tuple[Pose2, int] | None]):
    """Where some robots are in `map` at one time: by id the pose and its stamp (ns; 0: nothing on the way to it ever
    moves); None where it is not known. Each is made when it is looked at; KeyError for any other robot."""

    def __init__(self, rows: Mapping[int, int], poses: Any, stamps: Sequence[int]) -> None:
        """`rows` has the row of each robot, by its id; the others are as of `Buffer.find_poses2`."""
        self.rows, self.poses, self._stamps = rows, poses, stamps

    def __missing__(self, robot_id: int) -> tuple[Pose2, int] | None:
        row = self.rows[robot_id]
        stamp = self._stamps[row]
        found = None if stamp == NOT_KNOWN else (Pose2(*self.poses[4 * row : 4 * row + 3]), stamp)
        self[robot_id] = found
        return found


class View(msgspec.Struct, frozen=True, kw_only=True, eq=False, dict=True):
    """One robot's knowledge at `now`. Nothing in it changes while a behaviour looks at it."""

    now: int
    """Nanoseconds."""
    dt: float
    """Seconds since the last step; 0 on the first, and on the first after a pause."""
    robot_id: int
    scan: LaserScan | None
    """The newest, in the axes of the base however its laser is mounted: beams run from right to left, and angles count
    from the base's x axis. None before the first one, and if it cannot be used."""
    odom: Odometry | None
    lookup: FindPose
    laser: Point2 = (0.0, 0.0)
    """Where the beams of `scan` begin, in the base (m)."""
    scan_needs: str = ""
    """What is missing for the newest scan to be used, as a noun; empty if nothing is, or none has come."""
    base: Base = DEFAULT_BASE
    """Its outline and limits."""
    team: tuple[int, ...] = ()
    """Ids of the robots whose process is alive, as far as known; in lock-step those that take part in the tick."""
    inputs: Mapping[str, Any] = {}
    """What the behaviour declares in `inputs`, by name: the newest message or None; for a topic of every robot the
    newest messages by robot id."""
    silent: Set[int] = frozenset()
    """Robots whose newest status is more than SILENT_AFTER old: their process is frozen, cut off or gone. Known to
    behaviours that declare `robot_$*/status`."""
    seed: int = 1
    bases: Mapping[int, Base] = {}
    """The bases of the robots that have told theirs, by id."""

    @cached_property
    def poses(self) -> TeamPoses:
        """Those of this robot and of all of `team` and `bases`. A robot's process sets them before its step."""
        robots = sorted({self.robot_id, *self.team, *self.bases})
        found = [self.lookup(names.MAP_FRAME, names.robot_frame(robot, names.BASE_FOOTPRINT)) for robot in robots]
        return TeamPoses({robot: row for row, robot in enumerate(robots)}, *gather_poses(found))

    @cached_property
    def _seen(self) -> list[float]:
        """Of each row of `poses` x, y and yaw in the own base frame; NaN where not known."""
        return kernels.see_poses(self.poses.poses, self.poses.rows[self.robot_id])

    @cached_property
    def teammates(self) -> tuple[Teammate, ...]:
        """All other robots of `team` and `bases` whose pose is known, by id."""
        found = []
        for robot_id in self.poses.rows:
            at = self.base_from_robot(robot_id) if robot_id != self.robot_id else None
            if at is not None:
                age = abs(self.now - at[1]) / 1e9 if at[1] else 0.0
                found.append(Teammate(robot_id, at[0], age, self.bases.get(robot_id, DEFAULT_BASE)))
        return tuple(found)

    @property
    def base_frame(self) -> str:
        """The robot's own base: x forward, y left."""
        return names.robot_frame(self.robot_id, names.BASE_FOOTPRINT)

    def map_from_base(self) -> tuple[Pose2, int] | None:
        """The robot's own pose in `map` and its stamp, or None."""
        return self.map_from_robot(self.robot_id)

    def map_from_robot(self, robot_id: int) -> tuple[Pose2, int] | None:
        """A robot's pose in `map` and its stamp, or None."""
        poses = self.poses
        if robot_id in poses.rows:
            return poses[robot_id]
        return self.lookup(names.MAP_FRAME, names.robot_frame(robot_id, names.BASE_FOOTPRINT))

    def base_from_robot(self, robot_id: int) -> tuple[Pose2, int] | None:
        """Another robot's pose in the own base frame and its stamp, or None."""
        poses = self.poses
        row = poses.rows.get(robot_id)
        if row is None:
            return self.lookup(self.base_frame, names.robot_frame(robot_id, names.BASE_FOOTPRINT))
        found = poses[robot_id]
        if found is None or poses[self.robot_id] is None:
            return None
        return Pose2(*self._seen[3 * row : 3 * row + 3]), found[1]

    def random(self, draw: int = 0) -> float:
        """A number in [0, 1): the same for the same seed, robot, time and `draw`, whatever else was drawn."""
        return uniform(self.seed, self.robot_id, self.now, draw)

    def is_fresh(self, stamp: int, max_age: float) -> bool:
        """Whether data of `stamp` is at most `max_age` seconds away from now: a stamp from the future is old, too."""
        return abs(self.now - stamp) <= max_age * 1e9


NO_POSE = f"its own pose in {names.MAP_FRAME} is not known"


def own_pose(view: View) -> Pose2 | None:
    """The robot's own pose in `map`; None where it is not known, or no number."""
    found = view.map_from_base()
    return found[0] if found is not None and math.isfinite(sum(found[0])) else None


_ANGLE_TOLERANCE = 1e-5
"""Radians: the scan's angles are float32 sums, so a beam on the edge of a cone may come to lie beside it."""
_MOST_ANGLE = 1e6
"""Radians: beams further round have no usable angles."""
_TOUCHING = 1e-6
"""Metres: where a hit that is too close to measure is taken to be."""
_EDGE = math.radians(5.0)
"""The outermost beams see only one side of what is there."""
_ROUNDING = 1e-6
"""Relative: of a distance that is compared with a limit."""


class Cone(msgspec.Struct, frozen=True):
    """What the beams in a cone say."""

    nearest: float
    """Metres from the laser to the nearest hit; inf where nothing is hit."""
    bearing: float
    """Where that hit is: radians, left positive; 0 where nothing is hit."""
    invalid: float
    """Share of the cone's beams that say nothing, 0..1."""


class Beams(NamedTuple):
    """A scan read once."""

    angles: Floats
    """Of the beams, in [-pi, pi)."""
    axes: Floats
    """(2, n): their cosines and sines."""
    ranges: Floats
    distances: Floats
    """`ranges`, but a hit that is too close to measure is at _TOUCHING: it still has the direction of its beam."""
    nearest: float
    """No hit is nearer (metres)."""
    scan: Any
    """The same for C: a `laser_scan` of kernels.h. It points to arrays of this object and of `directions`."""
    directions: kernels.Directions
    """Kept because `scan` points to its arrays."""

    def find_hits(self, bound: float) -> Floats:
        """(2, m): where all beams that hit something nearer than `bound` ended, in the laser's frame."""
        at = (self.distances < bound).nonzero()[0]
        return self.axes.take(at, axis=1) * self.distances.take(at)


_directions = lru_cache(maxsize=64)(kernels.Directions)
"""The same in every scan of a laser."""


def _read(scan: LaserScan) -> Beams | None:
    start, step = float(scan.angle_min), float(scan.angle_increment)
    given = np.ascontiguousarray(scan.ranges, np.float32)
    if not (given.size and abs(start) + abs(step) * given.size < _MOST_ANGLE) or (step == 0.0 and given.size > 1):
        return None
    beams = _directions(start, step, given.size)
    distances, nearest, seen = beams.read(given, scan.range_min, scan.range_max, _TOUCHING)
    ranges = distances if nearest > _TOUCHING else np.where(distances <= _TOUCHING, 0.0, distances)
    return Beams(beams.angles, beams.axes, ranges, distances, nearest, seen, beams)


_newest: tuple[LaserScan | None, object, Beams | None] = None, None, None
"""The scan that was read last, with its ranges: a step looks at one up to forty times."""


def beams_of(scan: LaserScan) -> Beams | None:
    """The scan, read; None where there are no beams."""
    global _newest
    known, ranges, beams = _newest
    if known is not scan or ranges is not scan.ranges:
        ranges, beams = scan.ranges, _read(scan)
        # What can be changed is read each time.
        if isinstance(ranges, np.ndarray) and not ranges.flags.writeable:
            _newest = scan, ranges, beams
    return beams


def read_beams(scan: LaserScan) -> tuple[Floats, Floats] | None:
    """Bearings in [-pi, pi) and distances in metres, both (n,), or None where there are no beams. Bearings are from the
    axis from which the scan's angles count: that of the base for `view.scan`.

    A distance is NaN where the beam says nothing, inf where it met nothing, 0 where something is too close to measure.
    Beams without usable angles are no beams. A scan may run either way round (`angle_increment` < 0) and beyond pi.
    """
    beams = beams_of(scan)
    return None if beams is None else (beams.angles, beams.ranges)


def look_ahead(scan: LaserScan, half_angle: float) -> Cone | None:
    """What stands within `half_angle` (radians) of straight ahead, or None where no beam looks there."""
    beams = beams_of(scan)
    if beams is None:
        return None
    inside = (np.abs(beams.angles) <= half_angle + _ANGLE_TOLERANCE).nonzero()[0]
    if not inside.size:
        return None
    distances, silent = beams.ranges.take(inside), 0
    if beams.scan.silent:
        # Silent beams must not be taken for the nearest.
        is_silent = np.isnan(distances)
        distances[is_silent], silent = np.inf, int(is_silent.sum())
    at = int(distances.argmin())
    nearest = float(distances[at])
    bearing = float(beams.angles[inside[at]]) if nearest < math.inf else 0.0
    return Cone(nearest, bearing, silent / inside.size)


def look_along(scan: LaserScan, half_width: float, heading: float = 0.0) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` towards `heading` (rad), inf where it is clear."""
    beams = beams_of(scan)
    if beams is None:
        return math.inf
    return kernels.look_along(beams.scan, half_width, heading)


def is_seen(scan: LaserScan, heading: float) -> bool:
    """Whether beams look on both sides of a heading (rad)."""
    first, last = sorted((scan.angle_min, scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1)))
    middle = 0.5 * (first + last)
    if not math.isfinite(middle):
        return False
    # The angles of a laser that looks backwards go beyond pi.
    heading += math.tau * round((middle - heading) / math.tau)
    return last - first > math.tau - _EDGE or first + _EDGE <= heading <= last - _EDGE


def is_clear(scan: LaserScan, half_width: float, reach: float, heading: float = 0.0) -> bool:
    """Whether a corridor of 2 * `half_width` towards `heading` (rad) is clear for `reach` metres."""
    return first_clear(scan, half_width, reach, heading, ()) is not None


def first_clear(
    scan: LaserScan, half_width: float, reach: float, heading: float, turns: tuple[float, ...]
) -> float | None:
    """`heading` (rad) if a corridor of 2 * `half_width` towards it is clear for `reach` metres, else the first clear
    one of `heading` + each of the `turns`; None if there is none.
    """
    beams = beams_of(scan)
    # Mostly no hit is near enough to stand in it.
    if beams is None or beams.nearest >= math.hypot(reach, half_width) * (1.0 + _ROUNDING):
        return heading
    headings = [heading, *[heading + turn for turn in turns]]
    found = kernels.first_clear(beams.scan, half_width, reach, np.array(headings))
    return headings[found] if found >= 0 else None
