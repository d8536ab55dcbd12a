"""`zteam teleop` on a pseudo-terminal and by scripts, with a simulator in real time."""

import signal
import sys
from collections.abc import Callable, Sequence

import pytest

from support.terminal import TerminalCommand
from zteam import names
from zteam.messages import Twist, Vector3
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = [pytest.mark.team, pytest.mark.real_time]

FAILING = """
import sys
from zteam.robot.teleop import Pilot
press = Pilot.press
def fail_at_y(self, key, now):
    if key == "y":
        raise RuntimeError("y was pressed")
    press(self, key, now)
Pilot.press = fail_at_y
from zteam.cli.teleop import main
sys.exit(main(sys.argv[1:]))
"""
"""The command with a fault: it ends by an exception at the key y."""


STILL = Twist()


class Hands:
    """`zteam teleop` on a terminal, and the commands that it sends."""

    def __init__(self, team: TeamFixture, *arguments: str, command: Sequence[str] | None = None) -> None:
        self.commands: list[tuple[str, Twist]] = []
        """Key and command, in order."""
        for topic in (names.CMD_VEL, names.CMD_VEL_TELEOP):
            team.bus.subscribe(names.all_robots_key(topic), Twist, lambda *sent: self.commands.append(sent))
        self._team = team
        self.terminal = TerminalCommand([*(command or zteam_command("zteam", "teleop")), *arguments], team.environment)
        self.terminal.wait_for(lambda rows: "robot_0: keys 0.50 m/s, 1.00 rad/s" in rows[-1])

    def drive_until(self, condition: Callable[[], bool], expected: tuple[str, Twist]) -> None:
        """Press i until `condition()`: on a crowded machine the world may get little of the time that a key counts."""
        while not condition():
            self.press(b"i", expected)

    def press(self, keys: bytes, expected: tuple[str, Twist]) -> None:
        """Type, and wait for the command that follows."""
        known = len(self.commands)
        self.terminal.press(keys)
        self._team.wait_for(lambda: expected in self.commands[known:])


