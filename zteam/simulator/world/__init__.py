"""World files: Stage's .world language, bitmaps, and the plain data that the simulator runs on."""

from zteam.geometry import Point2
from zteam.simulator.world.builder import add_robot, load_world
from zteam.simulator.world.model import Floorplan, Limits, Obstacle, Ranger, Remark, Robot, Shape, World

__all__ = [
    "Floorplan", "Limits", "Obstacle", "Point2", "Ranger", "Remark", "Robot", "Shape", "World",
    "add_robot", "load_world",
]  # fmt: skip
