"""Stand still (a robot that a keyboard or navigation drives)."""

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.view import View
from zteam.messages import Twist


class Idle(Behavior):
    """Zero velocity for ever: for a robot that teleop or navigation drives."""

    def step(self, view: View) -> Twist:
        """Zero."""
        return Twist()

    def why_it_rests(self) -> str:
        """It never drives."""
        return "idle: only teleop or navigation drives it"
