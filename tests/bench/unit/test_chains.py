"""Chains of robots: what is read from true poses, the followers that they are compared with, and their tours."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from studies.behaviors import SHARE, Disturbance, LecturesFollow, LecturesParams, Losses
from studies.chains.recorder import Moment, Tracks, make_tracks
from studies.chains.tours import LEAD_IN as TOUR_LEAD_IN
from studies.chains.tours import Tour, tours_of
from studies.chains.tracks import Walls, count_touches, follow_path, resample, take_samples
from support.small_worlds import BODY, make_world
from zteam.errors import UsageError
from zteam.robot.view import View
from zteam.testing import make_view

LEAD_IN = np.array([[-5.0, 0.0], [0.0, 0.0]])


def along(ticks: int, start: float, aside: float = 0.0, begin: int = 10) -> list[tuple[float, float, float]]:
    """A robot that drives along x at 0.5 m/s from tick `begin` on."""
    return [(start + 0.05 * max(0, tick - begin), aside, 0.0) for tick in range(ticks)]


def tracks_of(*robots: list[tuple[float, float, float]], stalled: bool = False) -> Tracks:
    """The tracks of these robots."""
    return make_tracks(
        [Moment(i, [*poses], [stalled] * len(robots)) for i, poses in enumerate(zip(*robots, strict=True))]
    )


def walls(at: float = 100.0) -> Walls:
    """A wall far away, or at `at`."""
    return Walls(make_world(wall_at=at), BODY)


def samples_of(tracks: Tracks, at: float = 100.0):
    """The samples of a chain 0.8 m apart that drives 10 m along x."""
    return take_samples(tracks, LEAD_IN, np.array([10.0, 0.0]), 0.8, walls(at), 0.1)


def test_a_chain_that_keeps_its_path_has_no_error() -> None:
    """Two robots one behind the other: no deviation, the gap that they have, all arrived."""
    seen = samples_of(tracks_of(along(211, 0.0), along(211, -0.8)))
    assert max(seen.deviations[0]) < 1e-9
    assert seen.gaps[0] == pytest.approx([0.8] * len(seen.gaps[0]))
    assert (seen.arrived, seen.wall_hits, seen.touches) == (True, 0, 0)
    assert seen.seconds == pytest.approx(0.1 * len(seen.gaps[0]))


def test_deviation_and_gap_are_measured() -> None:
    """A follower 0.1 m aside and 0.3 m too far behind shows both; the start, where no robot moved, does not count.

    Where the leader stood at the start and behind it there is no way of its own to deviate from. A follower that is a
    metre too far back has not arrived.
    """
    seen = samples_of(tracks_of(along(211, 0.0), along(211, -1.1, aside=0.1)))
    assert seen.deviations[0] == pytest.approx([0.1] * len(seen.deviations[0]))
    assert seen.gaps[0] == pytest.approx([1.1] * len(seen.gaps[0]))
    assert 180 < len(seen.gaps[0]) < 200
    assert len(seen.gaps[0]) - len(seen.deviations[0]) == pytest.approx(1.1 / 0.05, abs=2)
    assert not samples_of(tracks_of(along(211, 0.0), along(211, -1.8))).arrived


def test_walls_are_hit_by_the_outline() -> None:
    """A robot of 0.4 m touches a wall 0.21 m ahead, and not one 0.3 m ahead; a blocked one is in contact too."""
    still = tracks_of([(0.0, 0.0, 0.0)] * 30)
    for distance, hits in ((0.21, 1), (0.3, 0)):
        assert int(walls(distance).touched(still.poses).any()) == hits
    driving = along(211, 0.0), along(211, -0.8)
    assert samples_of(tracks_of(*driving, stalled=True)).wall_hits == 2
    assert samples_of(tracks_of(*driving), at=9.0).wall_hits == 2


def test_robots_that_touch_are_counted_by_pairs() -> None:
    """Two of three robots come nearer to each other than 2 cm."""
    poses = np.array([[(0.0, 0.0, 0.0), (0.41, 0.0, 0.0), (3.0, 0.0, 0.0)]])
    outline = walls().outline
    assert count_touches(poses, outline) == 1
    poses[0, 1, 0] = 0.45
    assert count_touches(poses, outline) == 0


def test_a_path_that_crosses_itself_is_followed_in_order() -> None:
    """On a figure of eight a robot stays on its branch at the crossing."""
    angle = np.linspace(0.0, 2.0 * math.pi, 2000)
    path = resample(np.stack([3.0 * np.sin(2.0 * angle), 6.0 * np.sin(angle)], axis=1))
    places, asides = follow_path(path, path[::5], 0.0)
    assert np.all(np.diff(places) > 0.0) and asides.max() < 1e-9


@pytest.mark.parametrize("world", ["office", "willow"])
def test_there_are_thirty_tours_of_the_right_length(world: str) -> None:
    """The leader drives 25 to 60 m on each, with room for 16 robots behind it. Other worlds have none."""
    name, tours = tours_of(world)
    lengths = [tour.length - TOUR_LEAD_IN for tour in tours]
    assert name == world and len(tours) == 30
    assert min(lengths) > 23.0 and max(lengths) < 61.0
    with pytest.raises(UsageError):
        tours_of("arena")


def test_a_tour_is_split_by_arc_length() -> None:
    """Both parts meet in the place, and nothing is lost."""
    tour = Tour(((0.0, 0.0), (2.0, 0.0), (2.0, 3.0)))
    assert tour.length == 5.0
    assert tour.split(3.0) == ([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)], [(2.0, 1.0), (2.0, 3.0)])
    assert tour.split(1.0) == ([(0.0, 0.0), (1.0, 0.0)], [(1.0, 0.0), (2.0, 0.0), (2.0, 3.0)])


def test_the_lectures_follower_keeps_its_faults() -> None:
    """v = 0.5 d up to 0.7 m/s, w = 4 atan2(y, x) limited to the left alone; it drives on by the last transform."""
    behavior = LecturesFollow(LecturesParams(leader=0))

    def step(x: float, y: float) -> tuple[float, float]:
        view = make_view(robot_id=1, poses={0: (x, y, 0.0), 1: (0.0, 0.0, 0.0)})
        twist = behavior.step(view)
        assert behavior.step(make_view(robot_id=1)) == twist
        return twist.linear.x, twist.angular.z

    assert [step(x, 0.0) for x in (0.8, 1.0, 5.0)] == [(0.0, 0.0), (0.5, 0.0), (0.7, 0.0)]
    assert step(0.0, 2.0)[1] == 3.14
    assert step(0.0, -2.0)[1] == pytest.approx(-2.0 * math.pi)


def moving(now: float, robot_id: int = 1, tick: int = 0) -> View:
    """Robots 0 and 2 drive along x at 1 m/s, robot 1 stands; each has the number of the tick as its status."""
    poses = {0: (now, 0.0, 0.0), 1: (-1.0, 0.0, 0.0), 2: (now, 2.0, 0.0)}
    view = make_view(robot_id=robot_id, poses=poses, now=now)
    return replace(view, inputs={"statuses": {0: tick, 1: tick, 2: tick}, "goal": tick})


def test_teammates_come_late_and_the_own_pose_does_not() -> None:
    """After 0.3 s of history the leader is seen where it was 0.3 s ago, with that stamp; the own pose is of now."""
    disturbance = Disturbance(0.3, 0.0)
    for tick in range(10):
        seen = disturbance.change(moving(1.0 + 0.1 * tick))
        leader = seen.lookup("map", "robot_0/base_footprint")
    assert leader is not None and leader[0].x == pytest.approx(1.6) and leader[1] == 1_600_000_000
    own, between = seen.map_from_base(), seen.base_from_robot(0)
    assert own is not None and own[1] == 1_900_000_000
    assert between is not None and between[0].x == pytest.approx(2.6) and between[1] == 1_600_000_000
    assert Disturbance(0.3, 0.02).change(make_view()).map_from_base() is None


def test_errors_have_the_size_that_was_asked_for_and_all_see_them() -> None:
    """Over many ticks a pose errs by 2 cm along each axis, and two robots see the same error of a third."""
    disturbance, errors = Disturbance(0.0, 0.02), []
    for tick in range(1, 1000):
        own = disturbance.change(moving(0.1 * tick)).map_from_base()
        assert own is not None
        errors += [own[0].x + 1.0, own[0].y]
    assert math.sqrt(sum(e * e for e in errors) / len(errors)) == pytest.approx(0.02, rel=0.1)
    views = [Disturbance(0.0, 0.02).change(moving(1.0, robot_id)) for robot_id in (0, 1)]
    first, second = (view.lookup("map", "robot_0/base_footprint") for view in views)
    assert first == second and first is not None and first[0].x != 1.0


def test_a_share_of_the_poses_and_statuses_is_lost() -> None:
    """5 % of the ticks show a mate as it was before, each mate by itself; what is its own comes always."""
    losses, ticks = Losses(SHARE), 4000
    late, lost, both = {0: 0, 2: 0}, 0, 0
    for tick in range(ticks):
        view = losses.change(moving(0.1 * (tick + 1), tick=tick))
        own = view.map_from_base()
        assert own is not None and own[1] == view.now
        old = []
        for mate in late:
            seen = view.lookup("map", f"robot_{mate}/base_footprint")
            assert seen is not None and abs(seen[0].x - seen[1] / 1e9) < 1e-6
            old.append(seen[1] < view.now)
            late[mate] += old[-1]
        both += all(old)
        assert view.inputs["goal"] == view.inputs["statuses"][1] == tick
        lost += view.inputs["statuses"][0] != tick
    assert all(0.8 * SHARE < count / ticks < 1.2 * SHARE for count in (*late.values(), lost))
    assert both < 0.5 * SHARE * ticks
    assert losses.change(make_view(robot_id=1, now=1e6)).base_from_robot(0) is None
