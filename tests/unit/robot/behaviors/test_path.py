"""path: along waypoints, once or round and round."""

import math
from itertools import pairwise

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from support.flat_floor import ORIGIN, TICK, Floor, make_scan, make_view
from zteam.behaviors import Behavior, View, load_behavior
from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.messages import Twist

COURSES = {
    "square": [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0.5]],
    "zigzag": [[0, 0], [2, 0], [3, 1], [5, 1], [6, -1], [8, -1]],
    "there and back beside it": [[0, 0], [3, 0], [3, 0.5], [0, 0.5]],
    "there and back": [[0, 0], [3, 0], [0, 0]],
}


def along(waypoints: object, **params: object) -> Behavior:
    """The behaviour of robot 0."""
    return load_behavior("path", {"waypoints": waypoints, **params}, 0)


def drive(floor: Floor, behavior: Behavior, seconds: float) -> list[tuple[Pose2, Twist]]:
    """Poses and commands of robot 0 until it says why it stands."""
    driven = []
    for _ in range(round(seconds * 10)):
        floor.step([behavior])
        driven.append((floor.poses[0], floor.commands[0][0]))
        if behavior.reason:
            break
    return driven


@pytest.mark.parametrize("course", COURSES)
def test_it_keeps_to_its_path(course: str) -> None:
    """At 0.5 m/s nine tenths of the way lie within 3 cm of the path, it does not swing, and it stands at the end."""
    behavior, floor = along(COURSES[course]), Floor([ORIGIN], [])
    driven = drive(floor, behavior, 60.0)
    assert behavior.reason == "end of the path"
    x, y = COURSES[course][-1]
    assert math.hypot(floor.poses[0].x - x, floor.poses[0].y - y) <= 0.06
    line, off = Polyline([(float(x), float(y)) for x, y in COURSES[course]]), []
    for pose, _ in driven:
        off.append(line.near(pose)[1])
    assert sorted(off)[int(0.9 * len(off))] <= 0.03
    assert line.end / (0.1 * len(driven)) > 0.4
    turns = [command.angular.z for _, command in driven]
    assert not [1 for a, b in pairwise(turns) if a * b < -0.01]


def test_new_waypoints_are_driven_from_the_nearest_place() -> None:
    """Another path begins anew, also after the end; another speed alone changes nothing else."""
    behavior, floor = along([[0, 0], [1, 0]]), Floor([ORIGIN], [])
    drive(floor, behavior, 20.0)
    assert behavior.reason == "end of the path"
    behavior.params = along([[0, 0], [1, 0]], speed=0.3).params
    behavior.on_params()
    drive(floor, behavior, 0.1)
    assert behavior.reason == "end of the path"
    behavior.params = along([[0, 0], [1, 0], [1, 1]]).params
    behavior.on_params()
    drive(floor, behavior, 20.0)
    assert floor.poses[0].y > 0.9


def at(own: Pose2) -> View:
    """A view of robot 0 at a pose in map."""
    return make_view(make_scan([30.0] * 271), lookup=lambda _target, _source: (own, TICK))


@given(
    waypoints=st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=6, unique=True),
    poses=st.lists(
        st.tuples(st.floats(-60, 60), st.floats(-60, 60), st.floats(-math.pi, math.pi)), min_size=1, max_size=5
    ),
    loop=st.booleans(),
)
@example([(0.0, 0.0), (0.01, 0.0)], [(0.0, 0.0, 0.0), (9.0, 9.0, 0.0)], True)
def test_its_commands_are_finite_and_within_its_limits(
    waypoints: list[tuple[float, float]], poses: list[tuple[float, float, float]], loop: bool
) -> None:
    """Any path, any jumps of the robot: speed within 0 and `speed`, turn within `max_angular`."""
    assume(any(math.dist(place, waypoints[0]) >= 0.01 for place in waypoints))
    behavior = along(waypoints, loop=loop, speed=0.4, max_angular=0.8)
    for pose in poses:
        command = behavior.step(at(Pose2(*pose)))
        assert 0.0 <= command.linear.x <= 0.4
        assert abs(command.angular.z) <= 0.8 + 1e-9
