"""All of one robot in a panel, its parameters, and the doctor; held against what the bus says."""

from support.browser import Screen, start_view
from zteam.robot.client import ParametersClient
from zteam.team.testing.team import TeamFixture

FACT = "#page-robot dt:text-is('{}') + dd"
SPEED = "#page-robot [data-parameter=speed]"


def inspect(screen: Screen, robot: int) -> None:
    """Open the panel of a robot, by its row in the table."""
    screen.page.click(f"#robots button:has-text('robot_{robot}')")
    screen.page.click("#page-team button:text-is('Inspect')")
    screen.page.wait_for_selector(f"#page-robot strong:text-is('robot_{robot}')")


def test_a_robot_is_inspected(team: TeamFixture, screen: Screen) -> None:
    """Pose with its source, goal, sensors with rates, plots and log of the selected robot; each leads on by a click."""
    team.start("arena", robots=2, behavior="go_to", lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team), 2)
    inspect(screen, 1)
    pose = team.robot(1).pose
    screen.page.wait_for_selector(f"{FACT.format('Pose in map')}:has-text('{pose.x:.2f} m, {pose.y:.2f} m')")
    screen.page.wait_for_selector(f"{FACT.format('Source')}:text-is('odom by sim, base_footprint by robot_1')")
    # On a loaded machine a new publisher learns late who hears it.
    goal = f"zteam.app.send({{op: 'goal', robots: [1], x: {pose.x}, y: {pose.y + 1}, yaw: 0}})"
    team.wait_for(lambda: screen.ask(goal) == "")
    screen.page.wait_for_selector(f"{FACT.format('Goal')}:has-text('{pose.x:.2f} m, {pose.y + 1:.2f} m')")
    rate = "Number(document.querySelector('#sensors [data-topic=\"robot_1/base_scan\"] td:nth-child(3)').textContent)"
    screen.page.wait_for_selector("#sensors [data-topic='robot_1/base_scan'] td:text-is('LaserScan')")
    screen.wait(f"{rate} > 1 && {rate} < 20")
    # Its own lines only, there and where all lines are.
    screen.wait("document.querySelectorAll('#page-robot .line').length > 0")
    own = "[...document.querySelectorAll('{} .line .process')].every((node) => node.textContent === 'robot_1')"
    assert screen.ask(own.format("#page-robot"))
    screen.page.click("#page-robot button:text-is('All lines')")
    screen.page.wait_for_selector("#page-log .line")
    assert screen.ask(own.format("#page-log"))
    screen.page.click("#page-robot button:text-is('Distance to obstacle')")
    team.wait_for(lambda: team.robot(1).scan is not None)
    value = "Number(document.querySelector('#page-plots .chip output')?.textContent || NaN)"
    screen.wait(f"lowest => {value} > 0 && {value} < lowest + 1.5", float(team.robot(1).scan.ranges.min()))
    screen.page.mouse.dblclick(*screen.place(*team.robot(0).pose[:2]))
    screen.page.wait_for_selector("#page-robot strong:text-is('robot_0')")
    screen.page.click("#tab-team")
    screen.page.dblclick("#robots button:has-text('robot_1')")
    screen.page.click("#sensors [data-topic='robot_1/odom'] button")
    screen.page.wait_for_selector("#page-topics button[aria-label='Plot twist.twist.linear.x']")


def test_parameters_are_edited_in_place(team: TeamFixture, screen: Screen) -> None:
    """A value holds for the robot at once; a refused one stays with the reason; one that is set elsewhere is shown."""
    team.start("arena", robots=1, lockstep=False)
    client = ParametersClient(team.bus)
    screen.open(start_view(team), 1)
    inspect(screen, 0)
    screen.wait("document.querySelector('#parameter-speed')?.value === '0.4'")
    screen.page.fill(f"{SPEED} input", "0.25")
    screen.page.keyboard.press("Enter")
    team.wait_for(lambda: client.describe("robot_0").values["speed"] == 0.25)
    screen.page.uncheck("#parameter-hand_over")
    team.wait_for(lambda: client.describe("robot_0").values["hand_over"] is False)
    screen.page.fill(f"{SPEED} input", "7")
    screen.page.keyboard.press("Enter")
    screen.page.wait_for_selector(f"{SPEED} .problem:text-is('refused: a number of at most 1 is expected, not 7')")
    assert client.describe("robot_0").values["speed"] == 0.25
    assert screen.page.input_value(f"{SPEED} input") == "7"
    client.set("robot_0", {"speed": 0.5})
    screen.wait("document.querySelector('#parameter-speed').value === '0.5'")
    assert screen.page.inner_text(f"{SPEED} .problem") == ""


def test_the_doctor_names_the_way_out(team: TeamFixture, screen: Screen) -> None:
    """The panel has the findings of `zteam doctor` when it opens; after a click, those of the team as it is then."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team), 1)
    screen.page.click("#tab-doctor")
    screen.page.wait_for_selector("#page-doctor [data-what=transforms][data-level=ok]")
    team.kill("tf")
    screen.page.click("#page-doctor button:text-is('Check again')")
    found = screen.page.wait_for_selector("#page-doctor [data-what=transforms][data-level=problem]")
    assert "zteam-tf" in found.inner_text()


def test_a_robot_is_spawned_with_a_behaviour(team: TeamFixture, screen: Screen) -> None:
    """Model and behaviour are chosen, the map is clicked: the robot stands there and its process drives it."""
    team.spawn("zteam", "up", "heights", name="launcher")
    screen.open(start_view(team), 2)
    screen.page.click("#tab-simulator")
    screen.wait("zteam.app.store.team.launcher && zteam.app.store.team.behaviors.includes('wander')")
    screen.page.select_option("select[aria-label='Model of the new robot']", "tower")
    screen.page.select_option("select[aria-label='Behaviour of the new robot']", "wander")
    screen.page.click("text=Place in the map")
    screen.page.mouse.click(*screen.place(0.0, 0.0))
    team.wait_for(lambda: 2 in team.sim_status.robots)
    screen.wait("zteam.app.store.robots.get(2)?.model === 'tower'")
    team.wait_for_processes("robot_2")
    assert ParametersClient(team.bus).describe("robot_2").behavior == "wander"
