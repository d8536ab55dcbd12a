"""The beam that a stopped robot looks at first: it tells the same as the whole scan."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from support.flat_floor import LASER, TICK, Segment, cast, drive, make_odometry, make_scan, make_view
from zteam.base import Base
from zteam.behaviors import SafetyLayer
from zteam.behaviors.safety.stopping import Stoppers, Way
from zteam.behaviors.safety.surroundings import Sight
from zteam.behaviors.safety.swept import Arc, meeting_time, outline_of
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

WALLS: list[Segment] = [(1.0, -2.0, 1.3, 2.0), (-1.5, 0.6, 1.5, 0.7), (-1.0, -2.0, -1.0, 2.0)]
Step = tuple[float, float, float]


def run(walls: list[Segment], orders: list[tuple[float, float]], steps: int) -> list[Step]:
    """What a new layer leaves of orders (m/s, rad/s), each kept for `steps` ticks; and the robot's x."""
    layer, pose, now, left = SafetyLayer(), Pose2(0.0, 0.0, 0.0), 100 * TICK, []
    for i in range(steps * len(orders)):
        speed, turn = orders[i // steps]
        view = make_view(
            make_scan(np.clip(cast(pose.compose(LASER), walls), 0.01, 30.0), now),
            now=now,
            odom=make_odometry(pose),
            lookup=lambda target, source: (LASER, 0),
        )
        command, _ = layer.limit(Twist(Vector3(speed), Vector3(z=turn)), view)
        pose, now = drive(pose, command, TICK / 1e9), now + TICK
        left.append((command.linear.x, command.angular.z, pose.x))
    return left


@given(
    st.floats(-1.0, 1.0),
    st.floats(-2.0, 2.0),
    st.floats(-0.6, 0.6),
    st.floats(-0.6, 0.6),
    st.floats(0.01, 0.5),
    st.floats(0.01, 0.5),
)
def test_a_sure_point_is_met_in_time(speed: float, turn: float, x: float, y: float, due: float, more: float) -> None:
    """What one point tells for certain is what the time of the meeting tells."""
    assume(abs(speed) + abs(turn) > 0.01)
    way = Way(outline_of(Base()), Arc(speed, turn), due + more, due)
    if way.surely_meets(x, y):
        assert meeting_time(way.outline, way.arc, way.seconds, np.array(((x,), (y,)))) <= due


@pytest.mark.parametrize(("speed", "turn"), [(0.5, 0.0), (0.5, 0.7), (-0.3, 0.3), (0.0, 1.0)])
def test_the_point_that_stops_the_most_is_sure(speed: float, turn: float) -> None:
    """Of many points the one is found that the base surely meets, and none where there is none."""
    way = Way(outline_of(Base()), Arc(speed, turn), 1.0, 0.4)
    angles = np.linspace(-math.pi, math.pi, 90)
    circle = np.array((np.cos(angles), np.sin(angles)))
    assert way.surely_meets(*way.nearest(0.26 * circle))
    assert not way.surely_meets(*way.nearest(3.0 * circle))


@given(st.lists(st.tuples(st.floats(-0.5, 0.5), st.floats(-1.0, 1.0)), min_size=1, max_size=4))
def test_a_drive_is_the_same_without_it(orders: list[tuple[float, float]]) -> None:
    """Among walls, a robot that looks at the whole scan in each step is given the same velocities to the bit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stoppers, "stop", lambda *_: False)
        whole = run(WALLS, orders, 12)
    assert run(WALLS, orders, 12) == whole


def test_it_is_asked_while_a_robot_stands_and_lets_go() -> None:
    """A robot before a wall is stopped by one beam from step to step; turned away from the wall it drives on."""
    told: list[bool] = []
    stop = Stoppers.stop

    def noted(stoppers: Stoppers, way: Way, sight: Sight | None) -> bool:
        told.append(stop(stoppers, way, sight))
        return told[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stoppers, "stop", noted)
        left = run([(1.0, -2.0, 1.0, 2.0)], [(0.5, 0.0), (0.0, 1.0), (0.5, 0.0)], 30)
    assert left[29][0] == 0.0
    assert sum(told) >= 5
    assert left[-1][0] == 0.5
