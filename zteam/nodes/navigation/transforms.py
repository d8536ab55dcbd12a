"""The team's transforms as the navigation process has them."""

import logging

from zteam import names
from zteam.bus import NoRequest
from zteam.errors import BusError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import TFMessage, Tick
from zteam.runtime.step_node import StepNode
from zteam.services.transforms import FrameReply, Lookup, LookupReply, LookupRequest
from zteam.tf import Buffer

log = logging.getLogger("zteam")

_ANSWER_LIMIT = 1.0
"""Host seconds for the aggregator to tell what it knows."""


class TeamTransforms:
    """A buffer fed by `tf` and `tf_static`, and where robots were before this process came.

    A localiser publishes `map -> robot_N/odom` as moving data. If it has ended, nothing sends it again, and the start
    pose that it replaced is not published any more; only the aggregator knows it.
    """

    def __init__(self, node: StepNode) -> None:
        self.buffer = Buffer()
        self._node = node
        self._left: dict[int, Pose2] = {}
        """The `map -> robot_N/odom` of localisers of before, by robot."""
        self._connected: set[int] = set()
        node.on_time_reset(self._forget)
        node.subscribe(names.TF, TFMessage, self._take, every_tick=True)
        node.subscribe(names.TF_STATIC, TFMessage, self._take_static, latched=True)
        node.need(self._lacks)

    def ask(self) -> None:
        """Ask the aggregator, if there is one, where localisers of before have put robots. Before the first step."""
        try:
            answers = self._node.bus.query(
                names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameReply], NoRequest(), timeout=_ANSWER_LIMIT
            )
            frames = answers[0][1] if answers else {}
            moving = [child for child, frame in frames.items() if frame.parent == names.MAP_FRAME and not frame.static]
            if moving:
                request = LookupRequest([Lookup(names.MAP_FRAME, child) for child in moving])
                key = names.service_key(names.AGGREGATOR, "lookup")
                replies = self._node.bus.ask(key, list[LookupReply], request, timeout=_ANSWER_LIMIT)
                self._keep(dict(zip(moving, replies, strict=True)))
        except BusError as error:
            log.debug("%s", error)

    def _keep(self, replies: dict[str, LookupReply]) -> None:
        for child, reply in replies.items():
            robot_id = names.robot_id_of(child.partition("/")[0])
            if robot_id is not None and child == names.robot_frame(robot_id, names.ODOM) and not reply.error:
                x, y, _ = reply.translation
                self._left[robot_id] = Pose2(x, y, yaw_from_quaternion(*reply.rotation))

    def left(self, robot_id: int) -> Pose2 | None:
        """The `map -> robot_N/odom` that a localiser of before has left."""
        return self._left.get(robot_id)

    def _take(self, _key: str, message: TFMessage) -> None:
        for transform in message.transforms:
            self.buffer.set_transform(transform, names.TF)

    def _take_static(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_all_static(message.transforms, names.TF)

    def _forget(self) -> None:
        self.buffer.clear()
        self._left.clear()

    def _lacks(self, tick: Tick) -> list[str]:
        """Lock-step: the key of the fixed transforms, which may come after the first bundle."""
        if names.AGGREGATOR not in tick.participants:
            return []
        for robot_id in sorted({*tick.robots.tolist()} - self._connected - self._left.keys()):
            base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
            if self.buffer.latest_common_time(names.MAP_FRAME, base) is None:
                return [names.TF_STATIC]
            self._connected.add(robot_id)
        return []
