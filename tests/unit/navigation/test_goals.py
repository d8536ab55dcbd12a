"""Files of goals, which goal a robot gets next, and the process that sends them, with navigations by hand."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from support.fake_navigation import FakeNavigation
from support.limits import LIMIT
from support.lockstep_doubles import INTERVAL, ScriptedSimulator
from support.played_node import play
from support.transports import wait_until_true
from zteam.bus import MemoryHub
from zteam.errors import BusError, ConfigError
from zteam.geometry import Pose2
from zteam.messages import Done, NavigationState, Odometry, PoseStamped, ns_from_time
from zteam.navigation.client import TaskResult, goal_message
from zteam.navigation.goals import Dispatcher, FileGoal, Rounds, read_goals
from zteam.node.node import Node
from zteam.node.shutdown import Stop
from zteam.robot.client import find_lists, pause_lists
from zteam.team.testing.in_memory import RunningNode
from zteam.testing import run_node

State = NavigationState


def write(folder: Path, text: str) -> Path:
    """A file with this text."""
    path = folder / "goals.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_goals_keep_their_order_and_lines(tmp_path: Path) -> None:
    """A robot is named by its id or its name; yaw may be left out; numbers come in any notation.
    With robots that share goals, these may leave the robot out."""
    text = "# a tour\n- {robot: 1, x: 22.0, y: -17, yaw: 1.57}\n- robot: robot_2\n  x: 4.5e0\n  y: 1e-1\n"
    goals = read_goals(write(tmp_path, text + "- {robot: 010, x: 017, y: 1}\n"))
    assert goals[:2] == [FileGoal(1, Pose2(22.0, -17.0, 1.57), 2), FileGoal(2, Pose2(4.5, 0.1, 0.0), 3)]
    assert goals[2] == FileGoal(10, Pose2(17.0, 1.0, 0.0), 6)
    assert [goal.robot for goal in read_goals(write(tmp_path, "- {x: 1, y: 2}\n"), spread=True)] == [None]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("- {robot: 1, x: 1}\n", [":1: the key y is missing"]),
        ("- {x: 1, y: 2}\n", [":1: the key robot is missing, or name the robots that share the goals: --spread 0-3"]),
        ("- {robot: 1, x: 1, y: 2, yaww: 3}\n", [":1: unknown key 'yaww' (did you mean yaw?); known: robot, x, "]),
        ("- {robot: 1, x: 1, x: 2, y: 2}\n", [":1: x is given twice"]),
        ("- {robot: -1, x: 1, y: 2}\n", [":1: robot id '-1' is not a whole number from 0 to 9999"]),
        ("- {robot: 1, x: .nan, y: 1:30}\n", [":1: '.nan': give x in metres from -1e+08 to"]),
        ("- {robot: 1, x: 1, y: [2]}\n", [":1: '': give y in metres"]),
        ("- {robot: 1, x: 1, y: 1:30}\n", [":1: '1:30': give y in metres"]),
        ("- {robot: 1, x: 1, y: 2, yaw: 90}\n", [":1: yaw: 90 is more than a full turn; angles are radians"]),
        ("- robot: 1\n  x: 1\n  y: q\n  z: 1\n", [":1: 'q': give y in metres"]),
        ("- &a {robot: 1, x: 1, y: 2, ? *a : 3}\n", [":1: unknown key ''"]),
        ("- 3\n", [":1: a goal is expected, such as {robot: 1, x: 3.0, y: 4.0, yaw: 1.57}"]),
        ("\ngoals: []\n", [":2: a list of goals is expected"]),
        ("[]\n", [":1: a list of goals is expected"]),
        ("", [":1: a list of goals is expected"]),
        ("- {robot: 1}\n- {robot: 1}: 3: 4\n", [":2: not YAML: "]),
        ("\0", [": not YAML: "]),
        ("[" * 1_000, [": not YAML: "]),
        ("- {robot: 1, x: 1, y: 2}\n- {robot: 1, x: 3}\n\n- {robot: q, x: 1, y: 2}\n", [":2: the key y", ":4: robot "]),
    ],
)  # fmt: skip
def test_every_mistake_has_its_line(tmp_path: Path, text: str, told: list[str]) -> None:
    """All mistakes are told at once, each on a line of its own that begins with file and line."""
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as raised:
        read_goals(path)
    lines = str(raised.value).splitlines()
    assert len(lines) == len(told)
    for line, expected in zip(lines, told, strict=True):
        assert line.startswith(f"{path}{expected}")


def goals(*robots: int | None) -> list[FileGoal]:
    """Goals of these robots; the line is the place in the list."""
    return [FileGoal(robot, Pose2(float(line), 0.0, 0.0), line) for line, robot in enumerate(robots)]


def taken(rounds: Rounds, robot_id: int, most: int = 10) -> list[int]:
    """The lines of the goals that a robot gets, `most` at most."""
    found = []
    while len(found) < most and (goal := rounds.take(robot_id)) is not None:
        found.append(goal.line)
    return found


def test_shared_goals_go_to_each_robot_that_is_free() -> None:
    """Each shared goal is given once a round, after a robot's own in their order; robots that do not share get none.
    Rounds may be without end."""
    assert taken(Rounds(goals(1, 2, 1), rounds=None), 1) == [0, 2] * 5
    rounds = Rounds(goals(None, 1, None, 5, None), spread=[0, 1], rounds=2)
    assert rounds.robots == [0, 1, 5]
    assert [rounds.take(0).line, rounds.take(1).line, rounds.take(0).line] == [0, 1, 2]  # type: ignore[union-attr]
    assert taken(rounds, 5) == [3, 3]
    assert taken(rounds, 0) == [4, 0, 2, 4]
    assert taken(rounds, 1) == [1]
    assert (rounds.counts[0], rounds.counts[1], rounds.counts[5]) == (3, 4, 1)


class Desk:
    """A dispatcher in a node, and the robots' navigations."""

    def __init__(self, rounds: Rounds, hub: MemoryHub) -> None:
        self.navigations = {i: FakeNavigation(hub, i) for i in rounds.robots}
        self.made: list[Dispatcher] = []
        self._rounds = rounds
        self.running: RunningNode = run_node(self._body, hub, name="goals")

    def _body(self, node: Node) -> None:
        self.made.append(Dispatcher(node, self._rounds))
        node.run(self.made[0].step)

    @property
    def dispatcher(self) -> Dispatcher:
        """The dispatcher."""
        return self.made[0]

    def greet(self) -> None:
        """All navigations say that they are there."""
        for navigation in self.navigations.values():
            navigation.say(State.IDLE)

    def tick_until(self, condition: Callable[[], bool]) -> None:
        """Let ticks pass."""
        for _ in range(20):
            if condition():
                return
            self.running.tick()
        raise AssertionError("the condition did not become true within 20 ticks")

    def places(self, robot_id: int) -> list[float]:
        """x of each goal that this robot has got."""
        return [goal.pose.position.x for goal in self.navigations[robot_id].goals]

    def reach(self, robot_id: int, state: int = State.SUCCEEDED) -> None:
        """The robot's goal ends."""
        self.navigations[robot_id].say(state)


