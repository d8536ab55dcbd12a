"""The table of robots, and what the page says when something is missing."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from support.browser import VIEW, Screen, show, start_view
from zteam import names
from zteam.messages import Header, PoseWithCovariance, PoseWithCovarianceStamped
from zteam.team.testing.team import TeamFixture

ROW = "#robots tbody:has(button:has-text('robot_{}'))"


def test_the_table_says_what_the_robots_do(team: TeamFixture, screen: Screen) -> None:
    """State and behaviour, with the leader, of each robot, and GO."""
    team.start("arena", robots=2, follow={1: 0}, lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team), 2)
    for robot, behavior in enumerate(("wander", "follow robot_0")):
        cells = screen.page.locator(ROW.format(robot)).locator("td")
        screen.page.wait_for_selector(f"{ROW.format(robot)} td:text-is('running')")
        assert cells.nth(2).inner_text() == behavior
    screen.page.wait_for_selector("#status :text('GO given')")


def test_a_click_selects_and_shift_adds(team: TeamFixture, screen: Screen) -> None:
    """Rows and map have one selection: a row's click is the map's, and the map's marks the row; what can be done with a
    robot stands in one line."""
    show(team, screen)
    screen.page.click(ROW.format(1))
    assert screen.ask("[...zteam.app.store.selection]") == [1]
    buttons = screen.page.locator("#page-team .over button").all()
    assert [button.inner_text() for button in buttons] == ["Inspect", "Follow", "Deselect", "Remove"]
    assert len({(button.bounding_box() or {})["y"] for button in buttons}) == 1
    screen.page.click(ROW.format(0), modifiers=["Shift"])
    assert sorted(screen.ask("[...zteam.app.store.selection]")) == [0, 1]
    screen.select(0)
    screen.page.wait_for_selector(f"{ROW.format(0)}.selected")
    assert screen.page.locator("#robots tbody.selected").count() == 1
    assert screen.page.locator(f"{ROW.format(0)} button").get_attribute("aria-pressed") == "true"


def test_a_robot_that_is_gone_is_marked(team: TeamFixture, screen: Screen) -> None:
    """A killed robot's row says that it is lost, and why."""
    team.start("arena", robots=2, behavior="idle", lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team), 2)
    screen.page.wait_for_selector(f"{ROW.format(1)} td:text-is('running')")
    team.kill("robot_1")
    screen.page.wait_for_selector(f"{ROW.format(1)} td.bad:text-is('lost')")
    screen.page.wait_for_selector(f"{ROW.format(1)} :text('its process is gone')")


def test_the_start_gate_names_what_it_waits_for(team: TeamFixture, screen: Screen) -> None:
    """Before GO the footer names the robot that is missing, and the other one's row says what it waits for."""
    team.spawn("zteam-sim", "arena")
    team.spawn("zteam-tf")
    team.spawn("zteam-monitor", "--ids", "0,1")
    team.spawn("zteam-robot", "--id", "0", "--behavior", "idle")
    team.wait_for_processes("sim", "tf", "monitor", "robot_0")
    screen.open(start_view(team), 1)
    screen.page.wait_for_selector("#status .warn:text('1 of 2 ready; waiting for robot_1')")
    screen.page.wait_for_selector(f"{ROW.format(0)} .note:has-text('waiting for the monitor\\'s GO')")


@pytest.mark.parametrize(
    ("behavior", "params", "has_goal", "reason"),
    [
        ("idle", {}, False, "idle: only teleop or navigation drives it"),
        ("go_to", {}, False, "no goal yet"),
        ("go_to", {}, True, "goal reached"),
        ("forward", {"speed": 0.0}, False, "its parameter speed is 0"),
        ("forward", {"speed": 1.0}, False, "obstacle ahead"),
    ],
)
def test_a_robot_that_stands_says_why(
    team: TeamFixture, screen: Screen, behavior: str, params: dict[str, float], has_goal: bool, reason: str
) -> None:
    """Its row has the reason: that of its behaviour, or of the safety layer, which has stopped it before a wall."""
    team.start("arena", robots=1, behavior=behavior, params={0: params}, lockstep=False)
    screen.open(start_view(team), 1)
    if has_goal:
        goal = screen.pose(0)
        assert screen.ask("({x, y, yaw}) => zteam.app.send({op: 'goal', robots: [0], x, y, yaw})", goal) == ""
    screen.page.wait_for_selector(f"{ROW.format(0)} .note span:text-is('{reason}')")
    team.wait_for(lambda: team.robot(0).speed == 0.0)


