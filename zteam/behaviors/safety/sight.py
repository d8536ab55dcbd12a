"""Where a robot's laser looks, and which of its beams say nothing."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.safety.swept import Motion, Outline, place_after
from zteam.behaviors.scans import Beams
from zteam.clock import to_ns
from zteam.geometry import Pose2, normalize_angle

Floats = NDArray[np.float64]

STALE_AFTER = 0.5
"""Seconds after which a scan, the word of a beam, or the robot's own pose, is too old to move on."""
DAZZLE_ANGLE = math.radians(5.0)
"""Radians to either side of a teammate whose pose is fresh within which beams that say nothing are explained: its laser
dazzles, by 2 degrees in the simulator. The teammate itself is known from its pose."""
_SECTORS = 360
"""Of bearings: a beam that speaks does so for the others of its sector."""
_NARROW = math.radians(15.0)
"""Radians to either side of its way that a laser has to see for a drive forwards."""
_LOOKS = 6
"""Places on an arc at which is looked whether beams towards it say something."""
_NONE = np.empty(0)


class Sight:
    """What the newest scan shows, and what was silent before. Bearings are radians along the base's axes."""

    def __init__(self) -> None:
        self.beams: Beams | None = None
        """The newest scan, read; None without usable beams."""
        self.laser = Pose2(0.0, 0.0, 0.0)
        """In the base frame."""
        self.range = math.inf
        """Metres that the laser sees."""
        self.silent: Floats = _NONE
        """Bearings, from the laser, of beams that have said nothing for a while."""
        self._middle, self._half = 0.0, 0.0
        """The laser looks so far (rad) to either side of a bearing."""
        self._heard, self._whole = np.full(_SECTORS, -(1 << 62)), -(1 << 62)
        """When a beam of each sector of `odom` spoke last (ns), and all of them at once."""

    def take(self, beams: Beams, laser: Pose2, yaw: float, now: int) -> None:
        """A scan of `now` (ns) by a laser at a pose of the base, which is turned by `yaw` in `odom`."""
        start, step, count = beams.laser
        self.beams, self.laser, self.silent = beams, laser, _NONE
        self._middle, self._half = start + laser.yaw + 0.5 * step * (count - 1), 0.5 * abs(step) * count
        is_silent = None if beams.all_speak else np.isnan(beams.distances)
        if is_silent is None or not is_silent.any():
            self._whole = now
            return
        bearings = beams.directions.angles + laser.yaw
        sectors = np.remainder((bearings + yaw) * (_SECTORS / math.tau), _SECTORS).astype(np.intp) % _SECTORS
        if self._whole > 0:
            # The beams were then where they are now, or nearly so.
            self._heard[sectors], self._whole = self._whole, -1
        self._heard[sectors[~is_silent]] = now
        self.silent = bearings[is_silent & (self._heard[sectors] < now - to_ns(STALE_AFTER))]

    def looks_along(self, motion: Motion, seconds: float, forwards: bool) -> bool:
        """Whether the laser looks where the base drives to within `seconds`: a little to either side of a way forwards,
        and else as far as the base is wide. A turn on the spot is no way."""
        way = math.atan2(motion.y, motion.x)
        bend = max(-1.0, min(1.0, 0.5 * motion.turn * seconds))
        return not motion.speed or (self.looks(way + bend, _NARROW) if forwards else self.looks(way, 0.5 * math.pi))

    def looks(self, bearing: float, spare: float) -> bool:
        """Whether the laser looks to all bearings within `spare` (rad) of one."""
        return self._half > 3.1 or abs(normalize_angle(bearing - self._middle)) + spare <= self._half

    def is_blind(self, outline: Outline, motion: Motion, seconds: float, mates: list[tuple[float, float]]) -> bool:
        """Whether a beam that says nothing points into the way; those towards `mates` (x, y) are explained."""
        silent, laser = self.silent, self.laser
        for x, y in mates:
            silent = silent[np.abs(_wrap(silent - math.atan2(y - laser.y, x - laser.x))) > DAZZLE_ANGLE]
        if not silent.size:
            return False
        seconds = max(seconds, 0.3 / motion.speed) / _LOOKS
        places = [place_after(motion, seconds * (i + 1)) for i in range(_LOOKS)]
        corners = [place.compose(Pose2(x, y, 0.0))[:2] for place in places for x, y in outline.corners.tolist()]
        x, y = (points := np.array(corners).T)[:, outline.distances(points) > 0.0]
        bearings = np.arctan2(y - laser.y, x - laser.x)
        bearings = bearings[np.abs(_wrap(bearings - self._middle)) <= self._half]
        if not bearings.size:
            return False
        middle = math.atan2(np.sin(bearings).sum(), np.cos(bearings).sum())
        aside, off = _wrap(bearings - middle), _wrap(silent - middle)
        return bool(((off >= aside.min()) & (off <= aside.max())).any())


def _wrap(angles: Floats) -> Floats:
    """In [-pi, pi)."""
    wrapped: Floats = np.remainder(angles + math.pi, math.tau) - math.pi
    return wrapped
