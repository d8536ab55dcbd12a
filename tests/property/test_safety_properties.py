"""The safety layer against what its words mean, computed the slow way: in small steps, point by point."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from support.flat_floor import (
    BEAMS,
    FOV,
    LASER,
    TICK,
    Segment,
    cast,
    clearance,
    drive,
    make_odometry,
    make_scan,
    make_view,
)
from zteam.behaviors import SafetyLayer
from zteam.geometry import Pose2, Velocity
from zteam.messages import LaserScan, Twist, Vector3
from zteam.messages.base import Base
from zteam.robot.safety.motion import BRAKING, TURN_BRAKING, Outline, limits_of, outline_of

Floats = NDArray[np.float64]

CLOSEST = 2e-3
"""Metres: what is nearer leaves the margin as it is."""
FINE = 400
"""Steps of an arc the slow way."""
NOW = 100 * TICK
lengths = st.floats(0.05, 0.6)
turns = st.floats(-3.14, 3.14) | st.sampled_from([0.0, 1e-6, -1e-3, 3.14])
arcs = st.builds(Velocity, st.floats(-1.0, 1.0) | st.just(0.0), st.just(0.0) | st.floats(-1.0, 1.0), turns)


@st.composite
def footprints(draw: st.DrawFn) -> tuple[tuple[float, float], ...]:
    """Outlines of any kind: boxes, polygons round the origin, one that the origin lies outside of."""
    if draw(st.booleans()):
        front, rear, left, right = (draw(lengths) for _ in range(4))
        return (front, left), (-rear, left), (-rear, -right), (front, -right)
    count, radius, shift = draw(st.integers(3, 9)), draw(lengths), draw(st.floats(-0.7, 0.2))
    around = [math.tau * (i + draw(st.floats(0.0, 0.5))) / count for i in range(count)]
    return tuple((shift + radius * math.cos(a), radius * math.sin(a)) for a in around)


bases = footprints().map(lambda footprint: Base(footprint=footprint))


def margin_of(outline: Outline, arc: Velocity) -> float:
    """Metres that stay free around a base: 0.01 where it turns, 0.025 where it drives."""
    fastest = arc.speed + abs(arc.turn) * outline.radius
    return 0.01 + 0.015 * (arc.speed / fastest if fastest else 0.0)


def meeting_time(base: Base, arc: Velocity, seconds: float, points: Floats, clearance: float = 0.0) -> float:
    """What the kernel says."""
    return limits_of(base).meeting_time(arc, seconds, np.ascontiguousarray(points), clearance)


def moved(arc: Velocity, seconds: float) -> Pose2:
    """Where a base is after so long."""
    return drive(Pose2(0.0, 0.0, 0.0), Twist(Vector3(arc.x, arc.y), Vector3(z=arc.turn)), seconds)


def depths_of(outline: Outline, points: Floats) -> Floats:
    """Metres from points (2, n) to the outline's half-planes, below 0 inside; too little beside a corner."""
    found: Floats = np.maximum.reduce(outline.rows[:, :2] @ points - outline.rows[:, 2:3])
    return found


def distance(outline: Outline, at: Pose2, x: float, y: float) -> float:
    """The same of one point, with the base at a pose."""
    inside = at.inverse().compose(Pose2(x, y, 0.0))
    return float(depths_of(outline, np.array([[inside.x], [inside.y]]))[0])


def away(outline: Outline, at: Pose2, x: float, y: float) -> float:
    """Metres from a point to the nearest of the outline's sides, also beside its tips."""
    inside, corners = at.inverse().compose(Pose2(x, y, 0.0)), outline.corners.tolist()
    return clearance(inside, [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])


@given(bases, arcs, st.floats(0.05, 2.0), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(0.0, 0.4))
@example(Base(), Velocity(-0.3), 1.0, 0.4, 0.0, 0.0)
@example(Base(), Velocity(0.3), 1.0, 0.4, 0.0, 0.0)
# Beyond a sharp tip the half-planes are nearer than the outline is: such a point may be taken for met, or not.
@example(Base(footprint=((0.5, 0.0), (-0.5, 0.0), (-0.25, -0.433))), Velocity(turn=-1.0), 1.0, 1.25, 0.0, 0.25)
def test_when_a_point_is_met(base: Base, arc: Velocity, seconds: float, x: float, y: float, gap: float) -> None:
    """Until then the base is further away than the margin, or not nearer than it was; then it is as near."""
    outline, found = outline_of(base.footprint), meeting_time(base, arc, seconds, np.array([[x], [y]]), gap)
    near = margin_of(outline, arc) + gap
    limit, until = min(near, distance(outline, Pose2(0.0, 0.0, 0.0), x, y) - 1e-3), min(found, seconds)
    for at in (moved(arc, until * step / FINE) for step in range(FINE)):
        known = distance(outline, at, x, y)
        assert known >= limit - 1e-3 or (known > 0.0 and away(outline, at, x, y) >= near)
    if found < math.inf:
        assert found <= seconds
        assert distance(outline, moved(arc, found), x, y) <= limit + 1e-3


