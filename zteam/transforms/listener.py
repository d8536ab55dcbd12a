"""`zteam.TransformListener`: a node's own buffer of transforms."""

from zteam import names
from zteam.messages import TFMessage, Tick
from zteam.node.node import Node
from zteam.transforms import Buffer


class TransformListener(Buffer):
    """A transform buffer of a node's own, fed by `tf` and `tf_static`. Make it before `node.run(step)`.

    In lock-step `step` waits for the transforms of its tick. Look-ups do not use the bus, so `step` and callbacks may
    make them. They raise tf2's exceptions (`zteam.tf`). Times are in ns, 0 = the latest common time.
    """

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._connected: set[int] = set()
        """Robots that have been seen in `map`."""
        node.on_time_reset(self.clear)
        take, take_static, now = self.set_transforms, self.set_all_static, node.clock.now
        node.subscribe(names.TF, TFMessage, lambda _, m: take(m.transforms, names.TF, now()), every_tick=True)
        # At once: it leaves before the bundle that it belongs to, which is waited for.
        node.hear(names.TF_STATIC, TFMessage, lambda _, m: take_static(m.transforms, names.TF), latched=True)
        node.need(self._lacks)

    @property
    def buffer(self) -> Buffer:
        return self

    def _lacks(self, tick: Tick) -> list[str]:
        """The key of the fixed transforms until they have come too, which may take longer than the first bundle."""
        if names.AGGREGATOR not in tick.participants:
            return []
        for robot_id in sorted({*tick.robots.tolist()} - self._connected):
            base = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
            if self.latest_common_time(names.MAP_FRAME, base) is None:
                return [names.TF_STATIC]
            self._connected.add(robot_id)
        return []
