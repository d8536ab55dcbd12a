"""Keep a place in a formation behind a leader.

A slot lies so far back along the leader's trail, and so far to the left of it. So a formation goes round a bend as a
train does, and does not swing outwards like a board. It is squeezed to a column where walls are near, and where it
goes round a tight bend.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import combinations
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from msgspec import Meta, Struct

from zteam import names
from zteam.clock import to_ns
from zteam.geometry import Point2, Pose2, normalize_angle
from zteam.messages import LaserScan, Message, Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.escape import Escape
from zteam.robot.behaviors.evasion import MOVED, STRAY, Around, BoxedIn
from zteam.robot.behaviors.line import STATUSES, see_robot, waits_for
from zteam.robot.behaviors.path import LOOK_AHEAD, LeaderTrail, Polyline, SpeedLimits
from zteam.robot.behaviors.wander import draw_heading
from zteam.robot.view import NO_POSE, Teammate, View, beams_of, is_clear, own_pose

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


BESIDE_MARGIN = 0.1
"""Metres that have to be free beside the outermost robot."""
BEHIND, AHEAD = 0.5, 1.5
"""Metres along the trail, from the leader and from the own slot, within which walls count."""
BODY = 0.45
"""Metres around another robot within which a hit is that robot."""
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


def share_for_room(
    scan: LaserScan,
    places: Sequence[Pose2],
    others: Sequence[tuple[float, float]],
    left: float,
    right: float,
    half_width: float,
) -> float:
    """The share that walls beside these places of the trail need, without hits on the others. Own base frame."""
    beside = half_width + BESIDE_MARGIN
    # What is further to the side needs nothing.
    side = max(left, right) + beside
    bound = math.hypot(side, AHEAD) + max(math.hypot(place.x, place.y) for place in places)
    beams = beams_of(scan)
    if beams is None or beams.nearest >= bound:
        return 0.0
    hits = beams.find_hits(bound)
    for x, y in others:
        hits = hits[:, np.hypot(hits[0] - x, hits[1] - y) > BODY]
    needed = 0.0
    for x, y, yaw in places:
        dx, dy, cos, sin = hits[0] - x, hits[1] - y, math.cos(yaw), math.sin(yaw)
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        off = across[(along > -BEHIND) & (along < AHEAD) & (np.abs(across) < side)]
        for reach, offs in ((left, off[off > 0.0]), (right, -off[off < 0.0])):
            if reach > 0.0 and offs.size:
                needed = max(needed, 1.0 - (float(offs.min()) - beside) / reach)
    return min(needed, 1.0)


def assign(costs: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row in the cheapest assignment of a square table of costs: always the same; n³ steps."""
    count = len(costs)
    row_prices, column_prices = [0.0] * (count + 1), [0.0] * (count + 1)
    # Rows and columns count from 1 here; column 0 holds the row that has no column yet.
    row_of = [0] * (count + 1)
    for row in range(1, count + 1):
        row_of[0] = row
        # The free column at the end of the cheapest chain of changes, and the column before each one in such chains.
        column, before, slack, is_used = 0, [0] * (count + 1), [math.inf] * (count + 1), [False] * (count + 1)
        while row_of[column]:
            is_used[column] = True
            chosen, least, nearest = row_of[column], math.inf, 0
            for other in range(1, count + 1):
                if is_used[other]:
                    continue
                cost = costs[chosen - 1][other - 1] - row_prices[chosen] - column_prices[other]
                if cost < slack[other]:
                    slack[other], before[other] = cost, column
                if slack[other] < least:
                    least, nearest = slack[other], other
            for other in range(count + 1):
                if is_used[other]:
                    row_prices[row_of[other]] += least
                    column_prices[other] -= least
                else:
                    slack[other] -= least
            column = nearest
        while column:
            row_of[column] = row_of[before[column]]
            column = before[column]
    columns = [0] * count
    for column, row in enumerate(row_of[1:]):
        columns[row - 1] = column
    return columns


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
NEXT, LOOP = 0.2, 0.35
"""Metres between two points of a trail that is looked at for loops, and to which the points of one come together."""
NARROW, NARROW_FOR = 0.8, to_ns(5.0)
"""What the shares come to that the walls on either side of a corridor need of a spacing, and for how long it counts."""
ROOM_BACK, COMES, BOXED_FOR = 1.2, 0.6, to_ns(10.0)
"""Metres that a leader gets besides the spacing that turns to the way back, metres of that way to which it does, and
nanoseconds for which it gets them where it was boxed in."""
BLOCKED_FOR, AIMS_FOR = to_ns(5.0), to_ns(8.0)
"""Nanoseconds behind one that does not get on, and after which it looks elsewhere for a way on."""
JOINS = 1.5
"""Of the spacing, up to which a robot beyond the beginning of the way to the trail makes it longer."""
AROUND = 4.0
"""Metres from the robot within which its way is told where it is stuck."""
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


