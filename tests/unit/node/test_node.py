"""`zteam.Node` on a bus in memory: when its step runs, and what it may answer."""

import logging
import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

import zteam
from support.limits import LIMIT
from support.lockstep_doubles import HarnessFactory, ScriptedSimulator
from support.log_capture import captured_log
from support.played_node import play
from support.transforms import stamped
from support.transports import wait_until_true
from zteam import names
from zteam.bus import MemoryHub
from zteam.bus.presence import find_processes
from zteam.errors import BehaviorError, BusError, UsageError
from zteam.messages import (
    Bool,
    Clock,
    Done,
    Header,
    Message,
    Odometry,
    PoseStamped,
    RobotStatus,
    TFMessage,
    Twist,
    Vector3,
    ns_from_time,
    time_from_ns,
)
from zteam.node import node as node_module
from zteam.node.shutdown import Stop
from zteam.testing import run_node

TICK = 100_000_000
Make = Callable[..., zteam.Node]


@pytest.mark.parametrize(
    ("ticks", "period", "expected"),
    [
        (range(1, 12), 0.2, range(1, 12, 2)),
        # After a reset the step goes on a period later, not when the old time is reached again.
        ((500, 1, 2, 3), 0.1, (500, 2, 3)),
    ],
)
def test_its_step_follows_the_simulators_clock(
    hub: MemoryHub, make: Make, ticks: Sequence[int], period: float, expected: Sequence[int]
) -> None:
    """With a simulator in real time the step runs once a period of simulated time, and stands still with it. A jump
    back is told in the new time."""
    clock, node, steps, resets = hub.bus().publisher(names.CLOCK, Clock), make(), list[int](), list[int]()
    node.on_time_reset(lambda: resets.append(node.clock.now()))

    def script() -> Iterator[None]:
        for tick in ticks:
            clock.put(Clock(time_from_ns(tick * TICK)))
            yield

    play(node, steps.append, script(), period=period)
    assert steps == [tick * TICK for tick in expected]
    assert resets == ([TICK] if ticks[0] == 500 else [])


async def stepping_later(*_: object) -> None:
    """A call makes a coroutine, which nothing runs."""


def yielding(*_: object) -> Iterator[None]:
    """A call makes a generator, which nothing runs."""
    yield


CALLS: list[tuple[Callable[[Any], object], str]] = [
    (lambda node: node.subscribe("robot_*/odom", Odometry, print), "write 'robot_$*/odom'"),
    (lambda node: node.subscribe("robot*", Odometry, print), "write 'robot$*'"),
    (lambda node: node.subscribe("**/**", Odometry, print), "write '**'"),
    (lambda node: node.subscribe("*/**/*", Odometry, print), "write '*/*/**'"),
    (lambda node: node.subscribe("a$*$*/$*", Odometry, print), "write 'a$*/*'"),
    (lambda node: node.subscribe(" robot_0/odom", Odometry, print), "write 'robot_0/odom'"),
    (lambda node: node.subscribe(None, Odometry, print), "None is no text"),
    (lambda node: node.subscribe(5, Odometry, print, every_tick=True), "5 is no text"),
    (lambda node: node.subscribe(5, Odometry, print, latched=True), "5 is no text"),
    (lambda node: node.watch_tokens(None, print), "None is no text"),
    (lambda node: node.publisher(None, Bool), "None is no key"),
    (lambda node: node.run(), "write node.run(step)"),
    (lambda node: node.run(print, -1.0), "period=-1.0): give the seconds"),
    (lambda node: node.subscribe("/robot_0/odom", Odometry, print), "write 'robot_0/odom'"),
    (lambda node: node.publisher("/planner//plan", Bool), "write 'planner/plan'"),
    (lambda node: node.publisher("plan/", Bool), "write 'plan'"),
    (lambda node: node.subscribe("map", Bool, lambda message: None), "takes the key and the message"),
    (lambda node: node.subscribe("map", Bool, None), "def on_message(key, message)"),
    (lambda node: node.watch_tokens("sim/alive/*", lambda key: None), "takes the key and whether"),
    (lambda node: node.run(None), "write node.run(step)"),
    (lambda node: node.run(lambda: None), "def step(now)"),
    (lambda node: node.run(stepping_later), "without 'async' and 'yield'"),
    (lambda node: node.run(yielding), "without 'async' and 'yield'"),
    (lambda node: node.run(print, period=-1.0), "period=-1.0): give the seconds"),
    (lambda node: node.run(print, period=math.nan), "period=nan): give the seconds"),
    (lambda node: node.run(print, period="1"), "period='1'): give the seconds"),
]


