"""spreading: when neither end of a line can advance, its robots move apart, and the line unfolds."""

import math
from collections.abc import Sequence
from itertools import combinations, pairwise

import pytest
from msgspec.structs import replace

from support.flat_floor import Floor, clearance
from zteam.behaviors import Behavior, View
from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot.behaviors.behavior import NoParams
from zteam.robot.behaviors.line import LineRole
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.behaviors.spreading import Spreading, spread

LIMITS = SpeedLimits(0.7, math.pi)
ROOM = [(-2.0, -2.0, 2.0, -2.0), (2.0, -2.0, 2.0, 2.0), (2.0, 2.0, -2.0, 2.0), (-2.0, 2.0, -2.0, -2.0)]
FOLDED = [(-0.8, -1.2), (0.0, -1.2), (0.8, -1.2), (0.8, -0.5), (0.0, -0.5), (-0.8, -0.5), (-0.8, 0.2), (0.0, 0.2)]


class Spreads(Behavior):
    """A robot of a line of so many that spreads out."""

    def __init__(self, robot: int, count: int, limits: SpeedLimits = LIMITS) -> None:
        super().__init__(NoParams())
        self.role = LineRole(before=tuple(range(robot))[::-1], after=tuple(range(robot + 1, count)))
        self.limits = limits

    def step(self, view: View) -> Twist:
        return spread(replace(view, team=(*self.role.before, *self.role.after)), self.role, self.limits)


def run(places: Sequence[tuple[float, float]], limits: SpeedLimits = LIMITS) -> Floor:
    """Eight seconds of a line whose robots stand there."""
    floor = Floor([Pose2(x, y, 0.0) for x, y in places], ROOM)
    robots = [Spreads(i, len(places), limits) for i in range(len(places))]
    for _ in range(80):
        floor.step(robots)
        assert min(clearance(pose, ROOM) for pose in floor.poses) > 0.02
    return floor


def test_a_folded_line_unfolds_and_holds_together() -> None:
    """Three rows of robots in a room of 4 m: those that are no neighbours are further apart then, its ends above all,
    and no neighbour is far."""
    poses = run(FOLDED).poses
    others = [(a, b) for a, b in combinations(range(len(FOLDED)), 2) if b - a > 1]
    assert min(math.dist(poses[a][:2], poses[b][:2]) for a, b in others) > 0.9
    assert math.dist(poses[0][:2], poses[-1][:2]) > math.dist(FOLDED[0], FOLDED[-1])
    assert max(math.dist(a[:2], b[:2]) for a, b in pairwise(poses)) < 1.5


def test_robots_that_may_not_drive_only_turn() -> None:
    """`max_linear` 0 holds here too."""
    poses = run(FOLDED, SpeedLimits(0.0, 1.0)).poses
    assert max(math.dist(pose[:2], place) for pose, place in zip(poses, FOLDED, strict=True)) < 0.02
    assert max(abs(pose.yaw) for pose in poses) > 0.5


def test_it_stands_without_a_scan() -> None:
    """It does not know what is free."""
    view = Floor([Pose2(x, y, 0.0) for x, y in FOLDED], ROOM).view(7)
    assert Spreads(7, 8).step(view) != Twist()
    assert Spreads(7, 8).step(replace(view, scan=None)) == Twist()


@pytest.mark.parametrize(("apart", "is_due"), [(14.0, True), (16.0, False)])
def test_a_line_spreads_out_that_turns_twice_within_a_short_time(apart: float, is_due: bool) -> None:
    """For eight seconds, and again where it then turns soon; neither the first turn nor two 16 s apart are a reason."""
    spreading, floor = Spreading(), Floor([Pose2(0.0, 0.0, 0.0)], ROOM)

    def ask(seconds: float, turns: int, *, may_turn: bool = True) -> bool:
        view = replace(floor.view(0), now=to_ns(100.0 + seconds))
        return spreading.is_due(view, LineRole(may_turn=may_turn, turns=turns))

    assert not ask(0.0, 0)
    assert not ask(1.0, 1)
    assert not ask(apart, 1)
    assert ask(1.0 + apart, 2) is is_due
    assert ask(8.9 + apart, 2) is is_due
    assert not ask(8.9 + apart, 2, may_turn=False)
    assert not ask(9.1 + apart, 2)
    assert ask(23.9 + apart, 3) is is_due
