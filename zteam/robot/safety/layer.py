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

from collections.abc import Mapping

import numpy as np

from zteam import names
from zteam.kernels.binding import ffi, lib, memory
from zteam.messages import LaserScan, Twist, ns_from_time
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.messages.planar import pose2_of
from zteam.reasons import Reason
from zteam.robot.safety.motion import NO_NUMBER, BaseLimits, Floats, limits_of, twist_of
from zteam.robot.view import Beams, View, beams_of

STALE_AFTER = 0.5
"""Seconds after which a scan, or the robot's own pose, is too old to move on."""
_NO_BEAMS = ffi.new("laser_scan *")
_SIDES = "ahead", "behind", "beside"
_CAUSES = "", NO_NUMBER, "blind {}", "it cannot see {}", "{} {}"
_UNSEEN, _STOPPED = 3, 4
"""Of these: what slows the robot, and what it is stopped before."""


class SafetyLayer:
    """Limits the velocities of one robot. It remembers what came before: make a new one when time has jumped back."""

    def __init__(self) -> None:
        self._memory, self._inputs = ffi.new("safety_memory *"), ffi.new("safety_inputs *")
        self._odometry, self._known, self._silent = ffi.new("double[6]"), np.empty((3, 0)), ffi.new("double[0]")
        self._base: BaseLimits | None = None
        self._mates: list[BaseLimits] = []
        self._beams: Beams | None = None
        self._teammates = ffi.new("teammate[0]")
        """C has pointers to all of these."""
        self._scan: LaserScan | None = None
        self._team: tuple[Mapping[int, int], Mapping[int, Base]] | None = None
        """The rows of poses, and the bases, by which the teammates were chosen."""

    @property
    def points(self) -> Floats:
        """(2, n) in the base frame: what stands around."""
        return self._known[:2, : self._memory.count].copy()

    def limit(self, wanted: Twist, view: View, reason: str = "") -> tuple[Twist, str]:
        """`wanted` as far as it is safe, and why it was cut ("" = it was not).

        Only x and yaw are passed on, and y to an omni base: the others have no other way to move. The numbers are
        plain ones, whatever was wanted. With a `reason` a wanted stop is due to data that the driver lacks: the base
        then brakes evenly.
        """
        inputs, trouble, poses, limits = self._inputs, old_scan(view), view.poses, limits_of(view.base)
        if limits is not self._base:
            self._base, self._scan = limits, None
            self._memory.base, self._memory.has_pose = limits.struct, False
        if self._team != (poses.rows, view.bases):
            self._team = poses.rows, view.bases
            self._take_team(view, poses.rows)
        inputs.odom = ffi.NULL
        if view.odom is not None:
            twist = view.odom.twist.twist
            self._odometry[0:6] = *pose2_of(view.odom.pose.pose), twist.linear.x, twist.linear.y, twist.angular.z
            inputs.odom = self._odometry
        inputs.seen = ffi.NULL
        if view.scan is not None and view.scan is not self._scan and not trouble:
            self._scan, self._beams = view.scan, beams_of(view.scan)
            self._make_room(0 if self._beams is None else self._beams.distances.size)
            inputs.seen = _NO_BEAMS if self._beams is None else self._beams.scan
            inputs.range, (inputs.laser_x, inputs.laser_y) = view.scan.range_max, view.laser
        inputs.poses, inputs.own_row = poses.poses, poses.rows.get(view.robot_id, -1)
        inputs.now, inputs.dt = view.now, view.dt
        inputs.is_old, inputs.lacks = bool(trouble), bool(reason)
        cause = lib.limit(self._memory, inputs, (wanted.linear.x, wanted.linear.y, wanted.angular.z))
        return twist_of(*self._memory.command), trouble or (self._why(cause) if cause else "")

    def halt(self, view: View) -> None:
        """The robot is commanded zero velocity, whatever was wanted: its base brakes as hard as it can."""
        self.limit(Twist(), view)
        self.note_standing()

    def note_standing(self) -> None:
        """The base stands, whatever was commanded last: the next velocity begins there."""
        self._memory.motion, self._memory.held = (0.0, 0.0, 0.0), 0

    def _take_team(self, view: View, rows: Mapping[int, int]) -> None:
        """The teammates are others, or have other bases: what is known of those that stay is kept."""
        before = {(mate.robot_id, mate.base): mate for mate in self._teammates}
        robots = sorted({*view.bases, *view.team} - {view.robot_id})
        mates, self._mates = ffi.new("teammate[]", len(robots)), []
        for mate, robot in zip(mates, robots, strict=True):
            limits = limits_of(view.bases.get(robot, DEFAULT_BASE))
            if (known := before.get((robot, limits.struct))) is not None:
                ffi.memmove(ffi.addressof(mate), ffi.addressof(known), ffi.sizeof("teammate"))
            mate.robot_id, mate.row, mate.base = robot, rows[robot], limits.struct
            self._mates.append(limits)
        self._teammates = self._memory.mates = mates
        self._memory.mate_count = len(robots)

    def _make_room(self, beams: int) -> None:
        """For what a scan with so many beams shows."""
        kept = self._memory
        if kept.count + beams > kept.room or beams > len(self._silent):
            known, self._known = self._known[:, : kept.count], np.empty((3, 2 * kept.count + beams))
            self._known[:, : kept.count], self._silent = known, ffi.new("double[]", beams)
            kept.known, kept.room = memory("known", self._known, *self._known.shape, out=True), self._known.shape[1]
            kept.silent = self._silent

    def _why(self, cause: int) -> str:
        side, met = _SIDES[self._memory.side], self._memory.met
        if cause != _STOPPED:
            return Reason(_CAUSES[cause].format(side), slows=cause == _UNSEEN)
        before = "obstacle" if met < 0 else names.robot_name(met)
        return Reason(_CAUSES[cause].format(before, side), blocked_by=met)


def old_scan(view: View) -> str:
    """Why the scan cannot be driven by: there is none, it is of no use, or it is old; empty if it can."""
    if view.scan is None:
        return f"needs {view.scan_needs}" if view.scan_needs else "no scan yet"
    return "" if view.is_fresh(ns_from_time(view.scan.header.stamp), STALE_AFTER) else "stale scan"


def make_safe(wanted: Twist, view: View) -> tuple[Twist, str]:
    """What a new `SafetyLayer` makes of `wanted`, and why it was cut ("" = it was not)."""
    return SafetyLayer().limit(wanted, view)
