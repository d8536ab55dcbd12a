"""Keep a place in a formation behind a leader.

A slot lies so far back along the leader's trail, and so far to the left of it. So a formation goes round a bend as a
train does, and does not swing outwards like a board. It is squeezed to a column where walls are near, and where it
goes round a tight bend. Between two walls its robots are a line, each behind the next one, until all are out: so they
get out of a dead end, the last one first.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from functools import lru_cache
from itertools import combinations
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from msgspec import Meta, Struct

from zteam import names
from zteam.config.robot_ids import chain_from
from zteam.geometry import Point2, Pose2, normalize_angle
from zteam.kernels import formations as kernels
from zteam.kernels.polylines import LeaderTrail
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.escape import Escape
from zteam.robot.behaviors.evasion import MOVED, Around, BoxedIn
from zteam.robot.behaviors.line import Line, see_robot
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.behaviors.row import Row, share_for_room
from zteam.robot.behaviors.trail import HEAD_SPEED, HEAD_TURN_RATE, LineMember
from zteam.robot.view import NO_POSE, View, is_clear, own_pose

Shape = Literal["line", "column", "wedge", "diamond", "circle"]
_RISE = math.sqrt(0.5)


class Slot(NamedTuple):
    """A place in a formation: metres."""

    back: float
    """Arc length behind the leader along its trail."""
    lateral: float
    """To the left of the trail."""


@lru_cache(maxsize=64)
def slots_of(shape: Shape, count: int, spacing: float) -> tuple[Slot, ...]:
    """The slots of `count` followers, the foremost first. Neighbours are about `spacing` metres apart.

    `line`: side by side with the leader in the middle. `column`: one behind the other. `wedge`: two arms that go back
    from the leader at a right angle. `diamond`: along the sides of a square that stands on the leader's corner.
    `circle`: on a circle.
    """
    return tuple(sorted(_SLOTS[shape](count, spacing), key=lambda slot: (round(slot.back, 6), abs(slot.lateral))))


def squeeze(slot: Slot, rank: int, spacing: float, share: float) -> Slot:
    """A slot moved by `share` (0 to 1) towards place `rank` (from 0) of the column.

    It is at its place along the column at a share of a half: two slots side by side come one behind the other before
    they come together.
    """
    column = (rank + 1) * spacing
    return Slot(slot.back + min(1.0, 2.0 * share) * (column - slot.back), (1.0 - share) * slot.lateral)


def _diamond(count: int, spacing: float) -> list[Slot]:
    quarter = 0.25 * (count + 1)
    slots = []
    for place in range(1, count + 1):
        # From the leader's corner along the left sides, and back along the right ones.
        along = min(place, 4.0 * quarter - place)
        lateral = min(along, 2.0 * quarter - along)
        slots.append(Slot(along, lateral if place <= 2.0 * quarter else -lateral))
    # Two neighbours with a corner between them are nearer than along the sides.
    nearest = min(math.dist(a, b) for a, b in combinations([Slot(0.0, 0.0), *slots], 2))
    return [Slot(slot.back * spacing / nearest, slot.lateral * spacing / nearest) for slot in slots]


def _circle(count: int, spacing: float) -> list[Slot]:
    step = math.tau / (count + 1)
    radius = 0.5 * spacing / math.sin(0.5 * step)
    turns = [place * step for place in range(1, count + 1)]
    return [Slot(radius * (1.0 - math.cos(turn)), radius * math.sin(turn)) for turn in turns]


def _pairs(count: int) -> Iterator[tuple[int, float]]:
    """The number of the pair and the side (1 left, -1 right) of each follower."""
    return ((place // 2 + 1, -1.0 if place % 2 else 1.0) for place in range(count))


_SLOTS: dict[Shape, Callable[[int, float], list[Slot]]] = {
    "line": lambda count, spacing: [Slot(0.0, side * pair * spacing) for pair, side in _pairs(count)],
    "column": lambda count, spacing: [Slot((place + 1) * spacing, 0.0) for place in range(count)],
    "wedge": lambda count, spacing: [
        Slot(_RISE * pair * spacing, side * _RISE * pair * spacing) for pair, side in _pairs(count)
    ],
    "diamond": _diamond,
    "circle": _circle,
}


BEND = 0.9
"""The outermost slot lies within this share of the radius of a bend."""
CLOSING, OPENING = 0.5, 0.13
"""1/s: how fast the formation closes and opens."""


def approach(share: float, needed: float, dt: float) -> float:
    """The share after `dt` seconds: it closes faster than it opens, so a doorway does not open it."""
    return min(needed, share + CLOSING * dt) if needed > share else max(needed, share - OPENING * dt)


def share_for_bend(curvature: float, left: float, right: float) -> float:
    """The share that a bend (1/m, left positive) needs for slots that reach so far (m) to the left and to the right."""
    width = abs(curvature) * (left if curvature > 0.0 else right)
    return max(0.0, 1.0 - BEND / width) if width > BEND else 0.0


def assign(costs: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row in the cheapest assignment of a square table of costs: always the same; n³ steps."""
    return kernels.assign(np.array(costs, float).reshape(len(costs), len(costs)))


