"""Driving by keys and stick: who holds the lease, what the wheels get, and when they stand."""

from typing import Any

import pytest

from support.browser import OpenScreen, Screen, show, start_view
from zteam import names
from zteam.bus import NoRequest
from zteam.bus.presence import own_info
from zteam.messages import Twist
from zteam.team.testing.team import TeamFixture

TICKS = 10
"""A robot that has not moved in so many ticks stands."""


def start_arena(team: TeamFixture, screen: Screen) -> str:
    """Two idle robots, the first one selected for driving on a page; the page's URL."""
    url = show(team, screen)
    prepare(screen, 0)
    return url


def prepare(screen: Screen, robot: int) -> None:
    """Select a robot, and begin to drive."""
    screen.select(robot)
    screen.page.keyboard.press("d")
    screen.wait("zteam.app.drive.mode")


def lease_of(screen: Screen, robot: int = 0) -> Any:
    """Which viewer drives a robot, as the page shows it to its user."""
    return screen.ask("id => zteam.app.store.robots.get(id).lease", robot)


def is_driving(team: TeamFixture) -> bool:
    """Whether robot 0 moves forwards."""
    return team.robot(0).speed > 0.1


def listen(team: TeamFixture) -> list[Twist]:
    """The commands of teleop for robot 0, as they come."""
    heard: list[Twist] = []
    team.bus.subscribe("robot_0/cmd_vel_teleop", Twist, lambda _key, twist: heard.append(twist))
    return heard


def wait_for_release(team: TeamFixture, screen: Screen, heard: list[Twist]) -> None:
    """Wait until the wheels have heard what the page was told last, and stand: a crowded page is behind its hand."""
    # The answer comes after all that the page has sent before.
    assert screen.ask("async () => await zteam.app.send({op: 'take', robot: 0})") == ""
    wait_for_stand(team, heard, len(heard) + 5)


def wait_for_stand(team: TeamFixture, heard: list[Twist], count: int) -> None:
    """Wait until more than `count` commands came, the last one is zero, and the wheels stand."""
    team.wait_for(lambda: len(heard) > count and heard[-1] == Twist())
    team.wait_for(lambda: team.robot(0).speed == 0.0)


def assert_stands(team: TeamFixture) -> None:
    """Robot 0 does not move in the next ticks."""
    pose, tick = team.robot(0).pose, team.tick
    team.wait_for(lambda: team.tick >= tick + TICKS)
    assert team.robot(0).pose == pytest.approx(pose, abs=1e-6)


@pytest.mark.gate
def test_keys_drive_the_selected_robot(team: TeamFixture, screen: Screen) -> None:
    """A held i drives it forwards under a lease of this page, and its release stops it; the other robot stands."""
    start_arena(team, screen)
    heard = listen(team)
    before, other = team.robot(0).pose, team.robot(1).pose
    screen.page.keyboard.down("i")
    team.wait_for(lambda: is_driving(team) and team.robot(0).pose.x > before.x + 0.2)
    assert team.robot(0).status is not None
    team.wait_for(lambda: getattr(team.robot(0).status, "driver", "") == "teleop")
    screen.wait("zteam.app.store.robots.get(0).lease === zteam.app.store.connection.viewer")
    screen.page.keyboard.up("i")
    wait_for_release(team, screen, heard)
    assert_stands(team)
    assert team.robot(0).pose.y == pytest.approx(before.y, abs=0.02)
    assert team.robot(1).pose == pytest.approx(other, abs=1e-6)
    screen.page.keyboard.press("Escape")
    screen.wait("zteam.app.store.robots.get(0).lease === null")


@pytest.mark.parametrize("end", ["blur", "hidden", "close", "hang"])
def test_nothing_moves_after_the_hand_is_gone(team: TeamFixture, screen: Screen, end: str) -> None:
    """The page loses the focus, is hidden, closed, or hangs, while a key is held: the robot stands."""
    start_arena(team, screen)
    heard = listen(team)
    screen.page.keyboard.down("i")
    team.wait_for(lambda: is_driving(team))
    scripts = {
        "blur": "window.dispatchEvent(new Event('blur'))",
        "hidden": """() => {
            Object.defineProperty(document, 'hidden', {get: () => true});
            document.dispatchEvent(new Event('visibilitychange'));
        }""",
        "hang": "setTimeout(() => { const end = performance.now() + 8000; while (performance.now() < end); })",
    }
    count = len(heard)
    if end == "close":
        screen.page.close()
    else:
        screen.ask(scripts[end])
    wait_for_stand(team, heard, count)
    assert_stands(team)
    if end in ("blur", "hidden"):
        screen.wait("zteam.app.store.robots.get(0).lease === null")


