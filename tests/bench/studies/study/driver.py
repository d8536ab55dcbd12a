"""Teleop without a person: commands for one robot, drawn from a seed."""

import math
import sys
from collections.abc import Iterator

from zteam import names
from zteam.clock import to_ns
from zteam.counter_random import uniform
from zteam.messages import Twist, Vector3
from zteam.node.node import Node, run

TELEOP = "teleop"
"""Its name in a team."""
SPEED, TURN = 0.4, 1.0
"""m/s, rad/s."""
_ROUND = math.pi / TURN
_MOVES: tuple[tuple[tuple[float, float, float], ...], ...] = (
    # (m/s, rad/s, most seconds) one after the other; the last one for a drawn share of its time
    ((SPEED, 0.0, 10.0),),
    ((SPEED, 0.5, 4.0),),
    ((SPEED, -0.5, 4.0),),
    ((0.0, TURN, 6.0),),
    ((0.0, -TURN, 6.0),),
    ((-SPEED, 0.0, 5.0),),
    ((0.0, 0.0, 5.0),),
    # It drives back through the line.
    ((0.0, TURN, _ROUND), (SPEED, 0.0, 10.0)),
)


def draw_commands(seed: int, tick: float) -> Iterator[tuple[float, float]]:
    """(m/s, rad/s) of one tick of `tick` seconds after the other, without end."""
    draw = 0
    while True:
        *first, (speed, turn, seconds) = _MOVES[int(uniform(seed, draw, 0) * len(_MOVES))]
        for move in (*first, (speed, turn, seconds * (0.2 + 0.8 * uniform(seed, draw, 1)))):
            yield from [move[:2]] * max(1, round(move[2] / tick))
        draw += 1


class Driver:
    """Give its `body` to `run_team` as a node: it drives a robot in every tick."""

    def __init__(self, robot_id: int, seed: int) -> None:
        self._key, self._seed = names.robot_key(robot_id, names.CMD_VEL_TELEOP), seed

    def body(self, node: Node) -> None:
        """Drive until asked to stop."""
        publisher, tick = node.publisher(self._key, Twist), 0.1
        commands, due = draw_commands(self._seed, tick), 0
        command = next(commands)

        def step(now: int) -> None:
            nonlocal command, due
            if now >= due:
                command, due = next(commands), now + to_ns(tick)
            publisher.put(Twist(Vector3(command[0]), Vector3(0.0, 0.0, command[1])))

        node.run(step)


if __name__ == "__main__":
    run(TELEOP, Driver(0, int(sys.argv[1])).body)