def goal(robot: int | None, x: float, line: int = 1) -> FileGoal:
    """A goal of a file."""
    return FileGoal(robot, Pose2(x, 0.0, 0.0), line)


def test_a_robot_gets_a_goal_when_the_last_has_ended(hub: MemoryHub) -> None:
    """Robots do not wait for each other; the process stops when all goals have ended, and tells of each."""
    desk = Desk(Rounds([goal(1, 1.0), goal(2, 5.0), goal(1, 2.0, 3)]), hub)
    with desk.running:
        desk.greet()
        desk.tick_until(lambda: desk.places(1) == [1.0] and desk.places(2) == [5.0])
        desk.reach(1)
        desk.tick_until(lambda: desk.places(1) == [1.0, 2.0])
        assert [ended.goal.line for ended in desk.dispatcher.take_ended()] == [1]
        assert not desk.dispatcher.is_done
        desk.reach(1)
        desk.reach(2, State.ABORTED)
        with pytest.raises(BusError):
            # A node that stops leaves its last tick unanswered.
            desk.tick_until(lambda: desk.dispatcher.is_done)
    assert desk.dispatcher.is_done
    ended = desk.dispatcher.take_ended()
    assert [(each.robot, each.watch.result) for each in ended] == [(1, TaskResult.SUCCEEDED), (2, TaskResult.FAILED)]
    assert not desk.dispatcher.all_reached
    assert all(each.seconds > 0.0 for each in ended)
    assert [navigation.cancels for navigation in desk.navigations.values()] == [0, 0]


