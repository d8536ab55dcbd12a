"""The TF aggregator process: takes every robot's transforms, and publishes one tree in one bundled message a tick.

A bundle leaves as soon as every robot of its tick has spoken, in the callback of the last one. In real time a robot
that falls silent delays it by PATIENCE once and then counts as silent until it speaks again. In lock-step it waits for
every robot of the tick, however long that takes.
"""

import logging
from collections.abc import Iterable, Mapping

from zteam import names
from zteam.clock import Every, Rate, monotonic, to_ns
from zteam.messages import JointState, TFMessage, Tick, TransformStamped, ns_from_time
from zteam.nodes.transforms.bundle import PATIENCE, Bundle
from zteam.nodes.transforms.queries import serve_queries
from zteam.nodes.transforms.static_sources import StaticSources
from zteam.runtime.lockstep import Participant
from zteam.runtime.process_node import ProcessNode
from zteam.tf.bases import base_stamp
from zteam.tf.urdf import Description

log = logging.getLogger("zteam")

WALL_RATE = 20.0
"""Bundles a second where there is no simulator and no other rate was asked for."""
_MOST_CONFLICTS = 3
"""Lines a second: a sender can invent robots. 'zteam tf monitor' lists all."""


def _open_tick(part: Participant, bundle: Bundle) -> int:
    """Stamp (ns) of the tick of lock-step that is open, in which other processes send their frames; 0 in real time.

    The tick itself may still be on its way; the transforms that it brings left before it.
    """
    return max(part.stamp, bundle.stamp) if part.active else 0