@given(bases, arcs, st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=9))
def test_the_first_of_many_points_counts(base: Base, arc: Velocity, points: list[tuple[float, float]]) -> None:
    """Many points at once are met as the first of them alone, with the margin that the nearest one leaves."""
    outline = outline_of(base.footprint)
    depths = depths_of(outline, np.array(points).T)
    less = min(0.0, float(depths[depths > CLOSEST].min(initial=math.inf)) - margin_of(outline, arc))
    alone = [meeting_time(base, arc, 1.0, np.array([[x], [y]]), less) for x, y in points]
    assert math.isclose(meeting_time(base, arc, 1.0, np.array(points).T), min(alone), abs_tol=1e-9)


@given(st.floats(0.25, 1.3), st.floats(4e-3, 9e-3), st.floats(1e-3, 5e-3), st.floats(0.0, 1.0))
@example(0.8, 4.9e-3, 4.9e-3, 0.4)
def test_a_corner_turns_away_from_a_wall(slope: float, apart: float, spacing: float, phase: float) -> None:
    """A wall is nearer to it than the margin, and known by hits so far apart: the turn by which it recedes is free."""
    x, y = max(Base().footprint)
    normal = np.array((math.cos(slope), math.sin(slope)))
    along = (np.arange(-9, 10) + phase) * spacing
    wall = (np.array((x, y)) + apart * normal)[:, None] + np.array((-normal[1], normal[0]))[:, None] * along
    recedes = normal[1] * x - normal[0] * y
    assume(abs(recedes) > 0.03)
    assert meeting_time(Base(), Velocity(turn=-math.copysign(1.0, recedes)), 0.1, wall) == math.inf


def hits_of(scan: LaserScan, laser: Pose2) -> list[tuple[float, float]]:
    """All that a scan shows, in the base frame."""
    angles = laser.yaw + scan.angle_min + scan.angle_increment * np.arange(scan.ranges.size)
    shown = (scan.ranges >= scan.range_min) & (scan.ranges > 0.0) & (scan.ranges < scan.range_max)
    x, y = laser.x + scan.ranges * np.cos(angles), laser.y + scan.ranges * np.sin(angles)
    return [(float(a), float(b)) for a, b in zip(x[shown], y[shown], strict=True)]


@given(
    footprints(),
    st.floats(-9.0, 9.0),
    st.floats(-9.0, 9.0),
    st.lists(st.floats(1 / 64, 2.0, width=32) | st.sampled_from([30.0, math.nan, 0.0]), min_size=2, max_size=60),
    st.sampled_from([math.radians(90.0), math.radians(270.0), math.tau]),
    st.sampled_from([0.05, 0.1, 0.3]),
)  # fmt: skip
# The way back is blind on what is left of the arc, and then only the turn is.
@example(
    ((0.125, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.125, -0.5)),
    -1.0,
    -3.0,
    [math.nan, 0.25, 1.0],
    math.radians(270.0),
    0.1,
)
def test_no_command_leads_into_what_is_seen(
    footprint: tuple[tuple[float, float], ...], speed: float, turn: float, ranges: list[float], fov: float, dt: float
) -> None:
    """Any behaviour output, any scan, any footprint: the base can stop before it comes nearer than the margin to a
    hit, or nearer than it was to one, if it brakes one step later."""
    base = Base(footprint=footprint)
    scan = make_scan(ranges, NOW, fov)
    view = make_view(scan, now=NOW, dt=dt, base=base, laser=LASER[:2])
    command, _ = SafetyLayer().limit(Twist(Vector3(speed), Vector3(z=turn)), view)
    motion = Velocity(command.linear.x, turn=command.angular.z)
    # Braking evenly takes as long as half of that time at full speed.
    seconds = dt + 0.5 * max(abs(motion.x) / BRAKING, abs(motion.turn) / TURN_BRAKING)
    outline, arc, hits = outline_of(base.footprint), Velocity(*motion), hits_of(scan, LASER)
    depths = [distance(outline, Pose2(0.0, 0.0, 0.0), x, y) for x, y in hits]
    margin = min([margin_of(outline, arc), *(depth for depth in depths if depth > CLOSEST)])
    for (x, y), depth in zip(hits, depths, strict=True):
        nearest = min(margin, depth) - 2e-3
        for step in range(1, 31):
            at = moved(arc, seconds * step / 30)
            # Beside a tip the half-planes tell too little.
            known = distance(outline, at, x, y)
            assert known >= nearest or (known > 0.0 and away(outline, at, x, y) >= nearest)


commands = st.tuples(st.sampled_from([-1.0, -0.3, 0.0, 0.2, 0.7, 1.0]), st.sampled_from([-3.0, -0.7, 0.0, 0.7, 3.0]))
posts = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
scripts = st.lists(st.tuples(commands, st.integers(1, 15)), min_size=1, max_size=8)
Script = Sequence[tuple[tuple[float, float], int]]

UNSEEN = 0.2
"""m/s of the fastest corner into ground never seen."""
SPAN = 3.0
"""Metres of travel for which what was seen counts."""
WITHIN = 0.02
"""Metres from a beam's end, besides the way from beam to beam there, at which a place counts as shown."""


