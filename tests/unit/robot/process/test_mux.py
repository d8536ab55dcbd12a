"""The velocity mux: which source drives, and when another one takes over."""

from functools import partial

from support.real_time_robot import RealTimeRobot
from zteam import names
from zteam.messages import Header, RobotDriver, Twist, TwistStamped, Vector3, time_from_ns
from zteam.messages.topics import type_of_key
from zteam.node.tick_messages import HeldMessage, TickMessages
from zteam.robot.behaviors.straight import Forward
from zteam.robot.process.inputs import SOURCES, Mux

TICK = 100_000_000
TELEOP, NAVIGATION = RobotDriver.TELEOP, RobotDriver.NAVIGATION


def stamped(speed: float, tick: int) -> TwistStamped:
    """A velocity that is sent in a tick."""
    return TwistStamped(Header(time_from_ns(tick * TICK)), Twist(Vector3(speed)))


def driver_at(mux: Mux, tick: int) -> str | None:
    """Who drives in a tick."""
    choice = mux.choose(tick * TICK)
    return None if choice is None else choice[0]


def test_the_higher_priority_drives_until_its_time_out() -> None:
    """Teleop drives over navigation for 0.5 s after its last velocity, then navigation does, then the behaviour."""
    mux = Mux()
    mux.receive(TELEOP, "", Twist(Vector3(0.3)), TICK)
    mux.receive(NAVIGATION, "", stamped(0.2, 1), 4 * TICK)
    drivers = [driver_at(mux, tick) for tick in range(4, 11)]
    assert drivers == [RobotDriver.TELEOP] * 3 + [RobotDriver.NAVIGATION] * 3 + [None]


def test_the_velocity_of_a_source_is_that_of_its_message() -> None:
    """The velocity in a stamped message drives as it is."""
    mux = Mux()
    mux.receive(NAVIGATION, "", stamped(0.2, 1), TICK)
    choice = mux.choose(TICK)
    assert choice == (NAVIGATION, Twist(Vector3(0.2)))


def test_a_velocity_of_lock_step_counts_from_the_next_tick_on() -> None:
    """What is sent in tick 3 drives in the ticks 4 to 8, also if tick 3 is not answered yet when it comes."""
    mux, messages = Mux(), TickMessages()
    take = partial(mux.receive, TELEOP)
    messages.hold(
        HeldMessage(0, "robot_1/cmd_vel_teleop", Twist(Vector3(0.3)), "a", False, None, take),
        3 * TICK,
    )
    drives = []
    for tick in range(3, 12):
        messages.handle_due(tick * TICK)
        drives += [tick] if driver_at(mux, tick) else []
    assert drives == [4, 5, 6, 7, 8]


def test_a_jump_of_time_ends_all_driving() -> None:
    """After a jump back in time what drove does not drive."""
    mux = Mux()
    mux.receive(TELEOP, "", Twist(Vector3(0.3)), TICK)
    mux.forget()
    assert [driver_at(mux, tick) for tick in (1, 2, 3)] == [None] * 3


def test_a_clock_that_is_set_back_ends_a_velocity() -> None:
    """A velocity from an hour ahead, as after the host's clock was set, does not drive."""
    mux = Mux()
    mux.receive(TELEOP, "", Twist(Vector3(0.3)), 36_000 * TICK)
    assert driver_at(mux, 1) is None


def test_the_status_and_the_wheels_follow_the_mux() -> None:
    """A released robot drives as teleop says, tells so in its status, and then as its behaviour says again."""
    robot = RealTimeRobot(Forward)
    teleop, nav = (names.robot_key(1, topic) for topic, _ in SOURCES.values())
    try:
        robot.say_time(1)
        robot.say(teleop, Twist(Vector3(0.05)))
        robot.say(nav, stamped(0.07, 1))
        robot.ready(1)
        robot.wait_for_commands(1)
        for tick in range(2, 9):
            robot.say_time(tick)
            robot.say(teleop, Twist(Vector3(float("nan"))))
            if tick == 3:
                robot.say(nav, stamped(0.07, 3))
            robot.say_scan(tick)
            robot.wait_for_commands(tick)
        assert [command.linear.x for command in robot.commands] == [0.05] * 6 + [0.07] * 2
        robot.say_time(9)
        robot.say_scan(9)
        robot.wait_for_commands(9)
        assert robot.commands[-1].linear.x == 0.2
        drivers = [status.driver for status in robot.said]
        told = [a for a, b in zip(drivers, [*drivers[1:], None], strict=True) if a != b]
        assert told[-3:] == [RobotDriver.TELEOP, RobotDriver.NAVIGATION, RobotDriver.BEHAVIOR]
    finally:
        robot.close()


def test_every_source_has_a_key_and_a_type() -> None:
    """What the mux listens to is what tools know of these keys."""
    assert all(type_of_key(names.robot_key(0, topic)) is kind for topic, kind in SOURCES.values())
