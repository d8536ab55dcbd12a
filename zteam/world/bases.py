"""What a robot's base is, as `base_info` tells it: the outline that collides, and the limits of its drive."""

import math

from zteam.geometry import Point2, convex_hull
from zteam.messages import BaseInfo, Point32, Polygon
from zteam.world.model import Limits, Robot

_NO_LIMITS = Limits(*[(-math.inf, math.inf)] * 3)


def footprint(robot: Robot) -> tuple[Point2, ...]:
    """The convex hull of all shapes that collide, counter-clockwise in the base frame; of all shapes if none collides.

    Heights do not count. A robot without a body has no corners.
    """
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
