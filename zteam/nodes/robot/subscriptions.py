"""What a robot listens to: each message goes into its `Inputs`."""

from collections.abc import Callable

from zteam import names
from zteam.behaviors import Behavior
from zteam.clock import monotonic
from zteam.messages import BaseInfo, LaserScan, Odometry, TeamStatus, TFMessage, ns_from_time
from zteam.nodes.robot.inputs import Inputs
from zteam.runtime.node import Node
from zteam.runtime.participant import Participant


class Subscriptions:
    """The subscriptions of one robot. Handlers of messages run under `node.changed`."""

    def __init__(
        self, node: Node, robot_id: int, inputs: Inputs, part: Participant, on_input: Callable[[], None]
    ) -> None:
        """`on_input()` is called after each message that a step may wait for."""
        self._inputs = inputs
        self._part = part
        self._on_input = on_input
        self.first_data = 0.0
        """Host time of the first scan; 0 before."""

        def key(topic: str) -> str:
            return names.robot_key(robot_id, topic)

        node.subscribe(key(names.BASE_SCAN), LaserScan, self._on_scan, wake=False)
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        node.subscribe(key(names.BASE_INFO), BaseInfo, self._on_base_info, latched=True)
        self._odom = node.subscribe(key(names.ODOM), Odometry, self._on_odom, wake=False)
        self._tf = node.subscribe_payloads(names.TF, TFMessage, self._on_tf)
        node.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)

    def _on_scan(self, _key: str, scan: LaserScan) -> None:
        self._inputs.scan = scan
        self._part.take_stamp(ns_from_time(scan.header.stamp))
        self.first_data = self.first_data or monotonic()
        self._on_input()

    def _on_odom(self, _key: str, odom: Odometry) -> None:
        self._inputs.odom = odom
        if self._part.active:
            self._on_input()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._inputs.team = status

    def _on_tf(self, _key: str, payload: bytes) -> None:
        self._inputs.take_bundle(payload)
        self._on_input()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self._inputs.take_static(message)
        self._on_input()

    def _on_base_info(self, _key: str, message: BaseInfo) -> None:
        self._inputs.base_input.take(message)
        self._on_input()

    def drop_idle(self, behavior: Behavior) -> None:
        """Close the inputs that only the gate needed: every message wakes the process."""
        if not behavior.uses_odom:
            self._inputs.needs_odom = False
            self._odom.close()
        if not behavior.uses_tf:
            self._inputs.needs_tf = False
            self._tf.close()
