"""The kernels of the simulator (squares.c, edges.c, bodies.c, bases.c, chipmunk.c), as `binding.py` says."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Floats as Floats
from zteam.kernels.binding import check_within, empty, ffi, lib, memory


def _memories(*shape: int, **arrays: NDArray[Any]) -> dict[str, Any]:
    """The memory of arrays of one shape, by the names that they have in C."""
    return {name: memory(name, array, *shape) for name, array in arrays.items()}


Bitmap = tuple[NDArray[np.uint8], int, int, float, float, float, float, float, float, float]
"""What rays and bodies meet, as in kernels.h: the largest empty square at each cell (quadrants, rows * columns + 1),
rows, columns, metres of a cell along x and y, x, y and yaw of its lower left corner in `map`, least and largest z."""


class Bitmaps:
    """Bitmaps for kernels."""

    def __init__(self, maps: Sequence[Bitmap]) -> None:
        self.count = len(maps)
        self._kept = []
        for sides, rows, columns, *_ in maps:
            if rows < 0 or columns < 0 or 4 * (rows * columns + 1) >= 1 << 31:
                raise ValueError(f"sides: {rows} x {columns} cells are none, or too many for 32 bits")
            self._kept.append(memory("sides", sides, 4, rows * columns + 1))
            if sides[:, -1].any():
                raise ValueError("sides: the last entry of each quadrant, where rays are parked, is not 0")
        self.data = ffi.new("bitmap[]", [(kept, *one[1:]) for kept, one in zip(self._kept, maps, strict=True)])


class BeamTable(NamedTuple):
    """Directions of the beams of fans in the sensor's frame."""

    cos: Floats
    """(tables, beams): one row for all fans, or one for each."""
    sin: Floats
    angle_min: float
    increment: float
    limit: float
    """Nothing at this distance (metres) or beyond is seen."""
    jitter: float = 0.0
    """Increments that a beam may be off its place."""

    @staticmethod
    def ahead(limit: float) -> "BeamTable":
        return BeamTable(np.ones((1, 1)), np.zeros((1, 1)), 0.0, 0.0, limit)


class Rays(NamedTuple):
    """Where fans of rays start: sensors in `map`, or in the base frames of their robots."""

    at: Floats
    """(3, fans): rows x, y (metres) and yaw (radians)."""
    z: Floats
    """(fans): metres above the ground."""
    owner: NDArray[np.int64]
    """(fans): the mover that carries the sensor and that the sensor does not see, or -1."""


