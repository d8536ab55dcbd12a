"""Log, topics, plots and frames on the page, held against what the bus says."""

from support.browser import Screen, start_view
from zteam.messages import Bool
from zteam.team.testing.team import TeamFixture

LINES = "[...document.querySelectorAll('#page-log .line')].map((line) => line.textContent)"
SERIES = "[...document.querySelectorAll('#page-plots .chip')].map((chip) => chip.title)"


def start(team: TeamFixture, screen: Screen, layout: str = "") -> None:
    """A wandering team in real time, and a page that begins with the layout in its address."""
    team.start("arena", robots=1, lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team) + layout, 1)


def odom_x(team: TeamFixture) -> float:
    """Where the odometry sees robot_0 now (m)."""
    team.wait_for(lambda: team.robot(0).odom is not None)
    odom = team.robot(0).odom
    assert odom is not None
    return float(odom.pose.pose.position.x)


def test_the_log_has_the_lines_of_all_processes(team: TeamFixture, screen: Screen) -> None:
    """Lines from before the page was opened are there, of several processes; filters choose among them."""
    start(team, screen)
    screen.page.click("#tab-log")
    screen.wait(f"{LINES}.some((line) => line.includes('All robots GO!'))")
    screen.wait(f"{LINES}.some((line) => line.includes('robot_0') && line.includes('driving'))")
    screen.page.select_option("#page-log select[aria-label=Process]", "monitor")
    lines = screen.ask(LINES)
    assert lines
    assert all("monitor" in line for line in lines), lines
    screen.page.fill("#log-filter", "robots go")
    assert len(screen.ask(LINES)) == 1
    screen.page.select_option("#page-log select[aria-label='Minimum level']", "error")
    assert screen.ask(LINES) == []


def test_the_log_follows_its_end_until_the_user_reads(team: TeamFixture, screen: Screen) -> None:
    """New lines do not move a page that is scrolled up; a button leads back to the end."""
    start(team, screen)
    screen.page.click("#tab-log")
    add = """count => {
      const line = (_, i) => ({time: i, process: 'talker', level: 'info', text: `line ${i}`});
      const block = {type: 'doc', name: 'log', value: Array.from({length: count}, line)};
      zteam.app.store.takeFrame({number: 1, tick: 1, stamp: 1, age: -1, blocks: [block]}, 0);
    }"""
    screen.ask(add, 200)
    # The team's own lines, which come at any time, would count among the new ones.
    screen.page.select_option("#page-log select[aria-label=Process]", "talker")
    place = "document.querySelector('#page-log .log')"
    at_end = f"{place}.scrollHeight - {place}.scrollTop - {place}.clientHeight < 2"
    screen.wait(at_end)
    screen.page.hover("#page-log .log")
    end = screen.ask(f"{place}.scrollTop")
    screen.page.mouse.wheel(0, -600)
    screen.page.wait_for_selector("text=↓ End")
    # A browser may scroll smoothly.
    screen.wait(f"end => Math.abs(end - 600 - {place}.scrollTop) < 1", end)
    top = screen.ask(f"{place}.scrollTop")
    screen.ask(add, 7)
    screen.page.wait_for_selector("text=↓ 7 new")
    assert screen.ask(f"{place}.scrollTop") == top
    screen.page.click("text=↓ 7 new")
    screen.wait(at_end)


def test_what_processes_say_is_text_and_never_markup(team: TeamFixture, screen: Screen) -> None:
    """A line of the log that looks like HTML stands on the page as it is."""
    start(team, screen)
    screen.page.click("#tab-log")
    line = "<img src=x onerror=alert(1)><b>bold</b>"
    screen.ask(
        """line => zteam.app.store.takeFrame({number: 1, tick: 1, stamp: 1, age: -1, blocks: [{type: 'doc', name: 'log',
          value: [{time: 1, process: '<i>tf</i>', level: 'error', text: line}]}]}, 0)""",
        line,
    )
    screen.wait(f"line => {LINES}.some((text) => text.includes(line))", line)
    assert screen.page.locator("#page-log img, #page-log b, #page-log i").count() == 0


