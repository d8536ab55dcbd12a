"""`zteam.Node` on a bus in memory: when its step runs, and what it may answer."""

from collections.abc import Callable
from typing import Any

import pytest

import zteam
from support.lockstep_doubles import LIMIT, HarnessFactory, ScriptedSimulator
from support.own_node import Own
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.errors import UsageError
from zteam.messages import (
    Bool,
    Clock,
    Done,
    Header,
    Odometry,
    RobotStatus,
    TFMessage,
    TransformStamped,
    Twist,
    Vector3,
    ns_from_time,
    time_from_ns,
)
from zteam.runtime import node_inputs

TICK = 100_000_000


def test_its_step_follows_the_simulators_clock(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """With a simulator in real time the step runs once a period of simulated time, and stands still with it."""
    own = make().start(period=0.2)
    clock = hub.bus().publisher(names.CLOCK, Clock)
    for tick in range(1, 12):
        clock.put(Clock(time_from_ns(tick * TICK)))
        own.wait_for_steps((tick + 1) // 2)
    assert own.steps == [tick * TICK for tick in range(1, 12, 2)]


def test_it_counts_anew_when_time_jumps_back(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """After a reset the step goes on a period later, not when the old time is reached again."""
    own = make().start(period=0.1)
    clock = hub.bus().publisher(names.CLOCK, Clock)
    clock.put(Clock(time_from_ns(500 * TICK)))
    own.wait_for_steps(1)
    for tick in range(1, 400):
        clock.put(Clock(time_from_ns(tick * TICK)))
        with own.changed:
            # The main loop has to have seen a tick to count from.
            if wait_until(own.changed, lambda: len(own.steps) > 1, 0.05):
                break
    assert own.steps[0] == 500 * TICK
    assert own.steps[1] < 400 * TICK


def test_only_fresh_data_tells_of_a_base(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """What processes say, and latched messages, come before the simulator too: they do not decide for wall time."""
    own, bus = make(), hub.bus()
    own.node.subscribe("robot_0/status", RobotStatus, lambda key, status: None)
    own.node.subscribe(names.TF_STATIC, TFMessage, lambda key, message: None, latched=True)
    own.node.subscribe("robot_0/odom", Odometry, lambda key, odom: None)
    bus.publisher("robot_0/status", RobotStatus).put(RobotStatus())
    bus.publisher(names.TF_STATIC, TFMessage, latched=True).put(TFMessage())
    assert own.node._inputs.first_data == 0.0
    bus.publisher("robot_0/odom", Odometry).put(Odometry())
    assert own.node._inputs.first_data > 0.0


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
def test_in_wall_time_its_steps_are_a_period_apart(
    make: Callable[..., Own], monkeypatch: pytest.MonkeyPatch, period: float
) -> None:
    """It waits for the very moment, and one that came late does not move the next."""
    own, host = make(), Host(late=0.001)
    own.node.clock.use_wall()
    monkeypatch.setattr(own.node.clock, "steady", lambda: host.ns)
    monkeypatch.setattr(own.node, "wait", host.wait)
    steps: list[int] = []

    def step(_now: int) -> None:
        steps.append(host.ns)
        if len(steps) == 40:
            own.stop.request("enough")

    own.node.run(step, period=period)
    begin = steps[0]
    for count, moment in enumerate(steps):
        assert 0 <= moment - begin - count * round(period * 1e9) <= 1_000_000


@pytest.mark.usefixtures("patient")
def test_in_lock_step_it_waits_for_its_inputs(
    hub: MemoryHub, make: Callable[..., Own], new_harness: HarnessFactory
) -> None:
    """The world is held until the tick's odometry of every robot, and its transforms, have come; then it steps once."""
    own = make()
    bus = hub.bus()
    odoms = [bus.publisher(names.robot_key(i, names.ODOM), Odometry) for i in (0, 1)]
    tf = bus.publisher(names.TF, TFMessage)
    own.node.subscribe(names.all_robots_key(names.ODOM), Odometry, lambda key, odom: None, every_tick=True)
    own.node.subscribe(names.TF, TFMessage, lambda key, message: None, every_tick=True)
    own.start()
    world = new_harness("planner")
    own.wait_until_present()
    world.open(1, 0, 1)
    world.begin()
    header = Header(time_from_ns(TICK))
    odoms[0].put(Odometry(header))
    tf.put(TFMessage([TransformStamped(header)]))
    assert own.steps == []
    assert world.holds
    odoms[1].put(Odometry(header))
    assert world.end()
    assert own.steps == [TICK]


def test_before_the_first_tick_of_lock_step_it_does_not_step(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """The clock of a simulator in lock-step may come before its tick: the first step is that of the tick."""
    own = make("robot_3", Twist(Vector3(0.5)))
    script = ScriptedSimulator(hub, "robot_3")
    script.appear()
    own.start()
    own.wait_until_present()
    for tick in (1, 2, 3):
        script.tell(tick * TICK)
        own.node.wait(lambda: bool(own.steps), 0.2)
    assert own.steps == []
    script.tick(3, "robot_3")
    assert own.steps == [3 * TICK]


def test_go_in_the_held_first_tick_is_no_second_step(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """The tick comes again with GO: it is answered with the command of its one step. The next tick has its own."""
    own = make("robot_3", Twist(Vector3(0.5)))
    script = ScriptedSimulator(hub, "robot_3")
    script.appear()
    own.start()
    own.wait_until_present()
    script.tick(1, "robot_3", epoch=0)
    script.tick(1, "robot_3", epoch=4)
    script.tick(2, "robot_3", epoch=4)
    assert script.take() == [Done(epoch, tick, True, Twist(Vector3(0.5))) for epoch, tick in ((0, 1), (4, 1), (4, 2))]
    assert own.steps == [TICK, 2 * TICK]


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize(("name", "obeyed"), [("robot_3", True), ("planner", False)])
def test_a_robots_own_process_may_command(
    hub: MemoryHub, make: Callable[..., Own], new_harness: HarnessFactory, name: str, obeyed: bool
) -> None:
    """What `step` returns is a command if the process has a robot's name, and ignored otherwise."""
    own = make(name, Twist(Vector3(0.5)))
    own.start()
    world = new_harness(name)
    own.wait_until_present()
    world.open(1, 3)
    world.begin()
    assert world.end()
    commands = world.lockstep.take_commands({3: None})
    assert commands == ({3: Twist(Vector3(0.5))} if obeyed else {})


def test_what_step_raises_ends_it(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """An error is not swallowed: `run` raises it."""

    def fail(_now: int) -> None:
        raise ValueError("out of plans")

    own = make().start(fail)
    hub.bus().publisher(names.CLOCK, Clock).put(Clock(time_from_ns(TICK)))
    own._thread.join(LIMIT)
    assert str(own.failure) == "out of plans"


@pytest.mark.usefixtures("patient")
@pytest.mark.parametrize("every_tick", [True, False])
def test_what_a_callback_raises_ends_it(
    hub: MemoryHub, make: Callable[..., Own], new_harness: HarnessFactory, every_tick: bool
) -> None:
    """`run` raises it, the tick is not answered, and the world goes on without a time-out once it is closed: what
    `step` waits for is handled in its own tick, another process's message in the tick after that."""

    def fail(_key: str, odom: Odometry) -> None:
        if ns_from_time(odom.header.stamp) == 2 * TICK:
            raise ValueError("out of plans")

    own = make()
    key = names.robot_key(0, names.ODOM)
    odoms = hub.bus().publisher(key, Odometry)
    own.node.subscribe(key, Odometry, fail, every_tick=every_tick)
    own.start()
    world = new_harness("planner")
    own.wait_until_present()
    last = 2 if every_tick else 3
    for tick in range(1, last):
        world.open(tick, 0)
        world.begin()
        odoms.put(Odometry(Header(time_from_ns(tick * TICK))))
        assert world.end()
    odoms.put(Odometry(Header(time_from_ns(2 * TICK))))
    world.open(last, 0)
    world.begin()
    own._thread.join(LIMIT)
    assert str(own.failure) == "out of plans"
    assert world.lockstep.waiting_for() == "planner"
    own.node.close()
    assert world.end()
    assert own.steps == [tick * TICK for tick in range(1, last)]


@pytest.mark.parametrize("source", ["token", "reset"])
def test_what_other_callbacks_raise_ends_it(hub: MemoryHub, make: Callable[..., Own], source: str) -> None:
    """Those for tokens and for resets of time too."""

    def fail(*_: object) -> None:
        raise ValueError(source)

    own = make()
    own.node.watch_tokens(names.tokens_key("camera"), fail)
    own.node.on_time_reset(fail)
    own.start()
    bus = hub.bus()
    if source == "token":
        bus.declare_token(names.token_key("camera", bus.instance))
    else:
        clock = bus.publisher(names.CLOCK, Clock)
        clock.put(Clock(time_from_ns(2 * TICK)))
        clock.put(Clock(time_from_ns(TICK)))
    own._thread.join(LIMIT)
    assert str(own.failure) == source


def test_a_robots_step_returns_a_twist(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """What is neither that nor None is told, with what to do."""
    own = make("robot_3").start(lambda _now: 0.4)
    hub.bus().publisher(names.CLOCK, Clock).put(Clock(time_from_ns(TICK)))
    own._thread.join(LIMIT)
    assert str(own.failure) == "robot_3: step returned a float; return a Twist"


def test_an_input_without_a_stamp_is_refused(make: Callable[..., Own]) -> None:
    """A message that cannot say of which tick it is cannot be waited for."""
    with pytest.raises(UsageError, match="Bool has no header"):
        make().node.subscribe("robot_0/stall", Bool, lambda key, message: None, every_tick=True)


def test_a_reset_of_time_is_told(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """The callback runs when simulated time jumps back, already in the new time, and not as time goes on."""
    own = make()
    heard: list[int] = []
    own.node.on_time_reset(lambda: heard.append(own.node.clock.now()))
    clock = hub.bus().publisher(names.CLOCK, Clock)
    for tick in (1, 2, 1, 2, 3):
        clock.put(Clock(time_from_ns(tick * TICK)))
    assert heard == [TICK]


def test_its_publishers_close_with_it(hub: MemoryHub, make: Callable[..., Own]) -> None:
    """A latched publisher of the node serves late subscribers until the node is closed."""
    own = make()
    own.node.publisher("plan/valid", Bool, latched=True).put(Bool(True))
    heard: list[str] = []
    bus = hub.bus()
    bus.subscribe("plan/valid", Bool, lambda key, _: heard.append("while it lives"), latched=True)
    own.node.close()
    bus.subscribe("plan/valid", Bool, lambda key, _: heard.append("afterwards"), latched=True)
    assert heard == ["while it lives"]


def test_a_publisher_has_the_type_of_its_key(make: Callable[..., Own]) -> None:
    """A class that is no message, and a type that every receiver of the key would refuse, are told at once."""
    node = make().node
    with pytest.raises(UsageError, match="goal: str is no message type; take a class"):
        node.publisher("goal", str)  # type: ignore[type-var]
    with pytest.raises(UsageError, match="goal: 7 is no message type"):
        node.subscribe("goal", 7, lambda key, message: None)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="robot_0/cmd_vel carries geometry_msgs/msg/Twist, not std_msgs/msg/Bool"):
        node.publisher("robot_0/cmd_vel", Bool)


def test_run_takes_a_name_and_a_function(caplog: pytest.LogCaptureFixture) -> None:
    """Swapped arguments end with 2 and one line."""
    with pytest.raises(SystemExit) as end:
        zteam.run(lambda node: None, "mine")  # type: ignore[arg-type]
    assert end.value.code == 2
    assert "zteam.run(name, body) takes a text and a function of the node, not " in caplog.text


def test_a_clock_that_comes_at_once_is_taken(
    hub: MemoryHub, make: Callable[..., Own], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A node that is made in the middle of a run takes a message that arrives while it still subscribes."""

    class InARun(node_inputs.Participant):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            hub.bus().publisher(names.CLOCK, Clock).put(Clock(time_from_ns(7 * TICK)))

    monkeypatch.setattr(node_inputs, "Participant", InARun)
    node = make().node
    assert node.wait(lambda: node.clock.sim.now() == 7 * TICK, LIMIT)
    assert "error" not in caplog.text
