"""The lectures' follower as it was written, with its faults: what the study `robots` compares with."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.view import View

MIN_DIST, MAX_LINEAR, MAX_ANGULAR = 0.8, 0.7, 3.14


class LecturesParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the lectures' follower."""

    leader: Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID, description="id of the robot to follow")]


class LecturesFollow(Behavior):
    """Towards the leader by the newest transform, however old it is; turns to the right have no limit."""

    Params = LecturesParams
    params: LecturesParams
    uses_tf = True

    def __init__(self, params: LecturesParams) -> None:
        super().__init__(params)
        self.leader: int = params.leader
        self._seen = Pose2(0.0, 0.0, 0.0)

    def step(self, view: View) -> Twist:
        """v = 0.5 d and w = 4 atan2(y, x), with an upper limit each; zero within 0.8 m."""
        found = view.base_from_robot(self.leader)
        if found is not None:
            self._seen = found[0]
        distance = math.hypot(self._seen.x, self._seen.y)
        if distance <= MIN_DIST:
            return Twist()
        turn = min(4.0 * math.atan2(self._seen.y, self._seen.x), MAX_ANGULAR)
        return Twist(Vector3(min(0.5 * distance, MAX_LINEAR)), Vector3(0.0, 0.0, turn))

    def missing(self, view: View) -> list[str]:
        """The leader's pose, as long as it is not there."""
        return [] if view.base_from_robot(self.leader) else [f"the pose of its leader {names.robot_name(self.leader)}"]