def chain_to(end: Point2, places: Iterable[Point2]) -> Polyline:
    """Over these places to `end`, from each to the nearest of the others: a wall may be between."""
    way, rest = [end], list(places)
    while rest:
        way.append(min(rest, key=lambda place: math.dist(place, way[-1])))
        rest.remove(way[-1])
    return Polyline(way[::-1])


def find_way_out(trail: LeaderTrail, lead_in: Polyline) -> Polyline:
    """From the leader back over its trail, and to where that comes from, without loops and dead ends."""
    places = (trail.path.point(at) for at in np.arange(trail.path.start, trail.path.end, NEXT))
    before = (lead_in.point(at) for at in np.arange(0.0, lead_in.end, NEXT))
    points = np.array([*before, *places, trail.path.last, trail.leader[:2]])[::-1]
    at, way = 0, Polyline([points[0]])
    while at + 1 < len(points):
        near = np.hypot(*(points[at + 1 :] - points[at]).T) < LOOP
        at += 1 + (int(near.nonzero()[0][-1]) if near.any() else 0)
        way.append(*points[at].tolist())
    return way


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


def is_before(mate: Teammate, bearing: float) -> bool:
    """Whether another robot is in front of this one, if that drives towards a bearing (rad)."""
    along, across = mate.along(bearing)
    return along > abs(across)


