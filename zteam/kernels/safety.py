"""The kernels of robots (safety.c, escape.c): what a base meets, and how it gets free. As `binding.py` says."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from zteam.kernels.binding import Cells, Floats, check_within, empty, ffi, lib, memory

NO_NUMBER, BLIND, UNSEEN, STOPPED = 1, 2, 3, 4
"""Why a velocity is less than was wanted. 0: it is not."""
Triple = tuple[float, float, float]
"""x and y (m/s, m) and yaw or turn (rad, rad/s)."""


class BaseKernel:
    """The hull of a base and its limits, for C; kernels.h has the numbers."""

    def __init__(self, planes: Floats, corners: Floats, border: Floats, **numbers: Any) -> None:
        """`planes` (sides, 3), `corners` (tips, 2) and `border` (2, edge)."""
        sizes = {"sides": len(planes), "tips": len(corners), "edge": border.shape[-1]}
        arrays = {
            "planes": memory("planes", planes, sizes["sides"], 3),
            "corners": memory("corners", corners, sizes["tips"], 2),
            "border": memory("border", border, 2, sizes["edge"]),
        }
        self._kept, self.struct = arrays, ffi.new("base_limits *", {**arrays, **sizes, **numbers})

    def motion_of(self, x: float, y: float, turn: float) -> Triple | None:
        """What the base makes of a command within its limits of speed; None if that is no number."""
        motion = ffi.new("double[3]")
        return tuple(motion) if lib.motion_of(self.struct, (x, y, turn), motion) else None

    def command_of(self, motion: Triple) -> Triple:
        """The command that makes the base do this: of a car the angle of its wheels is last."""
        command = ffi.new("double[3]")
        lib.command_of(self.struct, motion, command)
        return tuple(command)

    def stop_time(self, motion: Triple) -> float:
        """Seconds that braking along the arc takes."""
        return float(lib.stop_time(self.struct, motion))

    def meet(self, motion: Triple, seconds: float, points: Floats, clearance: float = 0.0) -> float:
        """Seconds until a base that keeps a motion first comes nearer to a point of (2, n) than the margin and
        `clearance` (m), inf if it does not within `seconds`.

        Where it is nearer than that now, what counts is when it comes nearer still: so it may always move away.
        """
        count = points.shape[-1]
        return float(lib.meet(self.struct, motion, seconds, clearance, memory("points", points, 2, count), count))


class SafetyMemory:
    """What the safety layer of one robot remembers, and what comes in a step."""

    def __init__(self) -> None:
        self._memory, self._inputs = ffi.new("safety_memory *"), ffi.new("safety_inputs *")
        self._odometry, self._kept = ffi.new("double[6]"), dict[str, Any]()
        """Arrays that C knows have to outlive their pointers."""
        self._points = np.empty((3, 0))
        self._make_room(0)

    def _make_room(self, beams: int) -> None:
        """For the points of a scan with so many beams."""
        points, count = self._points, self._memory.count
        self._points = np.empty((3, 2 * count + beams + 1))
        self._points[:, :count] = points[:, :count]
        known, self._kept["silent"] = memory("known", self._points, *self._points.shape, out=True), ffi.new("double[]", beams)
        self._memory.known, self._memory.silent, self._memory.room = known, self._kept["silent"], self._points.shape[1]

    @property
    def points(self) -> Floats:
        """(2, n) in the base frame: what stands around."""
        return self._points[:2, : self._memory.count].copy()

    @property
    def side(self) -> int:
        """Of the last cause: 0 ahead, 1 behind, 2 beside."""
        return int(self._memory.side)

    @property
    def met(self) -> int:
        """Of the last stop: the robot that stands in the way, -1 for an obstacle."""
        return int(self._memory.met)

    def take_base(self, base: BaseKernel) -> None:
        """The base is this one; what stood around another one is forgotten."""
        self._kept["base"], self._memory.base, self._memory.has_pose = base, base.struct, False

    def take_mates(self, mates: Sequence[tuple[int, int, BaseKernel]]) -> None:
        """The teammates: the id of each, its row of the poses, and its base."""
        before = {(mate.robot_id, mate.base): mate for mate in self._memory.mates[0 : self._memory.mate_count]}
        made = ffi.new("teammate[]", len(mates))
        for mate, (robot, row, base) in zip(made, mates, strict=True):
            if (robot, base.struct) in before:
                ffi.memmove(ffi.addressof(mate), ffi.addressof(before[robot, base.struct]), ffi.sizeof("teammate"))
            mate.robot_id, mate.row, mate.base = robot, row, base.struct
        self._kept["mates"], self._kept["bases"] = made, mates
        self._memory.mates, self._memory.mate_count = made, len(mates)

    def take_odometry(self, told: Sequence[float] | None) -> None:
        """Pose in `odom` (m, m, rad) and velocity (m/s, m/s, rad/s); None without odometry."""
        if told is not None:
            self._odometry[0:6] = told
        self._inputs.odom = ffi.NULL if told is None else self._odometry

    def take_scan(
        self, angles: Floats, axes: Floats, distances: Floats, laser: tuple[float, float], range_max: float,
        place: tuple[float, float], *, all_speak: bool,
    ) -> None:  # fmt: skip
        """A new scan: bearings (n), their cosines and sines (2, n), distances (m; NaN: the beam says nothing).

        `laser`: first angle and increment (rad); `place`: where it is in the base (m).
        """
        beams, inputs = distances.size, self._inputs
        if self._memory.count + beams > self._memory.room or beams > len(self._kept["silent"]):
            self._make_room(beams)
        self._kept["scan"] = angles, axes, distances
        inputs.angles, (inputs.axes, inputs.distances, inputs.beams) = memory("angles", angles, beams), _scan(axes, distances)
        inputs.start, inputs.step = laser
        inputs.laser_x, inputs.laser_y = place
        inputs.range, inputs.all_speak = range_max, all_speak

    def limit(
        self, wanted: Triple, poses: Floats, stamps: Cells, own_row: int, now: int, dt: float,
        *, is_old: bool, has_scan: bool, lacks: bool,
    ) -> tuple[int, Triple]:  # fmt: skip
        """Why a wanted command is cut, and what is left of it.

        `poses` (rows, 3; m, m, rad) and `stamps` (rows; ns) of robots in `map`, NaN where not known. `has_scan`: a new
        one was taken; `is_old`: there is none, or an old one; `lacks`: a stop is due to data that the driver lacks.
        """
        inputs, rows = self._inputs, len(stamps)
        inputs.poses, inputs.stamps = memory("poses", poses, rows, 3), memory("stamps", stamps, rows)
        inputs.own_row, inputs.now, inputs.dt = own_row, now, dt
        inputs.is_old, inputs.has_scan, inputs.lacks = is_old, has_scan, lacks
        cause = lib.limit(self._memory, inputs, wanted)
        return cause, tuple(self._memory.command)

    def stand(self) -> None:
        """The base is told to stand, and nothing holds it."""
        self._memory.motion, self._memory.held = (0.0, 0.0, 0.0), 0


def see(
    known: Floats, axes: Floats, distances: Floats, laser: tuple[float, float], few: int,
    place: tuple[float, float], far: float, way: float, oldest: float,
) -> Floats:  # fmt: skip
    """What is known after a scan: `known` without what the scan tells of anew, and its hits.

    `known` (3, n) and what is returned: x and y in the base frame (m), and how far the base had travelled when that was
    seen (m): `way` now, and less than `oldest` is forgotten. So is what is more than `far` (m) from the laser, which
    has a `place` (m) in the base frame. The scan: directions `axes` (2, m: cosines and sines) and `distances`
    (m; NaN: it says nothing) of beams, whose first angle and increment are `laser` (rad). Of every `few` beams the
    nearest hit counts. A beam tells of points up to its end, and a little beyond.
    """
    count, beams = known.shape[-1], distances.size
    if few < 1:
        raise ValueError(f"few: {few} is less than 1")
    memory("known", known, 3, count)
    seen = np.empty((3, count + beams))
    seen[:, :count] = known
    made = memory("known", seen, *seen.shape, out=True)
    kept = lib.see(made, count, count + beams, *_scan(axes, distances), *laser, few, *place, far, way, oldest)
    return seen[:, :kept]


def see_poses(poses: Floats, own: int) -> list[Triple]:
    """Poses (n, 3; m, m, rad) of one frame in the frame at one of them."""
    count = len(poses)
    if not 0 <= own < count:
        raise ValueError(f"own: {own} is no row of {count}")
    seen, made = empty(np.float64, count, 3)
    lib.see_poses(memory("poses", poses, count, 3), count, own, made)
    return seen.tolist()


def read_ranges(distances: Floats, least: float, most: float) -> tuple[float, int]:
    """Make distances of the ranges (n) of a scan with these limits, in place; the nearest (m), and how many beams say
    nothing. `zteam.messages.laser` has the rule."""
    nearest = ffi.new("double *")
    silent = lib.read_ranges(memory("ranges", distances, distances.size, out=True), distances.size, least, most, nearest)
    return nearest[0], silent


def look_along(axes: Floats, distances: Floats, half_width: float, heading: float) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` (m) from the laser towards `heading` (rad), else inf.

    `axes` and `distances` are as for `see`.
    """
    return float(lib.look_along(*_scan(axes, distances), half_width, heading, -math.inf))