class Aggregator:
    """The merged tree on the bus. Callbacks run under `node.changed`."""

    def __init__(
        self,
        node: ProcessNode,
        configured: Iterable[TransformStamped],
        descriptions: Mapping[int, Description],
        rate: float | None,
    ) -> None:
        """The team file's fixed transforms, the robots' URDFs, and the bundles a second (None for one a tick)."""
        self._node = node
        self._given_rate = rate
        self._first_data = 0.0
        """Host time of the first moving transform; 0 before."""
        self._descriptions = descriptions
        self._sources = StaticSources(node, configured, self._publish_statics)
        self._merger = self._sources.merger
        self._bundle = Bundle()
        self._last = TFMessage([])
        """The bundle that was sent last."""
        self._tf = node.bus.publisher(names.TF, TFMessage)
        self._tf_static = node.bus.publisher(names.TF_STATIC, TFMessage, latched=True)
        self._part = Participant(node, self._has_inputs, lambda _: self._flush(self._bundle.stamp), self._repeat)
        node.clock.sim.on_jump_back(self._on_jump_back)
        node.subscribe(names.all_robots_key(names.TF), TFMessage, self._on_tf)
        self._sources.listen(self._on_statics)
        serve_queries(node.bus, self._merger, lambda: self._last, self._sources.name_of)
        for robot_id, description in descriptions.items():
            self._merger.describe(robot_id, description.static_transforms())
        if descriptions:
            node.subscribe(names.all_robots_key(names.JOINT_STATES), JointState, self._on_joint_states)
        self._publish_statics()

    @property
    def _rate(self) -> float | None:
        """Bundles a second; None for one a tick, which only a simulator has."""
        if self._given_rate is None and self._node.clock.decided and not self._node.clock.simulated:
            return WALL_RATE
        return self._given_rate

    def _on_joint_states(self, key: str, message: JointState) -> None:
        target = names.split_robot_key(key)
        description = self._descriptions.get(target[0]) if target is not None else None
        if target is None or description is None:
            return
        frames = TFMessage(description.moving_transforms(message))
        self._merger.take(target[0], frames, self._node.clock.now(), _open_tick(self._part, self._bundle))
        if self._rate is None and not self._bundle.is_open and not self._part.active:
            # No bundle is being filled that they could travel with.
            self._flush()

    def _on_tf(self, key: str, message: TFMessage) -> None:
        target = names.split_robot_key(key)
        if target is None or not message.transforms:
            return
        # Frames of other processes say nothing of the tick: their stamps may be of the past or of the future.
        robot_id, stamp = target[0], base_stamp(target[0], message)
        self._part.take_stamp(stamp)
        if self._part.active:
            self._take_in_lockstep(robot_id, message, stamp)
        else:
            self._take(robot_id, message, stamp)
        self._publish_statics()

    def _take(self, robot_id: int, message: TFMessage, stamp: int) -> None:
        """Real time: take a robot's transforms into the bundle of their tick, or those without a base into any."""
        self._first_data = self._first_data or monotonic()
        if self._rate is None and self._bundle.ends_with(stamp):
            # Transforms of the tick before must not wait any longer.
            self._flush_late()
        self._merger.take(robot_id, message, self._node.clock.now())
        is_whole = self._bundle.take(robot_id, stamp, monotonic()) if stamp >= 0 else not self._bundle.is_open
        if self._rate is None and is_whole:
            self._flush()

    def _take_in_lockstep(self, robot_id: int, message: TFMessage, stamp: int) -> None:
        self._merger.take(robot_id, message, self._node.clock.now(), max(self._part.stamp, self._bundle.stamp, stamp))
        self._bundle.take_in_lockstep(robot_id, stamp)
        if not self._part.advance() and self._bundle.may_leave(self._part.robots):
            self._flush(self._bundle.stamp)

    def _has_inputs(self, tick: Tick) -> bool:
        return self._bundle.stamp >= self._part.stamp and self._bundle.has_all(self._part.robots)

    def _repeat(self) -> None:
        if self._last.transforms:
            self._tf.hand_over(self._last)

    def _on_statics(self, robot_id: int) -> None:
        self._bundle.place(robot_id)
        self._part.advance()

    def _on_jump_back(self, old: int, new: int) -> None:
        log.warning("time jumped back from %.1f s to %.1f s: moving transforms are forgotten", old / 1e9, new / 1e9)
        self._merger.jump_back()
        self._bundle.restart()

    def _flush_late(self) -> None:
        """Send the bundle as it is; do not wait for robots that have not spoken for its tick until they speak again."""
        self._bundle.forget_silent()
        self._flush()

    def _flush(self, tick: int = 0) -> None:
        pending = self._merger.take_pending(tick)
        # Before the bundle: what a localiser has taken over ends for all robots together with the bundle that has it.
        self._publish_statics()
        self._bundle.close()
        if pending:
            bundle, last = TFMessage(pending), self._last.transforms
            same_tick = last and ns_from_time(last[-1].header.stamp) == ns_from_time(pending[-1].header.stamp)
            self._last = TFMessage([*last, *pending]) if same_tick else bundle
            self._tf.hand_over(bundle)

    def _publish_statics(self) -> None:
        if self._merger.statics_changed:
            self._tf_static.put(self._merger.statics())

    def run(self) -> None:
        """Send late bundles, and log conflicts, until the process is asked to stop."""
        pace: Rate | None = None
        may_log = Every(1.0)
        while not self._node.stopping:
            self._node.decide_clock(self._first_data)
            rate = None if self._part.active else self._rate
            if rate is None:
                self._send_late()
            else:
                pace = pace or Rate(to_ns(1.0 / rate), self._node.clock.steady())
                if self._node.wait_for_moment(pace):
                    with self._node.changed:
                        self._flush()
            with self._node.changed:
                self._sources.drop_lost()
                conflicts = self._merger.take_conflicts() if may_log.due() else []
            _log_conflicts(conflicts)

    def _send_late(self) -> None:
        """Wait for a bundle, and send it if it does not leave in time."""
        self._node.wait(lambda: self._bundle.is_open, 0.5)
        self._node.wait(lambda: self._bundle.is_old(monotonic()), PATIENCE)
        with self._node.changed:
            if self._bundle.is_old(monotonic()):
                self._flush_late()


def _log_conflicts(conflicts: list[str]) -> None:
    for conflict in conflicts[:_MOST_CONFLICTS]:
        log.warning("%s", conflict)
    if len(conflicts) > _MOST_CONFLICTS:
        log.warning("and %d more conflicts: 'zteam tf monitor' lists them", len(conflicts) - _MOST_CONFLICTS)


def run_aggregator(
    node: ProcessNode,
    configured: Iterable[TransformStamped],
    descriptions: Mapping[int, Description],
    rate: float | None,
) -> None:
    """Be the aggregator until asked to stop."""
    aggregator = Aggregator(node, configured, descriptions, rate)
    node.become_present()
    aggregator.run()
