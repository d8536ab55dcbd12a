"""The TF aggregator process: takes every robot's transforms, and publishes one tree in one bundled message a tick.

`Bundle` says for which robots it waits. It leaves in the callback of the last one.
"""

from collections.abc import Mapping

from zteam import names
from zteam.bus import NoRequest
from zteam.bus.transport import RawSample
from zteam.clock import FREEZES, Rate, monotonic, to_ns, wall_ns
from zteam.errors import log
from zteam.messages import JointState, TFMessage, Tick, encode, ns_from_time
from zteam.node.node import Node
from zteam.node.process_options import AggregatorOptions
from zteam.node.steps import Due
from zteam.node.tokens import CertainTokens, TokenSet
from zteam.transforms.answers import answer_frames, answer_history, answer_lookups
from zteam.transforms.client import BundleReply, HistoryRequest, LookupRequest, StaticReply, StaticRequest
from zteam.transforms.merge import MAX_APART, Merger, base_stamp
from zteam.transforms.process.bundle import PATIENCE, Bundle
from zteam.transforms.urdf import Description

WALL_RATE = 20.0
"""Bundles a second where there is no simulator and no other rate was asked for."""
_MOST_CONFLICTS = 3
"""Lines a second: a sender can invent robots. 'zteam tf monitor' lists all."""
_CALLER_ENDED = names.service_key(names.AGGREGATOR, "caller_ended")
"""Key of what a tick carries when the caller of fixed frames has ended: the caller's session."""
_SESSION = "session:"
"""What the authority of a broadcaster begins with, before the id of its session."""


