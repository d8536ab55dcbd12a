"""The aggregator on a bus in memory: bundles, the latched fixed set, its queries, losses of every kind."""

import itertools
import threading
from collections.abc import Callable, Iterator

import pytest

from support.cuttable_transport import CutTransport, cut_bus
from support.log_capture import LogCapture, captured_log
from zteam import names
from zteam.bus import Bus, MemoryHub
from zteam.clock import wait_until
from zteam.errors import BusError
from zteam.messages import (
    Clock,
    Header,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    ns_from_time,
    time_from_ns,
)
from zteam.nodes.transforms import node as aggregator_module
from zteam.nodes.transforms.node import Aggregator
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop
from zteam.services.transforms import FrameReply, Lookup, LookupReply, LookupRequest, StaticReply, StaticRequest

S = 1_000_000_000
LIMIT = 20.0
"""Host seconds after which a wait has failed."""

Bundle = list[tuple[str, int]]
"""(child frame, stamp in ns) of each transform."""


def transform(parent: str, child: str, stamp: int = 0, x: float = 0.0) -> TransformStamped:
    """`child` lies x metres ahead of `parent`."""
    pose = Transform(Vector3(x), Quaternion(0.0, 0.0, 0.0, 1.0))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, pose)


class Base:
    """A robot's base: says where it is."""

    def __init__(self, hub: MemoryHub, robot_id: int) -> None:
        self.bus = hub.bus()
        self.tf = self.bus.publisher(names.robot_key(robot_id, names.TF), TFMessage)
        self.tf_static = self.bus.publisher(names.robot_key(robot_id, names.TF_STATIC), TFMessage, latched=True)

    def stand(self, x: float) -> None:
        """The start pose, latched."""
        self.tf_static.put(TFMessage([transform("map", "odom", 0, x)]))

    def drive(self, stamp: int, x: float = 0.0) -> None:
        """Odometry of one tick."""
        self.tf.put(TFMessage([transform("odom", "base_footprint", stamp, x)]))


class Listener:
    """What a robot hears from the aggregator."""

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
        """Wait until something that came makes it true."""
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
        self.aggregator = Aggregator(self.node, configured, {}, rate)
        self.thread = threading.Thread(target=self.aggregator.run)

    def start(self) -> None:
        """Run the main loop."""
        self.thread.start()

    def end(self) -> None:
        """Stop and wait."""
        self.stop.request("test over")
        if self.thread.ident is not None:
            self.thread.join(LIMIT)
        self.node.close()
        assert not self.thread.is_alive()


@pytest.fixture
def desk(hub: MemoryHub) -> Iterator[Desk]:
    """An aggregator whose main loop stands still: what is tested happens in callbacks."""
    desk = Desk(hub)
    yield desk
    desk.end()


@pytest.fixture
def log() -> Iterator[LogCapture]:
    """What is logged during the test."""
    with captured_log() as lines:
        yield lines


def ask_static(hub: MemoryHub, child: str, x: float, instance: str) -> StaticReply:
    """Add `map -> child` for this caller."""
    request = StaticRequest("map", child, instance, x)
    return hub.bus().ask(names.service_key(names.AGGREGATOR, "static"), StaticReply, request)


def look_up(hub: MemoryHub, target: str, source: str, time: int = 0) -> LookupReply:
    """Ask the aggregator."""
    request = LookupRequest([Lookup(target, source, time)])
    (reply,) = hub.bus().ask(names.service_key(names.AGGREGATOR, "lookup"), list[LookupReply], request)
    return reply


