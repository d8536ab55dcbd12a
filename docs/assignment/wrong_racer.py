"""A hand-in with a mistake in exercise 2: it drives as soon as it runs."""

from reference import Avoider, Follower

from zteam import Node
from zteam.messages import Twist, Vector3

__all__ = ["Avoider", "Follower", "racer"]


def racer(node: Node) -> None:
    node.run(lambda now: Twist(Vector3(0.3)))
