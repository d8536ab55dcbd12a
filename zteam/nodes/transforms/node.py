"""The TF aggregator process: every robot's transforms in, one tree out, one bundled message a tick.

A bundle leaves as soon as every robot that speaks has spoken for its tick, in the callback of the last one; a robot
that falls silent delays it by PATIENCE once and then counts as silent until it speaks again. In lock-step it leaves
when every robot of the tick has spoken, however long that takes.
"""

import logging
from collections.abc import Iterable, Mapping

from zteam import names
from zteam.bus import NoRequest
from zteam.clock import Rate, monotonic, to_ns
from zteam.messages import (
    Header,
    JointState,
    Quaternion,
    TFMessage,
    Tick,
    Transform,
    TransformStamped,
    Vector3,
    ns_from_time,
)
from zteam.nodes.transforms.queries import answer_frames, answer_history, answer_lookups
from zteam.runtime.node import Node
from zteam.runtime.participant import Participant
from zteam.runtime.token_loss import GRACE, TokenLossFilter
from zteam.services.transforms import HistoryRequest, LookupRequest, StaticReply, StaticRequest
from zteam.tf.merge import Merger
from zteam.tf.urdf import Description

log = logging.getLogger("zteam")

WALL_RATE = 20.0
"""Bundles a second where there is no simulator and no other rate was asked for."""
PATIENCE = 0.03
"""Host seconds that a bundle waits for the last robot of its tick; by the host's clock, because simulated time stands
still within a tick."""


