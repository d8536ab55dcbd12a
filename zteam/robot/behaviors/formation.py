"""Keep a place in a formation behind a leader."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from msgspec import Meta, Struct

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Message, Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.evasion import Around, Escape
from zteam.robot.behaviors.leader_trail import LeaderTrail
from zteam.robot.behaviors.line import STATUSES, see_robot
from zteam.robot.behaviors.line_room import MOVED, BoxedIn, Stray
from zteam.robot.behaviors.polyline import SpeedLimits
from zteam.robot.behaviors.slots import (
    Assignment,
    Shape,
    Slot,
    approach,
    reach_of,
    share_for_bend,
    share_for_room,
    slots_of,
    squeeze,
)
from zteam.robot.scans import is_clear
from zteam.robot.view import NO_POSE, View, own_pose

ROOM, BESIDE = 1.6, 0.75
"""Metres that it gets ahead, and on either side of its way."""
STEP = 1.5
"""Metres to the place that a robot drives to: it goes on from there as long as it has to."""
SLOT_GAIN, TURN_GAIN = 2.0, 3.0
"""1/s: speed towards the slot, and turn rate."""
SPOT_ANGLE = 1.0
"""Radians: it turns on the spot towards a direction that is further off."""
STANDING = 0.02
"""m/s: what is slower stands."""
LEAST_FORWARD = 0.05
"""m/s along the slot's heading while the slot moves: a robot ahead of its slot waits for it and does not turn back."""
ALIGNED = 0.05
"""Radians to a heading from which on it does not turn."""
ALONG, MARGIN = 0.4, 0.03
"""Metres between the places of the trail to which it looks, and that have to be free beside it on the way there."""
PARKED, LEFT = 0.04, 0.12
"""Metres to the slot of a standing leader at which it stops, and at which it goes on."""
KEPT = 20.0
"""Metres of the leader's trail behind the last slot that are kept, for robots that were left behind."""
NEAR = 0.5
"""Metres to the slot within which it moves and turns as the slot does."""
APART = 0.75
"""Of the spacing: no robot stands nearer to its leader."""
MATE_REACH, MATE_MARGIN = 2.2, 0.1
"""Metres ahead up to which others are in the way to its slot, and metres that are left beside them."""
STALE_AFTER = 1.0
"""Seconds; a member with an older pose is not seen any more."""


class MakingWay:
    """Drives off until the leader has room, and then aside as long as the leader comes towards it."""

    def __init__(self) -> None:
        self._boxed_in = BoxedIn()
        self._is_asked = False
        self._around = Around()

    def forget(self) -> None:
        """The leader is not seen."""
        self._boxed_in, self._is_asked = BoxedIn(), False

    def step(self, view: View, here: Pose2, leader: Pose2, limits: SpeedLimits) -> Twist | None:
        """The velocity of a robot that is in the way; None for one that is not. Poses are in map."""
        is_boxed = self._boxed_in.look(view.now, leader)
        if not is_boxed and not self._is_asked:
            return None
        x, y, yaw = leader.inverse().compose(here)
        apart, at = math.hypot(x, y), here.inverse().compose(leader)
        nearer = sum(math.dist(at[:2], mate.pose[:2]) < apart - MOVED for mate in view.teammates) - 1
        comes = x > 0.0 and abs(y) < BESIDE and apart < 2.0 * ROOM
        self._is_asked = apart < ROOM + BESIDE * max(0, nearer) if is_boxed else comes
        if not self._is_asked:
            return None
        away = math.atan2(y, x) if is_boxed else math.copysign(0.25 * math.pi, y)
        return self._around.drive_to(view, STEP * math.cos(away - yaw), STEP * math.sin(away - yaw), limits)


def hold(slot: Pose2, speed: float, turn: float, limits: SpeedLimits) -> Twist:
    """The velocity that keeps a robot in a slot that is near (own base frame) and moves (m/s ahead, rad/s)."""
    cos, sin = math.cos(slot.yaw), math.sin(slot.yaw)
    forward, side = speed + SLOT_GAIN * (cos * slot.x + sin * slot.y), SLOT_GAIN * (cos * slot.y - sin * slot.x)
    if speed > STANDING:
        forward = max(forward, LEAST_FORWARD)
    wanted, angle = math.hypot(forward, side), normalize_angle(math.atan2(side, forward) + slot.yaw)
    if wanted < STANDING:
        return Twist()
    ahead = min(wanted, limits.linear) * math.cos(angle) if abs(angle) < SPOT_ANGLE else 0.0
    return Twist(Vector3(ahead), Vector3(z=_limit(TURN_GAIN * angle + turn, limits)))


def turn_to(angle: float, limits: SpeedLimits) -> Twist:
    """Turn on the spot by this angle (rad)."""
    return Twist(angular=Vector3(z=0.0 if abs(angle) < ALIGNED else _limit(TURN_GAIN * angle, limits)))


def _limit(turn: float, limits: SpeedLimits) -> float:
    return max(-limits.angular, min(limits.angular, turn))


def find_goal(view: View, here: Pose2, slot: Pose2, speed: float, trail: LeaderTrail, place: float) -> Pose2:
    """Where to drive that is far from its slot, which moves (m/s) at this place of the trail; in the own base frame.

    It goes along the trail where a wall is between. `here` is the own pose in map.
    """
    if not _is_in_sight(view, slot):
        to_base, path = here.inverse(), trail.path
        while place > path.start:
            seen = to_base.compose(path.at(place))
            if math.hypot(seen.x, seen.y) > ALONG and _is_in_sight(view, seen):
                return seen
            place -= ALONG
    # So far ahead that the robot has the slot's speed when it is there.
    return slot.compose(Pose2(max(0.0, speed) / SLOT_GAIN, 0.0, 0.0))