_PERIOD = 500_000_000
"""Nanoseconds between two looks for a better assignment: at the same times in all robots."""
_BETTER = 0.7
"""A new assignment costs at most this share of the present one: so slots do not flip where two cost nearly the same."""


def reassign(
    slots: Mapping[int, int], members: Mapping[int, Sequence[float]], places: Sequence[tuple[float, float]]
) -> dict[int, int]:
    """The slot of each member at these places, by robot id: the least squared distances, so straight ways do not cross.

    `slots` are those of now, which stay where others are not much better.
    """
    robots = sorted(members)
    costs = [[math.dist(members[robot], place) ** 2 for place in places] for robot in robots]
    best = assign(costs)
    if slots.keys() == members.keys():
        present = sum(costs[row][slots[robot]] for row, robot in enumerate(robots))
        if sum(costs[row][column] for row, column in enumerate(best)) > _BETTER * present:
            return {**slots}
    return dict(zip(robots, best, strict=True))


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
    return Twist(Vector3(ahead), Vector3(z=limits.clamp_turn(TURN_GAIN * angle + turn)))


def find_goal(view: View, here: Pose2, slot: Pose2, speed: float, trail: LeaderTrail, place: float) -> Point2:
    """Where to drive that is far from its slot, which moves (m/s) at this place of the trail; in the own base frame.

    It goes along the trail where a wall is between. `here` is the own pose in map.
    """
    if not _is_in_sight(view, slot.x, slot.y):
        while place > trail.path.start:
            seen = here.locate(*trail.path.point(place))
            if math.hypot(*seen) > ALONG and _is_in_sight(view, *seen):
                return seen
            place -= ALONG
    # So far ahead that the robot has the slot's speed when it is there.
    return slot.compose(Pose2(max(0.0, speed) / SLOT_GAIN, 0.0, 0.0))[:2]


def _is_in_sight(view: View, x: float, y: float) -> bool:
    """Whether there is room for the robot all the way to a place in its base frame."""
    reach, bearing = math.hypot(x, y), math.atan2(y, x)
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


