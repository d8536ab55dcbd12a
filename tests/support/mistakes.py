"""Mistakes of new users: what they type, and what the answer must name."""

from typing import NamedTuple

_TEAM = '[team]\nworld = "arena"\n[[robots]]\nid = 0\n'
_BEHAVIOR = "from zteam import Behavior\nfrom zteam.messages import Twist, Vector3\nclass Mine(Behavior):\n    "
_NODE = (
    "import os, zteam\nfrom zteam.messages import LaserScan, Twist\ndef main(node):\n    BODY\n"
    "zteam.run(f'mine_{os.getpid()}', main)\n"
)
_WALL = (
    "define seeing position( ranger( sensor( samples 181 fov 180 range [0 8] ) ) )\n"
    'model( name "wall" size [0.2 9 1] pose [1 0 0 0] )\n'
)


class Mistake(NamedTuple):
    """One command, its exit code, and texts that its answer holds: the cause, and the way out."""

    command: str
    told: tuple[str, ...]
    exit_code: int = 2
    file: tuple[str, str] = ("", "")
    """Name and text of a file that lies in the user's folder."""
    lines: int = 1
    """Lines of the answer at most, without those of a log that only tell what goes on."""
    is_link: bool = False
    """Whether the file is a symbolic link to its text."""

    @property
    def label(self) -> str:
        """A name for it."""
        return f"{self.command} {self.file[1]!r}"[:90] if self.file[1] else self.command[:90]


def _team(command: str, text: str, *told: str) -> Mistake:
    return Mistake(command, told, file=("team.toml", text))


def _robot(line: str, *told: str) -> Mistake:
    return _team("zteam up team.toml", f"{_TEAM}{line}\n", *told)


def _world(text: str, *told: str) -> Mistake:
    return Mistake("zteam world check my.world", told, file=("my.world", text))


def _behavior(number: int, body: str, *told: str) -> Mistake:
    """Robot `number` runs a behaviour of this body; a traceback of it is the user's own."""
    command = f"zteam-robot --id {number} --behavior mine:Mine --no-gate"
    return Mistake(command, told, 1, ("mine.py", _BEHAVIOR + body + "\n"), 10)


def _node(body: str, *told: str, exit_code: int = 1, lines: int = 1) -> Mistake:
    return Mistake("python mine.py", told, exit_code, ("mine.py", _NODE.replace("BODY", body)), lines)


