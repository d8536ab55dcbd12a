"""What a robot listens to: each message goes into its `Inputs`."""

from collections.abc import Callable
from functools import partial

from zteam import names
from zteam.behaviors.behavior import DeclaredInput
from zteam.bus.topics import is_latched
from zteam.clock import monotonic
from zteam.messages import BaseInfo, LaserScan, Message, Odometry, RobotStatus, TeamStatus, TFMessage, decode
from zteam.nodes.robot.inputs import Inputs
from zteam.nodes.robot.newest import Newest
from zteam.runtime.lockstep import Participant
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.tick_messages import stamp_of
from zteam.tf.bases import bases_stamp


def _stamp_of_bundle(bundle: bytes | TFMessage) -> int:
    return bases_stamp(bundle if isinstance(bundle, TFMessage) else decode(TFMessage, bundle))


class Subscriptions:
    """The subscriptions of one robot. Handlers of messages run under `node.changed`."""

    def __init__(
        self, node: ProcessNode, robot_id: int, inputs: Inputs, part: Participant, on_input: Callable[[], None]
    ) -> None:
        """`on_input()` is called after each message that a step may wait for."""
        self._node = node
        self._ended = node.ended_time
        self._inputs = inputs
        self._part = part
        self._on_input = on_input
        self.first_data = 0.0
        """Host time of the first scan; 0 before."""

        def key(topic: str) -> str:
            return names.robot_key(robot_id, topic)

        node.subscribe(key(names.BASE_SCAN), LaserScan, self._on_scan)
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        node.subscribe(names.all_robots_key(names.BASE_INFO), BaseInfo, self._on_base_info, latched=True)
        node.subscribe(key(names.ODOM), Odometry, self._on_odom)
        node.subscribe_contents(names.TF, TFMessage, self._on_tf)
        node.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)
        for source, newest in inputs.mux.slots:
            node.subscribe_from(key(source.topic), source.type, partial(self._keep, newest))
        for declared in inputs.declared.declared:
            take = partial(self._on_declared, declared)
            if is_latched(declared.key):
                # Its bus lets one sender's message count alone: the one with the newest time.
                node.subscribe(declared.key, declared.type, take, latched=True)
            else:
                node.subscribe_from(declared.key, declared.type, take)

    def _on_scan(self, _key: str, scan: LaserScan) -> None:
        self._inputs.take_scan(scan)
        self._part.take_stamp(self._inputs.scan_stamp)
        self.first_data = self.first_data or monotonic()
        self._on_input()

    def _on_odom(self, _key: str, odom: Odometry) -> None:
        self._inputs.take_odom(odom)
        if self._part.active:
            self._on_input()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._inputs.team = status

    def _on_tf(self, key: str, bundle: bytes | TFMessage) -> None:
        if self._ended.has(key, lambda: _stamp_of_bundle(bundle), self._node.clock.now()):
            return
        self._inputs.take_bundle(bundle)
        self._on_input()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self._inputs.take_static(message)
        self._on_input()

    def _on_base_info(self, key: str, message: BaseInfo) -> None:
        robot_id = names.robot_id_of(key.partition("/")[0])
        if robot_id is not None:
            self._inputs.take_base(robot_id, message)
            self._on_input()

    def _on_declared(self, declared: DeclaredInput, key: str, message: Message, source: str = "") -> None:
        if isinstance(message, RobotStatus) and self._ended.has(key, lambda: stamp_of(message), self._node.clock.now()):
            return
        self._keep(self._inputs.declared.slot(declared, key), key, message, source)

    def _keep(self, newest: Newest, _key: str, message: Message, source: str) -> None:
        if self._part.active:
            # The tick itself may be on its way; what it brings to this robot left before it.
            newest.hold(message, max(self._part.stamp, self._inputs.scan_stamp), source)
        else:
            newest.take(message, self._node.clock.now())
