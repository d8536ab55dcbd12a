"""Paths by arc length; and the trail of a leader from its poses: exact, noisy, backing up, and no number."""

import math
from collections.abc import Iterable
from itertools import accumulate, pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.flat_floor import TICK, drive
from zteam.geometry import Pose2
from zteam.kernels.polylines import LeaderTrail, Polyline, Pose
from zteam.messages import Twist, Vector3

places = st.floats(-10.0, 10.0, allow_subnormal=False)
POINTS = st.lists(st.tuples(places, places), min_size=1, max_size=20)


def corner() -> Polyline:
    """2 m along x, then 1 m along y."""
    return Polyline([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)])


@pytest.mark.parametrize(
    ("s", "pose"),
    [
        (-1.0, (0.0, 0.0, 0.0)),
        (0.5, (0.5, 0.0, 0.0)),
        (2.0, (2.0, 0.0, math.pi / 2)),
        (2.25, (2.0, 0.25, math.pi / 2)),
        (9.0, (2.0, 1.0, math.pi / 2)),
        (math.nan, (0.0, 0.0, 0.0)),
    ],
)
def test_a_place_is_metres_along_the_path(s: float, pose: Pose) -> None:
    """Between two points a place is interpolated, and a place beyond an end is that end."""
    assert corner().at(s) == pytest.approx(pose)


def test_a_point_twice_is_one_point() -> None:
    """A step of no length adds nothing, so that every piece has a direction."""
    path = Polyline([(1.0, 1.0), (1.0, 1.0), (1.0, 3.0), (1.0, 3.0 + 1e-12)])
    assert (len(path), path.end, path.point(path.end)) == (2, 2.0, (1.0, 3.0))


@pytest.mark.parametrize(
    ("x", "y", "low", "high", "s"),
    [
        (1.0, 3.0, 0.0, 9.0, 3.0),
        (0.5, -2.0, 0.0, 9.0, 0.5),
        (1.5, 0.9, 0.0, 9.0, 2.9),
        (1.5, 0.9, 0.0, 1.8, 1.5),
        (0.5, 0.0, 1.0, 2.0, 1.0),
        (5.0, 0.5, 0.0, 2.25, 2.25),
        (0.0, 0.0, 7.0, 8.0, 3.0),
        (0.0, 0.0, 1.5, 1.0, 1.5),
        (1.0, 3.0, math.nan, math.inf, 3.0),
        (math.nan, 3.0, 0.5, 2.0, 0.5),
    ],
)
def test_the_nearest_place_of_a_stretch(x: float, y: float, low: float, high: float, s: float) -> None:
    """Only places from `low` to `high` count, so a path that comes near itself is not confused."""
    assert corner().near((x, y), low, high)[0] == pytest.approx(s)


def test_what_is_no_number_is_no_point() -> None:
    """Neither NaN nor infinity is appended; a NaN place drops and cuts at the beginning, and is far from everything."""
    path = Polyline([(math.nan, 0.0), (0.0, 0.0), (1.0, math.inf), (1.0, 0.0), (math.nan, 2.0), (1e308, -1e308)])
    assert (len(path), path.end) == (2, 1.0)
    assert path.near((math.nan, 0.0)) == (0.0, math.inf)
    path.drop_before(math.nan)
    assert (path.start, path.end) == (0.0, 1.0)
    path.cut_after(math.nan)
    assert (len(path), path.end) == (1, 0.0)


def test_a_path_of_one_point_is_that_point() -> None:
    """It has no direction, and nothing is dropped or cut."""
    path = Polyline([(1.0, 2.0)])
    path.drop_before(3.0)
    path.cut_after(-1.0)
    assert (path.at(5.0), path.near((1.0, 5.0), 1.0, 2.0), path.end) == ((1.0, 2.0, 0.0), (0.0, 3.0), 0.0)


def test_a_path_without_a_point_has_no_place() -> None:
    """It may be dropped and cut all the same."""
    path = Polyline()
    path.drop_before(1.0)
    path.cut_after(-1.0)
    for find in (
        lambda: path.at(0.0),
        lambda: path.point(0.0),
        lambda: path.near((0.0, 0.0)),
        lambda: path.way_back(0),
    ):
        with pytest.raises(IndexError):
            find()


