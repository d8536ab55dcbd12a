"""The answers to `sim/shapes` and `sim/obstacles`: what a view draws of the world besides its map."""

from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.services.simulator import ObstacleShape, ObstaclesReply, RobotShape, ShapesReply
from zteam.sim import Engine
from zteam.world import Obstacle, Robot, Shape, World

_DIGITS = 4
"""Of a metre: a tenth of a millimetre is finer than any screen."""


def serve_shapes(bus: Bus, world: World, engine: Engine) -> None:
    """Serve both queries. They are answered from what is there, during a tick too."""

    def shapes(_: NoRequest) -> ShapesReply:
        robots = {robot_id: robot_shape(robot) for robot_id, robot in list(engine.robots.items())}
        return ShapesReply(robots, sorted({*world.templates, "erratic"}))

    def obstacles(_: NoRequest) -> ObstaclesReply:
        return ObstaclesReply([obstacle_shape(obstacle) for obstacle in engine.obstacles()])

    bus.serve(names.service_key(names.SIMULATOR, "shapes"), NoRequest, shapes)
    bus.serve(names.service_key(names.SIMULATOR, "obstacles"), NoRequest, obstacles)


def robot_shape(robot: Robot) -> RobotShape:
    """A robot from above: its polygons from the ground up, and its lasers."""
    shapes = sorted(robot.shapes, key=lambda shape: shape.z_max)
    lasers = [(ranger.x, ranger.y, ranger.yaw) for ranger in robot.rangers if ranger.is_laser]
    return RobotShape(robot.model, _outline(shapes), lasers)


def obstacle_shape(obstacle: Obstacle) -> ObstacleShape:
    """An obstacle from above."""
    pose = obstacle.pose
    movable = obstacle.mass is not None
    return ObstacleShape(obstacle.name, pose.x, pose.y, pose.yaw, _outline(obstacle.shapes), movable)


def _outline(shapes: Sequence[Shape]) -> list[list[tuple[float, float]]]:
    return [[(round(x, _DIGITS), round(y, _DIGITS)) for x, y in shape.points] for shape in shapes]
