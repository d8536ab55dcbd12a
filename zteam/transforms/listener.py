"""`zteam.TransformListener`: a node's own buffer of transforms."""

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import TFMessage, Tick, TransformStamped
from zteam.node.node import Node
from zteam.transforms import Buffer


class TransformListener:
    """A transform buffer of a node's own, fed by `tf` and `tf_static`. Make it before `node.run(step)`.

    In lock-step `step` waits for the transforms of its tick. Look-ups do not use the bus, so `step` and callbacks may
    make them. They raise tf2's exceptions (`zteam.tf`). Times are in ns, 0 = the latest common time. `buffer` has all
    other calls of tf2's buffer.
    """

    def __init__(self, node: Node) -> None:
        self.buffer, self._clock = Buffer(), node.clock
        self._connected: set[int] = set()
        """Robots that have been seen in `map`."""
        node.on_time_reset(self.buffer.clear)
        node.subscribe(names.TF, TFMessage, self._on_tf, every_tick=True)
        node.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)
        node.need(self._lacks)

    def _on_tf(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_transforms(message.transforms, names.TF, self._clock.now())

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_all_static(message.transforms, names.TF)

    def _lacks(self, tick: Tick) -> list[str]:
        """The key of the fixed transforms until they have come too, which may take longer than the first bundle."""
        if names.AGGREGATOR not in tick.participants:
            return []
        for robot_id in sorted({*tick.robots.tolist()} - self._connected):
            base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
            if self.buffer.latest_common_time(names.MAP_FRAME, base) is None:
                return [names.TF_STATIC]
            self._connected.add(robot_id)
        return []

    def lookup_transform(self, target_frame: str, source_frame: str, time: int = 0) -> TransformStamped:
        """The pose of `source_frame` in `target_frame`. Raises tf2's exceptions."""
        return self.buffer.lookup_transform(target_frame, source_frame, time)

    def lookup_pose2(self, target_frame: str, source_frame: str, time: int = 0) -> tuple[Pose2, int]:
        """The planar pose of `source_frame` in `target_frame`, and its stamp (ns). Raises tf2's exceptions."""
        return self.buffer.lookup_pose2(target_frame, source_frame, time)

    def can_transform(self, target_frame: str, source_frame: str, time: int = 0) -> tuple[bool, str]:
        """Whether `lookup_transform` would answer; if not, also its error text."""
        return self.buffer.can_transform(target_frame, source_frame, time)
