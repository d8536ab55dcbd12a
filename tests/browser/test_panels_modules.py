"""The panels' pure modules, in the browser: texts of numbers, units, the tree of frames, series, layouts."""

from support.browser import Screen

FORMAT = "async ([name, args]) => (await import('/page/js/panels/format.js'))[name](...args)"


TEXTS: list[tuple[str, list[object], str]] = [
    ("formatClock", [12.34], "12.3 s"),
    ("formatClock", [59.96], "60.0 s"),
    ("formatClock", [245.04], "4:05.0"),
    ("formatClock", [3723.0], "1:02:03.0"),
    ("formatNumber", [-0.001, 2], "0.00"),
    ("formatNumber", [None, 2, "m"], "–"),
    ("formatNumber", [-1.005, 1, "m/s"], "-1.0 m/s"),
    ("formatPlain", [0.1 + 0.2], "0.3"),
    ("formatPlain", [4_000_000_001], "4000000001"),
    ("formatAge", [0.25], "0.3 s"),
    ("formatAge", [-0.1], "0.0 s"),
    ("formatAge", [75], "75 s"),
    ("formatAge", [600], "10 min"),
    ("formatTime", [12.345], "12.35"),
    ("unitOf", ["twist.twist.linear.x"], "m/s"),
    ("unitOf", ["angular_velocity.z"], "rad/s"),
    ("unitOf", ["pose.pose.position.y"], "m"),
    ("unitOf", ["pose.pose.orientation.w"], ""),
    ("unitOf", ["pose.covariance[7]"], ""),
    ("unitOf", ["ranges[12]"], "m"),
    ("unitOf", ["angle_min"], "rad"),
    ("unitOf", ["linear_acceleration.x"], "m/s²"),
    ("unitOf", ["robot_id"], ""),
]
"""Function, arguments, what it says."""


def test_numbers_as_text(modules: Screen) -> None:
    """Times, numbers, ages and units are written as a user reads them."""
    said = [modules.ask(FORMAT, [name, arguments]) for name, arguments, _ in TEXTS]
    assert said == [text for _, _, text in TEXTS]


def test_a_time_of_the_host_is_a_time_of_day(modules: Screen) -> None:
    """A line that was logged by the host's clock says the hour and the minute."""
    text = modules.ask(FORMAT, ["formatTime", [1_800_000_000.25]])
    hour, minute, second = text.split(":")
    assert (len(hour), len(minute)) == (2, 2)
    assert second == "00.25"


def test_frames_stand_below_their_parents(modules: Screen) -> None:
    """In whatever order they come; numbers in names are ordered as numbers; an unknown parent is a root of its own."""
    frames = [("r_10/odom", "map"), ("r_2/base", "r_2/odom"), ("map", ""), ("r_2/odom", "map"), ("tool", "arm")]
    tree = modules.ask(
        """async (frames) => {
          const {treeOf} = await import('/page/js/panels/frames.js');
          return treeOf(frames.map(([name, parent]) => ({name, parent}))).map(({frame, depth}) => [frame.name, depth]);
        }""",
        frames,
    )
    assert tree == [["map", 0], ["r_2/odom", 1], ["r_2/base", 2], ["r_10/odom", 1], ["arm", 0], ["tool", 1]]


def test_series_keep_what_is_new(modules: Screen) -> None:
    """Samples of one time count once, a world that begins again begins the curve anew, and old ones go."""
    found = modules.ask("""async () => {
      const {Plots} = await import('/page/js/plots.js');
      const said = [];
      const tell = (name) => (...args) => said.push([name, ...args]);
      const connection = {watch: tell('watch'), unwatch: tell('unwatch')};
      const plots = new Plots(connection, () => {});
      plots.set('a:x,a:x,b:y.z,nothing');
      const take = (times, values) => plots.take({topic: 'a', field: 'x', times, values});
      take([1, 2, 2], [10, 20, 21]);
      const merged = [...plots.series[0].values];
      take([0.5, 3], [5, 30]);
      const again = [...plots.series[0].times];
      const many = Array.from({length: 50000}, (_, i) => 10 + i / 10);
      take(many, many);
      plots.span = 10;
      const [recent] = plots.recent(many.at(-1), plots.series[0]);
      const kept = plots.series[0].times.length;
      const text = plots.get();
      plots.remove('a', 'x');
      return {said, merged, again, kept, recent: [recent.length, recent.at(-1)], last: many.at(-1), text};
    }""")
    assert found["said"] == [["watch", "a", "x"], ["watch", "b", "y.z"], ["unwatch", "a", "x"]]
    assert found["merged"] == [10, 21]
    assert found["again"] == [0.5, 3]
    assert found["kept"] <= 22_000
    assert found["recent"][0] in (100, 101)
    assert found["recent"][1] == found["last"]
    assert found["text"] == "a:x,b:y.z"


