"""Goals and initial poses by mouse: what arrives on the bus is what was clicked."""

import math
from pathlib import Path

import pytest

from support.browser import OpenScreen, Screen, show, start_view
from support.navigated_team import FAKE
from zteam import names
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Header, Point, Pose, PoseStamped, PoseWithCovarianceStamped, Time
from zteam.team.testing.team import TeamFixture

PIXELS = 2
"""How far from the clicked place a pose may be."""
STAND = 10.0
"""Host seconds for the world to stand."""


def yaw_of(pose: Pose) -> float:
    """The heading of a pose."""
    q = pose.orientation
    return yaw_from_quaternion(q.x, q.y, q.z, q.w)


def hear_goals(team: TeamFixture, *robots: int) -> list[tuple[str, PoseStamped]]:
    """The goals of these robots, as they arrive: key and message."""
    heard: list[tuple[str, PoseStamped]] = []
    for robot in robots:
        team.bus.subscribe(names.robot_key(robot, names.GOAL_POSE), PoseStamped, lambda *sent: heard.append(sent))
    return heard


@pytest.mark.gate
def test_a_goal_arrives_where_it_was_clicked(team: TeamFixture, screen: Screen) -> None:
    """A press and a drag with the goal tool send the selected robot alone to that place, with that heading."""
    show(team, screen, behavior="go_to")
    heard = hear_goals(team, 0, 1)
    screen.select(0)
    screen.tool("goal")
    screen.drag((0.5, 1.0), (1.0, 2.0))
    team.wait_for(lambda: len(heard) > 0)
    [(key, goal)] = heard
    assert key == names.robot_key(0, names.GOAL_POSE)
    assert goal.header.frame_id == names.MAP_FRAME
    assert goal.pose.position.x == pytest.approx(0.5, abs=PIXELS * screen.pixel)
    assert goal.pose.position.y == pytest.approx(1.0, abs=PIXELS * screen.pixel)
    assert yaw_of(goal.pose) == pytest.approx(math.atan2(1.0, 0.5), abs=0.05)
    screen.wait("zteam.app.store.docs.goals?.some(({robot, x, y}) => robot === 0 && Math.hypot(x - 0.5, y - 1) < 0.1)")
    team.wait_for(lambda: team.robot(0).distance_travelled > 0.2)


RING = """([x, y]) => {
  const upper = document.querySelectorAll('#map canvas')[1].getContext('2d');
  const [px, py] = zteam.app.camera.toScreen(x, y);
  const color = document.querySelector('#robots .swatch').style.backgroundColor.match(/[0-9]+/g).map(Number);
  return Array.from({length: 16}, (_, i) => {
    const angle = (i + 0.5) * Math.PI / 8;
    const [x, y] = [px + 7 * Math.cos(angle), py + 7 * Math.sin(angle)].map(Math.floor);
    const {data} = upper.getImageData(x, y, 1, 1);
    return data[3] > 200 && color.every((part, k) => Math.abs(part - data[k]) < 30);
  }).filter(Boolean).length;
}"""
"""Of 16 places on the ring round a goal (m), how many have the colour of the first robot's row."""
LIST = "document.querySelector('#goals').innerText"
TOASTS = "document.querySelector('#toasts').innerText"
STATES = "zteam.app.store.docs.goals?.map(({state}) => state).join()"


def wait_for_ring(screen: Screen, x: float, y: float, *, shown: bool) -> None:
    """Wait until the first robot's goal is marked on the map there, or is not."""
    screen.wait(f"place => ({RING})(place) {'> 12' if shown else '=== 0'}", [x, y])


def click_goal(screen: Screen, robot: int, x: float, y: float) -> None:
    """Send a robot to a place (m)."""
    screen.select(robot)
    screen.tool("goal")
    screen.page.mouse.click(*screen.place(x, y))