def drive_at(target: Point2, speed: float, limits: SpeedLimits) -> Twist:
    """The velocity towards a place in the own base frame, on the spot as long as that is far to the side."""
    bearing = math.atan2(target[1], target[0])
    ahead = min(limits.linear, speed) * math.cos(bearing) if abs(bearing) < SPOT_ANGLE else 0.0
    return Twist(Vector3(ahead), Vector3(z=limits.clamp_turn(TURN_GAIN * bearing)))


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
        self._slots: dict[int, int] = {}
        """The number of each member's slot, by robot id."""
        self._assigned = -1
        """The period in which they were assigned."""
        self._trail = LeaderTrail()
        self._lead_in, self._led_in = Polyline(), 0
        """In map, to where the trail begins; and over the places of how many robots."""
        self._squeezed = self._needed = 0.0
        """The share of the way from the shape's slots to those of the column, 0 to 1: now, and as the room needs it."""
        self._around, self._around_leader = Around(SLOT_GAIN, MATE_REACH, MATE_MARGIN), Around()
        self._boxed_in, self._escape = BoxedIn(), Escape()
        self._got_on = 0
        """When it could get on last (ns)."""
        self._aim, self._aims_until = (0.0, 0.0), 0
        """Where in map it looks for a way on, and until when (ns)."""
        self._is_narrow, self._narrow_until, self._boxed_until = False, 0, 0
        """Whether it is in a corridor, until when that counts (ns); and until when its leader is to get room there."""
        self._makes_way = self._is_parked = False

    def on_params(self) -> None:
        """Follow the leader that `params` names; another shape or spacing counts at the next step."""
        if self.params.leader != self.leader:
            self.leader = self.params.leader
            self._trail.forget()
        # Assign anew at the next look.
        self._slots = {}

    def on_release(self) -> None:
        """See Behavior: neither it nor its leader is boxed in because it stood."""
        self._escape.rest()
        self._boxed_in, self._makes_way = BoxedIn(), False

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
            self.on_release()
            return Twist()
        members = self._members(view)
        trail = self._trail
        if trail.is_far(leader.pose) or (len(members) > self._led_in and trail.place - trail.path.start < NEAR):
            places = [here.compose(pose)[:2] for pose in members.values()]
            self._lead_in, self._led_in = chain_to(leader.pose[:2], places), len(members)
        self._trail.add(leader.pose, leader.stamp or view.now, (len(members) + 1) * self.params.spacing + KEPT)
        slot, target = self._apart(self._find_slot(view, here, members))
        limits = SpeedLimits(self.params.max_linear, self.params.max_angular)
        if self._is_narrow:
            command, way = self._drive_in_file(view, here, members, limits)
        else:
            command, way = self._drive(view, here, slot, target, limits)
        command = self._escape.free(view, command, way)
        if self._escape.is_moving:
            self.reason = "boxed in: leaves its way to its slot"
        return command

    def _drive(
        self, view: View, here: Pose2, slot: Slot, target: Pose2, limits: SpeedLimits
    ) -> tuple[Twist, list[Point2]]:
        """The velocity, and the way along which it leads in the base frame; none where the robot is in its slot."""
        trail, at = self._trail, here.inverse().compose(target)
        distance, place = math.hypot(at.x, at.y), trail.place - slot.back
        away = self._make_way(view, here)
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
        return self._around.drive_to(view, goal.x, goal.y, limits), self._way_to(here, slot, target)

    def _drive_in_file(
        self, view: View, here: Pose2, members: Mapping[int, Pose2], limits: SpeedLimits
    ) -> tuple[Twist, list[Point2]]:
        """As `_drive`, in a corridor: one behind the other along the way out, off from a leader that comes back."""
        for pose in members.values():
            self._lengthen(here.compose(pose)[:2])
        leader, way = self._trail.leader, find_way_out(self._trail, self._lead_in)
        if self._boxed_in.look(view.now, leader):
            self._boxed_until = view.now + BOXED_FOR
        place = way.project(here.x, here.y)
        rank = sum(way.project(*here.compose(pose)[:2]) < place for pose in members.values())
        x, y = leader.locate(*way.point(COMES))
        backs = view.now < self._boxed_until or x > abs(y)
        error = self.params.spacing * (rank + 1) + (ROOM_BACK if backs else 0.0) - place
        sign, needed = math.copysign(1.0, error), error
        error = min(error, way.end - place)
        target = here.locate(*way.point(place + sign * min(LOOK_AHEAD, abs(error))))
        # In a corridor robots do not pass each other: it stops behind the next one.
        bearing = math.atan2(target[1], target[0])
        before = [(mate.along(bearing)[0], mate.robot_id) for mate in view.teammates if is_before(mate, bearing)]
        apart, next_one = min(before, default=(math.inf, self.leader))
        error = sign * min(abs(error), max(0.0, apart - APART * self.params.spacing))
        if abs(error) > PARKED or abs(needed) < LEFT:
            self._got_on = view.now
        status = (view.inputs.get("statuses") or {}).get(next_one)
        faces = status is not None and status.waits_for == view.robot_id
        is_blocked = view.now - self._got_on > BLOCKED_FOR and (needed > 0.0 or faces)
        if is_blocked or (needed > LEFT and place > way.end - LEFT):
            # It is the first there, or stands behind one that does not get on: it looks for another way.
            self.reason = f"makes way: {names.robot_name(self.leader)} turns back"
            if view.now > self._aims_until or math.dist(here[:2], self._aim) < NEAR:
                heading = draw_heading(view)
                self._aim = here.compose(Pose2(STEP * math.cos(heading), STEP * math.sin(heading), 0.0))[:2]
                self._aims_until = view.now + AIMS_FOR
            return drive_at(here.locate(*self._aim), STRAY, limits), [here.locate(*self._aim)]
        self._aims_until = 0
        self._is_parked = abs(error) < (LEFT if self._is_parked else PARKED)
        if self._is_parked:
            is_there = abs(needed) < LEFT or not before
            self.reason = f"in its slot; leader {names.robot_name(self.leader)} stands"
            if not is_there:
                self.reason = waits_for(next_one, "is in its way")
            return Twist(), []
        command = drive_at(target, abs(self._trail.speed) + abs(error), limits)
        ahead = np.arange(place, place + error, sign * ALONG)[1:10]
        return command, [here.locate(*way.point(at)) for at in (*ahead, place + error)]

    def _lengthen(self, place: Point2) -> None:
        """The way to where the trail begins, by that of a robot which is the first there."""
        at, off = self._lead_in.near(place)
        if at <= 0.0 and LEFT < off < JOINS * self.params.spacing:
            points = [self._lead_in.point(at) for at in np.arange(0.0, self._lead_in.end, LEFT)]
            self._lead_in = Polyline([place, *points, self._lead_in.last])

    def _way_to(self, here: Pose2, slot: Slot, target: Pose2) -> list[Point2]:
        """Along the trail to its slot, in the own base frame."""
        lead_in, path, last = self._lead_in, self._trail.path, self._trail.place - slot.back
        places = [lead_in.point(place) for place in np.arange(lead_in.start, lead_in.end, ALONG)]
        places += [path.point(place) for place in np.arange(path.start, last, ALONG)]
        return [here.locate(*place) for place in (*places, target[:2]) if math.dist(place, here[:2]) < AROUND] or [
            here.locate(*target[:2])
        ]

    def _make_way(self, view: View, here: Pose2) -> Point2 | None:
        """Off from a leader that is boxed in until that has room, then aside as long as it comes; None to its slot."""
        leader = self._trail.leader
        is_boxed = self._boxed_in.look(view.now, leader)
        x, y, yaw = leader.inverse().compose(here)
        apart, at = math.hypot(x, y), here.inverse().compose(leader)
        if is_boxed:
            nearer = sum(math.dist(at[:2], mate.pose[:2]) < apart - MOVED for mate in view.teammates) - 1
            self._makes_way = apart < ROOM + BESIDE * max(0, nearer)
        else:
            self._makes_way = self._makes_way and x > 0.0 and abs(y) < BESIDE and apart < 2.0 * ROOM
        if not self._makes_way:
            return None
        away = (math.atan2(y, x) if is_boxed else math.copysign(0.25 * math.pi, y)) - yaw
        return STEP * math.cos(away), STEP * math.sin(away)

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
        params, period = self.params, view.now // _PERIOD
        slots = slots_of(params.shape, len(members), params.spacing)
        is_due = self._slots.keys() != members.keys() or period != self._assigned
        if is_due:
            # Not squeezed: each robot squeezes for itself, and all have to assign alike.
            places = {robot: here.compose(pose)[:2] for robot, pose in members.items()}
            self._slots = reassign(self._slots, places, [self._place(slot)[:2] for slot in slots])
            self._assigned = period
        rank = self._slots.get(view.robot_id, 0)
        slot = squeeze(slots[rank], rank, params.spacing, self._squeezed)
        if is_due:
            self._needed = self._needed_share(view, here, slot, slots)
            self._is_narrow = self._find_narrow(view, here)
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

    def _needed_share(self, view: View, here: Pose2, own: Slot, slots: Sequence[Slot]) -> float:
        """What share of the squeeze the bend and the walls need: at the leader, and where the own slot is."""
        # Metres that they reach to the left and to the right of the trail, to the micrometre.
        laterals = [0.0, *(round(slot.lateral, 6) for slot in slots)]
        left, right = max(laterals), -min(laterals)
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

    def _find_narrow(self, view: View, here: Pose2) -> bool:
        """Whether walls are near on both sides of the robot, or just were: it does not see all of them always."""
        if view.scan is not None:
            path = self._trail.path
            pose = Pose2(0.0, 0.0, path.at(path.project(here.x, here.y)).yaw - here.yaw)
            mates, reach = [(mate.pose.x, mate.pose.y) for mate in view.teammates], self.params.spacing
            left, right = (
                share_for_room(view.scan, [pose], mates, reach - right, right, view.base.half_width)
                for right in (0.0, reach)
            )
            if left + right > NARROW and min(left, right) > 0.0:
                self._narrow_until = view.now + NARROW_FOR
        return view.now < self._narrow_until

    def _place(self, slot: Slot) -> Pose2:
        return self._trail.at(self._trail.place - slot.back).compose(Pose2(0.0, slot.lateral, 0.0))