@pytest.mark.parametrize(("call", "words"), CALLS, ids=[words for _, words in CALLS])
def test_a_call_that_cannot_work_is_refused_at_once(make: Make, call: Callable[[Any], object], words: str) -> None:
    """The error says what to write, and the node holds nothing of it."""
    with pytest.raises(UsageError, match=re.escape(words)):
        call(make())


def test_a_jump_back_forgets_what_waits_for_a_tick(hub: MemoryHub, make: Make) -> None:
    """A message of the time before is not handled in a tick of the new one."""
    node, simulator, taken = make(), ScriptedSimulator(hub, "planner"), list[bool]()
    node.subscribe("camera/seen", Bool, lambda _, message: taken.append(message.data))
    seen = hub.bus().publisher("camera/seen", Bool)
    simulator.appear()
    node.adopt(lambda _due: None, node_module.UserStep(node, lambda _now: None, 1.0))
    node.become_present()
    for tick, is_seen in ((50, True), (1, False), (2, True)):
        simulator.tick(tick, "planner")
        seen.put(Bool(is_seen))
    assert taken == [False]


def test_only_fresh_data_tells_of_a_base(hub: MemoryHub, make: Make) -> None:
    """What processes say, and latched messages, come before the simulator too: they do not decide for wall time."""
    node, bus = make(), hub.bus()
    node.subscribe("robot_0/status", RobotStatus, lambda key, status: None)
    node.subscribe(names.TF_STATIC, TFMessage, lambda key, message: None, latched=True)
    node.subscribe("robot_0/odom", Odometry, lambda key, odom: None)
    bus.publisher("robot_0/status", RobotStatus).put(RobotStatus())
    bus.publisher(names.TF_STATIC, TFMessage, latched=True).put(TFMessage())
    assert node.first_data == 0.0
    bus.publisher("robot_0/odom", Odometry).put(Odometry())
    assert node.first_data > 0.0


