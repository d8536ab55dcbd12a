"""A hand-in with a mistake in exercise 3: it looks itself up in the frame of the leader, not the other way round."""

import math

from reference import Avoider, racer

from zteam import Behavior, View
from zteam.messages import Twist, Vector3

__all__ = ["Avoider", "Follower", "racer"]


class Follower(Behavior):
    uses_tf = True

    def step(self, view: View) -> Twist:
        found = view.lookup(f"robot_{view.robot_id - 1}/base_footprint", view.base_frame)
        if found is None or not view.is_fresh(found[1], 0.5):
            return Twist()
        leader, _stamp = found
        bearing = math.atan2(leader.y, leader.x)
        speed = min(0.5, max(0.0, math.hypot(leader.x, leader.y) - 0.8))
        return Twist(Vector3(speed if abs(bearing) < 1.0 else 0.0), Vector3(z=max(-2.0, min(2.0, 3.0 * bearing))))