def test_a_layout_is_taken_part_by_part(modules: Screen) -> None:
    """Parts get their texts; what the page does not know is named, and another version is refused as a whole."""
    found = modules.ask("""async () => {
      const {Layout} = await import('/page/js/layout.js');
      const layout = new Layout(), values = {side: 'team', log: 'info//'};
      for (const name of Object.keys(values)) {
        layout.register(name, {get: () => values[name], set: (text) => { values[name] = text; }});
      }
      const problems = [{version: 1, side: 'log & <b>', other: 'x'}, {version: 2, side: 'no'}, null, [], 'text']
        .map((text) => layout.apply(text));
      return {problems, collected: layout.collect()};
    }""")
    assert "other" in found["problems"][0]
    assert "side" not in found["problems"][0]
    assert all("version 1" in problem for problem in found["problems"][1:])
    assert found["collected"] == {"version": 1, "side": "log & <b>", "log": "info//"}


def test_what_the_user_did_before_the_panels_came_is_in_the_address(modules: Screen) -> None:
    """A part is left out of it as long as it says what a new page says, not what it said when it was registered."""
    modules.ask("""async () => {
      const { Layout } = await import('/page/js/layout.js'), layout = new Layout();
      layout.register('camera', { get: () => '1,2,30,0', set() {} }, '0,0,0,0');
      layout.register('theme', { get: () => 'auto', set() {} });
      layout.changed();
    }""")
    modules.wait("location.hash === '#camera=1,2,30,0'")


def test_the_banner_names_what_is_stopped_and_what_is_not_held(modules: Screen) -> None:
    """All robots, or some by name; a real base without a robot process is named as one that nothing holds."""
    texts = modules.ask(
        """async () => {
          const {stoppedText} = await import('/page/js/panels/stopped.js');
          const robot = (name, stopped, unheld = false) => ({name, stopped, unheld, present: true});
          return [
            [robot('robot_0', false)],
            [robot('robot_0', true), robot('robot_1', true)],
            [robot('robot_0', true), robot('robot_1', false)],
            [robot('robot_0', true), robot('robot_3', false, true)],
          ].map(stoppedText);
        }"""
    )
    assert texts == [
        "",
        "All robots stand, whatever drives them.",
        "robot_0 stands, whatever drives it.",
        "robot_0 stands, whatever drives it. Not held: robot_3, a base without a robot process.",
    ]


WHY = """async ([tool, selected, refused, mayCommand]) => {
  const {whyNoTool} = await import('/page/js/rights.js');
  const robots = [{id: 0, name: 'robot_0', takes_goals: false}, {id: 1, name: 'robot_1', takes_goals: true}];
  const store = {connection: {state: 'open', mayCommand}, team: {robots, refused}, selection: new Set(selected)};
  return whyNoTool({store: {...store, robots: new Map(robots.map((robot) => [robot.id, robot]))}}, tool);
}"""


def test_a_tool_that_cannot_work_says_why(modules: Screen) -> None:
    """Nothing takes goals for the selected robots, the certificate lacks a grant, or the page only watches."""
    cases: list[tuple[tuple[str, list[int], list[str], bool], str]] = [
        (("goal", [0], [], True), "nothing takes goals for robot_0"),
        (("goal", [0, 1], [], True), ""),
        (("goal", [], [], True), ""),
        (("goal", [1], ["goals"], True), "the grant goals"),
        (("pose", [0], ["goals"], True), "the grant goals"),
        (("drive", [0], ["goals"], True), ""),
        (("drive", [0], ["teleop"], True), "the grant teleop"),
        (("measure", [0], ["goals", "teleop"], False), ""),
        (("move", [0], [], False), "watching only"),
    ]
    for arguments, reason in cases:
        said = modules.ask(WHY, list(arguments))
        assert reason in said and bool(reason) == bool(said), arguments


