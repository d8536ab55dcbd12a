"""The layer under everything that drives: nothing moves on old data, into an obstacle, or faster than the limits.

The rules, which `kernels/safety.c` carries out:

- A commanded arc is looked at for as long as the base needs to stop on it. It is slowed down so far that the base can
  stop before what it would meet: 0.15 m before an obstacle, 0.3 m before a teammate, 0.1 m behind one that drives away.
  Beside its way 0.01 m (a turn) to 0.025 m (a drive) stay free. Away from what is nearer it may always move.
- Where there is no room for the arc, it turns as was wanted but drives more slowly, or it drives straight on.
- What stands around a robot is one set of points that stay where they are in `odom`. The newest scan clears what it
  sees through and adds its hits. What it does not look at stays for the last 3 m of travel, but for points at
  teammates. A beam that says nothing neither clears nor adds.
- Where beams towards the way have said nothing for 0.5 s, the base does not drive. Where no laser looks, and nothing
  that it remembers is, its fastest corner moves at 0.2 m/s at most.
- Teammates are placed by their poses, because the laser looks over low bodies, and lasers dazzle each other. One that
  moves takes up all its way until it stands. Its outline grows with the age of its pose.
- On old data, and where what was wanted is no number, the base brakes evenly on its arc.

The text that says why is the same from step to step, so that a robot's status changes only with the cause.
"""

import math
from collections.abc import Mapping

import numpy as np

from zteam import names
from zteam.kernels import safety as kernels
from zteam.messages import LaserScan, Twist, Vector3, ns_from_time
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.messages.planar import pose2_of
from zteam.reasons import Reason
from zteam.robot.safety.motion import NO_NUMBER, Floats, limits_of
from zteam.robot.view import Beams, View, beams_of

STALE_AFTER = 0.5
"""Seconds after which a scan, or the robot's own pose, is too old to move on."""
_NO_BEAMS = Beams((0.0, 0.0, 0), np.empty(0), np.empty((2, 0)), np.empty(0), np.empty(0), math.inf, all_speak=True)
_SIDES = "ahead", "behind", "beside"


class SafetyLayer:
    """Limits the velocities of one robot. It remembers what came before: make a new one when time has jumped back."""

    def __init__(self) -> None:
        self._memory = kernels.SafetyMemory()
        self._base: Base | None = None
        self._scan: LaserScan | None = None
        self._team: tuple[Mapping[int, int], Mapping[int, Base]] | None = None
        """The rows of poses, and the bases, by which the teammates were chosen."""

    @property
    def points(self) -> Floats:
        """(2, n) in the base frame: what stands around."""
        return self._memory.points

    def limit(self, wanted: Twist, view: View, reason: str = "") -> tuple[Twist, str]:
        """`wanted` as far as it is safe, and why it was cut ("" = it was not).

        Only x and yaw are passed on, and y to an omni base: the others have no other way to move. The numbers are
        plain ones, whatever was wanted. With a `reason` a wanted stop is due to data that the driver lacks: the base
        then brakes evenly.
        """
        memory, trouble, poses = self._memory, old_scan(view), view.poses
        if view.base is not self._base:
            self._base, self._scan = view.base, None
            memory.take_base(limits_of(view.base).kernel)
        if self._team is None or self._team[0] is not poses.rows or self._team[1] is not view.bases:
            self._team = poses.rows, view.bases
            mates = sorted({*view.bases, *view.team} - {view.robot_id})
            bases = [limits_of(view.bases.get(robot, DEFAULT_BASE)).kernel for robot in mates]
            memory.take_mates([(robot, poses.rows[robot], base) for robot, base in zip(mates, bases, strict=True)])
        if view.odom is None:
            memory.take_odometry(None)
        else:
            twist = view.odom.twist.twist
            memory.take_odometry((*pose2_of(view.odom.pose.pose), twist.linear.x, twist.linear.y, twist.angular.z))
        is_new = not trouble and view.scan is not None and view.scan is not self._scan
        if is_new and view.scan is not None:
            self._scan, beams = view.scan, beams_of(view.scan) or _NO_BEAMS
            read = beams.angles, beams.axes, beams.distances, beams.laser[:2]
            memory.take_scan(*read, view.scan.range_max, view.laser, all_speak=beams.all_speak)
        linear, turn = wanted.linear, wanted.angular.z
        cause, (x, y, turn) = memory.limit(
            (linear.x, linear.y, turn), poses.poses, poses.stamps, poses.rows.get(view.robot_id, -1), view.now, view.dt,
            is_old=bool(trouble), has_scan=is_new, lacks=bool(reason),
        )  # fmt: skip
        command = Twist(Vector3(x, y), Vector3(0.0, 0.0, turn))
        return command, trouble or (self._why(cause) if cause else "")

    def halt(self, view: View) -> None:
        """The robot is commanded zero velocity, whatever was wanted: its base brakes as hard as it can."""
        self.limit(Twist(), view)
        self._memory.stand()

    def _why(self, cause: int) -> str:
        side, met = _SIDES[self._memory.side], self._memory.met
        if cause == kernels.NO_NUMBER:
            return NO_NUMBER
        if cause == kernels.BLIND:
            return f"blind {side}"
        if cause == kernels.UNSEEN:
            return Reason(f"it cannot see {side}", slows=True)
        return f"obstacle {side}" if met < 0 else Reason(f"{names.robot_name(met)} {side}", blocked_by=met)


def old_scan(view: View) -> str:
    """Why the scan cannot be driven by: there is none, it is of no use, or it is old; empty if it can."""
    if view.scan is None:
        return f"needs {view.scan_needs}" if view.scan_needs else "no scan yet"
    return "" if view.is_fresh(ns_from_time(view.scan.header.stamp), STALE_AFTER) else "stale scan"


def make_safe(wanted: Twist, view: View) -> tuple[Twist, str]:
    """What a new `SafetyLayer` makes of `wanted`, and why it was cut ("" = it was not)."""
    return SafetyLayer().limit(wanted, view)
