"""What a robot of a line sees of the others, of the way of its head, and of walls between."""

import math
from collections.abc import Sequence, Set
from itertools import pairwise

from zteam import names
from zteam.behaviors.chain import see_robot
from zteam.behaviors.line import STRETCHED, Place
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.scans import is_clear, is_seen
from zteam.behaviors.view import View
from zteam.geometry import Pose2

OFF = 0.5
"""Metres from the trail from which on the whole trail is searched, and a robot drives to it past what is between."""
MARGIN = 0.1
"""Metres before a robot in which what the laser sees may be that robot."""
NEAREST = 0.6
"""Metres from base to base within which a robot does not drive on towards its neighbour: both can still turn."""
BEHIND, PAST, BESIDE = 5.0, 0.3, 1.0
"""Metres of the trail: a robot that is no further behind, no further ahead, and no further beside it comes past to its
place, and is waited for."""
LOOK_ON, BODY = 1.5, 0.15
"""Metres of the trail ahead on which no robot that is gone may stand, and metres beside it that have to be free."""


def is_walled_off(view: View, own: Pose2, point: tuple[float, float]) -> bool:
    """Whether a wall leaves no straight way to this point (map), as far as to the first robot on it."""
    x, y, _ = own.inverse().compose(Pose2(*point, 0.0))
    reach = apart = math.hypot(x, y)
    for mate in view.teammates:
        along, across = (x * mate.pose.x + y * mate.pose.y) / apart, (x * mate.pose.y - y * mate.pose.x) / apart
        if along > 0.0 and abs(across) < view.base.half_width + mate.base.radius:
            reach = min(reach, along - mate.base.radius - MARGIN)
    if view.scan is None or reach <= 0.0:
        return False
    return not is_clear(view.scan, view.base.half_width, reach, math.atan2(y, x))


def places_of(view: View, robots: Sequence[int]) -> list[Pose2]:
    """The poses in map of those that are seen."""
    seen = (see_robot(view, robot, names.MAP_FRAME, math.inf)[0] for robot in robots)
    return [each.pose for each in seen if each is not None]


def length_in_sight(view: View, before: Sequence[int], own: Pose2) -> float:
    """Metres straight from robot to robot up to the head; infinite where the first of them may be behind a wall."""
    way = [own, *places_of(view, before)]
    x, y, _ = own.inverse().compose(way[1])
    is_blind = view.scan is not None and not is_seen(view.scan, math.atan2(y, x))
    if is_blind or is_walled_off(view, own, way[1][:2]):
        return math.inf
    return sum(math.dist(a[:2], b[:2]) for a, b in pairwise(way))


def overtaken(view: View, own: Pose2, path: Polyline, here: float, after: Sequence[int]) -> list[int]:
    """Those of the robots that belong behind the place `here` that are ahead of it on the path."""
    found = []
    for robot in after:
        seen = view.base_from_robot(robot)
        if seen is not None:
            x, y, _ = own.compose(seen[0])
            place = path.project(x, y)
            if place > here + OFF and math.dist((x, y), path.point(place)) < OFF:
                found.append(robot)
    return found


def comes_past(path: Polyline, here: float, robot: Pose2) -> bool:
    """Whether a robot that belongs ahead of the place `here` is behind it, near the path."""
    place = path.project(robot.x, robot.y, here - BEHIND, here + BEHIND)
    return place < here + PAST and math.dist(robot[:2], path.point(place)) < BESIDE


def is_blocked(view: View, own: Pose2, path: Polyline, place: float, robots: Set[int]) -> bool:
    """Whether one of these robots is on the path, a little ahead of `place`."""
    for mate in view.teammates if robots else ():
        if mate.robot_id in robots and math.hypot(*mate.pose[:2]) < LOOK_ON:
            x, y, _ = own.compose(mate.pose)
            at = path.point(path.project(x, y, place, place + LOOK_ON))
            if math.dist((x, y), at) < view.base.half_width + mate.base.radius + BODY:
                return True
    return False


def head_comes_round(view: View, place: Place) -> bool:
    """Whether the head has left the robot that is to follow it, and is nearest to this one, the last of its line."""
    seen = [view.base_from_robot(robot) for robot in reversed(place.before)]
    if len(seen) < 2 or seen[0] is None or seen[1] is None:
        return False
    head, own = seen[0][0], math.hypot(*seen[0][0][:2])
    apart = [math.dist(head[:2], each[0][:2]) for each in seen[1:] if each is not None]
    return apart[0] > max(place.gap + STRETCHED, own + NEAREST) and min(apart) > own
