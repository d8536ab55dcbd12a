"""The table of robots, and what the page says when something is missing."""

from support.browser import VIEW, Screen, start_view
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
    screen.page.wait_for_selector("#status :text('GO is out')")


def test_a_click_selects_and_shift_adds(team: TeamFixture, screen: Screen) -> None:
    """Rows and map have one selection: a row's click is the map's, and the map's marks the row."""
    team.start("arena", robots=2, behavior="idle", lockstep=False)
    screen.open(start_view(team), 2)
    screen.page.click(ROW.format(1))
    assert screen.ask("[...zteam.app.store.selection]") == [1]
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
    screen.page.wait_for_selector(f"{ROW.format(1)} td:text('its process is gone')")


def test_the_start_gate_names_what_it_waits_for(team: TeamFixture, screen: Screen) -> None:
    """Before GO the footer names the robot that is missing."""
    team.spawn("zteam-sim", "arena")
    team.spawn("zteam-tf")
    team.spawn("zteam-monitor", "--ids", "0,1")
    team.spawn("zteam-robot", "--id", "0", "--behavior", "idle")
    team.wait_for_processes("sim", "tf", "monitor", "robot_0")
    screen.open(start_view(team), 1)
    screen.page.wait_for_selector("#status .warn:text('1 of 2 ready; waiting for robot_1')")


def test_without_a_team_the_page_says_so_and_sees_it_come_and_go(team: TeamFixture, screen: Screen) -> None:
    """No team yet: the way to one; with one no notice; when it has gone, that it is gone."""
    screen.open(start_view(team))
    screen.page.wait_for_selector("#notice :text('No team yet')")
    screen.page.wait_for_selector("#notice code:text-is('zteam up')")
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    screen.wait("document.querySelector('#notice').childElementCount === 0")
    screen.page.wait_for_selector(ROW.format(0))
    for name in ("robot_0", "monitor", "tf", "sim"):
        team.stop(name)
    screen.page.wait_for_selector("#notice :text('The team is gone')")


def test_a_server_that_is_gone_is_said_and_found_again(team: TeamFixture, screen: Screen) -> None:
    """The page says that the view's server is gone, disables the controls, and goes on when it is back."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    url = start_view(team)
    screen.open(url, 1)
    team.kill(VIEW)
    screen.page.wait_for_selector("#notice .bad strong:text('server is gone')")
    assert screen.page.locator("button[aria-label=Pause]").is_disabled()
    port = url.rpartition(":")[2].partition("/")[0]
    token = url.partition("token=")[2]
    again = team.spawn(
        "zteam-view", "--no-browser", "--port", port, "--token", token, "--name", VIEW, name="view_again"
    )
    team.wait_for_line(again, "the view is at")
    screen.wait("zteam.app.store.connection.state === 'open' && zteam.app.store.poses.count === 2")
    screen.wait("document.querySelector('#notice').childElementCount === 0")


def test_a_lost_simulator_is_said(team: TeamFixture, screen: Screen) -> None:
    """When the simulator's process is gone, the page says so and names the command that starts it."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    screen.open(start_view(team), 1)
    screen.wait("zteam.app.store.team?.sim.present")
    team.kill("sim")
    screen.page.wait_for_selector("#notice :text('The simulator is gone')")
    assert screen.page.locator("button[aria-label=Pause]").is_disabled()


def test_a_hung_server_is_noticed(team: TeamFixture, screen: Screen) -> None:
    """A server that stands still is said in the footer: what the page shows is old."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    screen.open(start_view(team), 1)
    team.pause_process(VIEW)
    screen.page.wait_for_selector("#status .bad:text('no frame')")
    team.resume_process(VIEW)
    screen.page.wait_for_selector("#status .good:text('connected')")