class Host:
    """The host's time, which goes on with every wait; `late` is what every wait takes too long."""

    def __init__(self, late: float = 0.0) -> None:
        self.ns = 1_000_000_000
        self._late = late

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Instead of `Node.wait`: nothing happens until the time is over."""
        if not ready():
            self.ns += round((timeout + self._late) * 1e9)
        return ready()


@pytest.mark.parametrize("period", [0.03, 0.15, 0.25, 1.7])
def test_in_wall_time_its_steps_are_a_period_apart(make: Make, monkeypatch: pytest.MonkeyPatch, period: float) -> None:
    """It waits for the very moment, and one that came late does not move the next."""
    node, host = make(), Host(late=0.001)
    node.clock.use_wall()
    monkeypatch.setattr(node.clock, "steady", lambda: host.ns)
    monkeypatch.setattr(node, "wait", host.wait)
    steps: list[int] = []

    def step(_now: int) -> None:
        steps.append(host.ns)
        if len(steps) == 40:
            node.stop.request("enough")

    node.run(step, period=period)
    begin = steps[0]
    for count, moment in enumerate(steps):
        assert 0 <= moment - begin - count * round(period * 1e9) <= 1_000_000


@pytest.mark.parametrize(
    ("period", "expected"),
    [(0.1, range(1, 13)), (0.03, range(1, 13)), (0.2, range(1, 13, 2)), (0.25, [1, 4, 6, 9, 11]), (1.0, [1, 11])],
)
def test_in_lock_step_its_steps_are_a_period_apart_in_ticks(
    hub: MemoryHub, period: float, expected: Sequence[int]
) -> None:
    """Each moment of the period is taken by the first tick after it, as by the simulator's clock in real time. After a
    reset the first tick has a step."""
    steps, taken = list[int](), list[object]()

    def main(node: zteam.Node) -> None:
        node.subscribe("camera/seen", Bool, lambda *seen: taken.append(seen))
        node.run(steps.append, period=period)

    with run_node(main, hub) as running:
        for _ in range(2):
            steps.clear()
            for _ in range(12):
                running.publish("camera/seen", Bool(True))
                running.tick()
            assert steps == [tick * TICK for tick in expected]
            running.reset()
    # What comes between two steps waits for none.
    assert len(taken) == 24


def test_a_node_is_told_of_keys_that_nothing_publishes(
    hub: MemoryHub, make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once, after a while, and not before a team is there, for which others wait too: the key that may be meant is
    named."""
    for name in ("HEARTBEAT", "_SEARCH_AFTER"):
        monkeypatch.setattr(node_module, name, 0.0)
    node, publisher = make(), hub.bus().publisher(names.CLOCK, Clock)
    for key in ("robot_0/scan", "robot_$*/odomm", "robot_1/odom", "plan"):
        node.subscribe(key, Odometry, lambda _key, _message: None)
    team = hub.bus()
    team.subscribe("robot_1/odom", Odometry, lambda _key, _message: None)

    def script() -> Iterator[None]:
        for tick in range(1, 7):
            publisher.put(Clock(time_from_ns(tick * TICK)))
            if tick == 4:
                assert log.count("nothing publishes") == 0
                for key in ("robot_0/odom", "robot_0/base_scan", "robot_1/odom"):
                    team.publisher(key, Odometry)
            yield
            if node._searching is not None:
                node._searching.join(LIMIT)

    with captured_log() as log:
        play(node, lambda _now: None, script())
    told = [line for line in log.lines if "nothing publishes" in line]
    assert told == [
        "nothing publishes plan",
        "nothing publishes robot_$*/odomm: did you mean robot_0/odom or robot_1/odom?",
        "nothing publishes robot_0/scan: did you mean robot_0/base_scan?",
    ]


@pytest.mark.parametrize(("name", "is_users"), [("watcher", True), ("robot_4", True), ("goals", False)])
def test_a_fast_lock_step_tells_of_keys_that_nothing_publishes(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, name: str, is_users: bool
) -> None:
    """As a warning, after 5 simulated seconds and not before, also to a robot's own node, which says that it is one.
    zteam's own nodes wait for what may never come."""
    monkeypatch.setattr(node_module, "HEARTBEAT", 0.0)
    team = hub.bus()
    team.publisher("robot_0/odom", Odometry)

    def main(node: zteam.Node) -> None:
        node.subscribe("robot_0/scan", Odometry, lambda _key, _message: None)
        node.run(lambda _now: None)

    with captured_log() as log, run_node(main, hub, name=name) as running:
        logging.getLogger("zteam").setLevel(logging.WARNING)
        for tick in range(1, 53):
            running.tick()
            assert tick > 50 or log.count("nothing publishes") == 0
        wait_until_true(lambda: log.count("nothing publishes robot_0/scan") == is_users)
        assert [info.is_users for info in find_processes(team, name)] == [is_users]


@pytest.mark.parametrize("last", ["robot_1/odom", "tf"])
def test_in_lock_step_it_waits_for_its_inputs(hub: MemoryHub, last: str) -> None:
    """The world is held until the tick's odometry of every robot, and its transforms, have come; then it steps once."""
    steps: list[int] = []

    def main(node: zteam.Node) -> None:
        node.subscribe(names.all_robots_key(names.ODOM), Odometry, lambda key, odom: None, every_tick=True)
        node.subscribe(names.TF, TFMessage, lambda key, message: None, every_tick=True)
        node.run(steps.append)

    odometry = Odometry(Header(time_from_ns(TICK)))
    inputs: dict[str, Message] = {f"robot_{i}/odom": odometry for i in (0, 1)}
    inputs[names.TF] = TFMessage([stamped("robot_0/odom", "robot_0/base_footprint", TICK)])
    late = inputs.pop(last)
    with run_node(main, hub, robots=(0, 1)) as running:
        for key, message in inputs.items():
            running.publish(key, message)
        with pytest.raises(BusError, match=r"waits for inputs of 0\.1 s"):
            running.tick()
        assert steps == []
        running.bus.publisher(last, type(late)).put(late)
    assert steps == [TICK]