@pytest.mark.gate
def test_a_robot_has_one_driver(team: TeamFixture, screen: Screen, open_screen: OpenScreen) -> None:
    """A second page sees which viewer drives and is refused the lease; it gets it when the first one lets go."""
    url = start_arena(team, screen)
    second = open_screen()
    second.open(url, 2)
    prepare(second, 0)
    screen.page.bring_to_front()
    screen.page.keyboard.down("i")
    team.wait_for(lambda: is_driving(team))
    viewer = screen.ask("zteam.app.store.connection.viewer")
    second.wait("viewer => zteam.app.store.robots.get(0).lease === viewer", viewer)
    second.ask("zteam.app.drive.wish('test', {linear: -1, left: 0, angular: 0})")
    second.wait("zteam.app.drive.lease === 'none'")
    assert lease_of(second) == viewer
    team.wait_for(lambda: is_driving(team))
    screen.page.keyboard.up("i")
    screen.page.keyboard.press("Escape")
    second.wait("zteam.app.store.robots.get(0).lease === null")
    second.page.keyboard.down("j")
    second.wait("zteam.app.store.robots.get(0).lease === zteam.app.store.connection.viewer")
    second.page.keyboard.up("j")


@pytest.mark.gate
def test_a_lost_lease_is_said(team: TeamFixture, screen: Screen) -> None:
    """An older process has the name of a robot that a page drives directly, as after a broken network: the page lets
    go and says so, though the key is still held."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.wait_for_processes(names.SIMULATOR)
    screen.open(start_view(team), 2)
    prepare(screen, 0)
    screen.page.keyboard.down("i")
    team.wait_for(lambda: is_driving(team))
    name, instance = names.robot_name(0), team.bus.instance
    team.bus.serve(names.info_key(name), NoRequest, lambda _: own_info(name, instance, 1))
    team.bus.declare_token(names.token_key(name, instance))
    screen.page.wait_for_selector("#toasts :text('Robot 0 is no longer driven from this page')")
    screen.wait("zteam.app.drive.lease === 'none'")
    team.wait_for(lambda: team.robot(0).speed == 0.0)


def test_the_stick_drives_and_springs_back(team: TeamFixture, screen: Screen) -> None:
    """The knob pushed up drives forwards as long as it is held."""
    start_arena(team, screen)
    heard = listen(team)
    box = screen.page.locator(".stick").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    screen.page.mouse.move(x, y)
    screen.page.mouse.down()
    screen.page.mouse.move(x, y - 44)
    team.wait_for(lambda: team.robot(0).speed > 0.3)
    screen.page.mouse.up()
    wait_for_release(team, screen, heard)
    assert_stands(team)


@pytest.mark.gate
def test_a_gamepad_drives_with_its_left_stick(team: TeamFixture, screen: Screen) -> None:
    """The stick of a gamepad that is plugged in while driving is on moves the robot; in its middle the robot stands."""
    start_arena(team, screen)
    heard = listen(team)
    screen.ask("""() => {
      window.pad = {connected: true, axes: [0, -1], buttons: []};
      navigator.getGamepads = () => [null, pad];
      window.dispatchEvent(new Event('gamepadconnected'));
    }""")
    team.wait_for(lambda: team.robot(0).speed > 0.3)
    screen.ask("pad.axes = [0.02, 0.05]")
    wait_for_release(team, screen, heard)
    assert_stands(team)


def test_tab_stops_and_takes_the_next_robot(team: TeamFixture, screen: Screen) -> None:
    """As in the terminal's teleop: the first robot stands and is free, the keys drive the second one."""
    start_arena(team, screen)
    screen.page.keyboard.down("i")
    team.wait_for(lambda: is_driving(team))
    screen.page.keyboard.press("Tab")
    team.wait_for(lambda: team.robot(0).speed == 0.0)
    screen.page.keyboard.up("i")
    screen.page.keyboard.down("j")
    turned = team.robot(1).pose.yaw
    team.wait_for(lambda: abs(team.robot(1).pose.yaw - turned) > 0.2)
    screen.wait(
        "zteam.app.store.robots.get(1).lease === zteam.app.store.connection.viewer"
        "&& zteam.app.store.robots.get(0).lease === null"
    )
    assert_stands(team)
    screen.page.keyboard.up("j")