class Formation(LineMember):
    """Keep a slot of a formation behind a leader: line, column, wedge, diamond or circle.

    The slots lie along the leader's trail. All robots of the formation compute from the same poses which of them takes
    which slot.
    """

    Params = FormationParams
    params: FormationParams
    uses_tf = True

    def __init__(self, params: FormationParams) -> None:
        super().__init__(params)
        self.steering = None
        self._leads: int = params.leader
        self.leader: int = params.leader
        """The robot that leads; and while this one is in a file, the one ahead of it there."""
        self._slots: dict[int, int] = {}
        """The number of each member's slot, by robot id."""
        self._assigned = -1
        """The period in which they were assigned."""
        self._driven = LeaderTrail()
        self._squeezed = self._needed = 0.0
        """The share of the way from the shape's slots to those of the column, 0 to 1: now, and as the room needs it."""
        self._around, self._around_leader = Around(SLOT_GAIN, MATE_REACH, MATE_MARGIN), Around()
        self._boxed_in, self._escape = BoxedIn(), Escape()
        self._before = 0
        """How many robots were before it in the file."""
        self._row = Row()
        self._makes_way = self._is_parked = False
        self._told: Set[int] = frozenset()
        """The other robots that form it, as found by what follows."""
        self._statuses: object = self
        self._found_by: tuple[object, ...] = ()

    def on_params(self) -> None:
        """Follow the leader that `params` names; another shape or spacing counts at the next step."""
        if self.params.leader != self._leads:
            self._leads = self.params.leader
            self._driven.forget()
        self._leave_file()
        # Assign anew at the next look.
        self._slots = {}

    def on_release(self) -> None:
        """See Behavior: neither it nor its leader is boxed in because it stood."""
        super().on_release()
        self._escape.rest()
        self._boxed_in.rest()
        self._makes_way = False

    @property
    def _may_turn(self) -> bool:
        return self.gap > 0.0

    def missing(self, view: View) -> list[str]:
        leader, _ = see_robot(view, self._leads, self.params.stale_after)
        return [] if leader else [f"the pose of its leader {names.robot_name(self._leads)}"]

    def step(self, view: View) -> Twist:
        """Towards its slot, or zero in the slot of a leader that stands."""
        here = own_pose(view)
        leader, self.reason = see_robot(view, self._leads, self.params.stale_after)
        if leader is None or here is None:
            self.reason = self.reason or NO_POSE
            self._driven.forget()
            self.on_release()
            return Twist()
        members = self._members(view, here)
        trail, pose, stamp = self._driven, leader[0], leader[1] or view.now
        if not trail.add(pose, stamp, (len(members) + 1) * self.params.spacing + KEPT):
            trail.begin(pose, (), pose, stamp)
        slot, target = self._apart(self._find_slot(view, here, members))
        limits = SpeedLimits(self.params.max_linear, self.params.max_angular)
        if self.gap:
            role, speed = self._find_role(view, self.leader), min(HEAD_SPEED, limits.linear)
            if len(role.before) > self._before:
                # Its way to the head leads over the places of those between.
                self._trail.forget()
            self._before = len(role.before)
            return self._drive_in_line(view, role, limits, speed, HEAD_TURN_RATE)
        command, way = self._drive(view, here, pose, slot, target, limits)
        if self._escape.makes_room(view, counts=not self._is_parked):
            command, way = Twist(angular=Vector3(z=1.0)), []
        command = self._escape.free(view, command, way)
        if self._escape.is_moving:
            self.reason = "boxed in: leaves its way to its slot"
        return command

    def _drive(
        self, view: View, here: Pose2, leader: Pose2, slot: Slot, target: Pose2, limits: SpeedLimits
    ) -> tuple[Twist, list[Point2]]:
        """The velocity, and the place in the base frame to which it leads; none where the robot is in its slot."""
        trail, at = self._driven, here.inverse().compose(target)
        distance, place = math.hypot(at.x, at.y), trail.place - slot.back
        away = self._make_way(view, here, leader)
        if away is not None:
            self.reason = f"makes way: {names.robot_name(self.leader)} turns back"
            return self._around_leader.drive_to(view, *away, limits), [away]
        self._is_parked = abs(trail.speed) <= STANDING and distance < (LEFT if self._is_parked else PARKED)
        if self._is_parked:
            self.reason = f"in its slot; leader {names.robot_name(self.leader)} stands"
            turn = 0.0 if abs(at.yaw) < ALIGNED else limits.clamp_turn(TURN_GAIN * at.yaw)
            return Twist(angular=Vector3(z=turn)), []
        bend = trail.curvature(place)
        speed = trail.speed * (1.0 - bend * slot.lateral)
        if distance < NEAR:
            return hold(at, speed, trail.speed * bend, limits), [at[:2]]
        goal = find_goal(view, here, at, speed, trail, place)
        return self._around.drive_to(view, *goal, limits), [goal]

    def _make_way(self, view: View, here: Pose2, leader: Pose2) -> Point2 | None:
        """Off from a leader that is boxed in until that has room, then aside as long as it comes; None to its slot."""
        is_boxed = self._boxed_in.look(view.now, leader)
        if not (is_boxed or self._makes_way):
            return None
        x, y, yaw = leader.inverse().compose(here)
        apart, at = math.hypot(x, y), here.inverse().compose(leader)
        if is_boxed:
            nearer = sum(math.dist(at[:2], mate.pose[:2]) < apart - MOVED for mate in view.teammates) - 1
            self._makes_way = apart < ROOM + BESIDE * max(0, nearer)
        else:
            self._makes_way = x > 0.0 and abs(y) < BESIDE and apart < 2.0 * ROOM
        if not self._makes_way:
            return None
        away = (math.atan2(y, x) if is_boxed else math.copysign(0.25 * math.pi, y)) - yaw
        return STEP * math.cos(away), STEP * math.sin(away)

    def why_it_rests(self) -> str:
        if not self.params.max_linear:
            return "its parameter max_linear is 0"
        return super().why_it_rests() if self.gap else "in its slot"

    def _members(self, view: View, here: Pose2) -> dict[int, Pose2]:
        """The robots that form it and are seen, itself among them, in map."""
        statuses: Mapping[int, Any] | None = view.inputs.get("statuses")
        found_by = self.leader, self._leads, self.params.team
        if statuses is not self._statuses or found_by != self._found_by:
            self._statuses, self._found_by, self._told = statuses, found_by, self._find_told(view, statuses or {})
        seen = ((robot, view.map_from_robot(robot)) for robot in self._told if robot in view.team or not view.team)
        found = {robot: at[0] for robot, at in seen if at and (not at[1] or view.is_fresh(at[1], STALE_AFTER))}
        return {**found, view.robot_id: here}

    def _find_told(self, view: View, statuses: Mapping[int, Any]) -> Set[int]:
        """The other robots that form it, as they say or as `team` says."""
        # The robots of a file get into it one after the other, and all are members meanwhile.
        leaders = {
            robot: status.leader
            for robot, status in statuses.items()
            if status.gap > 0.0 or (status.behavior == "formation" and status.leader == self._leads)
        }
        told = self.params.team or [
            robot
            for robot, status in statuses.items()
            if status.behavior == "formation"
            and self._leads in chain_from(robot, {**leaders, view.robot_id: self.leader, robot: status.leader})
        ]
        return {*told} - {self._leads}

    def _find_slot(self, view: View, here: Pose2, members: Mapping[int, Pose2]) -> Slot:
        params, period = self.params, view.now // _PERIOD
        slots = slots_of(params.shape, len(members), params.spacing)
        is_due = self._slots.keys() != members.keys() or period != self._assigned
        if is_due:
            # Not squeezed: each robot squeezes for itself, and all have to assign alike.
            places = {robot: pose[:2] for robot, pose in members.items()}
            self._slots = reassign(self._slots, places, [self._place(slot)[:2] for slot in slots])
            begins, self._assigned = self._assigned < 0, period
        rank = self._slots.get(view.robot_id, 0)
        slot = squeeze(slots[rank], rank, params.spacing, self._squeezed)
        if is_due:
            self._needed = self._needed_share(view, here, slot, slots)
            self._keep_file(view, here, members, begins=begins)
        self._squeezed = approach(self._squeezed, self._needed, view.dt)
        return slot

    def _apart(self, slot: Slot) -> tuple[Slot, Pose2]:
        """The slot and its pose in map; further back where the leader has come back to it: it needs room to turn."""
        trail, place = self._driven, self._place(slot)
        least = APART * self.params.spacing
        while math.dist(place[:2], trail.leader[:2]) < least and trail.place - slot.back > trail.path.start:
            slot = Slot(slot.back + least, slot.lateral)
            place = self._place(slot)
        return slot, place

    def _needed_share(self, view: View, here: Pose2, own: Slot, slots: Sequence[Slot]) -> float:
        """What share of the squeeze the bend and the walls need: at the leader, and where the own slot is."""
        # Metres that they reach to the left and to the right of the trail, to the micrometre.
        laterals = [0.0, *(round(slot.lateral, 6) for slot in slots)]
        left, right = max(laterals), -min(laterals)
        if not left and not right:
            return 0.0
        trail = self._driven
        places = trail.place, trail.place - own.back
        needed = max(share_for_bend(trail.curvature(place), left, right) for place in places)
        if view.scan is None:
            return needed
        to_base = here.inverse()
        poses = [to_base.compose(Pose2(*trail.at(place))) for place in places]
        mates = [(mate.pose.x, mate.pose.y) for mate in view.teammates]
        return max(needed, share_for_room(view.scan, poses, mates, left, right, view.base.half_width))

    def _keep_file(self, view: View, here: Pose2, members: Mapping[int, Pose2], *, begins: bool) -> None:
        """Be in a file from where walls are on both sides on, until no robot is where they are. The first of its robots
        says so, but where it begins: all are in it, or none is."""
        places = {robot: pose[:2] for robot, pose in members.items()}
        self._row.look(view, here)
        first = (view.inputs.get("statuses") or {}).get(min(members))
        if first is not None and first.robot_id != view.robot_id and not begins:
            is_narrow = first.gap > 0.0
        else:
            around = [self._driven.leader[:2], *places.values()] if self.gap else [here[:2]]
            is_narrow = any(map(self._row.is_between_walls, around))
        if not is_narrow:
            self._leave_file()
            return
        is_new = not self.gap
        self._line, self.gap = Line() if is_new else self._line, self.params.spacing
        self.leader = self._row.find_ahead(view, self._leads, members, self.leader, self._line.turns, is_new=is_new)

    def _leave_file(self) -> None:
        self.leader, self.follows, self.gap, self._before = self._leads, None, 0.0, 0

    def _place(self, slot: Slot) -> Pose2:
        return Pose2(*self._driven.at(self._driven.place - slot.back, slot.lateral))
