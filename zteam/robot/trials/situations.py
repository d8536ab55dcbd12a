"""Trials by hand: what a robot knows in awkward moments, as views; and values at the bounds of parameters."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

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


def make_scan(ranges: Sequence[float], fov: float, header: Header) -> LaserScan:
    """A scan of these metres, evenly spread over `fov` radians from right to left."""
    return LaserScan(
        header=header,
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


def laser_frame(robot_id: int) -> str:
    return names.robot_frame(robot_id, names.BASE_LASER_LINK)


Poses = Mapping[int, tuple[float, float, float]]

ROBOT = 1
"""The id of the robot under trial; the robots LEADER and 2 are there besides."""
LEADER = 0
STEPS = 12
"""Views of a situation: longer than a second, so that what depends on time shows."""
DT = 0.1
"""Seconds from one view to the next, and of a tick of Stage's worlds."""
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


def _all(value: float) -> np.ndarray:
    return np.full(_BEAMS, value)


class ViewMaker:
    """Makes views of one behaviour's robot."""

    def __init__(self, inputs: Mapping[str, Any]) -> None:
        """`inputs` is what the behaviour declares."""
        self._declared = declared_inputs(inputs, ROBOT)

    def view(
        self,
        seconds: float,
        dt: float,
        ranges: np.ndarray | None,
        poses: Poses = POSES,
        *,
        ages: tuple[float, float] = (0.0, 0.0),
        has_messages: bool = False,
    ) -> View:
        """What it knows at `seconds`; `ages` (s) are those of its own pose and of the others'."""
        now = to_ns(seconds)
        own, others = lookup_in(poses, now - to_ns(ages[0])), lookup_in(poses, now - to_ns(ages[1]))
        base, scan, odom = names.robot_frame(ROBOT, names.BASE_FOOTPRINT), None, None
        alone = {names.MAP_FRAME, base}
        if ranges is not None:
            scan = make_scan(ranges.tolist(), _FOV, Header(time_from_ns(now), laser_frame(ROBOT)))
            # As of a scan that came over the bus.
            scan.ranges.flags.writeable = False
            odom = Odometry(Header(time_from_ns(now), names.robot_frame(ROBOT, names.ODOM)), base)

        def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
            return (own if {target, source} <= alone else others)(target, source)

        return View(
            now=now,
            dt=dt,
            robot_id=ROBOT,
            scan=scan,
            odom=odom,
            lookup=lookup,
            team=tuple(sorted(POSES)),
            bases=dict.fromkeys(POSES, DEFAULT_BASE),
            inputs=self.messages((LEADER, 2) if has_messages else ()),
        )

    def views(self, ranges: np.ndarray | None = None, poses: Poses = POSES, **more: Any) -> Iterator[View]:
        """STEPS views in a row, by default in the middle of a room."""
        for step in range(STEPS):
            yield self.view(1.0 + step * DT, DT if step else 0.0, room() if ranges is None else ranges, poses, **more)

    def messages(self, robots: Collection[int] = ()) -> Mapping[str, Any]:
        """What a view holds of its inputs when empty messages have come from these robots; without any, none at all."""
        found: dict[str, Any] = {}
        for declared in self._declared:
            each, own = {robot: declared.type() for robot in robots}, declared.type() if robots else None
            found[declared.name] = MappingProxyType(each) if declared.of_all_robots else own
        return MappingProxyType(found)


def _moved(moment: ViewMaker) -> Iterator[View]:
    """It stands somewhere else from the middle on, as after `zteam sim move`."""
    for step in range(STEPS):
        is_late = step >= STEPS // 2
        ranges, poses = (0.5 * room(), ELSEWHERE) if is_late else (room(), POSES)
        yield moment.view(1.0 + step * DT, DT if step else 0.0, ranges, poses)


def _odd_times(moment: ViewMaker) -> Iterator[View]:
    now = 1.0
    for dt in (0.0, 0.1, 0.0, 0.0, 0.1, 5.0, 0.1, 1e-9):
        now += dt
        yield moment.view(now, dt, room())


def _near(moment: ViewMaker) -> Iterator[View]:
    angles = np.linspace(-0.5 * _FOV, 0.5 * _FOV, _BEAMS)
    ranges = np.where(np.abs(angles) < 0.5, 0.15, room())
    return moment.views(ranges, {**POSES, LEADER: (0.45, 0.0, math.pi)})


SITUATIONS: dict[str, Callable[[ViewMaker], Iterable[View]]] = {
    "in the middle of a room": lambda moment: moment.views(),
    "all beams say nothing (nan)": lambda moment: moment.views(_all(math.nan)),
    "all beams meet nothing (inf)": lambda moment: moment.views(_all(math.inf)),
    "all beams meet nothing (30 m)": lambda moment: moment.views(_all(RANGE_MAX)),
    "all ranges are 0": lambda moment: moment.views(_all(0.0)),
    "every second beam is nan": lambda moment: moment.views(np.where(np.arange(_BEAMS) % 2, math.nan, room())),
    "a laser of 1 beam": lambda moment: moment.views(np.array([_HALF_ROOM])),
    "a laser of 2 beams": lambda moment: moment.views(room(2)),
    "a laser of 7 beams": lambda moment: moment.views(room(7)),
    "a laser of 2000 beams": lambda moment: moment.views(room(2000)),
    "a robot right before it": _near,
    "no transforms": lambda moment: moment.views(poses={}),
    "no other robot known": lambda moment: moment.views(poses={ROBOT: POSES[ROBOT]}),
    "it is put elsewhere": _moved,
    "time stands still, then leaps": _odd_times,
    "nothing has come yet": lambda moment: [moment.view(1.0, 0.0, None, {})],
}
"""By name: the views of a robot."""
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