def start_world(team: TeamFixture) -> None:
    """A world of two robots in real time, without a process of a robot."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.wait_for_processes(names.SIMULATOR)


def ahead(robot_id: int = 0, speed: float = 0.5, topic: str = names.CMD_VEL) -> tuple[str, Twist]:
    """A command straight ahead, with its key."""
    return names.robot_key(robot_id, topic), Twist(Vector3(speed))


def still(robot_id: int = 0, topic: str = names.CMD_VEL) -> tuple[str, Twist]:
    """A command of zero, with its key."""
    return names.robot_key(robot_id, topic), STILL


def test_keys_drive_a_robot_without_a_process(team: TeamFixture) -> None:
    """The base moves while a key counts, then stands; speeds change; tab stops the one robot and drives the other."""
    start_world(team)
    hands = Hands(team, "--id", "0-1")
    try:
        hands.drive_until(lambda: team.robot(0).distance_travelled > 0.1, ahead())
        team.wait_for(lambda: hands.commands[-1] == still())
        team.wait_for(lambda: team.robot(0).speed == 0.0)
        hands.press(b"w\x1b[A", ahead(speed=0.5 * 1.1))
        hands.press(b"\t", still())
        known = len(hands.commands)
        hands.drive_until(lambda: team.robot(1).distance_travelled > 0.1, ahead(1, speed=0.5 * 1.1))
        # In the text and not on the screen: the key may not count any more when it is read.
        hands.terminal.wait_for(lambda _: "robot_1: keys 0.55 m/s, 1.00 rad/s | 0.55 m/s" in hands.terminal.text)
        assert {key for key, _ in hands.commands[known:]} == {"robot_1/cmd_vel"}
        hands.terminal.press(b"?")
        hands.terminal.wait_for(lambda rows: sum(row.startswith("u i o") for row in rows) == 2)
        hands.terminal.press(b"\x03")
        code, rows = hands.terminal.end()
    finally:
        hands.terminal.close()
    assert code == 0, rows
    assert rows[-1] == ""


ENDS = {"ctrl-c": b"\x03", "error": b"y", "sigterm": b"", "hang-up": b""}


@pytest.mark.parametrize("end", ENDS)
def test_every_end_stops_the_robot(end: str, team: TeamFixture) -> None:
    """The last command is zero, the name is given back, and the terminal is as it was before."""
    start_world(team)
    hands = Hands(team, "--id", "0", command=[sys.executable, "-c", FAILING])
    terminal = hands.terminal
    try:
        assert terminal.read_mode() != terminal.mode
        hands.press(b"i", ahead())
        if end == "hang-up":
            code = terminal.hang_up()
        else:
            terminal.press(ENDS[end])
            if end == "sigterm":
                terminal.process.send_signal(signal.SIGTERM)
            code, rows = terminal.end()
            assert terminal.read_mode() == terminal.mode
            assert terminal.text.rstrip().endswith("RuntimeError: y was pressed") == (end == "error"), rows
            assert terminal.text.index("\x1b[?1004h") < terminal.text.index("\x1b[?1004l")
    finally:
        terminal.close()
    assert code == (1 if end == "error" else 0)
    team.wait_for(lambda: not team.alive("robot_0"))
    assert hands.commands[-1] == still()


def test_a_robot_with_a_process_is_driven_through_it(team: TeamFixture) -> None:
    """Its behaviour drives until the first key, and again after tab; in between the keys do, and the line says so."""
    start_world(team)
    robot = ["--id", "0", "--behavior", "forward", "--param", "speed=0", "--no-gate"]
    team.spawn("zteam-robot", *robot, name="robot_0")
    team.wait_for_processes("robot_0")
    hands = Hands(team, "--id", "0")
    try:
        hands.terminal.wait_for(lambda rows: "| behavior drives 0.00 m/s" in rows[-1])
        assert not any(key == "robot_0/cmd_vel_teleop" for key, _ in hands.commands)
        hands.drive_until(lambda: team.robot(0).distance_travelled > 0.1, ahead(topic=names.CMD_VEL_TELEOP))
        hands.terminal.wait_for(lambda rows: "| teleop drives" in rows[-1])
        team.wait_for(lambda: team.robot(0).speed == 0.0)
        hands.press(b"\t", still(topic=names.CMD_VEL_TELEOP))
        hands.terminal.wait_for(lambda rows: "| behavior drives 0.00 m/s" in rows[-1])
    finally:
        hands.terminal.close()


@pytest.mark.ci
def test_the_newest_key_drives(team: TeamFixture) -> None:
    """An idle teleop gives way to a script, whose end does not end the hold of a newer key; both terminals, monitor and
    doctor name the processes."""
    start_world(team)
    team.spawn("zteam-monitor", "--ids", "0", name=names.MONITOR)
    robot = ["--id", "0", "--behavior", "forward", "--param", "speed=0", "--no-gate"]
    team.spawn("zteam-robot", *robot, name="robot_0")
    team.wait_for_processes("robot_0")
    hands = Hands(team, "--id", "0")
    try:
        hands.press(b"k", still(topic=names.CMD_VEL_TELEOP))
        script = team.spawn("zteam", "teleop", "--id", "0", "--script", "j*600", name="teleop")
        team.wait_for(lambda: abs(team.robot(0).pose[2]) > 0.5)
        hands.terminal.wait_for(lambda _: "robot_0: driven by " in hands.terminal.text)
        team.wait_for_line(names.MONITOR, "robot_0 has 2 publishers on cmd_vel_teleop: ")
        assert "robot_0/cmd_vel_teleop has 2 " in team.command("doctor").stdout
        hands.press(b"k", still(topic=names.CMD_VEL_TELEOP))
        team.wait_for_line(script, "robot_0: driven by ")
        turned = len(hands.commands)
        team.wait_for(lambda: len(hands.commands) > turned + 20)
        assert not any(command.angular.z for _, command in hands.commands[turned:])
    finally:
        hands.terminal.close()


def test_a_script_is_sent_press_by_press(team: TeamFixture) -> None:
    """Ten presses of i are ten commands of 0.5 m/s; five of k and the end of the script are six zeros."""
    start_world(team)
    commands: list[Twist] = []
    team.bus.subscribe(names.robot_key(0, names.CMD_VEL), Twist, lambda _, command: commands.append(command))
    ended = team.command("teleop", "--id", "0", "--script", "i*10 k*5")
    assert ended.returncode == 0, ended.stderr
    team.wait_for(lambda: len(commands) >= 16)
    assert commands == [ahead()[1]] * 10 + [STILL] * 6


def test_scripts_that_reach_nobody_fail(team: TeamFixture) -> None:
    """Without a simulator and a base nothing hears the commands; a robot that the world lacks is named."""
    ended = team.command("teleop", "--id", "3", "--script", "i")
    assert ended.returncode == 1
    assert "nothing subscribes to robot_3/cmd_vel" in ended.stderr
    start_world(team)
    ended = team.command("teleop", "--id", "3", "--script", "i")
    assert ended.returncode == 1
    assert "robot_3 is not in the world; it has 0, 1" in ended.stderr