@pytest.mark.usefixtures("desk")
def test_one_robots_transforms_leave_at_once(hub: MemoryHub) -> None:
    """With nobody to wait for, each message is sent on in the callback that took it, its stamp unchanged."""
    listener, base = Listener(hub), Base(hub, 4)
    for tick in range(1, 4):
        base.drive(tick * S // 10 + 7)
        assert listener.bundles[-1] == [("robot_4/base_footprint", tick * S // 10 + 7)]
    assert len(listener.bundles) == 3


def test_a_tick_is_one_bundle(hub: MemoryHub, desk: Desk) -> None:
    """Once it is known who speaks, the callback of a tick's last robot sends the bundle, whoever that is."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(3)]
    desk.start()
    for base in bases:
        base.drive(1)
    listener.wait_for_bundles(2)
    # From here on nothing but the callbacks can send.
    desk.stop.request("main loop over")
    desk.thread.join(LIMIT)
    for tick, order in enumerate(([0, 1, 2], [2, 0, 1], [1, 2, 0]), start=2):
        count = len(listener.bundles)
        for i in order:
            assert len(listener.bundles) == count
            bases[i].drive(tick * S)
        assert listener.bundles[count:] == [[(f"robot_{i}/base_footprint", tick * S) for i in order]]


@pytest.mark.usefixtures("desk")
def test_a_bundle_holds_one_tick(hub: MemoryHub) -> None:
    """However fast the ticks come, after the first one each leaves whole, in the callback of its last robot."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(3)]
    for tick in range(1, 6):
        for base in bases:
            base.drive(tick * S // 100)
    whole = [[(f"robot_{i}/base_footprint", tick * S // 100) for i in range(3)] for tick in range(2, 6)]
    assert listener.bundles[-4:] == whole


@pytest.mark.usefixtures("desk")
def test_a_silent_robot_delays_one_tick(hub: MemoryHub) -> None:
    """When a robot falls silent the others' bundles are late once, and not for ever."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(3)]
    for tick in range(1, 4):
        for base in bases:
            base.drive(tick * S // 100)
    for tick in range(4, 8):
        for base in bases[:2]:
            base.drive(tick * S // 100)
    assert {stamp for _, stamp in listener.bundles[-1]} == {7 * S // 100}


@pytest.mark.usefixtures("desk")
def test_a_robot_ahead_pushes_the_others_out(hub: MemoryHub) -> None:
    """What waits for somebody's older tick leaves when a newer one comes; nothing is lost or doubled."""
    listener, bases = Listener(hub), [Base(hub, i) for i in range(2)]
    for tick in range(1, 6):
        bases[0].drive(tick * S)
        if tick % 2:
            bases[1].drive(tick * S)
    bases[0].drive(6 * S)
    bases[0].drive(7 * S)
    sent = [pair for bundle in listener.bundles for pair in bundle]
    assert len(sent) == len(set(sent))
    assert {("robot_0/base_footprint", t * S) for t in range(1, 7)} <= set(sent)
    assert {("robot_1/base_footprint", t * S) for t in (1, 3, 5)} <= set(sent)
    for bundle in listener.bundles:
        assert len({child for child, _ in bundle}) == len(bundle)


def test_a_late_bundle_leaves_by_itself(hub: MemoryHub, desk: Desk) -> None:
    """A robot that falls silent holds the others' transforms for a moment only; then it is not waited for."""
    listener, bases = Listener(hub), [Base(hub, 0), Base(hub, 1)]
    desk.start()
    bases[0].drive(S)
    bases[1].drive(S)
    listener.wait_for_bundles(2)
    bases[1].drive(2 * S)
    listener.wait_for_bundles(3)
    bases[1].drive(3 * S)
    assert listener.bundles[2:] == [[("robot_1/base_footprint", tick * S)] for tick in (2, 3)]


def test_a_rate_bundles_by_time(hub: MemoryHub) -> None:
    """With --rate everything since the last bundle goes into one, stamps unchanged, and nothing leaves before."""
    desk, listener, bases = Desk(hub, rate=50.0), Listener(hub), [Base(hub, 0), Base(hub, 1)]
    for tick in (1, 2, 3):
        for base in bases:
            base.drive(tick * S)
    assert listener.bundles == []
    desk.start()
    listener.wait_for_bundles(1)
    desk.end()
    assert listener.bundles == [[(f"robot_{i}/base_footprint", t * S) for t in (1, 2, 3) for i in (0, 1)]]


def test_a_rate_goes_by_simulated_time(hub: MemoryHub) -> None:
    """While the simulator's time stands still no bundle leaves; the tick that completes the period sends it."""
    desk, listener, base = Desk(hub, rate=1.0), Listener(hub), Base(hub, 0)
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(S)))
    desk.start()
    base.drive(S)
    for tenth in range(11, 20):
        clock.put(Clock(time_from_ns(tenth * S // 10)))
        base.drive(tenth * S // 10)
    assert listener.bundles == []
    # The main loop has begun to count at 1 s, or at any of these moments.
    for tenth in range(20, 31):
        clock.put(Clock(time_from_ns(tenth * S // 10)))
    listener.wait(lambda: len(listener.bundles) > 0)
    assert listener.bundles[0][0] == ("robot_0/base_footprint", S)
    desk.end()


def test_without_a_simulator_bundles_leave_at_a_rate(hub: MemoryHub) -> None:
    """Real robots have no common tick: in wall time their transforms are gathered, not sent on one by one."""
    desk, listener, bases = Desk(hub), Listener(hub), [Base(hub, 0), Base(hub, 1)]
    desk.node.clock.use_wall()
    now = desk.node.clock.now()
    for step in range(3):
        for i, base in enumerate(bases):
            base.drive(now + step * S // 50 + i)
    assert listener.bundles == []
    desk.start()
    listener.wait_for_bundles(1)
    desk.end()
    assert len(listener.bundles[0]) == 6


def test_the_fixed_set_is_latched_and_whole(hub: MemoryHub) -> None:
    """The team file's and every robot's fixed transforms, in one message that late listeners get too."""
    Base(hub, 0).stand(1.0)
    desk = Desk(hub, (transform("robot_0/base_link", "robot_0/camera", 0, 0.1),))
    Base(hub, 1).stand(2.0)
    listener = Listener(hub)
    assert listener.statics == [{"robot_0/camera": 0.1, "robot_0/odom": 1.0, "robot_1/odom": 2.0}]
    desk.end()


@pytest.mark.usefixtures("desk")
def test_the_fixed_set_is_sent_on_change(hub: MemoryHub) -> None:
    """A moved start pose is sent, a repeated one is not."""
    listener, base = Listener(hub), Base(hub, 0)
    for x in (1.0, 1.0, 3.0, 3.0):
        base.stand(x)
    assert listener.statics == [{"robot_0/odom": 1.0}, {"robot_0/odom": 3.0}]


def test_a_restarted_aggregator_rebuilds(hub: MemoryHub) -> None:
    """The latched sets of the robots and the team file make the same tree as before."""
    configured = (transform("map", "table", 0, 4.0),)
    first, base = Desk(hub, configured), Base(hub, 0)
    base.stand(1.0)
    first.end()
    second = Desk(hub, configured)
    assert Listener(hub).statics == [{"robot_0/odom": 1.0, "table": 4.0}]
    base.drive(S, 0.5)
    assert look_up(hub, "map", "robot_0/base_footprint").translation[0] == 1.5
    second.end()


@pytest.mark.usefixtures("desk")
def test_a_localiser_takes_over_the_start_pose(hub: MemoryHub) -> None:
    """A robot that says where its odometry frame is takes it out of the fixed set."""
    listener, base = Listener(hub), Base(hub, 0)
    base.stand(1.0)
    base.tf.put(TFMessage([transform("map", "odom", S, 2.0)]))
    assert listener.statics[-1] == {}
    assert listener.bundles == [[("robot_0/odom", S)]]


def test_a_caller_adds_a_frame_while_it_lives(hub: MemoryHub, desk: Desk) -> None:
    """tf/static adds; a second caller is refused by name; the frame goes with the caller's token."""
    desk.start()
    listener, caller = Listener(hub), hub.bus()
    token = caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance))
    assert ask_static(hub, "/table", 4.0, caller.instance).refused == ""
    assert listener.statics[-1] == {"table": 4.0}
    assert "table is said by" in ask_static(hub, "table", 5.0, "f" * 32).refused
    token.close()
    listener.wait_for_statics({})
    assert ask_static(hub, "table", 5.0, "f" * 32).refused == ""


@pytest.mark.usefixtures("desk")
def test_a_frame_is_free_as_soon_as_its_caller_has_gone(hub: MemoryHub) -> None:
    """Ctrl+C and the same command again: the second caller gets the frame at once."""
    listener, callers = Listener(hub), [hub.bus(), hub.bus()]
    token = callers[0].declare_token(names.token_key(names.STATIC_CALLER, callers[0].instance))
    ask_static(hub, "table", 4.0, callers[0].instance)
    token.close()
    callers[1].declare_token(names.token_key(names.STATIC_CALLER, callers[1].instance))
    assert ask_static(hub, "table", 5.0, callers[1].instance).refused == ""
    assert listener.statics[-1] == {"table": 5.0}


@pytest.mark.usefixtures("desk")
def test_a_bad_frame_is_refused_to_its_caller(hub: MemoryHub) -> None:
    """No name, no rotation, a loop: the reply says why and the tree stays."""
    listener, service = Listener(hub), names.service_key(names.AGGREGATOR, "static")
    for request in (
        StaticRequest("map", "", "a"),
        StaticRequest("", "table", "a"),
        StaticRequest("table", "table", "a"),
        StaticRequest("map", "table", "a", qw=0.0),
    ):
        assert hub.bus().ask(service, StaticReply, request).refused
    with pytest.raises(BusError, match="bad request"):
        hub.bus().ask(service, StaticReply)
    assert listener.statics == []


def test_callers_are_told_apart(hub: MemoryHub, desk: Desk) -> None:
    """Session ids that begin alike are different callers."""
    desk.start()
    listener = Listener(hub)
    callers = ["00000000" + "a" * 24, "00000000" + "b" * 24]
    tokens = [hub.bus().declare_token(names.token_key(names.STATIC_CALLER, caller)) for caller in callers]
    for i, caller in enumerate(callers):
        ask_static(hub, f"table_{i}", 1.0, caller)
    tokens[0].close()
    listener.wait(lambda: "table_0" not in listener.statics[-1])
    assert listener.statics[-1] == {"table_1": 1.0}


def test_a_lost_router_takes_no_frames(hub: MemoryHub, desk: Desk) -> None:
    """After the router's return the frames of callers that live on are there."""
    desk.start()
    listener, caller = Listener(hub), hub.bus()
    key = names.token_key(names.STATIC_CALLER, caller.instance)
    token = caller.declare_token(key)
    ask_static(hub, "table", 4.0, caller.instance)
    token.close()
    desk.link.set_link(False)
    desk.link.set_link(True)
    caller.declare_token(key)
    assert listener.statics[-1] == {"table": 4.0}


def test_callers_have_time_to_find_the_router(
    hub: MemoryHub, desk: Desk, log: LogCapture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long the router is away, frames go only with callers that stay away when it is back."""
    now = [1000.0]
    monkeypatch.setattr(aggregator_module, "monotonic", lambda: now[0])
    desk.start()
    listener, strangers = Listener(hub), itertools.count()

    def pass_by(seconds: float) -> None:
        # Conflicts are logged at the end of a round, after it has looked for losses.
        now[0] += seconds
        child = f"nowhere_{next(strangers)}"
        hub.bus().publisher("robot_9/tf", TFMessage).put(TFMessage([transform("map", f"/{child}", S)]))
        log.wait_for(f"where {child} is")

    callers = [hub.bus(), hub.bus()]
    tokens = []
    for i, caller in enumerate(callers):
        tokens.append(caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance)))
        ask_static(hub, f"table_{i}", 4.0, caller.instance)
    desk.link.set_link(False)
    for token in tokens:
        token.close()
    pass_by(60.0)
    desk.link.set_link(True)
    pass_by(0.6)
    callers[0].declare_token(names.token_key(names.STATIC_CALLER, callers[0].instance))
    assert listener.statics[-1] == {"table_0": 4.0, "table_1": 4.0}
    pass_by(60.0)
    assert listener.statics[-1] == {"table_0": 4.0}


@pytest.mark.usefixtures("desk")
def test_look_ups_answer_or_say_why(hub: MemoryHub) -> None:
    """The pose and its stamp, at a time between two samples too; else tf2's exception by name."""
    base = Base(hub, 0)
    base.stand(1.0)
    base.drive(S, 0.0)
    base.drive(2 * S, 1.0)
    newest = look_up(hub, "map", "/robot_0/base_footprint")
    assert (newest.stamp, newest.translation, newest.error) == (2 * S, (2.0, 0.0, 0.0), "")
    between = look_up(hub, "map", "robot_0/base_footprint", S + S // 2)
    assert between.translation == pytest.approx((1.5, 0.0, 0.0))
    assert between.rotation == (0.0, 0.0, 0.0, 1.0)
    for target, source, time, error in (
        ("map", "moon", 0, "LookupException"),
        ("map", "robot_0/base_footprint", 3 * S, "ForwardExtrapolationException"),
        ("map", "robot_0/base_footprint", S // 2, "BackwardExtrapolationException"),
        ("", "map", 0, "InvalidArgumentException"),
    ):
        reply = look_up(hub, target, source, time)
        assert reply.error == error
        assert reply.text


@pytest.mark.usefixtures("desk")
def test_the_frames_are_listed(hub: MemoryHub) -> None:
    """Parent, authority, kind, rate and age of every frame."""
    base = Base(hub, 0)
    base.stand(1.0)
    for tick in range(1, 12):
        base.drive(tick * S // 10)
    found = hub.bus().ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameReply])
    assert list(found) == ["robot_0/base_footprint", "robot_0/odom"]
    moving, fixed = found.values()
    assert (moving.parent, moving.authority, moving.static) == ("robot_0/odom", "robot_0", False)
    assert moving.rate == pytest.approx(10.0)
    assert (moving.oldest, moving.newest, moving.samples) == (S // 10, 11 * S // 10, 11)
    assert (fixed.parent, fixed.static) == ("map", True)


def test_a_conflict_is_logged_once_with_both_sides(hub: MemoryHub, log: LogCapture) -> None:
    """Robot 0 contradicts the team file again and again: one line names both, and the file's frame stays."""
    desk, listener = Desk(hub, (transform("robot_0/base_link", "robot_0/camera", 0, 0.1),)), Listener(hub)
    base, other = Base(hub, 0), Base(hub, 1)
    desk.start()
    for tick in range(1, 20):
        base.tf_static.put(TFMessage([transform("base_link", "camera", 0, 0.2)]))
        base.drive(tick * S)
        other.drive(tick * S)
    count = len(listener.bundles)
    other.drive(20 * S)
    listener.wait_for_bundles(count + 1)
    desk.end()
    (line,) = [line for line in log.lines if "robot_0/camera" in line]
    assert "team file" in line
    assert "by robot_0" in line
    assert listener.statics[-1]["robot_0/camera"] == 0.1


@pytest.mark.usefixtures("desk")
def test_a_jump_back_forgets_what_moves(hub: MemoryHub, log: LogCapture) -> None:
    """A restarted simulator's transforms are taken at once, the fixed ones stay, and the log says so."""
    clock = hub.bus().publisher(names.CLOCK, Clock)
    listener, base = Listener(hub), Base(hub, 0)
    base.stand(1.0)
    clock.put(Clock(time_from_ns(500 * S)))
    base.drive(500 * S, 5.0)
    clock.put(Clock(time_from_ns(S)))
    assert look_up(hub, "map", "robot_0/base_footprint").error
    assert [line for line in log.lines if "jumped back" in line] == [
        "time jumped back from 500.0 s to 1.0 s: moving transforms are forgotten"
    ]
    base.drive(S, 2.0)
    assert listener.bundles[-1] == [("robot_0/base_footprint", S)]
    assert look_up(hub, "map", "robot_0/base_footprint").translation[0] == 3.0


@pytest.mark.usefixtures("desk")
def test_nonsense_changes_nothing(hub: MemoryHub, desk: Desk) -> None:
    """Garbage, a wildcard key, a robot that speaks for another, an empty message: nothing is sent on."""
    listener = Listener(hub)
    raw = hub.bus().transport
    for key in ("robot_0/tf", "robot_0/tf_static"):
        raw.declare_publisher(key, "", False).put(b"\x00\x01\x00\x00\xff\xff\xff\xff")
    for key in ("robot_0/tf", "robot_01/tf", "robot_x/tf"):
        hub.bus().publisher(key, TFMessage).put(TFMessage([transform("robot_1/odom", "/robot_1/base", S)]))
        hub.bus().publisher(key, TFMessage).put(TFMessage())
    assert listener.bundles == []
    assert listener.statics == []
    counts = desk.node.bus.counters.snapshot()
    assert [counts[key].dropped for key in ("robot_0/tf", "robot_0/tf_static")] == [1, 1]


def test_the_aggregator_ends_when_asked(hub: MemoryHub) -> None:
    """The main loop returns on a stop request, with and without a rate."""
    for rate in (None, 0.1):
        desk = Desk(hub, rate=rate)
        desk.start()
        desk.end()