def test_before_the_first_tick_of_lock_step_it_does_not_step(hub: MemoryHub, make: Make) -> None:
    """The clock of a simulator in lock-step may come before its tick: the first step is that of the tick."""
    simulator, steps = ScriptedSimulator(hub, "robot_3"), list[int]()
    simulator.appear()

    def script() -> Iterator[None]:
        for tick in (1, 2, 3):
            simulator.tell(tick * TICK)
            yield
        assert steps == []
        simulator.tick(3, "robot_3")

    play(make("robot_3"), steps.append, script())
    assert steps == [3 * TICK]


def test_go_in_the_held_first_tick_is_no_second_step(hub: MemoryHub, make: Make) -> None:
    """The tick comes again with GO: it is answered with the command of its one step. The next tick has its own."""
    simulator, steps = ScriptedSimulator(hub, "robot_3"), list[int]()
    simulator.appear()

    def step(now: int) -> Twist:
        steps.append(now)
        return Twist(Vector3(0.5))

    def script() -> Iterator[None]:
        for epoch, tick in ((0, 1), (4, 1), (4, 2)):
            simulator.tick(tick, "robot_3", epoch=epoch)
        yield

    play(make("robot_3"), step, script())
    assert simulator.take() == [
        Done(epoch, tick, True, Twist(Vector3(0.5))) for epoch, tick in ((0, 1), (4, 1), (4, 2))
    ]
    assert steps == [TICK, 2 * TICK]


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("every_tick", [True, False])
def test_what_a_callback_raises_ends_it(
    hub: MemoryHub, make: Make, new_harness: HarnessFactory, every_tick: bool
) -> None:
    """`run` raises it, the tick is not answered, and the world goes on without a time-out once it is closed: what
    `step` waits for is handled in its own tick, another process's message in the tick after that."""

    def fail(_key: str, odom: Odometry) -> None:
        if ns_from_time(odom.header.stamp) == 2 * TICK:
            raise ValueError("out of plans")

    node, steps, last = make(), list[int](), 2 if every_tick else 3
    key = names.robot_key(0, names.ODOM) if every_tick else "camera/odom"
    base = hub.bus()
    odoms = base.publisher(key, Odometry)
    node.subscribe(key, Odometry, fail, every_tick=every_tick)
    world = new_harness("planner", bus=base if every_tick else None)

    def script() -> Iterator[None]:
        for tick in range(1, last):
            world.open(tick, 0)
            world.begin()
            odoms.put(Odometry(Header(time_from_ns(tick * TICK))))
            assert world.end()
        odoms.put(Odometry(Header(time_from_ns(2 * TICK))))
        world.open(last, 0)
        world.begin()
        yield
        raise AssertionError("it goes on")

    with pytest.raises(ValueError, match="out of plans"):
        play(node, steps.append, script())
    assert world.lockstep.tick.waiting_for() == "planner"
    node.close()
    assert world.end()
    assert steps == [tick * TICK for tick in range(1, last)]


def test_what_a_step_waits_for_comes_from_within(hub: MemoryHub, make: Make, new_harness: HarnessFactory) -> None:
    """A node that waits in each tick for a process that takes no part would wait for ever: it ends, and names the
    key."""
    node, key = make(), "camera/pose"
    poses = hub.bus().publisher(key, PoseStamped)
    node.subscribe(key, PoseStamped, lambda *_: None, every_tick=True)
    world = new_harness("planner")

    def script() -> Iterator[None]:
        world.open(1, 0)
        world.begin()
        poses.put(PoseStamped(Header(time_from_ns(TICK))))
        # When the tick has come again.
        wait_until_true(lambda: not node.can_publish)
        yield
        raise AssertionError("it goes on")

    with pytest.raises(UsageError, match=r"planner waits for camera/pose in every tick, which comes from a process"):
        play(node, lambda now: None, script())
    node.close()
    assert world.end()