ALONE = (
    # The command line.
    Mistake("zteam", ("usage: zteam COMMAND",), lines=24),
    Mistake("zteam ups", ("no command 'ups'", "did you mean up?")),
    Mistake("zteam rostopic echo map", ("did you mean 'zteam topic echo map'?",)),
    Mistake("zteam --connect tcp/localhost:7447 topic list", ("behind the command",)),
    Mistake("zteam topic", ("zteam topic", "usage:")),
    Mistake(
        "zteam-nav --id 0 --param controller_server.FollowPath.plugin=dwb",
        ("controller_server.FollowPath.plugin: there is no controller 'dwb'", "regulated_pure_pursuit"),
    ),
    Mistake("zteam topic ecko map", ("'ecko'", "did you mean echo?")),
    Mistake("zteam topic pub robot_0/cmd_vel", ("TYPE", "usage: zteam topic pub")),
    Mistake("zteam topic pub robot_0/cmd_vel Twist linear: {x: 0.5}", ("neither JSON nor YAML", "single quotes")),
    Mistake("zteam topic echo robot_0//odom", ("'robot_0//odom'", "write 'robot_0/odom'")),
    Mistake("zteam bench sm", ("'sm'", "did you mean sim?")),
    Mistake("zteam topic list --connect 127.0.0.1:7447", ("give PROTOCOL/ADDRESS", "tcp/127.0.0.1:7447")),
    Mistake("zteam topic list --config no.json5", ("--config no.json5: no such file",)),
    Mistake("zteam up --robots 4", ("no option '--robots'", "[[robots]]")),
    Mistake("zteam up chain --followers=1-3", ("no option '--followers'", "has no dashes: followers=1-3")),
    Mistake("zteam up speed=0.3", ("name the team before its arguments", "zteam up line speed=0.3")),
    Mistake("zteam up chain sped=0.3", ("no argument sped", "did you mean speed?", "it takes speed, followers")),
    Mistake("zteam up chain speed=fast", ("chain.toml:19: robots[0].speed:", 'a number is expected, not "fast"')),
    Mistake("zteam up --for abc", ("--for", "'abc'", "simulated seconds")),
    Mistake("zteam sim move 0 1 1 90", ("YAW 90", "radians", "1.5708")),
    Mistake("zteam sim move robot_0 1 1 0", ("'robot_0'", "give 0")),
    Mistake("zteam sim unpause", ("did you mean resume?",)),
    Mistake("zteam tf static 0 0 0 180 0 0 map camera", ("YAW 180", "radians")),
    Mistake("zteam tf static 0 0 0 0 0 0 map map", ("both 'map'", "two frames")),
    # Team files.
    Mistake("zteam up missing.toml", ("no such file", "(arena, ", "line, ")),
    _team("zteam up team.toml", "[team\n", "team.toml:1:6: not TOML"),
    _team(
        "zteam up team.toml",
        '[team]\nworld = "offce"\n[[robots]]\nid = 0\n',
        "team.toml:2: team.world",
        "a shipped world (arena, ",
    ),
    _team(
        "zteam up team.toml", _TEAM.replace("[[robots]]", "[[robot]]"), "team.toml:3: robot:", "did you mean robots?"
    ),
    _robot('behaviour = "wander"', "team.toml:5: robots[0].behaviour: unknown key", "did you mean behavior?"),
    _robot('behavior = "wandr"', "team.toml:5:", "no behaviour 'wandr'", "did you mean wander?"),
    _robot('behavior = "mine:Robot"', "team.toml:5:", "No module named 'mine'", "beside the team file"),
    _robot('behavior = "follow"', "team.toml:5:", "say follow = ID"),
    _robot("sped = 0.2", "team.toml:5: robots[0].sped: unknown key", "did you mean speed?"),
    _robot('speed = "fast"', "team.toml:5: robots[0].speed:", 'a number is expected, not "fast"'),
    _robot("leader = 1", "team.toml:5: robots[0].leader:", "follow = ID"),
    _robot('follow = "robot_0"', "team.toml:5: robots[0].follow:", 'a robot id or "previous" is expected'),
    _robot("follow = 8", "team.toml:5: robots[0].follow:", "no robot 8 in this team (it has 0)"),
    _robot("follow = 0", "team.toml:5: robots[0].follow:", "cannot follow itself"),
    _robot(
        '[[nodes]]\nname = "a"\ncommand = ["python", "no.py"]', "team.toml:7: nodes[0].command[1]:", "no file 'no.py'"
    ),
    _robot('[[nodes]]\nname = "sim"\ncommand = ["true"]', "team.toml:6: nodes[0].name: sim is a process of the team"),
    *(
        _robot(f'[[nodes]]\nname = "{name}"\ncommand = ["true"]', f"{name} is a process of the team", "another name")
        for name in ("map", "nav_0", "view")
    ),
    _robot('[[nodes]]\nname = "a"\ncommand = "true"', "team.toml:7: nodes[0].command: a list is expected"),
    _robot('restart = "always"', "team.toml:5: robots[0].restart:", "one of no, on-failure"),
    Mistake(
        "zteam up team.toml --in-process --for 1",
        ("team.toml:7: nodes[0].command: a node is a process", "say --bus too, or leave --in-process out"),
        file=("team.toml", f'{_TEAM}[[nodes]]\nname = "a"\ncommand = ["true"]\n'),
    ),
    _robot("[[robots]]\nid = 0", "team.toml:6: robots[1].id: robot 0 is robots[0] already", "its own id"),
    _robot("[[robots]]\nid = 5", "team.toml:6:", "the world has no robot 5 (it has 0, 1)", "model and pose add one"),
    _robot('[[robots]]\nid = 5\nmodel = "erratic"\npose = [1, 2, 90]', "team.toml:8:", "radians", "1.5708"),
    Mistake("zteam up --report no/such/run.json --for 1", ("--report no/such/run.json", "name another file")),
    Mistake("zteam up my.world", ("that is a world", "--world my.world"), file=("my.world", 'position( name "r0" )\n')),
    Mistake("zteam up a.toml", ("a.toml", "symbolic link", "Too many levels"), file=("a.toml", "a.toml"), is_link=True),
    Mistake(
        "zteam up dazzle --world my.world --for 3",
        ("robots[0].behavior: avoid needs base_scan, but robot 0 carries no laser", "add one to 'r0'", "my.world"),
        file=("my.world", 'position( name "r0" )\nposition( name "r1" pose [3 0 0 0] )\n'),
        lines=2,
    ),
    Mistake(
        "zteam up arena --world my.world --for 3",
        ("robots[0].id: at its pose in my.world robot 0 would stand in 'wall'; give 'r0' a free pose there",),
        file=("my.world", f'{_WALL}seeing( name "r0" pose [1 0 0 0] )\nseeing( name "r1" pose [3 0 0 0] )\n'),
    ),
    # World files.
    Mistake("zteam-sim", ("WORLD", "usage: zteam-sim")),
    Mistake("zteam-sim arena --gui", ("no option '--gui'", "zteam world show")),
    Mistake("zteam-sim no.world", ("no such file", "(arena, ", "office")),
    Mistake("zteam-sim my.world", ("my.world:1:9: this '(' is never closed",), file=("my.world", "position( \n")),
    Mistake(
        "zteam world check my.world",
        ("robot 0 ('r0') has no room at its pose: it would stand in 'wall'", "1 warning"),
        0,
        ("my.world", f'{_WALL}seeing( name "r0" pose [1 0 0 0] )\n'),
        lines=7,
    ),
    _world('floorplan( bitmap "x.png" )\n', "my.world:1:1: unknown model type 'floorplan'", "'include'"),
    _world('model( bitmap "nothere.png" )\n', "my.world:1", "nothere.png", "not found"),
    _world("model( bitmap cave.png )\n", "my.world:1:15:", "quotes"),
    _world("position( pose [1 2 0] )\n", "my.world:1:11: pose takes 4 numbers, not 3"),
    # Single processes and behaviours.
    Mistake("zteam-robot", ("--id",)),
    Mistake("zteam-robot --id -1", ("--id", "0 to 9999")),
    Mistake("zteam-robot --id 1 --follow 1", ("cannot follow itself",)),
    Mistake("zteam-robot --id 1 --behavior follow", ("leader is missing", "--follow")),
    Mistake("zteam-robot --id 1 --speed 0.2", ("no option '--speed'", "--param speed=VALUE")),
    Mistake("zteam-robot --id 1 --param speed 0.2", ("'speed' is not KEY=VALUE", "--param speed=0.4")),
    Mistake("zteam-robot --id 1 --param speed=fast", ('speed: a number is expected, not "fast"',)),
    Mistake("zteam-robot --id 1 --behavior mine.py:Mine", ("did you mean mine:Mine?",)),
    Mistake(
        "zteam-robot --id 1 --behavior mine:Mine",
        ("its step must take the view", "def step(self, view)"),
        file=("mine.py", _BEHAVIOR + "def step(self): return Twist()\n"),
    ),
    Mistake(
        "zteam-robot --id 1 --behavior mine:Mine",
        ("mine.py:1:", "No module named 'geometry_msgs'", "zteam.messages"),
        file=("mine.py", "from geometry_msgs.msg import Twist\n"),
    ),
    Mistake("zteam-monitor --ids 3-1", ("--ids", "3-1", "the first id is above the last")),
    Mistake("zteam behaviors wandr", ("'wandr'", "did you mean wander?")),
    Mistake("python mine.py", ("run(name, body) takes",), 2, ("mine.py", "import zteam\nzteam.run(print, 'mine')\n")),
    # Nothing runs.
    Mistake("zteam topic list", ("no Zenoh router answers at tcp/127.0.0.1:9", "zteam-router --listen"), exit_code=1),
)
"""Mistakes that need no team. The router's address leads nowhere."""