@pytest.mark.gate
def test_a_goal_has_a_life_on_the_page(team: TeamFixture, screen: Screen) -> None:
    """It is called sent until the robot knows it, then the list says how far the robot is, and a ring is on the map;
    when it is there, a message says so, and the list and the ring are gone."""
    show(team, screen, behavior="go_to")
    start = screen.pose(0)
    goal = start["x"] + 0.8, start["y"]
    screen.page.click("button[aria-label=Pause]")
    team.wait_for(lambda: team.sim_status.paused)
    team.sim.stand(STAND)
    assert screen.ask(RING, goal) == 0
    click_goal(screen, 0, *goal)
    screen.wait(f"{STATES} === 'sent' && /robot_0\\nsent/.test({LIST})")
    wait_for_ring(screen, *goal, shown=True)
    screen.page.click("button[aria-label=Resume]")
    screen.wait(f"/robot_0\\n0\\.[0-9] m · [0-9]+ s/.test({LIST})")
    screen.wait(f"{TOASTS}.includes('robot_0 reached its goal')")
    screen.wait("document.querySelector('#goals').hidden")
    assert screen.ask(STATES) == "succeeded"
    wait_for_ring(screen, *goal, shown=False)


def test_a_goal_is_canceled_by_escape_and_by_its_button(team: TeamFixture, screen: Screen) -> None:
    """The first Esc leaves the tool, the next one stops the selected robot and its ring is gone; the button stops it
    too."""
    show(team, screen, behavior="go_to")
    click_goal(screen, 0, 0.0, -3.0)
    screen.wait(f"{STATES} === 'driving'")
    wait_for_ring(screen, 0.0, -3.0, shown=True)
    screen.page.keyboard.press("Escape")
    assert screen.ask("zteam.app.tool") == "select"
    assert screen.ask(STATES) == "driving"
    screen.page.keyboard.press("Escape")
    screen.wait(f"{TOASTS}.includes('robot_0 stops: its goal is canceled')")
    wait_for_ring(screen, 0.0, -3.0, shown=False)
    click_goal(screen, 0, 0.5, -3.0)
    screen.wait(f"{STATES} === 'driving'")
    screen.page.click("#goals [aria-label='Cancel the goal of robot_0']")
    screen.wait(f"{STATES} === 'canceled'")
    team.wait_for(lambda: team.robot(0).status.speed == 0.0)


def test_an_aborted_goal_says_why(team: TeamFixture, screen: Screen) -> None:
    """The reason is in a message, and in the list until it is put away."""
    show(team, screen, behavior="go_to")
    screen.wait(f"{STATES} === ''")
    goals = team.bus.publisher(names.robot_key(1, names.GOAL_POSE), PoseStamped)
    team.wait_for(lambda: goals.has_subscribers)
    goals.put(PoseStamped(Header(Time(1), names.MAP_FRAME), Pose(Point(2e9))))
    screen.wait(f"/aborted: .*too far away/.test({LIST})")
    fold = screen.page.locator("#goals header button.link")
    fold.click()
    assert "aborted" not in screen.ask(LIST)
    fold.click()
    screen.page.click("#goals [aria-label='Dismiss']")
    screen.wait("document.querySelector('#goals').hidden")


def start_navigated(team: TeamFixture, screen: Screen, folder: Path) -> None:
    """A navigated robot and one that stands, and a page that shows them."""
    path = folder / "team.toml"
    path.write_text(FAKE)
    team.launch(path, lockstep=False)
    screen.open(start_view(team), 2)
    screen.wait("zteam.app.store.grids.has('map')")


def test_a_goal_in_an_obstacle_is_sent_at_the_second_press(
    team: TeamFixture, screen: Screen, empty_folder: Path
) -> None:
    """The page says what is there and sends nothing, until the place is pressed again; then navigation aborts the goal,
    and its own reason is in a message and in the list."""
    start_navigated(team, screen, empty_folder)
    heard = hear_goals(team, 0)
    click_goal(screen, 0, 1.5, 2.5)
    screen.wait(f"{TOASTS}.includes('Goal not sent: in an obstacle (map). Press again at the same place')")
    assert screen.ask(STATES) == ""
    assert not heard
    screen.page.mouse.click(*screen.place(1.5, 2.5))
    team.wait_for(lambda: len(heard) == 1)
    reason = r"the goal \(1\.\d+, 2\.\d+\) is in an obstacle or too close to one, and so is all within 0\.2 m of it"
    screen.wait(f"/robot_0\\naborted: {reason}/.test({LIST})")
    screen.wait(f"/robot_0 gave up its goal: {reason}/.test({TOASTS})")