def test_topics_have_types_and_rates(team: TeamFixture, screen: Screen) -> None:
    """The list shows the topics that the bus has, with type, publishers and rate, whatever subscribes to them; a truth
    value is plotted."""
    start(team, screen)
    screen.page.click("#tab-topics")
    row = "#topics [data-topic='robot_0/base_scan']"
    screen.page.wait_for_selector(f"{row} td:text-is('LaserScan')")
    rate = f"Number(document.querySelector(`{row} td:nth-child(3)`).textContent)"
    screen.wait(f"{rate} > 5 && {rate} < 20")
    # Nothing else of the team subscribes to it; and a type of one's own is that of the messages.
    rate = f"Number(document.querySelector(`{row.replace('base_scan', 'stall')} td:nth-child(3)`).textContent)"
    screen.wait(f"{rate} > 5 && {rate} < 20")
    alarm = team.bus.publisher("crowd/alarm", Bool)

    def wait_while_it_rings(script: str) -> None:
        def look() -> bool:
            alarm.put(Bool(True))
            return bool(screen.ask(script))

        team.wait_for(look)

    row = "#topics [data-topic='crowd/alarm']"
    wait_while_it_rings(f"document.querySelector(`{row} td:nth-child(2)`)?.textContent === 'Bool'")
    screen.page.click(f"{row} button")
    wait_while_it_rings("document.querySelector(`[aria-label='Plot data']`) !== null")
    screen.page.click("[aria-label='Plot data']")
    wait_while_it_rings("document.querySelector('#page-plots .chip output')?.textContent === '1'")
    screen.page.fill("#page-topics input", "team_status")
    screen.wait("document.querySelectorAll('#topics tbody').length === 1")


def test_a_message_is_shown_and_its_numbers_are_plotted(team: TeamFixture, screen: Screen) -> None:
    """The newest message stands as a tree; a click on a number begins a curve that has the bus's values."""
    start(team, screen)
    screen.page.click("#tab-topics")
    screen.page.click("#topics [data-topic='robot_0/odom'] button")
    screen.page.click("button[aria-label='Plot pose.pose.position.x']")
    screen.page.click("button[aria-label='Plot pose.pose.position.y']")
    screen.page.click("button[aria-label='Plot twist.twist.linear.x']")
    screen.wait(f"{SERIES}.length === 3")
    # Two positions share a chart, in metres; the velocity has its own.
    screen.wait("document.querySelectorAll('#page-plots .chart canvas').length === 2")
    values = "[...document.querySelectorAll('#page-plots .chip output')].map((node) => Number(node.textContent))"
    screen.wait(f"{values}.every(Number.isFinite)")
    before = odom_x(team)
    screen.wait(f"x => Math.abs({values}[0] - x) > 0.2", before)
    # Both move on meanwhile.
    team.wait_for(lambda: abs(screen.ask(f"{values}[0]") - odom_x(team)) < 0.3)
    screen.page.click("#page-plots button:text-is('Clear')")
    screen.page.click("[aria-label^='Remove robot_0/odom twist']")
    screen.wait(f"{SERIES}.length === 2")
    assert [title.split(".")[-1] for title in screen.ask(SERIES)] == ["x", "y"]


def test_a_paused_plot_stands_still(team: TeamFixture, screen: Screen) -> None:
    """While plots are paused their values do not change; afterwards they have what came meanwhile."""
    start(team, screen, "&plots=robot_0/odom:header.stamp.sec&dock=plots")
    value = "Number(document.querySelector('#page-plots .chip output')?.textContent || NaN)"
    screen.wait(f"{value} > 0")
    screen.page.click("#page-plots button:text-is('Freeze')")
    stands = screen.ask(value)
    screen.wait("stamp => zteam.app.store.frame.stamp > stamp + 2", stands)
    assert screen.ask(value) == stands
    screen.page.click("#page-plots button:text-is('Go on')")
    screen.wait(f"stands => {value} > stands", stands)


def test_the_tree_of_frames_says_where_each_one_is(team: TeamFixture, screen: Screen) -> None:
    """All frames stand below their parents, with the process that says them; static ones say so."""
    start(team, screen)
    screen.page.click("#tab-frames")
    row = "#frames [data-frame='{}']"
    for frame in ("robot_0/base_footprint", "robot_0/base_laser_link"):
        screen.page.wait_for_selector(row.format(frame))
    # In one look: more frames may come.
    depth = dict(
        screen.ask("""[...document.querySelectorAll('#frames td.key')]
          .map((cell) => [cell.textContent, parseFloat(cell.style.paddingLeft)])""")
    )
    names = list(depth)
    assert names[0] == "map"
    assert names.index("robot_0/odom") < names.index("robot_0/base_footprint") < names.index("robot_0/base_laser_link")
    assert depth["map"] < depth["robot_0/odom"] < depth["robot_0/base_footprint"]
    assert screen.page.locator(row.format("robot_0/base_laser_link")).locator("td").nth(4).inner_text() == "static"
    said_by = f"document.querySelector(`{row.format('robot_0/base_footprint')} td:nth-child(6)`).textContent"
    screen.wait(f"{said_by} === 'robot_0'")