BESIDE_A_TEAM = (
    Mistake("zteam topic echo robot0/odom --once --timeout 1", ("did you mean robot_0/odom",), 1),
    Mistake("zteam topic echo robot_0/scan --once --timeout 1", ("did you mean robot_0/base_scan",), 1),
    Mistake("zteam topic echo robot_*/odom --once", ("robot_$*/odom",)),
    Mistake("zteam topic echo map --type Odometry --once", ("map carries nav_msgs/msg/OccupancyGrid", "--type")),
    Mistake("zteam topic pub robot_0/cmd_vel Twst {}", ("no message type 'Twst'", "did you mean Twist")),
    Mistake("zteam topic pub robot_0/cmd_vel LaserScan {} --once", ("robot_0/cmd_vel", "geometry_msgs/msg/Twist")),
    Mistake("zteam topic pub robot_0/cmd_vel Twist '{linear: {q: 1}}'", ("no field 'q'", "x, y, z")),
    Mistake("zteam topic pub robot_0/cmd_vel Twist {} --once", ("is published by robot_0 too", "end one"), 0, lines=2),
    Mistake(
        "zteam topic pub robot_8/cmd_vel Twist {} --once",
        ("no process publishes anything of robot_8", "robots: 0"),
        0,
        lines=2,
    ),
    Mistake("zteam tf echo map base_link --once --timeout 1", ("'base_link'", "did you mean robot_0/base_link"), 1),
    Mistake("zteam tf echo map robot_9/base_link --once --timeout 1", ("robot_9/base_link", "did you mean robot_"), 1),
    Mistake(
        "zteam tf static 1 0 0 0 0 0 robot_0/odom robot_0/base_footprint", ("robot_0/base_footprint", "already"), 1
    ),
    Mistake("zteam sim move 0 1000 1000 0", ("outside of the world", "force it"), 1),
    Mistake("zteam sim remove 42", ("no robot 42", "it has"), 1),
    Mistake("zteam sim spawn --pose 0 0 0 --model nomodel", ("nomodel", "erratic"), 1),
    Mistake("zteam sim speed -3", ("'-3'", "or max")),
    Mistake("zteam param set robot_0 sped 0.5", ("sped", "did you mean speed?")),
    Mistake("zteam param set robot_0 speed fast", ('a number is expected, not "fast"',)),
    Mistake("zteam param get robot_7 speed", ("robot_7", "there is robot_0, robot_1"), 1),
    Mistake("zteam goto 9 1 1", ("robot_9 is not in the world", "it has 0", "zteam sim spawn"), 1),
    Mistake("zteam goto --cancel 9", ("robot_9 is not in the world", "it has 0"), 1),
    Mistake("zteam log robot_9 --once", ("no process robot_9", "robot_0"), 1),
    Mistake("zteam-robot --id 0", ("robot_0 is taken by process", "another id"), 1),
    Mistake("zteam-sim arena", ("sim is taken by process", "--namespace"), 1),
    Mistake("zteam topic echo map --once --timeout 1 --namespace other", ("nothing publishes map", "zteam doctor"), 1),
    Mistake("zteam sim pause --namespace other", ("no simulator", "--namespace"), 1),
    Mistake("zteam tf positions --namespace other", ("no aggregator", "zteam-tf"), 0),
    Mistake("zteam doctor --namespace other", ("no process is in the namespace", "--namespace test_"), 1, lines=99),
    _behavior(
        2, "def step(self, view): return Twist(Vector3(view.speed))", "mine.py", "line 4", "no attribute 'speed'"
    ),
    _behavior(3, "def step(self, view): Twist(Vector3(0.2))", "Mine.step returned None; return a Twist"),
    _behavior(4, "def step(self, view): return Twist(0.2)", "Mine.step returned", "Twist(Vector3(forward)"),
    _behavior(5, "def step(self, view): return Twist(Vector3('0.2'))", "Mine.step returned the speed '0.2'", "numbers"),
    _node("node.publisher('goal', str)", "str is no message type", "zteam.messages", exit_code=2),
    _node(
        "node.publisher('robot_0/cmd_vel', LaserScan)", "robot_0/cmd_vel carries geometry_msgs/msg/Twist", exit_code=2
    ),
    _node("p = node.publisher('x', Twist); node.run(lambda now: p.put(0.5))", "put was given a float", exit_code=2),
    _node("node.publisher('a b/*', Twist)", "'a b/*' is no key to publish on", "without spaces", exit_code=2),
    _node("node.publisher('goal', Twist)", "its main has returned without node.run(step)", exit_code=0),
    _node("node.run(lambda now: node.stop.request('over') or 'go')", "a str, which nothing takes", exit_code=0),
    _node(
        "import time; node.run(lambda now: time.sleep(2) or node.stop.request('over'))",
        *("step has not returned for 1.", "step takes 2.", "one is due every 0.1 s; do less in a step"),
        exit_code=0,
        lines=2,
    ),
    _node("node.run(lambda: None)", "mine.py", "line 4", "positional argument", lines=10),
)
"""Mistakes beside a running team of robots 0 and 1; robots 2 to 5 are in its world and have no process."""