@pytest.mark.parametrize("source", ["token", "reset"])
def test_what_other_callbacks_raise_ends_it(hub: MemoryHub, make: Make, source: str) -> None:
    """Those for tokens and for resets of time too."""

    def fail(*_: object) -> None:
        raise ValueError(source)

    node, bus = make(), hub.bus()
    node.watch_tokens(names.tokens_key("camera"), fail)
    node.on_time_reset(fail)
    clock = bus.publisher(names.CLOCK, Clock)

    def script() -> Iterator[None]:
        if source == "token":
            bus.declare_token(names.token_key("camera", bus.instance))
        else:
            clock.put(Clock(time_from_ns(2 * TICK)))
            clock.put(Clock(time_from_ns(TICK)))
        yield

    with pytest.raises(ValueError, match=source):
        play(node, lambda now: None, script())


def test_a_robots_step_returns_a_twist(hub: MemoryHub, make: Make) -> None:
    """What is neither that nor None is told, with what to do."""

    def script() -> Iterator[None]:
        hub.bus().publisher(names.CLOCK, Clock).put(Clock(time_from_ns(TICK)))
        yield

    with pytest.raises(BehaviorError, match="robot_3: step returned a float"):
        play(make("robot_3"), lambda now: 0.4, script())  # type: ignore[arg-type, return-value]


def test_its_publishers_close_with_it(hub: MemoryHub, make: Make) -> None:
    """A latched publisher of the node serves late subscribers until the node is closed."""
    node = make()
    node.publisher("plan/valid", Bool, latched=True).put(Bool(True))
    heard: list[str] = []
    bus = hub.bus()
    bus.subscribe("plan/valid", Bool, lambda key, _: heard.append("while it lives"), latched=True)
    node.close()
    bus.subscribe("plan/valid", Bool, lambda key, _: heard.append("afterwards"), latched=True)
    assert heard == ["while it lives"]


@pytest.mark.parametrize(
    "use",
    [
        lambda node: node.publisher("goal", str),
        lambda node: node.publisher("robot_0/cmd_vel", Bool),
        lambda node: node.publisher("robot_$*/cmd_vel", Twist),
        lambda node: node.publisher("a b", Twist),
        lambda node: node.subscribe("goal", 7, print),
        # A message that cannot say of which tick it is cannot be waited for.
        lambda node: node.subscribe("robot_0/stall", Bool, print, every_tick=True),
    ],
)
def test_a_type_that_its_key_cannot_carry_is_refused(make: Make, use: Callable[[zteam.Node], object]) -> None:
    """At once: a class that is no message, or one that every receiver of the key would refuse; and what is no key."""
    with pytest.raises(UsageError):
        use(make())


@pytest.mark.parametrize(
    ("words", "told"),
    [((lambda node: None, "mine"), "a function 'def main(node): …'"), (("mine", stepping_later), "without 'async'")],
)
def test_run_takes_a_name_and_a_function(words: Any, told: str, caplog: pytest.LogCaptureFixture) -> None:
    """Swapped arguments end with 2, as does a function whose call runs nothing."""
    with pytest.raises(SystemExit) as end:
        zteam.run(*words)
    assert end.value.code == 2
    assert told in caplog.text


def test_a_clock_that_comes_at_once_is_taken(
    hub: MemoryHub, make: Make, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A node that is made in the middle of a run takes a message that arrives while it still subscribes."""

    class InARun(node_module.Participant):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            hub.bus().publisher(names.CLOCK, Clock).put(Clock(time_from_ns(7 * TICK)))

    monkeypatch.setattr(node_module, "Participant", InARun)
    node = make()
    assert node.wait(lambda: node.clock.now() == 7 * TICK, LIMIT)
    assert "error" not in caplog.text


def test_a_user_without_a_step_is_not_told_to_do_less_in_it(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where steps take too long, the way out is in the user's code, but for navigation, which is zteam's own."""
    ways: dict[str, str] = {}
    monkeypatch.setattr(node_module, "StepWatch", lambda step, _rhythm, way_out: ways.update({step: way_out}))
    for name in ("crowd", names.navigation_name(0)):
        node_module.UserStep(zteam.Node(name, hub.bus(), Stop()), lambda now: None, 0.1)
    assert ways["crowd: step"] == "do less in a step"
    assert "machine" in ways["nav_0: step"]