def test_a_navigated_robot_shows_its_goal_and_its_costmap_counts(
    team: TeamFixture, screen: Screen, empty_folder: Path
) -> None:
    """Neither its row nor its panel calls it idle; what its costmap alone has is an obstacle; `zteam goto --cancel`
    ends a goal."""
    start_navigated(team, screen, empty_folder)
    other = screen.pose(1)
    screen.select(0)
    screen.tool("goal")
    judged = "async ([x, y]) => (await import('/page/js/costs.js')).judge(zteam.app.store, [0], x, y)?.text"
    screen.wait(f"({judged})([{other['x']}, {other['y']}]).then(text => text === 'in an obstacle (costmap)')")
    screen.page.mouse.click(*screen.place(other["x"], other["y"]))
    screen.wait(f"{TOASTS}.includes('Goal not sent: in an obstacle (costmap)')")
    screen.page.mouse.click(*screen.place(3.5, 3.5))
    screen.wait(f"/robot_0\\n[0-9.]+ m · [0-9]+ s/.test({LIST})")
    row = "document.querySelector('#robots tbody td:nth-child(3)').innerText"
    screen.wait(f"{row} === 'navigation'")
    screen.page.keyboard.press("8")
    screen.page.wait_for_selector("#page-robot dt:text-is('Behaviour') + dd:text-is('navigation')")
    assert team.command("goto", "--cancel", "0", timeout=20.0).stdout == "robot_0: the goal is canceled\n"
    screen.wait(f"{TOASTS}.includes('robot_0 stops: its goal is canceled')")


@pytest.mark.parametrize("turn", [0.0, 2.5])
def test_a_goal_arrives_on_a_turned_and_zoomed_map_of_a_dense_screen(
    team: TeamFixture, open_screen: OpenScreen, turn: float
) -> None:
    """Angle and scale of the camera, and a dense screen, do not move the place that was clicked."""
    screen = open_screen(device_scale_factor=2)
    show(team, screen, behavior="go_to")
    heard = hear_goals(team, 1)
    screen.select(1)
    screen.ask("turn => zteam.app.camera.set({x: -2, y: 1, scale: 90, angle: turn})", turn)
    screen.tool("goal")
    screen.drag((-2.0, 0.5), (-2.5, 0.5))
    team.wait_for(lambda: len(heard) > 0)
    pose = heard[0][1].pose
    assert (pose.position.x, pose.position.y) == pytest.approx((-2.0, 0.5), abs=PIXELS * screen.pixel)
    assert abs(yaw_of(pose)) == pytest.approx(math.pi, abs=0.05)


def test_several_robots_spread_their_goals(team: TeamFixture, screen: Screen) -> None:
    """One click for two robots gives each a goal of its own, far enough apart for both to stand there."""
    show(team, screen, behavior="go_to")
    heard = hear_goals(team, 0, 1)
    screen.select(0, 1)
    screen.tool("goal")
    screen.drag((0.0, 0.0), (1.0, 0.0))
    team.wait_for(lambda: len(heard) == 2)
    assert {key for key, _ in heard} == {names.robot_key(i, names.GOAL_POSE) for i in (0, 1)}
    (x0, y0), (x1, y1) = ((goal.pose.position.x, goal.pose.position.y) for _, goal in heard)
    assert math.hypot(x0 - x1, y0 - y1) > 0.5
    assert min(math.hypot(x0, y0), math.hypot(x1, y1)) < PIXELS * screen.pixel
    assert max(math.hypot(x0, y0), math.hypot(x1, y1)) < 2.0


def test_an_initial_pose_arrives_where_it_was_clicked(team: TeamFixture, screen: Screen) -> None:
    """A press and a drag with the pose tool tell the selected robot's localisation this place and heading."""
    show(team, screen, behavior="go_to")
    heard: list[PoseWithCovarianceStamped] = []
    key = names.robot_key(1, names.INITIAL_POSE)
    team.bus.subscribe(key, PoseWithCovarianceStamped, lambda _key, sent: heard.append(sent))
    screen.select(1)
    screen.tool("pose")
    screen.drag((-3.0, -1.0), (-3.0, -2.0))
    team.wait_for(lambda: len(heard) > 0)
    pose = heard[0].pose.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((-3.0, -1.0), abs=PIXELS * screen.pixel)
    assert yaw_of(pose) == pytest.approx(-math.pi / 2, abs=0.05)
