"""Follow another robot by the transforms alone (the lectures' follower, mended)."""

import math
from typing import Annotated

import msgspec

from zteam import names
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

LINEAR_GAIN = 0.5
"""1/s: the lectures' v = 0.5 d."""
ANGULAR_GAIN = 4.0
"""1/s: the lectures' w = 4 atan2(y, x)."""


class FollowParams(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `follow`; only the leader has to be given."""

    leader: Annotated[int, msgspec.Meta(ge=0, le=names.MAX_ROBOT_ID)]
    """Id of the robot to follow."""
    min_dist: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 0.8
    """It stands while the leader is at most this far away, metres between base frames."""
    max_linear: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.7
    """m/s."""
    max_angular: Annotated[float, msgspec.Meta(ge=0.0, le=math.pi)] = 3.14
    """rad/s."""
    stale_after: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 0.5
    """It stands while the leader's newest pose is older than this, seconds."""


class Follow(Behavior):
    """Turn to the leader and drive up to it; turn on the spot while it is behind."""

    Params = FollowParams
    params: FollowParams
    uses_tf = True

    def __init__(self, params: FollowParams) -> None:
        super().__init__(params)
        self.leader: int = params.leader

    def step(self, view: View) -> Twist:
        """Towards the leader, or zero where it stands near or its place is not known for certain."""
        leader, self.reason = self._find_leader(view)
        if leader is None:
            return Twist()
        distance = math.hypot(leader.x, leader.y)
        if distance <= self.params.min_dist:
            return Twist()
        angle = math.atan2(leader.y, leader.x)
        # A leader behind is turned to on the spot: driving would lead away from it.
        speed = 0.0 if abs(angle) > 0.5 * math.pi else min(LINEAR_GAIN * distance, self.params.max_linear)
        limit = self.params.max_angular
        turn = max(-limit, min(limit, ANGULAR_GAIN * angle))
        return Twist(linear=Vector3(x=speed), angular=Vector3(z=turn))

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
