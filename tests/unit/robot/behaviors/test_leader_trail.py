"""The trail of a leader from its poses: exact, noisy, backing up and moved."""

import math
from collections.abc import Iterable
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.flat_floor import TICK, drive
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.path import LeaderTrail, Sample, between, fit

SPACING = 0.1
"""Metres between two points of the trail."""
TAIL = 0.2
"""Metres from the trail's end to the leader at most: the spacing, and the reach of the poses that tell of a point."""


class Trail(LeaderTrail):
    """A trail that gets a pose each tick."""

    ticks = 0

    def see(self, leader: Pose2, keep: float = 10.0) -> None:
        """The leader's pose in the next tick."""
        self.ticks += 1
        self.add(leader, self.ticks * TICK, keep)


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
        assert abs(math.remainder(found.yaw - expected.yaw, math.tau)) < short * bend + math.radians(1.0)
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
    points = [trail.path.at(0.01 * i) for i in range(count)]
    return max(min(math.hypot(p.x - q.x, p.y - q.y) for q in way) for p in points)


@pytest.mark.parametrize(("noise", "off", "length"), [(0.0, 0.01, 0.002), (0.02, 0.035, 0.01)])
def test_it_is_the_way_that_the_leader_drove(noise: float, off: float, length: float) -> None:
    """On a slalom no point is far from the way, and the trail is as long as the way to 0.2 %; 1 % with noise."""
    trail = Trail()
    show(trail, slalom(0.5, 20.0), noise)
    dense = list(slalom(0.5, 20.0))
    dense = [between([Sample(0.0, a), Sample(1.0, b)], s / 5) for a, b in pairwise(dense) for s in range(5)]
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
    last = trail.path.at(trail.path.end)
    assert math.hypot(last.x - turn, last.y) < 2.0
    assert max(trail.path.at(0.05 * i).x for i in range(round(trail.path.end / 0.05))) <= on[-1].x + 0.01


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 6), st.floats(-0.1, 0.1))
def test_a_parabola_is_found_exactly(terms: tuple[float, ...], place: float) -> None:
    """Samples on a parabola give its own point."""
    a, b, c, d, e, f = terms
    samples = [
        Sample(0.05 * i, Pose2(a + b * u + c * u * u, d + e * u + f * u * u, 0.0))
        for i in range(-5, 6)
        for u in [0.05 * i]
    ]
    u = place
    assert fit(samples, place, 0.25) == pytest.approx((a + b * u + c * u * u, d + e * u + f * u * u), abs=1e-6)