def test_the_way_back_leaves_out_what_was_gone_twice() -> None:
    """From the end over a spur's foot to the place, in steps of 0.1 m; NaN is no place to go back to."""
    spur = [*range(51), *range(49, 19, -1)]
    path = Polyline([*((0.1 * i, 0.0) for i in spur), *((2.0, 0.1 * i) for i in range(1, 31))])
    back = path.way_back(1.0)
    assert back[0] == (2.0, 3.0)
    assert back[-1] == pytest.approx((1.0, 0.0), abs=0.1)
    assert all(x < 2.3 for x, _ in back)
    assert sum(map(math.dist, back, back[1:])) == pytest.approx(4.0, abs=0.3)
    assert path.way_back(math.nan) == [(2.0, 3.0)]


@given(POINTS, places)
def test_places_are_those_of_a_walk_point_by_point(points: list[tuple[float, float]], s: float) -> None:
    """So far from the point before as the place says."""
    path, ends = Polyline(points), [0.0]
    ends += accumulate(math.dist(a, b) for a, b in pairwise(points))
    for (a, b), (begin, end) in zip(pairwise(points), pairwise(ends), strict=True):
        if begin <= s <= end and end - begin > 1e-6:
            share = (s - begin) / (end - begin)
            assert path.point(s) == pytest.approx(
                (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])), abs=1e-6
            )


SPACING = 0.1
"""Metres between two points of the trail."""
TAIL = 0.2
"""Metres from the trail's end to the leader at most: the spacing, and the reach of the poses behind a point."""


class Trail(LeaderTrail):
    """A trail that gets a pose each tick."""

    ticks = 0

    def see(self, leader: Pose2, keep: float = 10.0) -> None:
        """The leader's pose in the next tick."""
        self.ticks += 1
        if not self.add(leader, self.ticks * TICK, keep):
            self.begin(leader, (), leader, self.ticks * TICK)


def follow(trail: Trail, pose: Pose2, command: Twist, ticks: int, keep: float = 10.0) -> list[Pose2]:
    """The poses of a leader that drives on, one a tick, the first after one tick."""
    poses = []
    for _ in range(ticks):
        pose = drive(pose, command, 0.1)
        trail.see(pose, keep)
        poses.append(pose)
    return poses


@given(st.floats(0.1, 0.8), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0))
def test_places_are_where_the_leader_was(speed: float, turn: float, yaw: float) -> None:
    """On an arc, so many metres behind it: as near as straight pieces come to it, with the arc's curvature."""
    trail, start = Trail(), Pose2(1.0, -2.0, yaw)
    trail.see(start, 10.0)
    poses = [start, *follow(trail, start, Twist(Vector3(speed), Vector3(z=turn)), 100)]
    bend = abs(turn) / speed
    for ticks in (15, 40, 70):
        expected, behind = poses[-1 - ticks], 0.1 * ticks * speed
        found = trail.at(trail.place - behind)
        # A chord of length c is c^3 bend^2 / 24 shorter than its arc, and up to c^2 bend / 8 beside it.
        short, beside = (behind * SPACING**2 + TAIL**3) * bend**2 / 24.0, SPACING**2 * bend / 8.0
        assert math.dist(found[:2], expected[:2]) < math.hypot(short, beside) + 0.002
        assert abs(math.remainder(found[2] - expected.yaw, math.tau)) < short * bend + math.radians(1.0)
    assert trail.curvature(trail.place - 4.0 * speed) == pytest.approx(turn / speed, abs=0.15)


def show(trail: Trail, poses: Iterable[Pose2], noise: float = 0.0) -> None:
    """Show the trail these poses, one a tick, with an error in x and y of so many metres (standard deviation)."""
    random = Random(7)
    for x, y, yaw in poses:
        trail.see(Pose2(x + random.gauss(0.0, noise), y + random.gauss(0.0, noise), yaw), 100.0)


