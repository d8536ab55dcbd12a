"""An aggregator on a bus in memory, robots' bases that publish to it, and what a subscriber gets."""

import threading
from collections.abc import Callable

from support.cuttable_transport import CutTransport, cut_bus
from support.limits import LIMIT
from support.transforms import stamped
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.clock import wait_until
from zteam.messages import TFMessage, TransformStamped, ns_from_time
from zteam.node.node import Node
from zteam.node.process_options import AggregatorOptions
from zteam.node.shutdown import Stop
from zteam.transforms.client import Lookup, LookupReply, LookupRequest, StaticReply, StaticRequest
from zteam.transforms.process.node import Aggregator

S = 1_000_000_000

Bundle = list[tuple[str, int]]
"""(child frame, stamp in ns) of each transform."""


class Base:
    """A robot's base: publishes its transforms."""

    def __init__(self, hub: MemoryHub, robot_id: int) -> None:
        self.bus = hub.bus()
        self.tf = self.bus.publisher(names.robot_key(robot_id, names.TF), TFMessage)
        self.tf_static = self.bus.publisher(names.robot_key(robot_id, names.TF_STATIC), TFMessage, latched=True)

    def stand(self, x: float) -> None:
        """The start pose, latched."""
        self.tf_static.put(TFMessage([stamped("map", "odom", 0, x)]))

    def drive(self, stamp: int, x: float = 0.0) -> None:
        """Odometry of one tick."""
        self.tf.put(TFMessage([stamped("odom", "base_footprint", stamp, x)]))


class Listener:
    """What a subscriber gets from the aggregator."""

    def __init__(self, hub: MemoryHub) -> None:
        self.changed = threading.Condition()
        self.bundles: list[Bundle] = []
        self.statics: list[dict[str, float]] = []
        """x by child of each full set."""
        bus = hub.bus()
        bus.subscribe(names.TF, TFMessage, self._on_tf)
        bus.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)

    def _on_tf(self, _key: str, message: TFMessage) -> None:
        with self.changed:
            self.bundles.append([(t.child_frame_id, ns_from_time(t.header.stamp)) for t in message.transforms])
            self.changed.notify_all()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        with self.changed:
            self.statics.append({t.child_frame_id: t.transform.translation.x for t in message.transforms})
            self.changed.notify_all()

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait until a message makes it true."""
        with self.changed:
            assert wait_until(self.changed, condition, LIMIT), (self.bundles, self.statics)

    def wait_for_bundles(self, count: int) -> None:
        """Wait until so many have come."""
        self.wait(lambda: len(self.bundles) >= count)

    def wait_for_statics(self, expected: dict[str, float]) -> None:
        """Wait until this is the newest full set."""
        self.wait(lambda: self.statics[-1:] == [expected])


class Desk:
    """An aggregator, its main loop running once `start` is called."""

    def __init__(
        self, hub: MemoryHub, configured: tuple[TransformStamped, ...] = (), rate: float | None = None
    ) -> None:
        bus: Bus
        self.link: CutTransport
        bus, self.link = cut_bus(hub)
        self.stop = Stop()
        self.node = Node(names.AGGREGATOR, bus, self.stop)
        self.aggregator = Aggregator(self.node, AggregatorOptions(configured, rate=rate))
        self.thread = threading.Thread(target=self._run)

    def start(self) -> None:
        """Run the main loop."""
        self.node.become_present()
        self.thread.start()

    def _run(self) -> None:
        self.node.drive(self.aggregator.beat)

    def end(self) -> None:
        """Stop and wait."""
        self.stop.request("test over")
        if self.thread.ident is not None:
            self.thread.join(LIMIT)
        self.node.close()
        assert not self.thread.is_alive()


def ask_static(hub: MemoryHub, child: str, x: float, instance: str) -> StaticReply:
    """Add `map -> child` for this caller."""
    request = StaticRequest("map", child, instance, x)
    return hub.bus().ask(names.service_key(names.AGGREGATOR, "static"), StaticReply, request)


def look_up(hub: MemoryHub, target: str, source: str, time: int = 0) -> LookupReply:
    """Look one pair up."""
    request = LookupRequest([Lookup(target, source, time)])
    (reply,) = hub.bus().ask(names.service_key(names.AGGREGATOR, "lookup"), list[LookupReply], request)
    return reply
