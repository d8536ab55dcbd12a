"""Where a leader has driven, as a follower saw it: poses by arc length behind it.

Its poses may be noisy and late. So the trail is not the poses themselves, whose zigzag would be longer than the way,
but a smooth line through them, which ends a little behind the leader. How far the leader has come, and how fast it
drives, is estimated (an alpha-beta filter).
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from zteam.geometry import Point2, Pose2, normalize_angle
from zteam.robot.behaviors.path import Polyline

_SPACING = 0.1
"""Metres between two points of the trail."""
_REACH, _MOST_REACH = 0.1, 0.25
"""Metres of the way before and behind a point of the trail whose poses tell where it is: without noise, and at most."""
_STEP = 0.01
"""Metres that the leader has to come forward for its next pose to tell something of the trail."""
_REVERSE = 0.05
"""Metres that the leader backs up behind the trail's end before its trail is cut."""
_BESIDE = 0.2
"""Metres beside its trail at which it backs up another way."""
_JUMP = 1.0
"""Metres in one step after which the leader has not driven but was moved."""
_CHORD = 0.1
"""Metres on either side between which a direction is measured."""
_PLACE_GAIN, _SPEED_GAIN = 0.75, 0.25
"""Of the alpha-beta filter: critically damped."""
_NOISE_GAIN, _LEAST_NOISE = 0.05, 0.002
"""How fast the mean deviation of a pose from the place that was expected is learnt; metres that it is at least."""
_SURPRISE = 6.0
"""So many mean deviations are no noise: the leader has changed its speed, and the pose is believed."""
_STANDING, _PER_NOISE = 0.02, 8.0
"""m/s: a slower leader stands; and 1/s: so much more for each metre of noise, because its speed is then less sure."""
_LONGEST = 500.0
"""Metres of the trail that are kept at most."""


class Sample(NamedTuple):
    """A pose of the leader."""

    place: float
    pose: Pose2