def test_without_a_team_the_page_says_so_and_sees_it_come_and_go(team: TeamFixture, screen: Screen) -> None:
    """No team yet: the way to one; with one no notice; when it has gone, that it is gone."""
    screen.open(start_view(team))
    screen.page.wait_for_selector("#notice :text('No team yet')")
    screen.page.wait_for_selector("#notice code:text-is('zteam up')")
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    screen.wait("document.querySelector('#notice [role=status]').childElementCount === 0")
    screen.page.wait_for_selector(ROW.format(0))
    for name in ("robot_0", "monitor", "tf", "sim"):
        team.stop(name)
    screen.page.wait_for_selector("#notice :text('The team is gone')")


def test_a_hung_server_is_noticed(team: TeamFixture, screen: Screen) -> None:
    """A server that stands still is said in the footer: what the page shows is old."""
    show(team, screen, 1)
    team.pause_process(VIEW)
    screen.page.wait_for_selector("#status .bad:text('no frame')")
    team.resume_process(VIEW)
    screen.page.wait_for_selector("#status .good:text('connected')")


def test_a_spawned_robot_says_what_it_lacks_and_leaves_when_removed(team: TeamFixture, screen: Screen) -> None:
    """Without `zteam up` the row has the command to type. A removed robot has no row and is not drawn; one whose
    process lives says so. In a paused world a new one is drawn too, and robots are paused."""
    show(team, screen, 1)
    team.sim.spawn(0.0, -3.0, 0.0, robot_id=7)
    screen.page.wait_for_selector(f"{ROW.format(7)} .note:has-text('drive it, or start one')")
    command = screen.page.locator(f"{ROW.format(7)} code").inner_text()
    assert command.startswith("zteam-robot --id 7 --behavior wander --connect tcp/"), command
    assert screen.page.locator(f"{ROW.format(7)} td.bad").count() == 0
    screen.wait("zteam.app.store.poses.at(7) !== null")
    team.sim.pause()
    screen.page.wait_for_selector(f"{ROW.format(0)} td:text-is('paused')")
    new = team.sim.spawn(3.0, -1.0, 0.0)
    screen.wait_for_robot(new, 3.0, -1.0)
    team.sim.move(new, 3.0, -4.0, 0.0)
    screen.wait_for_robot(new, 3.0, -4.0)
    team.sim.remove(7)
    screen.page.wait_for_selector(ROW.format(7), state="detached")
    screen.wait("zteam.app.store.poses.at(7) === null")
    team.sim.remove(0)
    screen.page.wait_for_selector(f"{ROW.format(0)} .note:has-text('not in the world; robot_0 still runs')")
    screen.page.wait_for_selector(f"{ROW.format(0)} td.bad:text-is('absent')")
    screen.wait("zteam.app.store.poses.at(0) === null")


COLORS = """() => [
  document.querySelector('#robots .swatch').style.backgroundColor.match(/[0-9]+/g).map(Number),
  getComputedStyle(document.querySelector('#scene')).backgroundColor.match(/[0-9]+/g).map(Number),
]"""
"""Of the first robot, and of ground that is not drawn."""
LOST = """
[team]
world = "arena"
[[robots]]
id = 0
behavior = "idle"
navigation = {localizer = "amcl"}
"""


