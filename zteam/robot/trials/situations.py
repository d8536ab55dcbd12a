"""Trials by hand: what a robot knows in awkward moments, as views; and values at the bounds of parameters."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from zteam import names
from zteam.clock import to_ns
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import Header, LaserScan, Odometry, time_from_ns
from zteam.messages.base import DEFAULT_BASE
from zteam.robot.behaviors.behavior import Behavior, declared_inputs
from zteam.robot.parameters import parameters_of
from zteam.robot.view import FindPose, View

RANGE_MAX = 30.0
"""Metres."""
_HERE = Pose2(0.0, 0.0, 0.0)


def make_scan(ranges: Sequence[float], fov: float, stamp: int, robot_id: int) -> LaserScan:
    """A robot's scan of these metres at `stamp` (ns), evenly spread over `fov` radians from right to left."""
    return LaserScan(
        header=Header(time_from_ns(stamp), names.robot_frame(robot_id, names.BASE_LASER_LINK)),
        angle_min=-0.5 * fov,
        angle_max=0.5 * fov,
        angle_increment=fov / (len(ranges) - 1) if len(ranges) > 1 else 0.0,
        range_max=RANGE_MAX,
        ranges=np.array(ranges, np.float32),
    )


def lookup_in(poses: Mapping[int, tuple[float, float, float]], stamp: int) -> FindPose:
    """Look-ups among `map` and the bases of robots with these poses (x, y in m, yaw in rad) in `map`, at `stamp` (ns).

    Every look-up fails where no robot is known.
    """
    known = {names.robot_frame(i, names.BASE_FOOTPRINT): Pose2(*pose) for i, pose in poses.items()}
    if known:
        known[names.MAP_FRAME] = _HERE

    def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
        if target not in known or source not in known:
            return None
        return known[target].inverse().compose(known[source]), stamp

    return lookup


Poses = Mapping[int, tuple[float, float, float]]


class Moment(NamedTuple):
    """What stands around the robot under trial."""

    dt: float
    """Seconds since the moment before."""
    ranges: np.ndarray | None
    """Of its laser, in metres; None: no scan and no odometry has come."""
    poses: Poses
    """Of the robots that are known."""


ROBOT = 1
"""The id of the robot under trial; the robots LEADER and 2 are there besides."""
LEADER = 0
STEPS = 12
"""Moments of a situation: longer than a second, so that what depends on time shows."""
DT = 0.1
"""Seconds from one moment to the next, and of a tick of Stage's worlds."""
_BEAMS, _FOV = 1081, math.radians(270.25)
_HALF_ROOM = 3.0
"""Metres from the robot to the walls of the made-up room."""
POSES: Poses = {LEADER: (1.5, 0.3, 0.2), ROBOT: (0.0, 0.0, 0.0), 2: (-1.5, -0.5, 0.0)}
ELSEWHERE: Poses = {LEADER: (-0.43, 2.1, 1.5), ROBOT: (0.4, -0.6, 0.9), 2: (1.3, 1.0, 0.0)}
OTHER_POSES: tuple[Poses, ...] = (
    ELSEWHERE,
    {LEADER: (0.17, -0.06, -0.7), ROBOT: (-0.05, -0.02, -0.3), 2: (-0.2, 0.11, 0.4)},
)
"""Far apart, and close together."""


def room(beams: int = _BEAMS) -> np.ndarray:
    """Ranges (beams,) in metres in the middle of a square room."""
    angles = np.linspace(-0.5 * _FOV, 0.5 * _FOV, beams)
    return _HALF_ROOM / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))


def empty_messages(inputs: Mapping[str, Any], robots: Collection[int] = ()) -> Mapping[str, Any]:
    """What views hold of `inputs`, as a behaviour declares them, when these robots have sent empty messages."""
    found: dict[str, Any] = {}
    for declared in declared_inputs(inputs, ROBOT):
        each, own = {robot: declared.type() for robot in robots}, declared.type() if robots else None
        found[declared.name] = MappingProxyType(each) if declared.of_all_robots else own
    return MappingProxyType(found)