class Aggregator:
    """The merged tree on the bus, and the timer of its bundles in real time. Callbacks run under `node.changed`.

    A broadcaster's fixed frames have its session as their authority. A caller's fixed frame is dropped when the
    caller's token is gone for good.
    """

    def __init__(
        self, node: Node, options: AggregatorOptions, descriptions: Mapping[int, Description] | None = None
    ) -> None:
        """`descriptions` are those of `options`, read from their files."""
        self._node, self._part, self._given_rate = node, node.part, options.rate
        self._pace: Rate | None = None
        self._is_due = False
        self._descriptions = descriptions or {}
        self._tokens = TokenSet()
        self._merger = Merger(options.static_transforms, self._name_of)
        self._told = 0
        """How many conflicts the log has."""
        self._bundle = Bundle()
        self._last = TFMessage([])
        """The bundle that was sent last."""
        self._tf = node.bus.publisher(names.TF, TFMessage)
        self._tf_static = node.bus.publisher(names.TF_STATIC, TFMessage, latched=True)
        self._part.repeat = self._repeat
        # The simulator's transforms come before their tick, and so does the bundle of them.
        self._part.is_early = True
        node.need(self._lacks)
        node.adopt(self.act, self)
        node.clock.on_jump_back(self._on_jump_back)
        node.hear(names.all_robots_key(names.TF), TFMessage, self._on_tf)
        # The newest one of each broadcaster counts.
        node.bus.subscribe_raw(names.all_robots_key(names.TF_STATIC), node.handler(self._on_statics), latched=True)
        node.watch_tokens(names.tokens_key("*"), self._on_token)
        self._callers = CertainTokens(node.bus, names.tokens_key(names.STATIC_CALLER), self._on_caller)
        serve, service, buffer = node.bus.serve, names.service_key, self._merger.buffer
        self._asked: dict[str, str] = {}
        """Fixed frames that were asked for, by child: their callers, until a tick of lock-step has carried them."""
        self._ended: set[str] = set()
        """Callers that have ended, until a tick of lock-step has carried that."""
        node.serve_change(service(names.AGGREGATOR, "static"), StaticRequest, self._check_static, self._add_static)
        self._part.changes[_CALLER_ENDED] = lambda caller: self._drop_caller(caller.decode())
        serve(service(names.AGGREGATOR, "lookup"), LookupRequest, lambda request: answer_lookups(buffer, request))
        serve(service(names.AGGREGATOR, "history"), HistoryRequest, lambda request: answer_history(buffer, request))
        serve(service(names.AGGREGATOR, "conflicts"), NoRequest, lambda _: self._merger.conflicts())
        serve(service(names.AGGREGATOR, "frames"), NoRequest, lambda _: answer_frames(self._merger))
        serve(service(names.AGGREGATOR, "newest"), NoRequest, lambda _: BundleReply(encode(self._last)))
        for robot_id, description in self._descriptions.items():
            self._merger.describe(robot_id, description.static_transforms())
        if self._descriptions:
            node.hear(names.all_robots_key(names.JOINT_STATES), JointState, self._on_joint_states)
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
        # The open tick of lock-step may still be on its way; the transforms that it brings left before it.
        tick = self._bundle.begun(self._part.stamp) if self._part.tick is not None else 0
        self._merge(target[0], frames, tick)
        if self._rate is None and not self._bundle.is_open and self._part.tick is None:
            # No bundle is being filled that they could travel with.
            self._flush()

    def _merge(self, robot_id: int, message: TFMessage, tick: int = 0) -> None:
        now = self._node.clock.now()
        self._merger.receive(robot_id, message, now, tick, 0 if now else wall_ns(), trusts=self._trusts_clock)

    def _trusts_clock(self) -> bool:
        """After a cut link or a freeze, transforms may come before the clock that belongs to them."""
        return not self._node.clock.stands and not FREEZES.has_just_woken()

    def _on_tf(self, key: str, message: TFMessage) -> None:
        target = names.split_robot_key(key)
        if target is None or not message.transforms:
            return
        # Frames of other processes say nothing of the tick: their stamps may be of the past or of the future.
        robot_id, stamp = target[0], base_stamp(target[0], message)
        part, bundle = self._part, self._bundle
        if part.tick is not None:
            if stamp <= part.stamp + MAX_APART:
                bundle.take_in_lockstep(robot_id, stamp, part.stamp)
            self._merge(robot_id, message, bundle.begun(part.stamp))
            if (leaves := bundle.leaves(part.robots)) is not None:
                self._flush(leaves)
            return
        # Real time: into the bundle of their tick, or those without a base into any.
        self._node.first_data = self._node.first_data or monotonic()
        if self._rate is None and bundle.ends_with(stamp):
            # Transforms of the tick before must not wait any longer.
            self._flush_late()
        self._merge(robot_id, message)
        is_whole = bundle.take(robot_id, stamp, monotonic()) if stamp >= 0 else not bundle.is_open
        if self._rate is None and is_whole:
            self._flush()

    def _lacks(self, tick: Tick) -> list[str]:
        is_whole = self._bundle.has_all(self._part.robots, self._part.stamp)
        return [] if is_whole else [names.all_robots_key(names.TF)]

    def act(self, due: Due) -> None:
        """Send the bundle: in lock-step that of the tick, which is whole."""
        with self._node.changed:
            if due.tick is not None:
                self._flush(due.now)
            else:
                self._flush_late()

    def _repeat(self) -> None:
        if self._last.transforms:
            self._tf.put_owned(self._last)

    def _on_statics(self, sample: RawSample) -> None:
        target, message = names.split_robot_key(sample.key), self._node.bus.counters.decode(sample, TFMessage)
        if target is not None and message is not None:
            self._merger.receive_static(target[0], message, _SESSION + sample.source, sample.sent(monotonic()))
            self._publish_statics()
            self._bundle.placed.add(target[0])

    def _name_of(self, authority: str) -> str | None:
        """What users read for an authority; None for a session that holds no name: its process may have ended."""
        if not authority.startswith(_SESSION):
            return authority
        with self._node.changed:
            return self._tokens.name_of(authority.removeprefix(_SESSION))

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and token[0] != names.STATIC_CALLER:
            self._tokens.take(*token, alive)
            self._merger.statics.look_again(_SESSION + token[1])
            self._publish_statics()

    def _on_caller(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and not alive:
            with self._node.changed:
                if self._part.expected:
                    self._ended.add(_caller(token[1]))
                    self._part.hand_on(_CALLER_ENDED, token[1].encode())
                else:
                    self._drop_caller(token[1])

    def _drop_caller(self, caller: str) -> None:
        self._ended.discard(_caller(caller))
        self._merger.statics.drop_authority(_caller(caller))
        self._publish_statics()

    def _check_static(self, request: StaticRequest) -> tuple[StaticReply, bool]:
        """Whether a fixed frame may be added to those that hold or are about to."""
        # The request came over the router, so the link is up and missing tokens are gone: their frames are free.
        self._callers.look(0.0)
        transform, caller = request.transform(), _caller(request.caller)
        child = transform.child_frame_id
        refused = self._merger.why_not_static(transform, caller, self._ended)
        if not refused and self._asked.setdefault(child, caller) != caller:
            refused = f"{self._asked[child]} publishes {child} already: end that process or name another child"
        return StaticReply(refused), not refused

    def _add_static(self, request: StaticRequest) -> None:
        transform = request.transform()
        self._asked.pop(transform.child_frame_id, None)
        refused = self._merger.add_static(transform, _caller(request.caller))
        if refused:
            log.warning("%s", refused)
        self._publish_statics()

    def _on_jump_back(self, old: int, new: int) -> None:
        log.warning("time jumped back from %.1f s to %.1f s: moving transforms are forgotten", old / 1e9, new / 1e9)
        self._merger.jump_back()
        self._bundle = Bundle(self._bundle.placed)

    def _flush_late(self) -> None:
        """Send the bundle as it is; do not wait for robots that have not spoken for its tick until they speak again."""
        self._bundle.forget_silent()
        self._flush()

    def _flush(self, tick: int = 0) -> None:
        pending = self._merger.take_pending(tick)
        # Before the bundle: what a localiser has taken over ends for all robots together with the bundle that has it.
        self._publish_statics()
        self._bundle.close(tick)
        if pending:
            bundle, last = TFMessage(pending), self._last.transforms
            same_tick = last and ns_from_time(last[-1].header.stamp) == ns_from_time(pending[-1].header.stamp)
            self._last = TFMessage([*last, *pending]) if same_tick else bundle
            self._tf.put_owned(bundle)

    def _publish_statics(self) -> None:
        if self._merger.statics.changed:
            self._tf_static.put(self._merger.statics.message())

    def wait(self, limit: float) -> None:
        """Wait for the next bundle at its rate, or for one that does not leave in time."""
        node, rate = self._node, self._rate
        if rate is None:
            node.wait(lambda: self._bundle.is_open, 0.5)
            self._is_due = node.wait(lambda: self._bundle.is_old(monotonic()), PATIENCE)
        else:
            self._pace = self._pace or Rate(to_ns(1.0 / rate), node.clock.steady())
            self._is_due = node.wait_for_moment(self._pace)

    def take(self) -> int | None:
        """Now, if a bundle is due."""
        is_due = self._is_due and (self._rate is not None or self._bundle.is_old(monotonic()))
        return self._node.clock.now() if is_due else None

    def beat(self) -> None:
        """Log the conflicts of the last second."""
        with self._node.changed:
            conflicts = self._merger.conflicts()[self._told :]
        self._told += len(conflicts)
        for conflict in conflicts[:_MOST_CONFLICTS]:
            log.warning("%s", conflict)
        if more := len(conflicts[_MOST_CONFLICTS:]):
            log.warning("and %d more conflicts: 'zteam tf monitor' lists them", more)


def _caller(caller: str) -> str:
    return f"{names.STATIC_CALLER} {caller}"


def run_aggregator(node: Node, options: AggregatorOptions, descriptions: Mapping[int, Description]) -> None:
    aggregator = Aggregator(node, options, descriptions)
    node.become_present()
    if not node.in_team:
        log.info("aggregator of transforms: waiting for those of the robots (robot_N/tf)")
    node.drive(aggregator.beat)
