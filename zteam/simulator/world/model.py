"""A world file as plain data for the simulator: no parser and no physics.

Everything is SI: metres, radians, nanoseconds. `z` values are heights above the ground, absolute: in a planar world
they never change, so a shape is seen by a laser exactly if `z_min <= laser z <= z_max`."""

import math
from typing import Any, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Point2, Pose2, convex_hull
from zteam.messages import BaseInfo, Point32, Polygon


class Shape(msgspec.Struct, frozen=True):
    """A prism over a simple polygon: `points` counter-clockwise in the owner's frame, heights absolute."""

    points: tuple[Point2, ...]
    z_min: float
    z_max: float
    ranger_return: float = 1.0
    """Intensity a laser reads; below 0 the shape is invisible and transparent."""
    obstacle: bool = True
    """Whether bodies collide with it."""
    color: str = "red"
    """A name of X11's, or #rrggbb."""


class FiducialMarker(msgspec.Struct, frozen=True):
    """What fiducial finders look for: a model with a `fiducial_return`."""

    id: int
    """The `fiducial_return`, never 0."""
    key: int
    """Only finders with the same key see it."""
    x: float
    """Of the model's origin in the owner's frame; so is y."""
    y: float
    yaw: float


class Floorplan(msgspec.Struct, frozen=True, eq=False):
    """A bitmap that stands on the ground, kept on the bitmap's own cells."""

    name: str
    occupied: NDArray[np.bool_]
    """(rows, columns), row 0 at the bottom (lowest y), column 0 at the left (lowest x)."""
    cell: Point2
    """Size of one cell along x and y; a crop makes them unequal."""
    pose: Pose2
    """Pose in `map` of the lower left corner of cell [0, 0], axes along columns and rows."""
    z_min: float
    z_max: float
    ranger_return: float = 1.0
    obstacle: bool = True
    color: str = "black"
    picture: tuple[int, ...] = ()
    """Rows and columns of the picture that it was cropped from, or of the whole one."""


class Obstacle(msgspec.Struct, frozen=True):
    """A model without a drive: a box, a pillar, the slabs of a boundary."""

    name: str
    pose: Pose2
    shapes: tuple[Shape, ...]
    mass: float | None = None
    """Kilograms if robots can push it; None if it stands still."""
    markers: tuple[FiducialMarker, ...] = ()


class Device(msgspec.Struct, frozen=True):
    """Something that senses, on a robot."""

    name: str
    x: float
    y: float
    z: float
    """Height above the ground; x, y and yaw are in the robot's base frame."""
    yaw: float


D = TypeVar("D", bound=Device)


class Ranger(Device, frozen=True):
    """One sensor of a ranger model: `samples` rays from `-fov/2` to `+fov/2` about the sensor's own yaw."""

    fov: float
    samples: int
    range_min: float
    range_max: float
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Stage's triple: gaussian variance (m²), proportional, angular (fraction of the increment)."""

    @property
    def is_laser(self) -> bool:
        """Rangers with more than one ray are lasers (LaserScan), the others sonars (Range)."""
        return self.samples > 1

    @property
    def angle_increment(self) -> float:
        return self.fov / (self.samples - 1) if self.samples > 1 else 0.0


class Limits(msgspec.Struct, frozen=True):
    """Smallest and largest value of a velocity or acceleration along x, y (SI) and about z (radians)."""

    x: Point2 = (-1.0, 1.0)
    y: Point2 = (-1.0, 1.0)
    yaw: Point2 = (-np.pi / 2, np.pi / 2)


class Robot(msgspec.Struct, frozen=True):
    """A position model with everything it carries."""

    name: str
    model: str
    """The macro it was made from, e.g. `erratic`."""
    pose: Pose2
    """Start pose in `map`."""
    shapes: tuple[Shape, ...]
    """Its body and its children's bodies, in the base frame (centre of rotation at the origin)."""
    rangers: tuple[Ranger, ...]
    """In file order."""
    devices: tuple[Device, ...] = ()
    """All other devices (`zteam.simulator.world.devices`), in file order."""
    markers: tuple[FiducialMarker, ...] = ()
    drive: str = "diff"
    wheelbase: float = 1.0
    velocity: Limits = Limits()
    acceleration: Limits | None = None
    localization: str = "odom"
    """As in the file, "gps" (Stage's default) or "odom"; odometry starts at zero where the robot starts in both."""
    odom_error: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Stage's bias: the share of each motion along x, along y and about z that odometry counts too much."""
    odom_alphas: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Thrun's noise of odometry: rotation by rotation, by translation, translation by translation, by rotation."""
    wheel_radius: float = 0.05
    wheel_separation: float = 0.3
    """Metres between the left and the right wheels."""
    mass: float = 10.0
    color: str = "red"

    def devices_of(self, kind: type[D]) -> tuple[D, ...]:
        """The robot's devices of one class, in file order; its rangers are apart."""
        return tuple(device for device in self.devices if isinstance(device, kind))


class Remark(msgspec.Struct, frozen=True):
    """Something in the file that has no effect here."""

    file: str
    line: int
    column: int
    text: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.text}"


class World(msgspec.Struct, eq=False):
    name: str
    interval: int
    """Nanoseconds of simulated time a tick (`interval_sim`)."""
    floorplans: tuple[Floorplan, ...]
    obstacles: tuple[Obstacle, ...]
    robots: tuple[Robot, ...]
    """By id: position models in file order."""
    physics: str = "dynamic"
    """The default physics of contacts: one of `zteam.config.simulation_options.PHYSICS`."""
    warnings: tuple[Remark, ...] = ()
    templates: dict[str, Any] = msgspec.field(default_factory=dict)
    """The file's own robot macros by name, from which `zteam.world.add_robot` makes further robots."""


_NO_LIMITS = Limits(*[(-math.inf, math.inf)] * 3)


def footprint(robot: Robot) -> tuple[Point2, ...]:
    """The convex hull of all shapes that collide, counter-clockwise in the base frame; of all shapes if none collides.
    Heights do not count. A robot without a body has no corners."""
    solid = [shape for shape in robot.shapes if shape.obstacle] or robot.shapes
    points = [point for shape in solid for point in shape.points]
    return convex_hull(points) if points else ()


def base_info(robot: Robot) -> BaseInfo:
    """The message of a robot of the world. A limit for both ways is the smaller one of left and right."""
    velocity, acceleration = robot.velocity, robot.acceleration or _NO_LIMITS
    return BaseInfo(
        model=robot.model,
        drive=robot.drive,
        footprint=Polygon([Point32(x, y) for x, y in footprint(robot)]),
        max_vel_x=velocity.x[1],
        min_vel_x=velocity.x[0],
        max_vel_theta=min(-velocity.yaw[0], velocity.yaw[1]),
        acc_lim_x=acceleration.x[1],
        decel_lim_x=acceleration.x[0],
        acc_lim_theta=min(-acceleration.yaw[0], acceleration.yaw[1]),
        max_vel_y=min(-velocity.y[0], velocity.y[1]) if robot.drive == "omni" else 0.0,
        acc_lim_y=min(-acceleration.y[0], acceleration.y[1]),
        decel_lim_reverse=acceleration.x[1],
        wheelbase=robot.wheelbase if robot.drive == "car" else 0.0,
    )