def test_a_loop_ends_for_a_robot_that_reaches_nothing(hub: MemoryHub) -> None:
    """After a round without a single goal a robot gets no more; the others go on."""
    desk = Desk(Rounds([goal(1, 1.0), goal(1, 2.0), goal(2, 3.0)], rounds=None), hub)
    with desk.running:
        desk.greet()
        for count, end in enumerate((State.ABORTED, State.CANCELED), start=1):
            desk.tick_until(lambda count=count: len(desk.places(1)) == count)  # type: ignore[misc]
            desk.reach(1, end)
        desk.tick_until(lambda: desk.dispatcher.errands[1].watch is None)
        for count in (1, 2, 3):
            desk.tick_until(lambda count=count: len(desk.places(2)) == count)  # type: ignore[misc]
            desk.reach(2)
        assert desk.places(1) == [1.0, 2.0]
        assert not desk.dispatcher.is_done


def test_the_end_of_the_process_cancels_what_is_under_way(hub: MemoryHub) -> None:
    """A robot on its way stops; one that has no goal is left alone."""
    desk = Desk(Rounds([goal(1, 1.0), goal(2, 2.0)]), hub)
    with desk.running:
        desk.greet()
        desk.tick_until(lambda: bool(desk.places(1) and desk.places(2)))
        desk.reach(2)
        desk.tick_until(lambda: desk.dispatcher.errands[2].watch is None)
    assert (desk.navigations[1].cancels, desk.navigations[2].cancels) == (1, 0)


def test_a_paused_list_sends_no_goal_until_it_goes_on(hub: MemoryHub) -> None:
    """A goal that is canceled meanwhile is followed by none; other robots drive on. A goal that is not sent yet stays
    unsent. The process does not end while a list is paused."""
    desk = Desk(Rounds([goal(1, 1.0), goal(2, 5.0), goal(1, 2.0), goal(2, 6.0)]), hub)
    with desk.running:
        desk.greet()
        desk.tick_until(lambda: desk.places(1) == [1.0] and desk.places(2) == [5.0])
        assert find_lists(hub.bus()) == {1: False, 2: False}
        assert pause_lists(hub.bus(), [1, 7], paused=True) == [1]
        assert find_lists(hub.bus()) == {1: True, 2: False}
        desk.reach(1, State.CANCELED)
        desk.reach(2)
        desk.tick_until(lambda: desk.places(2) == [5.0, 6.0])
        desk.reach(2)
        desk.tick_until(lambda: desk.dispatcher.errands[2].is_over)
        for _ in range(5):
            desk.running.tick()
        assert desk.places(1) == [1.0]
        assert not desk.dispatcher.is_done
        assert pause_lists(hub.bus(), paused=False) == [1, 2]
        desk.tick_until(lambda: desk.places(1) == [1.0, 2.0])


def test_a_paused_list_loses_no_goal(hub: MemoryHub) -> None:
    """Neither one that waits for its robot's navigation, nor the rest of the list by a cancel."""
    desk = Desk(Rounds([goal(1, 1.0)], rounds=2), hub)
    desk.navigations[1].end()
    with desk.running:
        for paused in (True, False):
            desk.running.tick()
            assert desk.dispatcher.errands[1].client.lack.startswith("the navigation of robot_1: start 'zteam-nav")
            pause_lists(hub.bus(), paused=paused)
        desk.navigations[1] = FakeNavigation(hub, 1)
        desk.tick_until(lambda: desk.places(1) == [1.0])
        pause_lists(hub.bus(), paused=True)
        desk.reach(1, State.CANCELED)
        desk.tick_until(lambda: desk.dispatcher.errands[1].watch is None)
        pause_lists(hub.bus(), paused=False)
        desk.tick_until(lambda: desk.places(1) == [1.0, 1.0])


@pytest.mark.parametrize("loses_status", [True, False])
def test_chance_has_no_part_in_the_tick_of_the_first_goal(hub: MemoryHub, *, loses_status: bool) -> None:
    """The first tick waits for navigation's presence; the goal is sent in the second, also if its status was lost."""
    simulator, node = ScriptedSimulator(hub, "goals"), Node("goals", hub.bus(), Stop())
    simulator.appear()
    dispatcher = Dispatcher(node, Rounds([goal(1, 1.0)]))

    def script() -> Iterator[None]:
        simulator.tick(1, "goals", "nav_1", "robot_1")
        yield
        assert simulator.take() == []
        navigation = FakeNavigation(hub, 1)
        if not loses_status:
            navigation.say(State.IDLE)
        simulator.tick(1, "goals", "nav_1", "robot_1")
        yield
        # Twice if the status has come: the same answer to the same tick.
        assert simulator.take()[-1] == Done(1, 1)
        assert navigation.goals == []
        simulator.tick(2, "goals", "nav_1", "robot_1")
        yield
        assert simulator.take() == [Done(1, 2)]
        assert [ns_from_time(each.header.stamp) for each in navigation.goals] == [2 * INTERVAL]

    play(node, dispatcher.step, script())
    node.close()


