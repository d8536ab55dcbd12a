"""The reference solution. A hand-in is a file homework.py with these three names."""

import math

from zteam import Behavior, Node, View
from zteam.behaviors import look_ahead
from zteam.messages import LaserScan, Twist, Vector3


class Avoider(Behavior):
    """Exercise 1: drive about without touching anything."""

    def step(self, view: View) -> Twist:
        ahead = look_ahead(view.scan, math.radians(60.0))
        if ahead is None or ahead.invalid > 0.5 or ahead.nearest < 0.7:
            return Twist(angular=Vector3(z=0.8))
        return Twist(Vector3(0.3))


def racer(node: Node) -> None:
    """Exercise 2: the process of a robot that starts together with all others."""
    node.subscribe(f"{node.name}/base_scan", LaserScan, lambda key, scan: None, every_tick=True)
    node.run(lambda now: Twist(Vector3(0.3)), gate=True)


class Follower(Behavior):
    """Exercise 3: keep 0.8 m behind the robot with the id before the own one."""

    uses_tf = True

    def step(self, view: View) -> Twist:
        found = view.base_from_robot(view.robot_id - 1)
        if found is None or not view.is_fresh(found[1], 0.5):
            return Twist()
        leader, _stamp = found
        bearing = math.atan2(leader.y, leader.x)
        speed = min(0.5, max(0.0, math.hypot(leader.x, leader.y) - 0.8))
        return Twist(Vector3(speed if abs(bearing) < 1.0 else 0.0), Vector3(z=max(-2.0, min(2.0, 3.0 * bearing))))
