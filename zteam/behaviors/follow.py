"""Follow another robot by the transforms alone (the lectures' follower, mended)."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from zteam import names
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.scans import first_clear
from zteam.behaviors.view import View
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan, Twist, Vector3

LINEAR_GAIN = 0.5
"""1/s: the lectures' v = 0.5 d."""
ANGULAR_GAIN = 4.0
"""1/s: the lectures' w = 4 atan2(y, x)."""


REACH = 0.6
"""Metres ahead of the laser that have to be clear."""
LEADER_ROOM = 0.3
"""Metres before the leader's base where its own body begins to be seen."""
SIDE_MARGIN = 0.075
"""Metres that have to be free on either side of the base."""
DETOUR_STEP = math.radians(10.0)
DETOUR_STEPS = 12
"""It looks for a way round up to so far from the leader's bearing."""


class FollowParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `follow`; only the leader has to be given."""

    leader: Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID, description="id of the robot to follow")]
    min_dist: Annotated[float, Meta(ge=0.0, le=100.0, description="m; it stands while the leader is nearer")] = 0.8
    max_linear: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.7
    max_angular: Annotated[float, Meta(ge=0.0, le=math.pi, description="rad/s")] = 3.14
    stale_after: Annotated[float, Meta(ge=0.0, le=10.0, description="s; it stands on older poses of the leader")] = 0.5


class Follow(Behavior):
    """Turn to the leader and drive up to it, round what stands between; turn on the spot while it is behind."""

    Params = FollowParams
    params: FollowParams
    uses_odom = False
    uses_tf = True

    def __init__(self, params: FollowParams) -> None:
        super().__init__(params)
        self.leader: int = params.leader
        self._side = 0.0
        """1 while going round something on its left, -1 on its right, 0 with a clear way."""

    def on_params(self) -> None:
        """Follow the robot that `params` names."""
        self.leader = self.params.leader

    def step(self, view: View) -> Twist:
        """Towards the leader, or zero where it stands near or its place is not known for certain."""
        leader, self.reason = self._find_leader(view)
        if leader is None:
            return Twist()
        distance = math.hypot(leader.x, leader.y)
        if distance <= self.params.min_dist:
            return Twist()
        angle = math.atan2(leader.y, leader.x)
        if view.scan is not None:
            angle = self._way_round(view.scan, angle, distance, view.base.half_width + SIDE_MARGIN)
        # A leader behind is turned to on the spot: driving would lead away from it.
        speed = 0.0 if abs(angle) > 0.5 * math.pi else min(LINEAR_GAIN * distance, self.params.max_linear)
        limit = self.params.max_angular
        turn = max(-limit, min(limit, ANGULAR_GAIN * angle))
        return Twist(linear=Vector3(x=speed), angular=Vector3(z=turn))

    def _way_round(self, scan: LaserScan, bearing: float, distance: float, half_width: float) -> float:
        """The heading to take: the leader's bearing, or the nearest to it that is clear where something stands between.

        It goes round on the side it chose until the leader's bearing is clear again, so it does not swing in front of
        a post; without any clear heading it keeps to the bearing.
        """
        reach = min(REACH, distance - LEADER_ROOM)
        if first_clear(scan, half_width, (bearing,), reach) is not None:
            self._side = 0.0
            return bearing
        heading = first_clear(scan, half_width, _detours(bearing, (self._side,)), reach) if self._side else None
        if heading is None:
            heading = first_clear(scan, half_width, _detours(bearing, (1.0, -1.0)), reach)
        if heading is None:
            self._side = 0.0
            return bearing
        self._side = math.copysign(1.0, heading - bearing)
        return normalize_angle(heading)

    def missing(self, view: View) -> list[str]:
        """The leader's pose, as long as it is not there or old."""
        leader, _ = self._find_leader(view)
        return [] if leader else [f"the pose of its leader {names.robot_name(self.leader)}"]

    def _find_leader(self, view: View) -> tuple[Pose2 | None, str]:
        """The leader in the own base frame, or None and why not."""
        name = names.robot_name(self.leader)
        if self.leader == view.robot_id:
            return None, "it cannot follow itself"
        found = view.base_from_robot(self.leader)
        if found is None:
            return None, f"leader {name} not seen"
        pose, stamp = found
        # A stamp of 0 says that nothing on the way ever moves, so there is no age.
        if stamp and not view.is_fresh(stamp, self.params.stale_after):
            return None, f"leader {name} not seen for {self.params.stale_after:g} s"
        return (pose, "") if all(map(math.isfinite, pose)) else (None, f"the pose of leader {name} is no number")


def _detours(bearing: float, sides: tuple[float, ...]) -> list[float]:
    """Headings to one of the sides of `bearing`, the nearest to it first."""
    return [bearing + side * step * DETOUR_STEP for step in range(1, DETOUR_STEPS + 1) for side in sides]
