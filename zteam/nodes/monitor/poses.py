"""Where the robots are, asked of the aggregator about once a second, and what the launcher has started again.

A subscription to `tf` would wake the monitor at every tick, which costs a run in lock-step its speed.
"""

import logging
import threading
from collections.abc import Callable

from zteam import names
from zteam.errors import BusError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import TransformStamped
from zteam.runtime.process_node import ProcessNode
from zteam.services.transforms import Lookup
from zteam.services.transforms_client import TransformClient

log = logging.getLogger("zteam")

PERIOD = 1.0
"""Host seconds between two questions."""


class Poses:
    """The robots' newest poses in `map`; a thread of its own asks, so that nothing else waits for the answers."""

    def __init__(self, node: ProcessNode, robots: Callable[[], list[int]]) -> None:
        """`robots()` are the ids to ask for."""
        self._bus = node.bus
        self._client = TransformClient(node.bus)
        self._robots = robots
        self._stop = threading.Event()
        self.newest: dict[int, Pose2] = {}
        """By id; a robot whose pose is not known has none. Replaced as a whole."""
        self.restarts: dict[str, int] = {}
        """How often the launcher has started processes again, by name. Replaced as a whole."""
        node.stop.on_request(self._stop.set)
        threading.Thread(target=self._run, name="poses", daemon=True).start()

    def _run(self) -> None:
        while not self._stop.is_set():
            self.newest = self._ask(self._robots())
            self.restarts = self._ask_launcher()
            self._stop.wait(PERIOD)

    def _ask_launcher(self) -> dict[str, int]:
        try:
            answers = self._bus.query(names.service_key(names.LAUNCHER, names.RESTARTS), dict[str, int])
        except BusError as error:
            log.debug("%s", error)
            return {}
        return dict(answers[0][1]) if answers else {}

    def _ask(self, robots: list[int]) -> dict[int, Pose2]:
        if not robots:
            return {}
        lookups = [Lookup(names.MAP_FRAME, names.robot_frame(i, names.BASE_FOOTPRINT)) for i in robots]
        try:
            found = self._client.lookup_many(lookups)
        except BusError as error:
            # No aggregator, or none that answers; the session may also be closed.
            log.debug("%s", error)
            return {}
        return {i: _pose(f) for i, f in zip(robots, found, strict=True) if isinstance(f, TransformStamped)}


def _pose(found: TransformStamped) -> Pose2:
    place, turn = found.transform.translation, found.transform.rotation
    return Pose2(place.x, place.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))
