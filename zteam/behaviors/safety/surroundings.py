"""What a robot knows of what stands around it: one set of points that stay where they are in `odom`.

The newest scan clears what it sees through and adds its hits. What it does not look at stays for the last metres of
travel. A beam that says nothing neither clears nor adds.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.safety.sight import Sight
from zteam.behaviors.scans import beams_of
from zteam.behaviors.view import View
from zteam.geometry import Pose2, normalize_angle, yaw_from_quaternion
from zteam.kernels import binding as kernels
from zteam.messages import LaserScan, Odometry

Floats = NDArray[np.float64]

SPAN = 3.0
"""Metres of travel that are remembered: longer, and the odometry's error outgrows the margins."""
REACH = 4.0
"""Metres: points further from the laser are not remembered. More than SPAN and a braking distance."""
_FINEST = math.radians(1.0)
"""Of beams so close together the nearest hit is a point: 5 mm apart where the corners of an erratic turn."""
_PUT = 0.02
"""Metres that a base may back up where it was put down and still has room to turn."""
_WEARS = 0.5
"""Metres of way behind it that a base no longer knows when it has turned by a radian."""


class Surroundings:
    """What one robot knows."""

    def __init__(self) -> None:
        self._lasers: dict[str, Pose2] = {}
        """The pose of each laser in the base frame, by its frame: it is fixed there."""
        self._scan: LaserScan | None = None
        self._pose: Pose2 | None = None
        """Of the base in `odom`."""
        self._forget()

    def _forget(self) -> None:
        """The robot is somewhere else."""
        self.sight = Sight()
        self._known, self._travelled = np.empty((3, 0)), 0.0
        """x and y of the points, and how far the base had travelled when each was seen (m). As it moves they
        are told in its frame anew."""
        self._room = 0.0
        """Metres that the base may back up over ground that it drove over; below 0: so far it backed up over other."""

    @property
    def points(self) -> Floats:
        """(2, n) in the base frame: what stands around."""
        return self._known[:2]

    @property
    def has_room(self) -> bool:
        """Whether the ground that the corners come to in a turn was seen, or the base was put down there."""
        return self._room >= -_PUT or self.sight.looks(0.0, math.pi)

    def take(self, view: View, reach: float) -> None:
        """See what the view shows, at least up to `reach` metres away."""
        self._pose = self._move(view.odom, reach)
        if view.scan is not None and view.scan is not self._scan:
            self._scan, beams = view.scan, beams_of(view.scan)
            self.sight.beams = beams
            self.sight.range = view.scan.range_max if view.scan.range_max > 0.0 else math.inf
            if beams is not None:
                laser = self._find_laser(view, view.scan.header.frame_id)
                self.sight.take(beams, laser, self._pose.yaw if self._pose else 0.0, view.now)
                (start, step, _), way = beams.laser, self._travelled
                few = max(1, int(_FINEST / max(abs(step), 1e-9) + 1e-6))
                self._known = kernels.see(
                    self._known, beams.directions.axes, beams.distances, (start, step), few,
                    laser, max(REACH, reach), way, way - SPAN,
                )  # fmt: skip

    def _move(self, odom: Odometry | None, reach: float) -> Pose2 | None:
        """The base is where odometry says; the pose in `odom` by which points are told now."""
        last, pose = self._pose, None if odom is None else _pose_of(odom)
        if pose is not None and not math.isfinite(sum(pose)):
            return last
        if last is None or pose is None or math.hypot(pose.x - last.x, pose.y - last.y) > reach:
            # It was set down here, or it is not known where the points are now.
            self._forget()
        elif pose != last:
            x, y, turn = last.inverse().compose(pose)
            turn, way = normalize_angle(turn), math.hypot(x, y)
            self._travelled += way
            kernels.move_points(self._known, x, y, turn)
            forwards = math.cos(0.5 * turn) * x + math.sin(0.5 * turn) * y > 0.9 * way
            self._room = min(SPAN, self._room + way) if forwards else self._room - way
            self._room = max(min(0.0, self._room), self._room - _WEARS * abs(turn))
        return pose

    def _find_laser(self, view: View, frame: str) -> Pose2:
        if frame not in self._lasers:
            found = view.lookup(view.base_frame, frame) if frame else None
            if found is None or not math.isfinite(sum(found[0])):
                return Pose2(0.0, 0.0, 0.0)
            self._lasers[frame] = Pose2(*map(float, found[0]))
        return self._lasers[frame]


def _pose_of(odom: Odometry) -> Pose2:
    position, turn = odom.pose.pose.position, odom.pose.pose.orientation
    return Pose2(float(position.x), float(position.y), yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))