def make_views(
    situation: Iterable[Moment], messages: Mapping[str, Any], ages: tuple[float, float] = (0.0, 0.0)
) -> Iterator[View]:
    """What it knows in these moments; `ages` (s) are those of its own pose and of the others'."""
    seconds, base = 1.0, names.robot_frame(ROBOT, names.BASE_FOOTPRINT)
    for dt, ranges, poses in situation:
        seconds += dt
        now, scan, odom = to_ns(seconds), None, None
        if ranges is not None:
            scan = make_scan(ranges.tolist(), _FOV, now, ROBOT)
            # As of a scan that came over the bus.
            scan.ranges.flags.writeable = False
            odom = Odometry(Header(time_from_ns(now), names.robot_frame(ROBOT, names.ODOM)), base)
        own, others = (lookup_in(poses, now - to_ns(age)) for age in ages)
        yield View(
            now=now,
            dt=dt,
            robot_id=ROBOT,
            scan=scan,
            odom=odom,
            lookup=partial(_look_up, {names.MAP_FRAME, base}, own, others),
            team=tuple(sorted(POSES)),
            bases=dict.fromkeys(POSES, DEFAULT_BASE),
            inputs=messages,
        )


def _look_up(alone: set[str], own: FindPose, others: FindPose, target: str, source: str) -> tuple[Pose2, int] | None:
    return (own if {target, source} <= alone else others)(target, source)


def steady(ranges: np.ndarray | None = None, poses: Poses = POSES, *later: Moment) -> list[Moment]:
    """STEPS moments at one place, by default in the middle of a room; `later` are the last of them."""
    ranges = room() if ranges is None else ranges
    return [Moment(DT if step else 0.0, ranges, poses) for step in range(STEPS - len(later))] + [*later]


_NEAR = np.where(np.abs(np.linspace(-0.5 * _FOV, 0.5 * _FOV, _BEAMS)) < 0.5, 0.15, room())

SITUATIONS: dict[str, list[Moment]] = {
    "in the middle of a room": steady(),
    "all beams say nothing (nan)": steady(np.full(_BEAMS, math.nan)),
    "all beams meet nothing (inf)": steady(np.full(_BEAMS, math.inf)),
    "all beams meet nothing (30 m)": steady(np.full(_BEAMS, RANGE_MAX)),
    "all ranges are 0": steady(np.full(_BEAMS, 0.0)),
    "every second beam is nan": steady(np.where(np.arange(_BEAMS) % 2, math.nan, room())),
    "a laser of 1 beam": steady(np.array([_HALF_ROOM])),
    "a laser of 2 beams": steady(room(2)),
    "a laser of 7 beams": steady(room(7)),
    "a laser of 2000 beams": steady(room(2000)),
    "a robot right before it": steady(_NEAR, {**POSES, LEADER: (0.45, 0.0, math.pi)}),
    "no transforms": steady(poses={}),
    "no other robot known": steady(poses={ROBOT: POSES[ROBOT]}),
    "it is put elsewhere": steady(None, POSES, *[Moment(DT, 0.5 * room(), ELSEWHERE)] * (STEPS // 2)),
    "time stands still, then leaps": [Moment(dt, room(), POSES) for dt in (0, 0.1, 0, 0, 0.1, 5.0, 0.1, 1e-9)],
    "nothing has come yet": [Moment(0.0, None, {})],
}
"""By name."""
STALE_SITUATIONS: dict[str, tuple[float, float]] = {
    "the others' poses are 3 s old": (0.0, 3.0),
    "all poses are 3 s old": (3.0, 3.0),
}
"""By name: the ages (s) of its own pose and of the others'."""


_INSIDE = 1e-3
"""How far inside a bound that does not belong to the allowed values, relative to 1 or to the bound."""
_SIGNS = {"ge": 0, "gt": 1, "le": 0, "lt": -1}


def bounds(kind: type[Behavior]) -> Iterator[tuple[str, Any]]:
    """(parameter, value) for each bound that a number has, and both values of a switch."""
    for parameter in parameters_of(kind.Params):
        if parameter.type == "bool":
            yield from ((parameter.name, value) for value in (False, True))
        for limit, bound in parameter.limits.items():
            if limit in _SIGNS:
                step = 1 if parameter.type == "int" else _INSIDE * max(1.0, abs(bound))
                yield parameter.name, bound + _SIGNS[limit] * step


def given_params(spec: str, kind: type[Behavior], params: dict[str, Any]) -> dict[str, Any]:
    """`params`, and the leader if the behaviour needs one. Raises UsageError where another one is missing."""
    required = [parameter.name for parameter in parameters_of(kind.Params) if parameter.required]
    given = {"leader": LEADER, **params} if "leader" in required else dict(params)
    missing = [name for name in required if name not in given]
    if missing:
        raise UsageError(f"behaviour {spec} needs {', '.join(missing)}: give --param {missing[0]}=VALUE")
    return given