def test_a_robot_that_takes_itself_to_be_elsewhere_is_lost(team: TeamFixture, screen: Screen, tmp_path: Path) -> None:
    """After a wrong initial pose the row says that it is lost, and a pale ghost stands at its true place."""
    (tmp_path / "lost.toml").write_text(LOST)
    team.launch(tmp_path / "lost.toml", lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team), 1)
    true = team.robot(0).pose
    screen.page.wait_for_selector(f"{ROW.format(0)} td:text-is('running')")
    assert screen.ask("zteam.app.store.robots.get(0).localised")
    screen.ask("([x, y]) => zteam.app.send({op: 'initialpose', robot: 0, x, y, yaw: 0})", [true.x + 2.0, true.y + 1.0])
    screen.page.wait_for_selector(f"{ROW.format(0)} .bad:has-text('localisation lost')")
    screen.wait("zteam.app.store.robots.get(0).truth !== null")
    x, y, _ = screen.ask("zteam.app.store.robots.get(0).truth")
    assert (x, y) == pytest.approx((true.x, true.y), abs=0.05)
    # It might find itself again.
    team.sim.pause()
    screen.wait("zteam.app.store.team.sim.state === 'paused'")
    assert not screen.ask("zteam.app.store.robots.get(0).localised")
    screen.ask("() => [...zteam.app.layers.shown].forEach((name) => zteam.app.layers.set(name, name === 'robots'))")

    def color() -> tuple[int, ...]:
        picture = Image.open(io.BytesIO(screen.page.screenshot())).convert("RGB")
        px, py = screen.place(x, y)
        return picture.getpixel((round(px), round(py)))  # type: ignore[return-value]

    own, ground = screen.ask(COLORS)
    ghost = pytest.approx([0.15 * part + 0.85 * below for part, below in zip(own, ground, strict=True)], abs=3)
    team.wait_for(lambda: color() == ghost)


def test_a_robot_whose_place_is_known_badly_is_lost(team: TeamFixture, screen: Screen) -> None:
    """The row says how large the deviation of its localisation is."""
    show(team, screen, 1)
    wide = PoseWithCovariance(covariance=np.diag([4.0, 1.0, 0.0, 0.0, 0.0, 0.0]).ravel())
    pose = PoseWithCovarianceStamped(Header(frame_id=names.MAP_FRAME), wide)
    publisher = team.bus.publisher(names.robot_key(0, names.AMCL_POSE), PoseWithCovarianceStamped)

    def is_lost() -> bool:
        publisher.put(pose)
        text = "localisation lost: its place is known to ± 2.0 m only"
        return screen.page.locator(f"{ROW.format(0)} .bad:has-text('{text}')").count() == 1

    team.wait_for(is_lost)


def test_zteam_up_starts_a_behavior_for_a_spawned_robot(team: TeamFixture, screen: Screen) -> None:
    """The button has the launcher start a process, which drives the robot; to remove the robot ends it."""
    name = team.spawn("zteam", "up", "arena", "--view", "--no-browser")
    team.wait_for_line(name, "the view is at http://127.0.0.1:")
    url = next(line.partition("the view is at ")[2].strip() for line in team.lines(name) if "the view is at" in line)
    screen.open(url, 1)
    new = team.sim.spawn(0.0, -3.0)
    screen.page.click(f"{ROW.format(new)} button:text-is('Start')")
    screen.page.wait_for_selector(f"{ROW.format(new)} td:text-is('running')")
    screen.page.wait_for_selector(f"{ROW.format(new)} td:text-is('wander')")
    assert "has a process already" in screen.ask(
        "robot => zteam.app.send({op: 'start', robot, behavior: 'avoid'})", new
    )
    assert screen.ask("robot => zteam.app.send({op: 'remove', robot})", new) == ""
    screen.page.wait_for_selector(ROW.format(new), state="detached")
    screen.wait("robot => zteam.app.store.poses.at(robot) === null", new)
    assert team.stop(name) == 0
    assert any(f"robot_{new} is started on request" in line for line in team.lines(name))
