"""Which robots follow a robot that is not there, and which follow each other in a circle. Pure."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from zteam import names
from zteam.config.robot_ids import circle_from


class FollowProblem(NamedTuple):
    """Robots that cannot follow."""

    robots: tuple[int, ...]
    """One, or all of a circle."""
    leader: int | None
    """The robot that is not there; None for a circle."""
    text: str


def follow_problems(leaders: Mapping[int, int], is_there: Callable[[int], bool]) -> Iterator[FollowProblem]:
    """Of robots by id with the id of the robot that each follows; `is_there(id)`: whether that one can be followed."""
    told: set[int] = set()
    for robot_id, leader in sorted(leaders.items()):
        if circle := circle_from(robot_id, leaders):
            if robot_id not in told:
                chain = " -> ".join(map(names.robot_name, circle))
                yield FollowProblem(tuple(circle[:-1]), None, f"robots follow each other in a circle: {chain}")
            told.update(circle)
        elif not is_there(leader):
            text = f"{names.robot_name(robot_id)} follows {names.robot_name(leader)}, which has no process"
            yield FollowProblem((robot_id,), leader, text)
