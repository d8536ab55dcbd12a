"""What the pressed keys command, and which robot. Pure: the caller passes the time in seconds of any clock."""

from collections.abc import Sequence

from zteam.messages import Twist, Vector3
from zteam.nodes.teleop.keys import DIRECTIONS, FOCUS_GAINED, FOCUS_LOST, HELP, NEXT, SPEED_FACTORS

FIRST = 0.75
"""Seconds that a key counts after its first press: a terminal tells no release, and repeats begin after 0.5 s."""
REPEAT = 0.3
"""Seconds that a key counts after each repeat."""
MIN_SPEED, MAX_SPEED = 0.01, 10.0
"""Bounds of speed (m/s) and turn rate (rad/s), however often their keys are pressed."""


class Pilot:
    """Drives one robot of several.

    It holds a robot from the first key on, with zero velocity while no key counts, and lets go of it with `tab`.
    """

    def __init__(self, robot_ids: Sequence[int], speed: float, turn: float) -> None:
        self.robot_ids = tuple(robot_ids)
        self.robot_id = self.robot_ids[0]
        """The robot that the keys drive."""
        self.speed, self.turn = speed, turn
        self.holds = False
        """Whether the robot is commanded."""
        self._left: list[int] = []
        """Robots that are to be stopped, because the pilot has let go of them."""
        self._key = ""
        self._until = 0.0

    def press(self, key: str, now: float) -> None:
        """Take a key, its repeat, or a change of the focus. A key without a meaning stops."""
        if key in SPEED_FACTORS:
            speed, turn = SPEED_FACTORS[key]
            self.speed, self.turn = _bounded(self.speed * speed), _bounded(self.turn * turn)
        elif key == NEXT:
            self.let_go()
            self.robot_id = self.robot_ids[(self.robot_ids.index(self.robot_id) + 1) % len(self.robot_ids)]
        elif key == FOCUS_LOST:
            self._key = ""
        elif key in DIRECTIONS:
            repeated = key == self._key and now < self._until
            self._until = max(self._until, now + REPEAT) if repeated else now + FIRST
            self._key, self.holds = key, True
        elif key not in (FOCUS_GAINED, HELP):
            self._key, self.holds = "", True

    def let_go(self) -> None:
        """Stop the robot and command it no more."""
        if self.holds:
            self._left.append(self.robot_id)
        self._key, self.holds = "", False

    def command(self, now: float) -> Twist:
        """What the keys command now."""
        if not self._key or now >= self._until:
            return Twist()
        forward, left, turn = DIRECTIONS[self._key]
        return Twist(Vector3(forward * self.speed, left * self.speed), Vector3(z=turn * self.turn))

    def take_commands(self, now: float) -> list[tuple[int, Twist]]:
        """What to send now, in this order: robot id and command."""
        commands = [(robot_id, Twist()) for robot_id in self._left]
        self._left.clear()
        if self.holds:
            commands.append((self.robot_id, self.command(now)))
        return commands


def _bounded(speed: float) -> float:
    return min(max(speed, MIN_SPEED), MAX_SPEED)
