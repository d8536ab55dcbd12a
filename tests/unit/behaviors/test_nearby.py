"""nearby: the teammates within reach are known as if all were looked up each time, with few look-ups."""

import math
from collections.abc import Set
from random import Random

import msgspec

from support.flat_floor import TICK, make_view
from zteam import names
from zteam.base import DEFAULT_BASE
from zteam.behaviors.nearby import REACH, Nearby
from zteam.geometry import Pose2

Places = dict[int, tuple[float, float]]


class Watch:
    """Robot 0, which asks in each tick."""

    def __init__(self) -> None:
        self.looked = 0
        self._nearby = Nearby()
        self._view = make_view()

    def find(self, tick: int, places: Places, team: tuple[int, ...]) -> Set[int]:
        """The robots that are near at this tick, with all robots at these places in map."""
        by_frame = {names.robot_frame(robot, names.BASE_FOOTPRINT): place for robot, place in places.items()}

        def lookup(_target: str, source: str) -> tuple[Pose2, int] | None:
            self.looked += source != names.robot_frame(0, names.BASE_FOOTPRINT)
            return (Pose2(*by_frame[source], 0.0), tick * TICK) if source in by_frame else None

        self._view = msgspec.structs.replace(self._view, now=tick * TICK, lookup=lookup, team=team)
        return self._nearby.find(self._view)


def within_reach(places: Places, team: tuple[int, ...]) -> set[int]:
    """The robots that are near."""
    return {i for i in team if i and i in places and math.dist(places[i], places[0]) <= REACH}


def test_robots_that_come_and_go_are_known_in_that_very_tick() -> None:
    """Ten robots drive about at up to 1 m/s: each tick, those near are those within reach."""
    chance, team, watch = Random(1), tuple(range(10)), Watch()
    places = {i: (chance.uniform(-8.0, 8.0), chance.uniform(-8.0, 8.0)) for i in team}
    goals = dict(places)
    changes, last = 0, set[int]()
    for tick in range(1, 1000):
        for i, (x, y) in places.items():
            left = math.dist((x, y), goals[i])
            if left < 0.1:
                goals[i] = chance.uniform(-8.0, 8.0), chance.uniform(-8.0, 8.0)
                continue
            places[i] = x + 0.1 * (goals[i][0] - x) / left, y + 0.1 * (goals[i][1] - y) / left
        found = watch.find(tick, places, team)
        assert found == within_reach(places, team)
        changes, last = changes + (found != last), set(found)
    assert changes > 50
    assert watch.looked < 0.4 * 9 * 1000


def test_a_robot_that_leaves_the_team_is_not_near() -> None:
    """And a new one is looked up at once, also one that has only told its base."""
    watch, places = Watch(), {0: (0.0, 0.0), 1: (1.0, 0.0), 2: (0.0, 1.0)}
    assert watch.find(1, places, (0, 1)) == {1}
    assert watch.find(2, places, (0, 1, 2)) == {1, 2}
    assert watch.find(3, places, (0, 2)) == {2}
    view = msgspec.structs.replace(watch._view, bases={1: DEFAULT_BASE})
    assert watch._nearby.find(view) == {1, 2}


def test_a_robot_without_a_pose_is_looked_up_again_after_a_second() -> None:
    """Also one whose pose is no number."""
    for lost in ({0: (0.0, 0.0)}, {0: (0.0, 0.0), 1: (math.nan, 0.0)}):
        watch, places = Watch(), {0: (0.0, 0.0), 1: (1.0, 0.0)}
        assert [watch.find(tick, lost, (0, 1)) for tick in (1, 2)] == [set(), set()]
        assert [watch.find(tick, places, (0, 1)) for tick in (10, 11)] == [set(), {1}]
