"""Presses become commands; every way out leaves all robots with zero velocity."""

from collections.abc import Callable, Iterable, Mapping

from zteam.nodes.teleop.pilot import Pilot
from zteam.runtime.wheels import Wheels

Presses = Iterable[tuple[list[str], float]]
"""Keys, and the time in seconds at which commands are due; without keys as often as commands are to be sent."""


def drive(pilot: Pilot, wheels: Mapping[int, Wheels], presses: Presses, show: Callable[[], None]) -> None:
    """Drive until the presses end; `show()` is called after each of them."""

    def send(now: float) -> None:
        for robot_id, command in pilot.take_commands(now):
            wheels[robot_id].drive(command)

    now = 0.0
    try:
        for keys, now in presses:
            for key in keys:
                pilot.press(key, now)
            send(now)
            show()
    finally:
        pilot.let_go()
        send(now)