def first_clear(axes: Floats, distances: Floats, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    given = *_scan(axes, distances), half_width, reach, memory("headings", headings, count), count
    return int(lib.first_clear(*given))


def _scan(axes: Floats, distances: Floats) -> tuple[Any, Any, int]:
    beams = distances.size
    return memory("axes", axes, 2, beams), memory("distances", distances, beams), beams


def find_moves(
    planes: Floats, radius: float, points: ArrayLike, hits: int, way: ArrayLike, shunned: ArrayLike, failed: ArrayLike,
    headings: Floats, cell: float, leaves: tuple[float, float, float],
) -> Floats:  # fmt: skip
    """The moves (n, 4) of a base out of a narrow place: the kind of each, and x, y and yaw of where it ends.

    They lead along `way`. If it has no points, they lead away: `leaves` are the metres from the base if there is room,
    at least, and from places `shunned`. Of `points` the first `hits` are on what stands around, the others on
    teammates. kernels.h has the shapes. Raises ValueError, and MemoryError if `radius` (m) is more than 10 000 cells.
    """
    places = cell * np.arange(-42, 43)
    given = [memory("headings", headings, 16, 5), memory("away", np.hypot(places, places[:, None]), 85, 85)]
    check_within("headings", headings[:, :2], -2, 3)
    for rows, width in ((planes, 3), (points, 2), (way, 2), (shunned, 2), (failed, 4)):
        array = np.array(rows, float, order="C").reshape(-1, width)
        given += memory("rows", array, *array.shape), len(array)
    moves, made = empty(np.float64, 200, 4)
    count = lib.find_moves(ffi.new("surroundings *", (*given, hits, radius, cell, *leaves)), made)
    if count < 0:
        raise MemoryError(f"no room for a search with cells of {cell} m and a base of {radius} m")
    return moves[len(moves) - count :]
