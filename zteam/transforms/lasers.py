"""Scans as the base of their robot sees them: a laser may be mounted turned, upside down or a little tilted.

Every reader of scans begins here, and no other place turns beams.
"""

import math
from contextlib import suppress
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.clock import to_ns
from zteam.geometry import Point2, Quat, normalize_angle
from zteam.kernels.transforms import Floats
from zteam.messages import Header, LaserScan, ns_from_time
from zteam.messages.laser import read_ranges
from zteam.transforms.buffer import Buffer
from zteam.transforms.errors import TransformException
from zteam.transforms.rigid import IDENTITY, floats_of

MAX_TILT = math.radians(10.0)
"""Radians between the plane of a laser's beams and the base's, at most: a beam then rises or falls by 17 cm a metre."""
MAX_OFFSET = 5.0
"""Metres between a laser and the origin of its base, at most. More is a mistake, such as millimetres."""
_LEVEL = 1e-4
"""Radians: with less tilt, ranges change by less than float32 rounds."""
MAX_AGE = to_ns(0.5)
"""Nanoseconds between a scan and the newest pose of a laser that moves on its base, such as one that nods."""


class LaserProblem(NamedTuple):
    """Why a scan cannot be used."""

    noun: str
    """What is missing, for a list of what a robot waits for."""
    way_out: str


class LevelScan(NamedTuple):
    """A scan in the axes of its robot's base."""

    scan: LaserScan | None
    """Its beams run from right to left, its angles are bearings from the base's x axis; None if it cannot be used."""
    laser: Point2
    """Where the beams begin, in the base (m)."""
    problem: LaserProblem | None = None
    """Why `scan` is None."""


def turn_scan(scan: LaserScan, rotation: Quat) -> LaserScan:
    """A scan in the axes of a base in which its laser has this rotation (a unit quaternion), from right to left.

    Of a tilted laser the ranges are those in the base's plane. Its bearings are the untilted ones, so that they stay
    evenly spread: they are off by a quarter of the squared tilt (rad), 0.44 degrees at MAX_TILT.
    """
    if rotation == IDENTITY[3:] and scan.angle_increment >= 0.0:
        return scan
    (i, j, k, w), (tilt, is_upright) = rotation, tilt_of(rotation)
    # What is left without the tilt: a rotation about z, or half a turn about an axis in the plane.
    turn, sense = (math.atan2(k, w), 1.0) if is_upright else (math.atan2(j, i), -1.0)
    start, step = normalize_angle(2.0 * turn) + sense * scan.angle_min, sense * scan.angle_increment
    ranges, intensities, least, most = scan.ranges, scan.intensities, scan.range_min, scan.range_max
    if tilt > _LEVEL:
        ranges = _project(scan, rotation, most := most * math.cos(tilt))
        least *= math.cos(tilt)
    elif start == scan.angle_min and step == scan.angle_increment and not step < 0.0:
        return scan
    if step < 0.0:
        start, step = start + step * (len(ranges) - 1), -step
        ranges, intensities = ranges[::-1], intensities[::-1]
    return msgspec.structs.replace(
        scan,
        angle_min=start,
        angle_max=start + step * (len(ranges) - 1),
        angle_increment=step,
        range_min=least,
        range_max=most,
        ranges=_fixed(ranges),
        intensities=_fixed(intensities),
    )


def tilt_of(rotation: Quat) -> tuple[float, bool]:
    """The angle (rad, 0 to pi/2) between the xy plane before and after it, and whether the z axis still points up."""
    i, j, k, w = rotation
    aside, along = math.hypot(i, j), math.hypot(k, w)
    return 2.0 * math.atan2(min(aside, along), max(aside, along)), aside <= along


def _project(scan: LaserScan, rotation: Quat, most: float) -> NDArray[np.float32]:
    """The ranges (n,) in the plane; at `most` (m) a laser sees no farther in any direction."""
    i, j, k, w = rotation
    with np.errstate(invalid="ignore"):
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        rise = 2.0 * (i * k - j * w) * np.cos(angles) + 2.0 * (j * k + i * w) * np.sin(angles)
    read = read_ranges(scan.ranges, scan.range_min, scan.range_max).distances
    found: NDArray[np.float32] = (read * np.sqrt(1.0 - rise * rise)).astype(np.float32)
    found[found >= most] = np.inf
    # Too close to measure.
    found[read == 0.0] = -np.inf
    return found


def _fixed(array: NDArray[np.float32]) -> NDArray[np.float32]:
    """The array, in one piece and read-only, as those of messages from the bus are."""
    copy: NDArray[np.float32] = np.array(array, np.float32)
    copy.flags.writeable = False
    return copy


