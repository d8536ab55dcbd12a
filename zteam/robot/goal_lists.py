"""What other processes ask of one that sends robots the goals of a list (`zteam goals`): to pause, and to go on."""

from collections.abc import Callable, Collection, Iterable
from functools import partial

import msgspec

from zteam import names
from zteam.bus import Bus, Change, NoRequest

ANSWER_LIMIT = 1.0
"""Host seconds for an answer."""


class PauseRequest(Change):
    """Send the robot no further goal of the list. The one that it has stays, unless it is canceled."""


class ResumeRequest(Change):
    """Go on with the next goal of the list."""


class ListReply(msgspec.Struct):
    """The list of one robot."""

    is_paused: bool


def serve_list(bus: Bus, robot_id: int, is_paused: Callable[[], bool], pause: Callable[[bool], None]) -> None:
    """Answer for the list of a robot; `pause(paused)` is called on a thread of the bus."""

    def take(paused: bool, _request: Change) -> ListReply:
        pause(paused)
        return ListReply(paused)

    bus.serve(names.robot_key(robot_id, names.GOALS), NoRequest, lambda _: ListReply(is_paused()))
    bus.serve(names.robot_key(robot_id, names.PAUSE_GOALS), PauseRequest, partial(take, True))
    bus.serve(names.robot_key(robot_id, names.RESUME_GOALS), ResumeRequest, partial(take, False))


def find_lists(bus: Bus) -> dict[int, bool]:
    """By robot that drives through a list: whether it is paused, and so for one of several."""
    found: dict[int, bool] = {}
    for key, reply in bus.find(names.all_robots_key(names.GOALS), ListReply, timeout=ANSWER_LIMIT):
        if target := names.split_robot_key(key):
            found[target[0]] = found.get(target[0], False) or reply.is_paused
    return found


def pause_lists(bus: Bus, robots: Iterable[int] | None = None, *, paused: bool) -> list[int]:
    """Pause the lists of these robots, or of all, or go on with them; the robots whose lists have answered.

    Raises BusError.
    """
    lists: Collection[int] = find_lists(bus)
    service, request = (names.PAUSE_GOALS, PauseRequest()) if paused else (names.RESUME_GOALS, ResumeRequest())
    done = []
    for robot_id in sorted(lists if robots is None else set(robots) & set(lists)):
        if bus.query(names.robot_key(robot_id, service), ListReply, request, timeout=ANSWER_LIMIT):
            done.append(robot_id)
    return done