def _is_in_sight(view: View, place: Pose2) -> bool:
    """Whether there is room for the robot all the way to a place in its base frame."""
    reach, bearing = math.hypot(place.x, place.y), math.atan2(place.y, place.x)
    return view.scan is None or is_clear(view.scan, view.base.half_width + MARGIN, reach, bearing)


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
        self._trail = LeaderTrail()
        self._squeezed = self._needed = 0.0
        """The share of the way from the shape's slots to those of the column, 0 to 1: now, and as the room needs it."""
        self._making_way, self._around, self._escape = MakingWay(), Around(SLOT_GAIN, MATE_REACH, MATE_MARGIN), Escape()
        self._stray = Stray()
        self._is_parked = False

    def on_params(self) -> None:
        """Follow the leader that `params` names; another shape or spacing counts at the next step."""
        if self.params.leader != self.leader:
            self.leader = self.params.leader
            self._trail.forget()
        # Assign anew at the next look.
        self._assignment.slots = {}

    def on_release(self) -> None:
        """See Behavior: neither it nor its leader is boxed in because it stood."""
        self._stray.rest()
        self._escape.rest()
        self._making_way.forget()

    def missing(self, view: View) -> list[str]:
        leader, _ = see_robot(view, self.leader, names.MAP_FRAME, self.params.stale_after)
        return [] if leader else [f"the pose of its leader {names.robot_name(self.leader)}"]

    def step(self, view: View) -> Twist:
        """Towards its slot, or zero in the slot of a leader that stands."""
        here = own_pose(view)
        leader, self.reason = see_robot(view, self.leader, names.MAP_FRAME, self.params.stale_after)
        if leader is None or here is None:
            self.reason = self.reason or NO_POSE
            self._trail.forget()
            self._making_way.forget()
            return Twist()
        members = self._members(view)
        self._trail.add(leader.pose, leader.stamp or view.now, (len(members) + 1) * self.params.spacing + KEPT)
        slot, target = self._apart(self._find_slot(view, here, members))
        limits = SpeedLimits(self.params.max_linear, self.params.max_angular)
        command = self._drive(view, here, slot, target, limits)
        stray = self._stray.step(view, here, limits, wants=command.linear.x != 0.0)
        if stray is None:
            return self._escape.free(view, command)
        self.reason = "boxed in: leaves its way to its slot"
        return stray

    def _drive(self, view: View, here: Pose2, slot: Slot, target: Pose2, limits: SpeedLimits) -> Twist:
        trail, at = self._trail, here.inverse().compose(target)
        distance, place = math.hypot(at.x, at.y), trail.place - slot.back
        command = self._making_way.step(view, here, trail.leader, limits)
        if command is not None:
            self.reason = f"makes way: {names.robot_name(self.leader)} turns back"
            return command
        self._is_parked = abs(trail.speed) <= STANDING and distance < (LEFT if self._is_parked else PARKED)
        if self._is_parked:
            self.reason = f"in its slot; leader {names.robot_name(self.leader)} stands"
            return turn_to(at.yaw, limits)
        bend = trail.curvature(place)
        speed = trail.speed * (1.0 - bend * slot.lateral)
        if distance < NEAR:
            return hold(at, speed, trail.speed * bend, limits)
        goal = find_goal(view, here, at, speed, trail, place)
        return self._around.drive_to(view, goal.x, goal.y, limits)

    def why_it_rests(self) -> str:
        return "in its slot" if self.params.max_linear else "its parameter max_linear is 0"

    def _members(self, view: View) -> dict[int, Pose2]:
        """The robots that form it and are seen, itself among them, in its own base frame."""
        statuses: Mapping[int, Any] = view.inputs.get("statuses") or {}
        told = self.params.team or [
            robot
            for robot, status in statuses.items()
            if status.behavior == "formation" and status.leader == self.leader
        ]
        found = {
            robot: pose
            for robot, pose, age, _base in view.teammates
            if robot in told and robot != self.leader and (robot in view.team or not view.team) and age < STALE_AFTER
        }
        return {**found, view.robot_id: Pose2(0.0, 0.0, 0.0)}

    def _find_slot(self, view: View, here: Pose2, members: Mapping[int, Pose2]) -> Slot:
        params, assignment = self.params, self._assignment
        slots = slots_of(params.shape, len(members), params.spacing)
        is_due = assignment.is_due(view.now, members)
        if is_due:
            # Not squeezed: each robot squeezes for itself, and all have to assign alike.
            places = {robot: here.compose(pose)[:2] for robot, pose in members.items()}
            assignment.look(view.now, places, [self._place(slot)[:2] for slot in slots])
        rank = assignment.slots.get(view.robot_id, 0)
        slot = squeeze(slots[rank], rank, params.spacing, self._squeezed)
        if is_due:
            self._needed = self._needed_share(view, here, slot, *reach_of(slots))
        self._squeezed = approach(self._squeezed, self._needed, view.dt)
        return slot

    def _apart(self, slot: Slot) -> tuple[Slot, Pose2]:
        """The slot and its pose in map; further back where the leader has come back to it: it needs room to turn."""
        trail, place = self._trail, self._place(slot)
        least = APART * self.params.spacing
        while math.dist(place[:2], trail.leader[:2]) < least and trail.place - slot.back > trail.path.start:
            slot = Slot(slot.back + least, slot.lateral)
            place = self._place(slot)
        return slot, place

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