class Look(NamedTuple):
    """A scan that was made."""

    travelled: float
    laser: Pose2
    ranges: Floats


class Contact(NamedTuple):
    """A tick in which the outline came to something."""

    speed: float
    """m/s of the fastest corner."""
    is_seen: bool
    """Whether a beam showed a place there within the last metres of travel."""


def walk(script: Script, places: Sequence[tuple[float, float]], base: Base) -> Contact | None:
    """The first contact of a robot that is asked for all this in a room with posts, if there is one."""
    room = [(-2.5, -2.5, 2.5, -2.5), (2.5, -2.5, 2.5, 2.5), (2.5, 2.5, -2.5, 2.5), (-2.5, 2.5, -2.5, -2.5)]
    walls: list[Segment] = [*room]
    for x, y in places:
        corners = [(x - 0.1, y - 0.1), (x + 0.1, y - 0.1), (x + 0.1, y + 0.1), (x - 0.1, y + 0.1)]
        walls += [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    outline, layer, pose, now, travelled = outline_of(base.footprint), SafetyLayer(), Pose2(0.0, 0.0, 0.0), NOW, 0.0
    shape, looks = points_of(walls), []
    for speed, turn in (command for command, ticks in script for _ in range(ticks)):
        looks.append(Look(travelled, pose.compose(LASER), cast(pose.compose(LASER), walls)))
        view = make_view(
            make_scan(looks[-1].ranges, now),
            now=now, base=base, odom=make_odometry(pose), laser=LASER[:2],
        )  # fmt: skip
        command, _ = layer.limit(Twist(Vector3(speed), Vector3(z=turn)), view)
        last, pose, now = pose, drive(pose, command, TICK / 1e9), now + TICK
        travelled += math.hypot(pose.x - last.x, pose.y - last.y)
        touched = shape[:, distances(outline, pose, shape) <= 0.0]
        if touched.size:
            x, y = outline.corners.T
            corners = np.hypot(command.linear.x - command.angular.z * y, command.angular.z * x)
            return Contact(
                float(corners.max()), any(_shows(look, touched) for look in looks if look.travelled >= travelled - SPAN)
            )
    return None


@given(scripts, st.lists(posts, max_size=5), st.booleans())
# The rear swings out beside a post while speed and turn cannot be braked as fast as the cut asks for.
@example([((0.2, 3.0), 4), ((0.2, 3.0), 15)], [(0.0, 0.51953125)], True)
# Of an arc a turn on the spot is left, beside a post that the laser does not see any more.
@example([((1.0, -0.7), 17), ((0.0, -3.0), 6), ((1.0, -0.7), 1)], [(1.625, -0.75)], False)
# Beside its way backwards stands what has shown a corner alone: the face beyond that was never seen.
@example(
    [((0.2, -0.7), 13), ((0.7, -3.0), 9), ((0.0, 0.0), 9), ((0.7, 0.7), 10), ((0.0, 0.7), 6), ((-1.0, 3.0), 14)],
    [(0.0, -1.687864132921323), (0.4848614669391762, 0.6420127149483315), (-1.2113085850065122, 0.0)],
    True,
)
# Straight behind stands what was never seen.
@example([((-1.0, 0.0), 15), ((-1.0, 0.0), 15)], [(-0.6, 0.0)], False)
def test_a_robot_touches_nothing_it_saw_and_is_slow_where_it_never_saw(
    script: Script, places: list[tuple[float, float]], accelerates: bool
) -> None:
    """Whatever is asked for, in whatever order, in a room with posts and a laser of 270°, backwards too: the outline
    comes to no place that a beam showed in the last 3 m of travel, and to others at 0.2 m/s of its fastest corner."""
    assume(all(math.hypot(x, y) > 0.5 for x, y in places))
    base = Base(acc_lim_x=1.5, decel_lim_x=-1.0, acc_lim_theta=4.0) if accelerates else Base()
    contact = walk(script, places, base)
    assert contact is None or (not contact.is_seen and contact.speed <= UNSEEN + 1e-9)


def points_of(walls: Sequence[Segment]) -> Floats:
    """(2, n): places on the walls, 1 cm apart."""
    parts = [np.linspace(wall[:2], wall[2:], 1 + round(100 * math.dist(wall[:2], wall[2:]))).T for wall in walls]
    return np.hstack(parts)


def distances(outline: Outline, pose: Pose2, points: Floats) -> Floats:
    """Metres from the outline to points (2, n)."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = points[0] - pose.x, points[1] - pose.y
    return depths_of(outline, np.array((cos * x + sin * y, cos * y - sin * x)))


def _shows(look: Look, points: Floats) -> bool:
    """Whether a beam ended at one of the points (2, n)."""
    angles = look.laser.yaw + np.linspace(-0.5 * FOV, 0.5 * FOV, BEAMS)
    x, y = look.laser.x + look.ranges * np.cos(angles), look.laser.y + look.ranges * np.sin(angles)
    away = np.hypot(x[:, None] - points[0], y[:, None] - points[1])
    return bool((away <= WITHIN + (look.ranges * FOV / (BEAMS - 1))[:, None]).any())