def send_other(hub: MemoryHub, robot_id: int, x: float) -> None:
    """Another sender's goal for a robot, as `zteam goto` and the view send it."""
    hub.bus().publisher(f"robot_{robot_id}/goal_pose", PoseStamped).put(goal_message(Pose2(x, 0.0, 0.0)))


@pytest.mark.parametrize("end", [State.SUCCEEDED, State.ABORTED, State.CANCELED])
def test_the_goal_of_another_sender_goes_before(hub: MemoryHub, end: int) -> None:
    """While it lasts nothing is sent; then the goal that it replaced is sent again, and has not failed."""
    desk = Desk(Rounds([goal(1, 1.0), goal(2, 5.0)], rounds=None), hub)
    with desk.running:
        desk.greet()
        desk.tick_until(lambda: desk.places(1) == [1.0] and desk.places(2) == [5.0])
        desk.running.tick()
        send_other(hub, 1, 9.0)
        for _ in range(15):
            desk.running.tick()
            desk.navigations[1].say(State.DRIVING, left=1.0)
        assert desk.places(1) == [1.0, 9.0]
        assert desk.dispatcher.errands[1].client.waits_for == "the end of another goal: x 9, y 0, yaw 0"
        desk.reach(2)
        desk.tick_until(lambda: desk.places(2) == [5.0, 5.0])
        desk.reach(1, end)
        desk.tick_until(lambda: desk.places(1) == [1.0, 9.0, 1.0])
        desk.reach(1)
        desk.tick_until(lambda: desk.dispatcher.errands[1].reached == 1)
        assert desk.dispatcher.errands[1].failed == 0


def test_a_goal_that_lasts_at_the_start_goes_before(hub: MemoryHub) -> None:
    """The process that sends goals comes when a robot has one already: it says its first when that has ended."""
    desk = Desk(Rounds([goal(1, 1.0)]), hub)
    with desk.running:
        send_other(hub, 1, 9.0)
        for _ in range(15):
            desk.navigations[1].say(State.DRIVING)
            desk.running.tick()
        assert desk.places(1) == [9.0]
        desk.reach(1)
        desk.tick_until(lambda: desk.places(1) == [9.0, 1.0])


def test_of_two_goals_of_one_tick_the_other_senders_counts(hub: MemoryHub) -> None:
    """Navigation has heard the process's own goal last: it gets the other one once more, and drives there."""
    desk = Desk(Rounds([goal(1, 1.0)]), hub)
    with desk.running:
        desk.greet()
        desk.tick_until(lambda: desk.places(1) == [1.0])
        desk.navigations[1].is_deaf = True
        send_other(hub, 1, 9.0)
        desk.navigations[1].is_deaf = False
        for _ in range(3):
            desk.running.tick()
        assert desk.places(1) == [1.0, 9.0]
        assert desk.dispatcher.errands[1].client.waits_for == "the end of another goal: x 9, y 0, yaw 0"


def test_real_robots_have_the_hosts_time(hub: MemoryHub) -> None:
    """Without a simulator a base's odometry decides for it; what robots and navigation say does not."""
    navigation, stop = FakeNavigation(hub, 1), Stop()
    node = Node("goals", hub.bus(), stop)
    dispatcher = Dispatcher(node, Rounds([goal(1, 1.0)]))
    thread = threading.Thread(target=node.run, args=(dispatcher.step,))
    thread.start()
    odometry = hub.bus().publisher("robot_1/odom", Odometry)

    def has_goal() -> bool:
        odometry.put(Odometry())
        navigation.say(State.IDLE)
        return bool(navigation.goals)

    try:
        wait_until_true(has_goal)
        navigation.say(State.SUCCEEDED)
        thread.join(LIMIT)
    finally:
        stop.request("the test is over")
        thread.join(LIMIT)
        node.close()
    assert dispatcher.is_done
    assert dispatcher.all_reached
    assert not node.clock.simulated