def slalom(speed: float, seconds: float, yaw_rate: float = 0.6) -> Iterable[Pose2]:
    """Poses of a robot that drives left and right bends of 1 / yaw_rate * speed metres radius; exact arcs."""
    pose = Pose2(0.0, 0.0, 0.0)
    for tick in range(round(seconds * 10)):
        yield pose
        turn = yaw_rate * 0.1 * (1.0 if (tick // 30) % 2 == 0 else -1.0)
        chord = speed * 0.1 * math.sin(0.5 * turn) / (0.5 * turn)
        step = Pose2(chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn)
        pose = pose.compose(step)


def off_the_way(trail: Trail, way: list[Pose2]) -> float:
    """The largest distance of the trail's points, 1 cm apart, from the nearest of the poses of a dense way."""
    count = math.floor(trail.path.end * 100)
    points = [trail.path.point(0.01 * i) for i in range(count)]
    return max(min(math.dist(p, q[:2]) for q in way) for p in points)


@pytest.mark.parametrize(("noise", "off", "length"), [(0.0, 0.01, 0.002), (0.02, 0.035, 0.01)])
def test_it_is_the_way_that_the_leader_drove(noise: float, off: float, length: float) -> None:
    """On a slalom no point is far from the way, and the trail is as long as the way to 0.2 %; 1 % with noise."""
    trail = Trail()
    show(trail, slalom(0.5, 20.0), noise)
    dense = list(slalom(0.5, 20.0))
    dense = [a.compose(Pose2(0.01 * s, 0.0, 0.0)) for a in dense for s in range(5)]
    assert off_the_way(trail, dense) < off
    assert trail.place == pytest.approx(0.5 * 19.9, rel=length, abs=noise)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_leader_that_stands_adds_nothing(noise: float) -> None:
    """A minute on one spot: the trail does not grow, whatever the poses say, and its speed is about zero."""
    trail = Trail()
    show(trail, slalom(0.5, 5.0), noise)
    place, end = trail.place, list(slalom(0.5, 5.0))[-1]
    show(trail, (end for _ in range(600)), noise)
    assert trail.place == pytest.approx(place, abs=0.01 + 3.0 * noise)
    assert abs(trail.speed) < 0.005 + 5.0 * noise


def test_a_new_speed_is_known_within_half_a_second() -> None:
    """From standing to 0.5 m/s and back, to 4 cm/s."""
    trail = Trail()
    show(trail, [Pose2(0.0, 0.0, 0.0)] * 5 + [Pose2(0.05 * i, 0.0, 0.0) for i in range(1, 7)])
    assert trail.speed == pytest.approx(0.5, abs=0.04)
    show(trail, [Pose2(0.3, 0.0, 0.0)] * 6)
    assert trail.speed == pytest.approx(0.0, abs=0.04)


@given(back=st.floats(0.3, 2.5), sideways=st.floats(-0.6, 0.6))
def test_a_leader_that_backed_up_goes_on_from_there(back: float, sideways: float) -> None:
    """Its place goes back as it does; the trail then leads to where it goes on, not to where it turned."""
    trail = Trail()
    ahead = [Pose2(0.05 * i, 0.0, 0.0) for i in range(61)]
    behind = [Pose2(3.0 - 0.05 * i, 0.0, 0.0) for i in range(round(back / 0.05) + 1)]
    show(trail, ahead + behind)
    turn = behind[-1].x
    assert trail.place == pytest.approx(turn, abs=0.06)
    on = [Pose2(turn, 0.0, sideways).compose(Pose2(0.05 * i, 0.0, 0.0)) for i in range(41)]
    show(trail, on)
    assert trail.place == pytest.approx(turn + 2.0, abs=0.15)
    assert math.dist(trail.path.point(trail.path.end), (turn, 0.0)) < 2.0
    assert max(trail.path.point(0.05 * i)[0] for i in range(round(trail.path.end / 0.05))) <= on[-1].x + 0.01


@pytest.mark.parametrize("odd", [math.nan, math.inf])
def test_a_pose_that_is_no_number_changes_nothing(odd: float) -> None:
    """Neither as the first one, nor later; and a place that is none is the beginning."""
    trail, same = Trail(), Trail()
    trail.see(Pose2(odd, 0.0, 0.0))
    same.ticks += 1
    for each in (trail, same):
        follow(each, Pose2(0.0, 0.0, 0.3), Twist(Vector3(0.5)), 30)
    if math.isnan(odd):
        trail.see(Pose2(odd, 0.0, 0.0))
    assert (trail.place, trail.at(1.0), trail.at(9.0, 0.5)) == (same.place, same.at(1.0), same.at(9.0, 0.5))
    assert trail.at(math.nan) == trail.at(0.0)
    assert trail.curvature(math.nan) == trail.curvature(trail.place)


def test_a_trail_without_a_pose_is_at_the_origin() -> None:
    """Straight on along x; beside it is to the left."""
    trail = LeaderTrail()
    assert (trail.at(-1.0), trail.at(2.0, 0.5)) == ((-1.0, 0.0, 0.0), (2.0, 0.5, 0.0))
