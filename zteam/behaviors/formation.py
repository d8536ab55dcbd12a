"""Keep a place in a formation behind a leader."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from msgspec import Meta, Struct

from zteam import names
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.chain import STATUSES, Seen, see_robot
from zteam.behaviors.escape import Escape
from zteam.behaviors.formation_slots import Assignment
from zteam.behaviors.leader_trail import LeaderTrail
from zteam.behaviors.making_way import Detour, MakingWay
from zteam.behaviors.pursuit import Limits
from zteam.behaviors.shapes import Shape, Slot, reach_of, slots_of, squeeze
from zteam.behaviors.slot_driving import STANDING, Other, Others, Target, drive_to, turn_to
from zteam.behaviors.squeezing import Squeeze, share_for_bend, share_for_room
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import Message, Twist

PARKED, LEFT = 0.04, 0.12
"""Metres to the slot of a standing leader at which it stops, and at which it goes on."""
KEPT = 20.0
"""Metres of the leader's trail behind the last slot that are kept, for robots that were left behind."""
ROOM = 0.6
"""Metres: no robot is passed nearer, or nearer than three quarters of the spacing."""


class FormationParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `formation`; only the leader has to be given."""

    leader: Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID, description="id of the robot that leads")]
    shape: Annotated[Shape, Meta(description="where the slots lie")] = "wedge"
    spacing: Annotated[float, Meta(ge=0.5, le=100.0, description="m between neighbours")] = 0.8
    team: Annotated[
        tuple[Annotated[int, Meta(ge=0, le=names.MAX_ROBOT_ID)], ...],
        Meta(description="ids that form it; empty: all that are alive and run `formation` with this leader"),
    ] = ()
    max_linear: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 1.0
    max_angular: Annotated[float, Meta(ge=0.1, le=math.pi, description="rad/s")] = 2.0
    stale_after: Annotated[float, Meta(ge=0.0, le=10.0, description="s; it stands on older poses of the leader")] = 0.5


class Formation(Behavior):
    """Keep a slot of a formation behind a leader: line, column, wedge, diamond or circle.

    The slots lie along the leader's trail. All robots of the formation compute from the same poses which of them takes
    which slot.
    """

    Params = FormationParams
    params: FormationParams
    uses_tf = True
    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = STATUSES

    def __init__(self, params: FormationParams) -> None:
        super().__init__(params)
        self.leader: int = params.leader
        self._assignment = Assignment()
        self._others = Others()
        self._trail = LeaderTrail()
        self._squeeze = Squeeze()
        self._making_way, self._detour, self._escape = MakingWay(), Detour(), Escape()
        self._is_parked = False
        self._rank = 0
        """The number of its slot."""

    def on_params(self) -> None:
        """Follow the leader that `params` names; another shape or spacing counts at the next step."""
        if self.params.leader != self.leader:
            self.leader = self.params.leader
            self._trail.forget()
        self._assignment.forget()

    def missing(self, view: View) -> list[str]:
        """The leader's pose, as long as it is not there or old."""
        leader, _ = self._see_leader(view)
        return [] if leader else [f"the pose of its leader {names.robot_name(self.leader)}"]

    def step(self, view: View) -> Twist:
        """Towards its slot, or zero in the slot of a leader that stands."""
        own = view.map_from_base()
        leader, self.reason = self._see_leader(view)
        if leader is None or own is None:
            self.reason = self.reason or f"its own pose in {names.MAP_FRAME} is not known"
            self._trail.forget()
            self._making_way.forget()
            return Twist()
        here = own[0]
        members = self._members(view)
        others = self._others.take(view, here, {*members, self.leader})
        self._trail.take(leader.pose, leader.stamp or view.now, (len(members) + 1) * self.params.spacing + KEPT)
        target = self._find_target(view, here, {robot: others[robot] for robot in members if robot in others})
        limits = Limits(self.params.max_linear, self.params.max_angular)
        command = self._making_way.step(view, here, leader.pose, others.values(), limits)
        if command is not None:
            self.reason = f"makes way: {names.robot_name(self.leader)} turns back"
        elif self._parks(math.dist(target.pose[:2], here[:2])):
            self.reason = f"in its slot; leader {names.robot_name(self.leader)} stands"
            return turn_to(target.pose.yaw - here.yaw, limits.angular)
        elif self._detour.is_needed(view, here, target.pose):
            command = self._detour.step(view, here, self._trail, target.pose, limits)
        else:
            way = self._in_the_way(here, others)
            command, waits_for = drive_to(here, target, way, self._room, limits.linear, limits.angular)
            self.reason = f"waits: {names.robot_name(waits_for)} comes past" if waits_for is not None else ""
        return self._escape.free(view, here, command)

    def why_it_rests(self) -> str:
        """It would come too near to another robot, or is told to."""
        return "gives way to others" if self.params.max_linear else "its parameter max_linear is 0"

    def _see_leader(self, view: View) -> tuple[Seen | None, str]:
        return see_robot(view, self.leader, names.MAP_FRAME, self.params.stale_after)

    def _members(self, view: View) -> list[int]:
        """The robots that form it, itself among them, by id."""
        statuses: Mapping[int, Any] = view.inputs.get("statuses") or {}
        told = self.params.team or [
            robot
            for robot, status in statuses.items()
            if status.behavior == "formation" and status.leader == self.leader
        ]
        alive = set(told) & set(view.team) if view.team else set(told)
        return sorted((alive | {view.robot_id}) - {self.leader})

    def _find_target(self, view: View, here: Pose2, members: dict[int, Other]) -> Target:
        """The own slot now."""
        params, assignment, trail = self.params, self._assignment, self._trail
        members[view.robot_id] = Other(here.x, here.y)
        slots = slots_of(params.shape, len(members), params.spacing)
        is_due = assignment.is_due(view.now, members)
        if is_due:
            # Not squeezed: each robot squeezes for itself, and all have to assign alike.
            assignment.look(view.now, members, [self._place(slot)[:2] for slot in slots])
        self._rank = assignment.slot_of(view.robot_id) or 0
        slot = squeeze(slots[self._rank], self._rank, params.spacing, self._squeeze.share)
        bend = trail.curvature(trail.place - slot.back)
        if is_due:
            self._squeeze.needed = self._needed_share(
                view, here, slot, *reach_of(params.shape, len(slots), params.spacing)
            )
        self._squeeze.step(view.dt)
        return Target(self._place(slot), trail.speed * (1.0 - bend * slot.lateral), trail.speed * bend)

    def _needed_share(self, view: View, here: Pose2, own: Slot, left: float, right: float) -> float:
        """What share of the squeeze the bend and the walls need: at the leader, and where the own slot is."""
        if not left and not right:
            return 0.0
        trail = self._trail
        places = trail.place, trail.place - own.back
        needed = max(share_for_bend(trail.curvature(place), left, right) for place in places)
        if view.scan is None:
            return needed
        to_base = here.inverse()
        poses = [to_base.compose(trail.at(place)) for place in places]
        mates = [(mate.pose.x, mate.pose.y) for mate in view.teammates]
        return max(needed, share_for_room(view.scan, poses, mates, left, right, view.base.half_width))

    def _place(self, slot: Slot) -> Pose2:
        return self._trail.at(self._trail.place - slot.back).compose(Pose2(0.0, slot.lateral, 0.0))

    def _in_the_way(self, here: Pose2, others: Mapping[int, Other]) -> list[Other]:
        """The robots that it gives way to: the leader, those with a slot before its own, that stand or are near."""
        room, slot_of = self._room, self._assignment.slot_of
        return [
            other
            for robot, other in others.items()
            if (slot_of(robot) or -1) < self._rank
            or other.speed < STANDING
            or math.hypot(other.x - here.x, other.y - here.y) < room
        ]

    @property
    def _room(self) -> float:
        return min(ROOM, 0.75 * self.params.spacing)

    def _parks(self, distance: float) -> bool:
        """Whether it stands in the slot of a leader that stands."""
        self._is_parked = abs(self._trail.speed) <= STANDING and distance < (LEFT if self._is_parked else PARKED)
        return self._is_parked