class LaserMounts:
    """Where the lasers of one robot are on its base, by the newest transforms."""

    def __init__(self, robot_id: int, *buffers: Buffer) -> None:
        """A later buffer counts where the ones before it do not connect the laser to the base."""
        self._robot, self._buffers = names.robot_name(robot_id), buffers
        self._base, self._odom = (names.robot_frame(robot_id, each) for each in (names.BASE_FOOTPRINT, names.ODOM))
        self._statics, self._tf = (names.robot_key(robot_id, each) for each in (names.TF_STATIC, names.TF))
        self._newest: tuple[LaserScan, Floats, LevelScan] | None = None
        self._fixed: tuple[str, list[int], Floats] | None = None
        """The frame of a laser that does not move on its base, the buffers' versions, and base_from_laser."""

    def level(self, scan: LaserScan) -> LevelScan:
        """A scan of one of the robot's lasers as the base sees it; the same object for the same scan and mount."""
        mount = self._find(scan.header)
        if isinstance(mount, LaserProblem):
            return LevelScan(None, (0.0, 0.0), mount)
        newest = self._newest
        if newest is None or newest[0] is not scan or newest[1] != mount:
            level = LevelScan(turn_scan(scan, mount[3:]), mount[:2])
            newest = self._newest = scan, mount, level
        return newest[2]

    def _find(self, header: Header) -> Floats | LaserProblem:
        """base_from_laser; or why it is not known, or of no use."""
        versions, fixed = [buffer.version for buffer in self._buffers], self._fixed
        if fixed is not None and fixed[0] == header.frame_id and fixed[1] == versions:
            return fixed[2]
        given, stamp = names.strip_slash(header.frame_id), ns_from_time(header.stamp)
        if not given:
            return self._problem("a frame_id in the header of its scans", "its laser's frame")
        is_full = names.robot_id_of(given.partition("/")[0]) is not None
        frame = given if is_full else names.resolve_frame(self._robot, header.frame_id)
        for buffer in self._buffers:
            # A frame of the team file may have a name without a prefix.
            known = next((each for each in (frame, given) if len(buffer.chain(each)) > 1), frame)
            found = self._find_in(buffer, known, stamp)
            if found is None:
                continue
            if not isinstance(found, LaserProblem) and not buffer.latest_common_time(self._base, known):
                self._fixed = header.frame_id, versions, found
            return found
        return self._problem(f"its laser's frame {frame} ({self._statics}, from its base)", frame)

    def _problem(self, noun: str, frame: str) -> LaserProblem:
        where = f"{self._base} -> {frame} on {self._statics}, in metres and level to {math.degrees(MAX_TILT):.0f}°"
        moves = f"with every scan on {self._tf} if it moves"
        return LaserProblem(noun, f"have its base publish {where} ({moves}), and name it in the header of its scans")

    def _find_in(self, buffer: Buffer, frame: str, stamp: int) -> Floats | LaserProblem | None:
        """The same by one buffer, None where it does not connect the frame to the base."""
        with buffer.lock:
            above, below = buffer.chain(frame), buffer.chain(self._base)
            common = next((each for each in above if each in below), None)
            if common is None:
                return None
            if common in buffer.chain(self._odom) or not common.startswith(f"{self._robot}/"):
                return self._problem(f"a laser on its own base (its scans are in {frame}, which is not)", frame)
            mount = self._newest_in(buffer, frame, stamp)
        if mount is None:
            return self._problem(f"newer transforms of its laser's frame {frame} ({self._tf})", frame)
        offset, (tilt, _) = math.hypot(*mount[:2]), tilt_of(mount[3:])
        if not offset <= MAX_OFFSET:
            far = f"{frame} is {offset:.3g} m away from it, {MAX_OFFSET:g} m is the most"
            return self._problem(f"a laser on its base ({far})", frame)
        if tilt > MAX_TILT + 1e-9:
            tilted, most = (f"{math.degrees(angle):.0f}°" for angle in (tilt, MAX_TILT))
            return self._problem(f"a level laser ({frame} is tilted by {tilted}, {most} is the most)", frame)
        return mount

    def _newest_in(self, buffer: Buffer, frame: str, stamp: int) -> Floats | None:
        """base_from_laser at a scan's stamp, or the newest one if that is not older than MAX_AGE."""
        for time in (stamp, 0):
            with suppress(TransformException):
                found = buffer.lookup_transform(self._base, frame, time)
                newest = ns_from_time(found.header.stamp)
                return floats_of(found.transform) if not newest or abs(stamp - newest) <= MAX_AGE else None
        return None
