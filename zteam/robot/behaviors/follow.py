"""Follow another robot: along the trail of the robot ahead, in a line that may be led from either end, or straight."""

import math
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

from zteam import names
from zteam.errors import log
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.evasion import Around
from zteam.robot.behaviors.line import MOST_GAP, LineRole, OnLeaderLost, see_robot
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.behaviors.trail import HEAD_SPEED, HEAD_TURN_RATE, LineMember
from zteam.robot.behaviors.wander import Avoid, Forward, Idle, Wander
from zteam.robot.view import View


class FollowParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `follow`; only the leader has to be given."""

    leader: Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID, description="id of the robot to follow")]
    law: Annotated[
        Literal["trail", "direct"], Meta(description="trail: along the leader's trail; direct: straight to the leader")
    ] = "trail"
    gap: Annotated[
        float, Meta(ge=0.4, le=MOST_GAP, description="m along the trail to the robot ahead, base to base; law trail")
    ] = 0.8
    min_dist: Annotated[
        float, Meta(ge=0.0, le=100.0, description="m; it stands while the leader is nearer; law direct")
    ] = 0.8
    max_linear: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.7
    max_angular: Annotated[float, Meta(ge=0.0, le=math.pi, description="rad/s")] = 3.14
    stale_after: Annotated[float, Meta(ge=0.0, le=10.0, description="s; it stands on older poses of the leader")] = 0.5
    hand_over: Annotated[
        bool, Meta(description="whether the line may be led from its other end where its head is stuck; law trail")
    ] = True
    on_leader_lost: Annotated[
        OnLeaderLost, Meta(description="what it does when a robot in front is gone, see below")
    ] = "relink"
    takeover_behavior: Annotated[
        Literal["same", "idle", "forward", "avoid", "wander"],
        Meta(description="what it does as the new head; same: what the lost one did, else avoid"),
    ] = "same"


SUCCESSORS: dict[Any, type[Behavior]] = {"idle": Idle, "forward": Forward, "avoid": Avoid, "wander": Wander}
"""What a robot can go on with that takes over: they need no parameters and no further inputs."""
LEADER_ROOM = 0.3
"""Metres before the leader's base where its own body begins to be seen."""


class Follow(LineMember):
    """Follow a robot along its trail, each the one before it (law trail), or straight (law direct).

    A head that gets on no more hands over to the last robot of the line, which then leads the other way.
    """

    Params = FollowParams
    params: FollowParams
    uses_tf = True

    def __init__(self, params: FollowParams) -> None:
        super().__init__(params)
        self._around = Around()
        self._successor: Behavior | None = None
        """What it does in the place of a head that is gone."""
        self._before = params.leader
        """The robot that it followed last."""
        self.on_params()

    def on_params(self) -> None:
        """Follow the robot that `params` names, by the law that they name."""
        self.leader, self.follows = self.params.leader, self.params.leader
        self.gap, self._successor = self.params.gap, None
        self._limits = SpeedLimits(self.params.max_linear, self.params.max_angular)

    @property
    def _may_turn(self) -> bool:
        return self.params.hand_over and self.params.law == "trail"

    def on_release(self) -> None:
        super().on_release()
        if self._successor is not None:
            self._successor.on_release()

    def step(self, view: View) -> Twist:
        """By its law; zero where a pose that it needs is not known for certain, or a robot in front is gone."""
        params = self.params
        role = self._find_role(view, params.leader, params.on_leader_lost)
        before, speed = self.follows, min(HEAD_SPEED, params.max_linear)
        command = self._drive_in_line(view, role, self._limits, speed, HEAD_TURN_RATE)
        if self.follows != before:
            log.info("%s now", "leads the line" if role.ahead is None else f"follows {names.robot_name(role.ahead)}")
        return command

    def _follow(self, view: View, own: Pose2, role: LineRole, limits: SpeedLimits) -> Twist:
        self._successor, self._before = None, role.before[0]
        if self.params.law == "direct":
            return self._drive_straight(view, own, role.before[0], limits)
        gap, stale_after = self.params.gap, self.params.stale_after
        command, self.reason = self._trail.step(view, own, role, gap, stale_after, limits)
        return command

    def _lead(self, view: View, own: Pose2, role: LineRole, limits: SpeedLimits, speed: float, rate: float) -> Twist:
        """In the place of a head that is gone, or that has handed over."""
        if self._before in role.gone:
            lost = see_robot(view, self._before)[0]
            command = self._trail.pass_by(view, own, lost and lost[0], limits, role.gone)
            if command is not None:
                self._head.rest()
                return command
        if role.head in role.gone:
            then: str = self.params.takeover_behavior
            if then == "same":
                status = (view.inputs.get("statuses") or {}).get(role.head)
                then = status.behavior if status is not None else ""
            if then != "wander" or not role.may_turn:
                kind = SUCCESSORS.get(then, Avoid)
                if type(self._successor) is not kind:
                    self._successor = kind(kind.Params())
                self._head.rest()
                command, self.reason = self._successor.step(view), self._successor.reason
                return command
        return super()._lead(view, own, role, limits, speed, rate)

    def why_it_rests(self) -> str:
        if not self.params.max_linear:
            return "its parameter max_linear is 0"
        return super().why_it_rests() if self._successor is None else self._successor.why_it_rests()

    def _drive_straight(self, view: View, own: Pose2, ahead: int, limits: SpeedLimits) -> Twist:
        """The lectures' law, mended: to the robot ahead, past what stands between."""
        seen, self.reason = see_robot(view, ahead, self.params.stale_after)
        if seen is None:
            return Twist()
        x, y = own.locate(*seen[0][:2])
        apart = self._trail.apart = math.hypot(x, y)
        if apart <= self.params.min_dist:
            return Twist()
        return self._around.drive_to(view, x, y, limits, ahead, LEADER_ROOM)

    def missing(self, view: View) -> list[str]:
        seen, _ = see_robot(view, self.params.leader, self.params.stale_after)
        return [] if seen else [f"the pose of its leader {names.robot_name(self.params.leader)}"]
