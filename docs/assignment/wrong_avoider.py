"""A hand-in with a mistake in exercise 1: it takes the first beam for the one ahead, but that looks to the right."""

from reference import Follower, racer

from zteam import Behavior, View
from zteam.messages import Twist, Vector3

__all__ = ["Avoider", "Follower", "racer"]


class Avoider(Behavior):
    def step(self, view: View) -> Twist:
        if view.scan.ranges[0] < 0.7:
            return Twist(angular=Vector3(z=0.8))
        return Twist(Vector3(0.3))