def test_what_a_robot_does_reads_well_after_a_turn_of_the_line(modules: Screen) -> None:
    """A leader that follows now, and a follower that leads, say so; a world that stands is the state of its robots."""
    does = """async ([behavior, leader, driver]) => {
      const {behaviorOf} = await import('/page/js/panels/team.js');
      return behaviorOf({behavior, leader, driver});
    }"""
    shown = [
        (["wander", -1, "behavior"], "wander"),
        (["wander", 1, "behavior"], "wander, follows robot_1"),
        (["follow", 0, "behavior"], "follow robot_0"),
        (["follow", -1, "behavior"], "follow, leads"),
        (["idle", -1, "navigation"], "navigation"),
    ]
    assert [modules.ask(does, arguments) for arguments, _ in shown] == [text for _, text in shown]
    state = """async ([state, stopped, world]) => {
      const {stateOf} = await import('/page/js/panels/team.js');
      return stateOf({state, stopped}, {sim: {state: world}});
    }"""
    states = [
        (["running", False, "running"], "running"),
        (["running", False, "paused"], "paused"),
        (["running", False, "gone"], "no world"),
        (["running", False, ""], "running"),
        (["lost", False, "paused"], "lost"),
        (["running", True, "paused"], "held"),
    ]
    assert [modules.ask(state, arguments) for arguments, _ in states] == [text for _, text in states]


def test_a_robots_log_has_the_lines_of_its_navigation_that_mean_it(modules: Screen) -> None:
    """One process may navigate for all robots."""
    about = """async ([process, text]) => {
      const {isAbout} = await import('/page/js/panels/inspector.js');
      return isAbout({process, text}, 1);
    }"""
    lines = [
        (["robot_1", "ready"], True),
        (["robot_10", "ready"], False),
        (["nav_0", "robot_1: driving"], True),
        (["nav_0", "robot_10: driving"], False),
        (["nav_1", "robot_0: driving"], False),
        (["nav_1", "ready"], True),
    ]
    assert [modules.ask(about, line) for line, _ in lines] == [expected for _, expected in lines]


def test_curves_have_the_colours_of_their_robots(modules: Screen) -> None:
    """A further one of the same robot in a chart has other dashes, one of no robot the colour of text."""
    looks = modules.ask(
        """async (topics) => {
          const {looksOf} = await import('/page/js/panels/plots.js');
          const {robotColor} = await import('/page/js/robot_colors.js');
          const found = looksOf(topics.map((topic) => ({topic})));
          return found.map(({color, dash}) => [[0, 1].find((id) => robotColor(id) === color) ?? -1, dash.join()]);
        }""",
        ["robot_0/odom", "robot_1/odom", "robot_0/odom", "clock"],
    )
    assert [owner for owner, _ in looks] == [0, 1, 0, -1]
    assert looks[0][1] == looks[1][1] == looks[3][1] == ""
    assert looks[2][1] != ""


def test_a_line_of_a_log_that_comes_now_has_the_simulated_time(modules: Screen) -> None:
    """As the tool bar and the plots have it; of older lines, and without a simulator, only the host's is known."""
    stamps = modules.ask(
        """async () => {
          const {Store} = await import('/page/js/store.js'), now = Date.now() / 1000, found = [];
          for (const state of ['running', 'paused', '']) {
            const store = new Store();
            store.team = {sim: {present: state !== '', state, rtf: 2}};
            const value = [1, 600].map((ago) => ({time: now - ago, process: 'sim', level: 'info', text: ''}));
            const blocks = [{type: 'doc', name: 'log', value}];
            store.takeFrame({number: 1, tick: 1, stamp: 50, age: -1, blocks}, 0);
            found.push(store.log.map(({stamp}) => stamp === undefined ? null : Math.round(stamp)));
          }
          return found;
        }"""
    )
    assert stamps == [[48, None], [50, None], [None, None]]