class Fans:
    """Fans of rays, and what they met. The arrays are kept: their contents may change."""

    def __init__(self, mounts: Rays, beams: BeamTable) -> None:
        """The rays start at `mounts`, until `place` brings them to where the sensors are."""
        count, width = len(mounts.z), beams.cos.shape[1]
        tables = 1 if len(beams.cos) == 1 else count
        self._mounts, self.beams = mounts, beams
        self.at = mounts.at.copy()
        """(3, fans): rows x, y and yaw in `map`."""
        self.ranges, self.hits = np.empty((count, width)), np.empty((count, width), np.int32)
        """(fans, beams): metres, and what was met."""
        self._kept = {
            **_memories(3, count, at=self.at),
            **_memories(count, z=mounts.z, owner=mounts.owner),
            **_memories(tables, width, cosine=beams.cos, sine=beams.sin),
            **_memories(count, width, ranges=self.ranges, hits=self.hits),
            **_memories(width // 8 + 1, tops=np.empty(width // 8 + 1)),
        }
        _, _, *numbers = beams._asdict().items()
        self.data = ffi.new("fans *", {"count": count, "beams": width, "tables": tables, **dict(numbers), **self._kept})

    def place(self, poses: Floats) -> None:
        """Bring the rays of sensors that robots carry to where they are with the robots at `poses` (robots; x, y, yaw
        in `map`)."""
        count, robots = len(self._mounts.z), len(poses)
        mounts = memory("mounts", self._mounts.at, 3, count)
        places = memory("poses", poses, robots, 3)
        if not lib.place_mounts(count, self.data.owner, mounts, robots, places, self._kept["at"]):
            raise ValueError(f"owner: a robot is not within 0 to {robots - 1}")


Prism = tuple[Sequence[tuple[float, float]], float, float]
"""Vertices, counter-clockwise, and the heights between which it lies: least, greatest."""


class Polygons:
    """Polygons in groups that move together: the shapes of a mover, or a shape that stands still. Kernels move them."""

    def __init__(self, groups: Sequence[tuple[int, Sequence[Prism]]]) -> None:
        """Each group has a mover (or -1) and at least one shape, in the mover's frame; in `map` if it stands still."""
        shapes = [shape for _, own in groups for shape in own]
        vertices = [len(points) for points, _, _ in shapes]
        if not (all(vertices) and all(own for _, own in groups)):
            raise ValueError("groups: a group has no shape, or a shape has no vertices")
        self.owner = np.array([owner for owner, _ in groups], np.int64)
        self.movers = int(self.owner.max(initial=-1)) + 1
        check_within("owner", self.owner, -1, self.movers)
        # A circle about the middle of each group holds its shapes.
        corners = [np.array([point for points, _, _ in own for point in points], float) for _, own in groups]
        centre = np.array([0.5 * (own.min(axis=0) + own.max(axis=0)) for own in corners]).reshape(-1, 2)
        radius = [float(np.hypot(*(own - middle).T).max()) for own, middle in zip(corners, centre, strict=True)]
        x, y = np.concatenate([np.empty((0, 2)), *corners]).T
        count, widest = len(groups), max(vertices, default=0)
        arrays = {
            "local_x": x.copy(), "local_y": y.copy(), "x": x.copy(), "y": y.copy(),
            "first_vertex": np.cumsum([0, *vertices], dtype=np.int32),
            "first_shape": np.cumsum([0, *(len(own) for _, own in groups)], dtype=np.int32),
            "z_min": np.array([low for _, low, _ in shapes], float),
            "z_max": np.array([high for _, _, high in shapes], float),
            "owner": self.owner, "local_centre": centre, "radius": np.array(radius, float),
            "centre_x": centre[:, 0].copy(), "centre_y": centre[:, 1].copy(),
            "in_bin": np.empty(count, np.int32), "bin_start": np.empty(64 * 64 + 2, np.int32),
            "corner_x": np.empty(widest), "corner_y": np.empty(widest),
        }  # fmt: skip
        self._kept = {name: memory(name, array, *array.shape) for name, array in arrays.items()}
        counts = {"shapes": len(shapes), "groups": count, "movers": self.movers}
        self.data = ffi.new("polygons *", {**counts, **self._kept})
        self.move(np.zeros((self.movers, 3)))

    def move(self, poses: Floats) -> None:
        """Bring the groups of movers to `poses` (movers or more; x, y, yaw in `map`)."""
        lib.move_polygons(self.data, self.poses(poses))

    def poses(self, poses: Floats, *, out: bool = False) -> Any:
        """The memory of an array of poses (movers or more; x, y, yaw)."""
        if len(poses) < self.movers:
            raise ValueError(f"poses: {len(poses)} are too few for {self.movers} movers")
        return memory("poses", poses, len(poses), 3, out=out)


_cast_squares = lib.cast_squares_avx2 if lib.has_avx2() else lib.cast_squares


def build_fields(occupied: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The empty squares of a bitmap (rows, columns), row 0 at the bottom: (4, rows * columns + 1).

    Row q is the flattened field of quadrant q = (dx < 0) + 2 (dy < 0): at each cell the side of the largest square of
    free cells, at most 254, that begins there and extends into the quadrant. The last entry is a parking place.
    """
    rows, columns = occupied.shape
    sides = np.zeros((4, rows * columns + 1), np.uint8)
    for quadrant in range(4):
        view = occupied[:, ::-1] if quadrant & 1 else occupied
        free = np.ascontiguousarray(~(view[::-1] if quadrant & 2 else view))
        made = memory("sides", sides[quadrant], rows * columns + 1, out=True)
        lib.fill_squares(memory("free", free, rows, columns), rows, columns, made)
    return sides


def cast_squares(maps: Bitmaps, fans: Fans, mark: int) -> None:
    """Shorten ranges to the occupied cells of bitmaps, and set hits to `mark` (or the next, for the next bitmap) where
    one is nearer.

    A start inside an occupied cell gives 0. A sensor sees only a bitmap that has its height.
    """
    for index in range(maps.count):
        _cast_squares(maps.data + index, fans.data, mark + index)


def cast_edges(polygons: Polygons, fans: Fans) -> None:
    """Shorten ranges to polygons, to 0 in their interior, and set hits to the index of the shape that is nearer."""
    lib.cast_edges(polygons.data, fans.data)


def find_overlaps(polygons: Polygons, maps: Bitmaps, apart: bool, found: NDArray[np.bool_]) -> None:
    """Which movers (`found`) overlap a bitmap or what stands still where they are; with `apart` each other too."""
    if len(found) < polygons.movers:
        raise ValueError(f"found: {len(found)} are too few for {polygons.movers} movers")
    lib.find_overlaps(polygons.data, maps.data, maps.count, apart, memory("found", found, len(found), out=True))


def move_all(polygons: Polygons, maps: Bitmaps, poses: Floats, ends: Floats, blocked: NDArray[np.bool_]) -> None:
    """Move robots, in order, from `poses` (movers; x, y, yaw) to `ends` (robots; x, y, yaw): a move that meets
    something is `blocked` (robots), and not made at all. The polygons are at `poses`."""
    robots = len(ends)
    if robots > len(poses):
        raise ValueError(f"ends: {robots} are too many for {len(poses)} poses")
    lib.move_all(
        polygons.data, maps.data, maps.count, robots, polygons.poses(poses, out=True),
        memory("ends", ends, robots, 3), memory("blocked", blocked, robots, out=True),
    )  # fmt: skip


def hold(
    polygons: Polygons, maps: Bitmaps, half: Floats, poses: Floats, ends: Floats, suspects: NDArray[np.bool_],
    tangled: NDArray[np.bool_], apart: bool,
) -> Floats:  # fmt: skip
    """Cut the ways of the `suspects` (movers) from `poses` to `ends` (movers; x, y, yaw) to what is free; the shares
    (movers) that are left.

    `half` (groups) is half the width of a body in metres: no two places that are tested are farther apart. With `apart`
    bodies stay out of each other too, unless both are `tangled` (movers). The polygons are at `poses`.
    """
    movers, groups = len(poses), len(polygons.owner)
    (places, scratch), (shares, made) = empty(np.float64, movers), empty(np.float64, movers)
    places[:], shares[:] = 0.0, 1.0
    lib.hold(
        polygons.data, maps.data, maps.count, memory("half", half, groups), polygons.poses(poses),
        memory("ends", ends, movers, 3, out=True), memory("suspects", suspects, movers),
        memory("tangled", tangled, movers), apart, scratch, made,
    )  # fmt: skip
    return shares


def follow(poses: Floats, velocity: Floats, seconds: float, *, tangents: bool = False) -> Floats:
    """Where robots at `poses` (robots; x, y, yaw) get to at constant body velocity (robots; m/s, m/s, rad/s).

    On the exact arc or, with `tangents`, as Stage steps (Euler): straight ahead by the old heading, then the turn.
    """
    count = len(poses)
    ends, made = empty(np.float64, count, 3)
    ways = memory("poses", poses, count, 3), memory("velocity", velocity, count, 3)
    lib.follow(count, *ways, seconds, tangents, made)
    return ends


class Bases:
    """The bases of all robots, their odometry without errors, and their wheels.

    Rows are x, y (m/s) and yaw (rad/s) in the base frame.
    """

    def __init__(
        self, limits: Floats, is_car: NDArray[np.bool_], wheelbase: Floats, start: Floats,
        wheel_owner: NDArray[np.int64], wheel_rows: Floats,
    ) -> None:  # fmt: skip
        """`limits` (4, robots, 3): least and largest velocity, least (below 0) and largest acceleration.

        Odometry is zero at `start` (robots; x, y, yaw in `map`). A wheel turns by its row of `wheel_rows` (wheels, 3;
        rad/s for each unit of velocity) with its robot, `wheel_owner` (wheels).
        """
        robots, wheels = len(is_car), len(wheel_owner)
        check_within("wheel_owner", wheel_owner, 0, robots)
        self.setpoint, self.velocity, self.odom = np.zeros((3, robots, 3))
        """(robots, 3): velocity as commanded, within the limits; velocity as it was; pose seen from the start."""
        self.start, self.is_car = start, is_car
        self.angles, self.rates = np.zeros((2, wheels))
        """(wheels): rad since the start, and rad/s."""
        low, high, slow, fast = limits
        self._kept = {
            **_memories(robots, 3, low=low, high=high, slow=slow, fast=fast, start=start),
            **_memories(robots, 3, setpoint=self.setpoint, velocity=self.velocity, odom=self.odom),
            **_memories(robots, is_car=is_car, wheelbase=wheelbase),
            **_memories(wheels, wheel_owner=wheel_owner, angles=self.angles, rates=self.rates),
            **_memories(wheels, 3, wheel_rows=wheel_rows),
        }
        self._robots = robots
        self._data = ffi.new("bases *", {"robots": robots, "wheels": wheels, **self._kept})

    def obey(self, commands: Floats, fresh: NDArray[np.bool_], seconds: float) -> None:
        """Change the setpoints towards `commands` (robots, 3) as far as the limits allow in `seconds`; one that is not
        `fresh` (robots) is 0.

        A car's angular command is Stage's: the angle of the steered wheels, v sin(angle) / wheelbase the yaw rate.
        """
        count = self._robots
        given = memory("commands", commands, count, 3), memory("fresh", fresh, count)
        lib.obey(self._data, *given, seconds)

    def note_motion(self, before: Floats, after: Floats, seconds: float, *, tangents: bool) -> None:
        """Note velocity, odometry and wheels after the ways from `before` to `after` (robots; x, y, yaw in `map`).

        They were arcs or, with `tangents`, Stage's steps by the heading before.
        """
        count = self._robots
        given = memory("before", before, count, 3), memory("after", after, count, 3)
        lib.note_motion(self._data, *given, seconds, tangents)


CHIPMUNK = (
    "get_position", "get_velocity", "get_angle", "set_velocity", "set_force", "set_angular_velocity", "each_arbiter",
)  # fmt: skip
"""Chipmunk's functions of a body that kernels call: `get_position` is its cpBodyGetPosition."""


class ChipmunkBodies:
    """Bodies of Chipmunk, robots first."""

    def __init__(
        self, functions: Sequence[int], bodies: Sequence[int], mass: Floats, in_wall: NDArray[np.bool_],
        held: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """Addresses of the functions `CHIPMUNK`, and of the bodies, which have to outlive this; the robots' masses in
        kg; which bodies stand in a wall, and which were held in this tick."""
        self._count, self._robots = count, robots = len(bodies), len(mass)
        if robots > count:
            raise ValueError(f"mass: {robots} are too many for {count} bodies")
        self.touching, self.met, self.stalled = np.zeros((3, robots), bool)
        """(robots): what touches something, to which the caller adds contacts that begin; what something may have
        hindered in the last tick; what made less than half its way then."""
        self._kept = {
            **{name: ffi.cast("void *", there) for name, there in zip(CHIPMUNK, functions, strict=True)},
            **_memories(robots, mass=mass, touching=self.touching, met=self.met, stalled=self.stalled),
            **_memories(count, in_wall=in_wall, held=held),
            **_memories(robots, 3, ways=np.empty((robots, 3))),
            "bodies": ffi.new("void *[]", [ffi.cast("void *", body) for body in bodies]),
        }
        self._data = ffi.new("chipmunk *", {"count": count, "robots": robots, **self._kept})

    def plan(self, poses: Floats, velocity: Floats, seconds: float) -> float:
        """Plan the ways of a tick from `poses` (bodies, 3) at constant body velocity (robots, 3); return the longest
        along x or y in metres."""
        given = memory("poses", poses, self._count, 3), memory("velocity", velocity, self._robots, 3)
        return float(lib.plan_ways(self._data, *given, seconds))

    def drive(self, share: float, seconds: float, step: float, *, is_first: bool) -> None:
        """Set velocities that make this share of the ways in `seconds`, at the first step of a tick alone. What touches
        something gets a force instead, in each step (seconds)."""
        lib.drive_bodies(self._data, share, seconds, step, is_first)

    def poses(self) -> Floats:
        """(bodies, 3): x, y, yaw in `map`."""
        poses, made = empty(np.float64, self._count, 3)
        lib.read_bodies(self._data, made)
        return poses

    def judge(self, poses: Floats, ends: Floats, share: float, least: float) -> None:
        """Find what was met, touches something and stalled in a tick from `poses` to `ends` (bodies, 3); a way of
        `least` metres or less is none."""
        given = memory("poses", poses, self._count, 3), memory("ends", ends, self._count, 3)
        lib.judge_ways(self._data, *given, share, least)