class Aggregator:
    """The merged tree on the bus. Callbacks run under `node.changed`."""

    def __init__(
        self,
        node: Node,
        configured: Iterable[TransformStamped],
        descriptions: Mapping[int, Description],
        rate: float | None,
    ) -> None:
        self._node = node
        self._given_rate = rate
        self._first_data = 0.0
        """Host time of the first moving transform; 0 before."""
        self._descriptions = descriptions
        self._merger = Merger(configured)
        self._spoken: dict[int, int] = {}
        """Robots that a bundle waits for, and the stamp each spoke for last."""
        self._opened: float | None = None
        """Host time of the bundle's first transform; None while it is empty."""
        self._stamp = 0
        """The tick of the bundle: its newest stamp."""
        self._fresh: set[int] = set()
        """Lock-step: robots that have spoken for `_stamp`."""
        self._placed: set[int] = set()
        """Robots whose fixed transforms have come."""
        self._last = TFMessage([])
        """The bundle that was sent last."""
        self._losses = TokenLossFilter()
        self._tf = node.bus.publisher(names.TF, TFMessage)
        self._tf_static = node.bus.publisher(names.TF_STATIC, TFMessage, latched=True)
        self._part = Participant(node, self._has_inputs, self._act, self._repeat)
        node.clock.sim.on_jump_back(self._on_jump_back)
        node.subscribe(names.all_robots_key(names.TF), TFMessage, self._on_tf, wake=False)
        node.subscribe(names.all_robots_key(names.TF_STATIC), TFMessage, self._on_tf_static, latched=True)
        node.bus.watch_link(self._on_link)
        node.watch_tokens(names.tokens_key(names.STATIC_CALLER), self._on_static_caller)
        serve, service = node.bus.serve, names.service_key
        serve(service(names.AGGREGATOR, "static"), StaticRequest, self._add_static)
        buffer = self._merger.buffer
        serve(service(names.AGGREGATOR, "lookup"), LookupRequest, lambda request: answer_lookups(buffer, request))
        serve(service(names.AGGREGATOR, "history"), HistoryRequest, lambda request: answer_history(buffer, request))
        serve(service(names.AGGREGATOR, "conflicts"), NoRequest, lambda _: self._merger.conflicts())
        serve(service(names.AGGREGATOR, "frames"), NoRequest, lambda _: answer_frames(buffer))
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
        self._merger.take(target[0], TFMessage(description.moving_transforms(message)), self._node.clock.now())
        if self._rate is None and self._opened is None and not self._part.active:
            # No bundle is being filled that they could travel with.
            self._flush()

    def _on_tf(self, key: str, message: TFMessage) -> None:
        target = names.split_robot_key(key)
        if target is None or not message.transforms:
            return
        robot_id = target[0]
        stamp = max(ns_from_time(t.header.stamp) for t in message.transforms)
        self._part.take_stamp(stamp)
        if self._part.active:
            self._merger.take(robot_id, message, self._node.clock.now())
            self._hear(robot_id, stamp)
        else:
            self._bundle(robot_id, message, stamp)
            self._node.changed.notify_all()
        if self._merger.statics_changed:
            self._publish_statics()

    def _bundle(self, robot_id: int, message: TFMessage, stamp: int) -> None:
        """Take a robot's transforms into the bundle of their tick."""
        self._first_data = self._first_data or monotonic()
        if self._rate is None and self._opened is not None and stamp > self._stamp:
            # The next tick begins: what is here must not wait for anybody any more.
            self._flush_late()
        self._merger.take(robot_id, message, self._node.clock.now())
        if self._opened is None:
            self._opened, self._stamp = monotonic(), stamp
        self._stamp = max(self._stamp, stamp)
        self._spoken[robot_id] = stamp
        if self._rate is None and all(s >= self._stamp for s in self._spoken.values()):
            self._flush()

    def _hear(self, robot_id: int, stamp: int) -> None:
        """Lock-step: a robot has spoken for the tick of `stamp`, which itself may be told after it."""
        if stamp > self._stamp:
            self._stamp = stamp
            self._fresh.clear()
        if stamp == self._stamp:
            self._fresh.add(robot_id)
        if not self._part.advance() and self._is_complete():
            self._flush()

    def _is_complete(self) -> bool:
        """Lock-step: whether every robot has said where it is at the newest stamp, and how it is made."""
        robots = self._part.robots
        return len(self._fresh) >= len(robots) and robots <= self._fresh and robots <= self._placed

    def _has_inputs(self, tick: Tick) -> bool:
        return self._stamp >= ns_from_time(tick.stamp) and self._is_complete()

    def _act(self, _tick: Tick) -> None:
        self._flush()

    def _repeat(self) -> None:
        if self._last.transforms:
            self._tf.put(self._last)

    def _on_tf_static(self, key: str, message: TFMessage) -> None:
        target = names.split_robot_key(key)
        if target is not None:
            self._merger.take_static(target[0], message)
            self._publish_statics()
            self._placed.add(target[0])
            self._part.advance()

    def _on_static_caller(self, key: str, alive: bool) -> None:
        self._losses.take_token(key, alive, monotonic())

    def _on_link(self, up: bool) -> None:
        with self._node.changed:
            self._losses.take_link(up, monotonic())

    def _drop_lost_callers(self, grace: float = GRACE) -> None:
        for key in self._losses.take_due(monotonic(), grace):
            token = names.split_token_key(key)
            if token is not None:
                self._merger.drop_authority(_authority(token[1]))
        self._publish_statics()

    def _on_jump_back(self, old: int, new: int) -> None:
        log.warning("time jumped back from %.1f s to %.1f s: moving transforms are forgotten", old / 1e9, new / 1e9)
        self._merger.jump_back()
        self._spoken.clear()
        self._fresh.clear()
        self._opened, self._stamp = None, 0

    def _flush_late(self) -> None:
        """Send what is here; who has not spoken for its tick is not waited for until he speaks again."""
        self._spoken = {robot_id: stamp for robot_id, stamp in self._spoken.items() if stamp >= self._stamp}
        self._flush()

    def _flush(self) -> None:
        pending = self._merger.take_pending()
        self._opened = None
        if pending:
            if self._last.transforms and self._last.transforms[-1].header.stamp == pending[-1].header.stamp:
                self._last = TFMessage([*self._last.transforms, *pending])
            else:
                self._last = TFMessage(pending)
            self._tf.put(TFMessage(pending))

    def _publish_statics(self) -> None:
        if self._merger.statics_changed:
            self._tf_static.put(self._merger.statics())

    def _add_static(self, request: StaticRequest) -> StaticReply:
        rotation = Quaternion(request.qx, request.qy, request.qz, request.qw)
        transform = TransformStamped(
            Header(frame_id=names.strip_slash(request.parent)),
            names.strip_slash(request.child),
            Transform(Vector3(request.x, request.y, request.z), rotation),
        )
        with self._node.changed:
            # The request came over the router, so tokens that are gone are gone: their frames are free.
            self._drop_lost_callers(0.0)
            refused = self._merger.add_static(transform, _authority(request.caller))
            self._publish_statics()
        return StaticReply(refused or "")

    def run(self) -> None:
        """Send late bundles, and say conflicts, until the process is asked to stop."""
        pace: Rate | None = None
        self._node.wakes_with_clock = self._given_rate is not None
        while not self._node.stopping:
            self._node.decide_clock(self._first_data)
            rate = None if self._part.active else self._rate
            if rate is None:
                self._node.wait(lambda: self._opened is not None, 0.5)
                self._node.wait(self._bundle_is_old, PATIENCE)
                with self._node.changed:
                    if self._bundle_is_old():
                        self._flush_late()
            else:
                pace = pace or Rate(to_ns(1.0 / rate), self._node.clock.steady())
                if self._node.wait_for_moment(pace):
                    with self._node.changed:
                        self._flush()
            with self._node.changed:
                self._drop_lost_callers()
                conflicts = self._merger.take_conflicts()
            for conflict in conflicts:
                log.warning("%s", conflict)

    def _bundle_is_old(self) -> bool:
        return self._opened is not None and monotonic() - self._opened >= PATIENCE


def _authority(caller: str) -> str:
    return f"{names.STATIC_CALLER} {caller}"


def run_aggregator(
    node: Node,
    configured: Iterable[TransformStamped],
    descriptions: Mapping[int, Description],
    rate: float | None,
) -> None:
    """Be the aggregator until asked to stop."""
    aggregator = Aggregator(node, configured, descriptions, rate)
    node.become_present()
    aggregator.run()