class LeaderTrail:
    """The trail of one leader. Places on it are metres of arc length; it goes straight on before its beginning."""

    def __init__(self) -> None:
        self.leader = Pose2(0.0, 0.0, 0.0)
        """The newest pose in map."""
        self.place = 0.0
        """Where the leader is on its trail, as far as can be told."""
        self.speed = 0.0
        """Of the leader along its trail, m/s."""
        self.path = Polyline()
        """The trail up to a little behind the leader."""
        self._has_turned = False
        """Whether it ends where the leader turned round."""
        self._first = self.leader
        """The pose at the trail's beginning."""
        self._noise = 0.005
        """Metres: the mean deviation of a pose from the place that was expected."""
        self.stamp = 0
        """Of that pose, ns."""
        self._samples: list[Sample] = []
        """The newest poses, by place: from a little before the end of `path` on."""

    @property
    def stands(self) -> bool:
        """Whether the leader stands, as far as can be told."""
        return abs(self.speed) < _STANDING + _PER_NOISE * (self._noise - _LEAST_NOISE)

    def forget(self) -> None:
        """Begin anew with the next pose."""
        self.path = Polyline()

    def is_far(self, leader: Pose2) -> bool:
        """Whether the leader cannot have driven to this pose from the last one: it was set down there."""
        return not len(self.path) or math.hypot(leader.x - self.leader.x, leader.y - self.leader.y) > _JUMP

    def begin(self, first: Pose2, way: Iterable[Point2], leader: Pose2, stamp: int) -> None:
        """Begin anew with a way from `first` to this pose of the leader, of time `stamp` (ns)."""
        self.path = Polyline([first[:2], *way, leader[:2]])
        self._first, self.leader, self.stamp = first, leader, stamp
        self.place, self.speed = self.path.end, 0.0
        self._samples, self._has_turned = [Sample(self.place, leader)], False

    def add(self, leader: Pose2, stamp: int, keep: float) -> None:
        """The leader's newest pose, of time `stamp` (ns); forgets what lies more than `keep` metres behind."""
        if self.is_far(leader):
            self.begin(leader, (), leader, stamp)
            return
        seconds = (stamp - self.stamp) / 1e9
        if seconds <= 0.0:
            return
        self.leader, self.stamp = leader, stamp
        self._estimate(self._measure(leader), seconds)
        self._grow(leader)
        keep = min(keep, _LONGEST)
        if self.place - self.path.start > keep + 1.0:
            self._first = self.at(self.place - keep)
            self.path.drop_before(self.place - keep)

    def at(self, place: float) -> Pose2:
        """The pose that the leader had at this place; extrapolated straight behind the beginning and ahead."""
        path = self.path
        if place >= self.place:
            return self.leader.compose(Pose2(place - self.place, 0.0, 0.0))
        if place <= path.start:
            return self._first.compose(Pose2(place - path.start, 0.0, 0.0))
        if place > path.end - _CHORD:
            return between([*self._samples, Sample(self.place, self.leader)], place)
        (x, y), behind, ahead = path.point(place), path.point(place - _CHORD), path.point(place + _CHORD)
        return Pose2(x, y, math.atan2(ahead[1] - behind[1], ahead[0] - behind[0]))

    def curvature(self, place: float) -> float:
        """1/m, left positive."""
        low, high = place - _CHORD, min(place + _CHORD, self.place)
        low = min(low, high - _CHORD)
        return normalize_angle(self.at(high).yaw - self.at(low).yaw) / (high - low)

    def _measure(self, leader: Pose2) -> float:
        """The place of this pose. Cuts the trail if the leader has backed up behind its end."""
        path = self.path
        if self._has_turned:
            return path.end + math.hypot(leader.x - path.last[0], leader.y - path.last[1])
        # The direction of a single point is the leader's.
        tip = path.at(path.end) if len(path) > 1 else Pose2(*path.last, leader.yaw)
        ahead, _ = tip.locate(leader.x, leader.y)
        backs_up = ahead <= -_REVERSE
        place = path.project(leader.x, leader.y, path.end - _JUMP) if backs_up else path.end
        is_beside = backs_up and math.dist(leader[:2], path.point(place)) > _BESIDE
        if is_beside or math.cos(leader.yaw - tip.yaw) < 0.0:
            # It has turned round, or backs up another way: the trail goes on from here.
            path.append(leader.x, leader.y)
            self._samples, self._has_turned = [Sample(path.end, leader)], True
            return path.end
        if ahead >= 0.0:
            return path.end + math.dist(leader[:2], tip[:2])
        if ahead > -_REVERSE:
            return path.end + ahead
        path.cut_after(place)
        self._samples = []
        return path.end

    def _estimate(self, measured: float, seconds: float) -> None:
        expected = self.place + self.speed * seconds
        error = measured - expected
        most = _SURPRISE * self._noise
        is_surprise = abs(error) > most
        self.place = expected + (1.0 if is_surprise else _PLACE_GAIN) * error
        self.speed += (1.0 if is_surprise else _SPEED_GAIN) * error / seconds
        self._noise = max(_LEAST_NOISE, self._noise + _NOISE_GAIN * (min(abs(error), most) - self._noise))

    def _grow(self, leader: Pose2) -> None:
        """Add the points of the trail that the leader is far enough ahead of."""
        path, samples = self.path, self._samples
        while samples and samples[-1].place > self.place + _REVERSE:
            samples.pop()
        if not samples or self.place >= samples[-1].place + _STEP:
            samples.append(Sample(self.place, leader))
        if self.place < path.end + _SPACING + _REACH:
            return
        reach = min(_MOST_REACH, _REACH + 10.0 * (self._noise - _LEAST_NOISE))
        while self.place >= path.end + _SPACING + reach:
            place = path.end + _SPACING
            while len(samples) > 1 and samples[1].place < place - _MOST_REACH:
                samples.pop(0)
            before = path.end
            path.append(*fit(samples, place, reach))
            self._has_turned = False
            if path.end == before:
                break


def fit(samples: Sequence[Sample], place: float, reach: float) -> tuple[float, float]:
    """The point at `place` of the least-squares parabola of all samples within `reach`; with too few, as `between`."""
    s0 = s1 = s2 = s3 = s4 = x0 = x1 = x2 = y0 = y1 = y2 = 0.0
    for at, (x, y, _yaw) in samples:
        u = (at - place) / reach
        if abs(u) > 1.0:
            continue
        v = u * u
        s0, s1, s2, s3, s4 = s0 + 1.0, s1 + u, s2 + v, s3 + u * v, s4 + v * v
        x0, x1, x2 = x0 + x, x1 + u * x, x2 + v * x
        y0, y1, y2 = y0 + y, y1 + u * y, y2 + v * y
    # The constant term of the parabola, by Cramer's rule on the normal equations.
    a, b, c = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    det = s0 * a + s1 * b + s2 * c
    if s0 < 4.0 or det < 1e-3:
        return between(samples, place)[:2]
    return (x0 * a + x1 * b + x2 * c) / det, (y0 * a + y1 * b + y2 * c) / det


def between(samples: Sequence[Sample], place: float) -> Pose2:
    """The pose at `place` between the samples on either side; the first or the last one beyond them."""
    after = next((i for i, sample in enumerate(samples) if sample.place > place), len(samples))
    if after == 0 or after == len(samples):
        return samples[min(after, len(samples) - 1)].pose
    (begin, a), (end, b) = samples[after - 1], samples[after]
    share = (place - begin) / (end - begin)
    yaw = a.yaw + share * normalize_angle(b.yaw - a.yaw)
    return Pose2(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), yaw)
