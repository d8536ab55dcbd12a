"""What robots do while their steps are measured: in clear space, beside walls, among others, with each behaviour."""

import math
from typing import Any

import msgspec

from zteam.geometry import Pose2
from zteam.sim import Options

HALL = """
name "hall"
interval_sim 100
define wall model ( size [30 0.2 1] )
wall ( pose [0  15 0 0] )
wall ( pose [0 -15 0 0] )
wall ( pose [-15 0 0 90] )
wall ( pose [ 15 0 0 90] )
wall ( pose [0 -12 0 0] size [12 0.2 1] )
wall ( pose [0 -11.1 0 0] size [12 0.2 1] )
define post model ( size [0.4 0.4 1] )
post ( pose [ 9  9 0 30] )
post ( pose [10  7 0 30] )
post ( pose [ 7  9.5 0 30] )
post ( pose [ 8  7 0 30] )
post ( pose [-6 -5 0 0] )
"""
"""30 × 30 m with a corridor of 0.7 m along y = -11.55, four posts about (8.5, 8), and one more."""

Script = tuple[tuple[float, float, float], ...]
"""What teleop asks for, round and round: seconds, m/s and rad/s."""


class Part(msgspec.Struct, frozen=True):
    """One robot of a scene."""

    start: Pose2
    behavior: str = "idle"
    parameters: dict[str, Any] = {}
    teleop: Script = ()
    """Drives instead of the behaviour."""
    goal: tuple[float, float] | None = None
    """Metres in map, for `go_to`."""


class Scene(msgspec.Struct, frozen=True):
    """Robots 0, 1, … in HALL."""

    parts: tuple[Part, ...]
    measured: int = 1
    """The first so many are measured."""
    options: Options = Options()
    """Of the simulator."""


def _at(x: float, y: float, yaw_deg: float = 0.0) -> Pose2:
    return Pose2(x, y, math.radians(yaw_deg))


def _driven(start: Pose2, *script: tuple[float, float, float]) -> Part:
    return Part(start, teleop=script)


def _crowd(count: int, behavior: str, **parameters: Any) -> tuple[Part, ...]:
    """Robots in a square about the four posts, 1 m apart."""
    side = math.ceil(math.sqrt(count))
    places = [_at(6.5 + 1.0 * (i % side), 5.5 + 1.0 * (i // side), 67.0 * i) for i in range(count)]
    return tuple(Part(place, behavior, parameters) for place in places)


_SQUARE = [[-10.0, -4.0], [-2.0, -4.0], [-2.0, 4.0], [-10.0, 4.0]]
_LEADER = Part(_at(-8.0, -4.0), "path", {"waypoints": _SQUARE, "speed": 0.5, "loop": True})
_BEHIND = [_at(-8.0 - 0.8 * i, -4.0) for i in range(1, 4)]
_DAZZLE = Options(dazzle="drop")

SCENES = {
    "teleop in the open": Scene((_driven(_at(-5, 5), (9.0, 0.5, 0.1)),)),
    "teleop along a wall": Scene((_driven(_at(-12, 14.6), (9.0, 0.5, 0.0)),)),
    "teleop into a wall": Scene((_driven(_at(-5, 14.0, 90), (9.0, 0.5, 0.0)),)),
    "teleop to and fro in a corridor": Scene((_driven(_at(-4, -11.55), (8.0, 0.4, 0.02), (8.0, -0.4, -0.02)),)),
    "teleop turns in a corridor": Scene((_driven(_at(-4, -11.55), (4.0, 0.4, 0.0), (8.0, 0.0, 0.8)),)),
    "teleop among 7 wanderers": Scene((_driven(_at(9, 8), (5.0, 0.3, 0.6), (5.0, -0.3, 0.4)), *_crowd(7, "wander"))),
    "teleop, dazzled": Scene(
        (_driven(_at(-4, 5), (5.0, 0.5, 0.0)), _driven(_at(2, 5.1, 180), (5.0, 0.5, 0.0))), 1, _DAZZLE
    ),
    "idle": Scene((Part(_at(-5, 5)),)),
    "forward": Scene((Part(_at(-12, 5), "forward", {"speed": 0.3}),)),
    "avoid": Scene((Part(_at(-5, 13), "avoid", {"speed": 0.3}), Part(_at(9, 8), "avoid")), 2),
    "wander, 8 robots": Scene(_crowd(8, "wander"), 8),
    "path": Scene((_LEADER,)),
    "go_to round a post": Scene((Part(_at(-10, -5), "go_to", goal=(-2.0, -5.0)),)),
    "follow, 4 robots": Scene((_LEADER, *(Part(at, "follow", {"leader": i}) for i, at in enumerate(_BEHIND))), 4),
    "formation, 4 robots": Scene(
        (_LEADER, *(Part(at, "formation", {"leader": 0, "team": [1, 2, 3]}) for at in _BEHIND)), 4
    ),
}
"""By what the robot does. The teleop rows are mux and safety layer alone."""
