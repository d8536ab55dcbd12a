"""Mistakes of new users: what they type, and what the answer must name: the cause and the way out."""

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
    """One command, its exit code, and texts that its answer holds."""

    command: str
    told: tuple[str, ...]
    exit_code: int = 2
    file: tuple[str, str] = ("", "")
    """Name and text of a file that lies in the user's folder."""
    lines: int = 1
    """Lines of the answer at most, without those of a log that only tell what goes on."""

    @property
    def label(self) -> str:
        """A name for it."""
        return f"{self.command} {self.file[1]!r}"[:90] if self.file[1] else self.command[:90]


def _usage(command: str, *told: str) -> Mistake:
    """A command line that is refused before anything is opened: the answer ends with the help to see."""
    return Mistake(command, (*told, "; see 'zteam"))


def _refused(command: str, *told: str, code: int = 2) -> Mistake:
    return Mistake(command, told, code)


def _team(command: str, text: str, *told: str, lines: int = 1) -> Mistake:
    return Mistake(command, told, file=("team.toml", text), lines=lines)


def _robot(line: str, *told: str) -> Mistake:
    return _team("zteam up team.toml", f"{_TEAM}{line}\n", *told)


def _world(text: str, *told: str) -> Mistake:
    return Mistake("zteam world check my.world", told, file=("my.world", text))


def _module(text: str, *told: str) -> Mistake:
    return Mistake("zteam-robot --id 1 --behavior mine:Mine", told, file=("mine.py", text))


def _behavior(number: int, body: str, *told: str) -> Mistake:
    """Robot `number` runs a behaviour of this body; a traceback of it is the user's own."""
    command = f"zteam-robot --id {number} --behavior mine:Mine --no-gate"
    return Mistake(command, told, 1, ("mine.py", _BEHAVIOR + body + "\n"), 10)


def _node(body: str, *told: str, exit_code: int = 1, lines: int = 1) -> Mistake:
    return Mistake("python mine.py", told, exit_code, ("mine.py", _NODE.replace("BODY", body)), lines)


ALONE = (
    # Commands and options.
    Mistake("zteam", (), lines=0),
    _refused("zteam ups", "no command 'ups'", "did you mean up?"),
    _refused("zteam qqq", "no command 'qqq': commands: up, topic, "),
    _refused("zteam start arena", "did you mean 'zteam up arena'?"),
    _refused("zteam tf_echo map odom", "did you mean 'zteam tf echo map odom'?"),
    _refused("zteam shutdown", "did you mean 'zteam stop'?", "to end a team, press Ctrl+C"),
    _refused("zteam arena --for 3", "did you mean 'zteam up arena --for 3'?"),
    _team("zteam team.toml", _TEAM, "did you mean 'zteam up team.toml'?"),
    _refused("zteam --connect tcp/localhost:7447 topic list", "options stand behind the command"),
    _usage("zteam topic", "required: list|echo|hz|info|pub"),
    _usage("zteam topic ecko map", "no subcommand 'ecko': did you mean echo?"),
    _usage("zteam sim unpause", "no subcommand 'unpause': did you mean resume?"),
    _usage("zteam bench sm", "'sm': did you mean sim?"),
    _usage("zteam world show arena --otput=x", "required: -o/--output"),
    _usage("zteam tf static 1 --pos", "zteam tf static: no option '--pos'; see 'zteam tf static --help'"),
    _usage("zteam node list --jsn", "zteam node list: no option '--jsn': did you mean --json?; see"),
    _usage("zteam node list all", "'all' is too much"),
    _usage("zteam sim speed", "required: X|max; see 'zteam sim speed --help'"),
    _usage("zteam topic pub robot_0/cmd_vel", "required: TYPE; see"),
    _usage("zteam sim spawn", "required: --pose; see"),
    _usage("zteam up --for", "zteam up: --for: expected one argument; see"),
    _refused("zteam topic list --connect 127.0.0.1:7447", "give PROTOCOL/ADDRESS, such as tcp/127.0.0.1:7447"),
    _refused("zteam topic list --connect tcp/127.0.0.1:99999", "port '99999': give a port from 0 to 65535"),
    _refused("zteam-router --listen tcp/127.0.0.1:²", "port '²': give a port from 0 to 65535"),
    _refused("zteam topic list --connect tcp/127.0.0.1:9 --config no.json5", "--config no.json5: no such file"),
    _refused("zteam topic list --namespace a*", "--namespace 'a*': use letters, digits, '_', '-' and '/'"),
    # Topics, frames, maps and logs.
    _refused("zteam topic pub robot_0/cmd_vel Twist linear: {x: 0.5}", "neither JSON nor YAML", "single quotes"),
    _refused("zteam topic pub robot_$*/cmd_vel Twist", "is a wildcard: give one key"),
    _refused("zteam topic echo robot_0//odom", "'robot_0//odom'", "write 'robot_0/odom'"),
    _usage("zteam topic pub a Bool -1 -t 2", "--times: not allowed with argument -1/--once"),
    _usage("zteam log robot_0/odom", "'robot_0/odom' is not the name of a process, such as robot_1, sim or "),
    _refused("zteam tf static 1 2", "give X Y Z YAW PITCH ROLL PARENT CHILD, e.g. 0.1 0 0.2 0 0 0 "),
    _refused("zteam tf static a b 0 0 0 0 map cam", "give X Y Z YAW PITCH ROLL PARENT CHILD", "'a': give numbers from"),
    _refused("zteam tf static 1e308 0 0 0 0 0 map table", "give X Y Z YAW PITCH ROLL PARENT CHILD"),
    _refused("zteam tf static 0 0 0 180 0 0 map camera", "yaw: 180 is more than a full turn", "180 degrees are 3.1416"),
    _refused("zteam tf static 0 0 0 0 -90 0 map camera", "pitch: -90 is more than a full turn"),
    _refused("zteam tf static 0 0 0 2 2 0 5 map camera", "qw: the quaternion has the length 5.74; it must be 1"),
    _refused("zteam tf static 0 0 0 0 0 0 map /map", "child: must be the name of another frame than parent"),
    _usage("zteam tf tree -o x.gif", "zteam tf tree: --output x.gif: name a .svg, .png, .pdf or .dot file"),
    _usage("zteam map save x --free 0.7", "--free 0.7, --occupied 0.65: the first is to be below the second"),
    _usage("zteam map save x --mode scale --fmt pgm", "leave --fmt pgm out"),
    # The simulator, goals, parameters, faults, certificates.
    _usage("zteam sim step 0", "give a number of ticks from 1 to"),
    _usage("zteam sim speed fast", "speed 'fast': give simulated seconds a second from 1e-06 to 1e+06, or max"),
    _usage("zteam sim move 0 1e308 2 0", "pose '1e308 2 0': give X Y YAW in metres and radians from -1e+08 to 1e+08"),
    _usage("zteam sim spawn --pose 0 nan 0", "pose '0 nan 0': give X Y YAW"),
    _usage("zteam sim move 0 1 1 90", "YAW 90 is more than a full turn", "90 degrees are 1.5708"),
    _usage("zteam sim move robot_3 1 1 0", "robot id 'robot_3' is not a whole number from 0 to 9999; give 3"),
    _usage("zteam sim spawn --id 10000 --pose 0 0 0", "robot id '10000' is not"),
    _usage("zteam sim remove robot_0", "remove: 'robot_0': give robot ids from 0 to 9999"),
    _usage("zteam sim remove 3-1", "remove: '3-1': the first id is above the last"),
    _usage("zteam goto", "required: ID; see"),
    _usage("zteam goto 1 2", "give X Y, or X Y YAW, in the map"),
    _usage("zteam goto 1 2 3 4 5", "give X Y, or X Y YAW, in the map"),
    _usage("zteam goto robot_1 2 3", "robot id 'robot_1' is not a whole number from 0 to 9999; give 1"),
    _usage("zteam goto 1 2 3 90", "YAW 90 is more than a full turn"),
    _usage("zteam goto --cancel 1 2 3", "--cancel takes a robot and nothing else: zteam goto --cancel 1"),
    _usage("zteam goto --cancel 1 --no-wait", "--cancel takes a robot and nothing else"),
    _usage("zteam goals", "one of the arguments FILE --pause --resume is required"),
    _usage("zteam goals f.yaml --pause", "--pause: not allowed with argument FILE"),
    _usage("zteam goals f.yaml --spread a", "--spread: 'a': give robot ids"),
    _usage("zteam goals --pause x", "--pause: 'x': give robot ids"),
    _usage("zteam goals f.yaml --rounds 0", "--rounds: '0': give rounds from 1"),
    _usage("zteam goals f.yaml --name a/b", "--name 'a/b': use letters, digits and '_'"),
    Mistake("zteam goals g.yaml", ("goals: g.yaml:1: the key y is missing",), file=("g.yaml", "- {robot: 0, x: 1}\n")),
    _usage("zteam teleop --script i", "required: --id"),
    _usage("zteam teleop --id 0", "standard input and output are no terminal: give the keys with --script"),
    _usage("zteam teleop --id 0,0 --script i", "--id names a robot twice: 0"),
    _usage("zteam teleop --id 0 --script i*0", "--script: 'i*0'"),
    _usage("zteam teleop --id 0 --speed 0 --script i", "--speed: '0': give a speed from 0.01 to 10"),
    _usage("zteam param set 0 speed", "set 'speed': give each parameter a value, e.g. speed 0.3 turn_rate 1.0"),
    _usage("zteam param set 0 speed 0.1 speed 0.2", "set speed: it is given twice"),
    _usage("zteam param set 0 speed -inf", "set speed -inf: give a finite number"),
    _usage("zteam chaos", "one of the arguments kill|pause|cut|slow --plan --random is required"),
    _usage("zteam chaos pause robot_1 --random 3", "--random: not allowed with argument kill|pause|cut|slow"),
    _usage("zteam chaos freeze robot_1", "freeze: say kill, pause, cut, slow and a process"),
    _usage("zteam chaos pause", "pause: say kill, pause, cut, slow and a process"),
    _usage("zteam chaos pause robot_1 --delay 1", "--delay and --rate belong to slow"),
    _usage("zteam chaos --plan plan.toml --for 3", "--plan: the plan says how long each fault lasts: leave --for out"),
    _usage("zteam chaos --random 3", "--random needs --for"),
    _usage("zteam chaos kill tf --print", "--print needs --random"),
    _usage("zteam chaos pause robot_1 --for 0", "give seconds from 0.001"),
    _usage("zteam chaos slow robot_1 --rate 0", "give bytes a second from 1"),
    _refused(
        "zteam certs list", "zteam certs: certs: there are no certificates: make them with 'zteam certs init'", code=1
    ),
    _refused("zteam certs revoke robot_1 --folder x", "'zteam certs init --folder x'", code=1),
    _refused("zteam certs renew router robot_1 --host b", "--host b: only the certificate router has hosts: name it a"),
    _usage("zteam bench team --realtime --in-process", "--in-process: not allowed with argument --realtime"),
    # Teams.
    _refused("zteam up missing.toml", "No such file or directory, nor a shipped team (arena, ", "line, "),
    _refused("zteam up aren", "did you mean arena?"),
    _refused("zteam up office", "that is a world; say 'zteam up --world office' or 'zteam-sim office'"),
    _refused("zteam up willow", "--world"),
    _refused("zteam up .", "that is a folder; name the team file in it (*.toml)"),
    _refused(
        "zteam up arena --world ofice",
        "'ofice': No such file or directory, nor a shipped world (",
        "did you mean",
    ),
    _refused("zteam up arena --world .", "that is a folder; name the world file in it (*.world)"),
    _team("zteam up line --world team.toml", _TEAM, "that is a team; say 'zteam up team.toml'"),
    _usage("zteam up --robots 4", "no option '--robots'"),
    _usage("zteam up chain --followers=1-3", "no option '--followers'", "has no dashes: followers=1-3"),
    _usage("zteam up chain --count 3", "no option '--count'", "has no dashes: count=3"),
    _usage("zteam up line arena", "zteam up: 'arena' is not NAME=VALUE, such as leader=2"),
    _refused("zteam up chain sped=0.3", "no argument sped", "did you mean speed?", "it takes speed, followers"),
    _refused("zteam up chain speed=fast", "chain.toml:19: robots[0].speed:", 'a number is expected, not "fast"'),
    _usage("zteam up --for abc", "--for", "'abc'", "simulated seconds"),
    _usage("zteam up --speed inf", "speed 'inf': give simulated seconds a second from 1e-06 to 1e+06, or max"),
    _usage("zteam up --expect planner", "--expect needs --lockstep"),
    _usage("zteam up speed=0.3", "name the team before its arguments, as in 'zteam up line speed=0.3'"),
    _usage("zteam up --report x.json", "--report needs --for or --until"),
    _usage("zteam up --bus", "--bus needs --in-process"),
    _usage("zteam up --no-browser", "--no-browser needs --view"),
    _usage("zteam up --only robot_1 --connect tls/a:1 --secure", "--only: leave --secure out"),
    _usage("zteam up --only robot_1", "--only needs --connect"),
    _usage("zteam up --listen tcp/127.0.0.1:0 --in-process", "--listen: leave --in-process out"),
    _usage("zteam up --listen 7447", "give PROTOCOL/ADDRESS"),
    _usage("zteam up --secure --in-process", "--secure: leave --in-process out"),
    _usage("zteam up --secure --connect tcp/127.0.0.1:7447", "with --secure the router is at tls/HOST:PORT"),
    _usage("zteam up --secure arena", "say 'zteam up arena --secure'"),
    _usage("zteam up --lockstep --expect planner --in-process", "--expect and --connect need processes, or --bus"),
    _usage("zteam up --in-process --connect tcp/10.0.0.1:7447", "--expect and --connect need processes, or --bus"),
    _refused("zteam up --report no/r.json --for 1", "--report no/r.json: cannot write: "),
    _refused("zteam up --report . --for 1", "--report .: cannot write: "),
    _refused("zteam up --report /proc/r.json --for 1", "--report /proc/r.json: cannot write: "),
    _team("zteam up team.toml --for 3", _TEAM.replace("arena", "none"), "has no simulator: leave --for"),
    _team("zteam up team.toml", "[team\n", "team.toml:1:6: not TOML"),
    _team("zteam up team.toml", _TEAM.replace('"', ""), "team.toml:2:9: not TOML: Invalid value; text needs quotes"),
    *(
        _team("zteam up team.toml", text, "team.toml:2: not TOML: the text that begins here has no closing quote")
        for text in (
            _TEAM.replace('arena"', "arena"),
            _TEAM.replace('"arena"', "'arena"),
            _TEAM.replace('"arena"', '"""arena'),
            _TEAM.replace('"arena"', '["arena, "office"]'),
            '[team]\nworld = "arena',
        )
    ),
    _team("zteam up team.toml", _TEAM.replace(" =", ":"), "team.toml:2:6: not TOML: ", "write key = value"),
    Mistake("zteam up a.launch", ("a launch file of ROS, not a team file",), file=("a.launch", "<launch/>\n")),
    Mistake(
        "zteam up team.yaml",
        ("team.yaml: this is a YAML or JSON file, not a team file", "a team file is TOML"),
        file=("team.yaml", "{robots: 1}\n"),
    ),
    _team("zteam up team.toml", _TEAM.replace("arena", "~/no.world"), "team.world: world '/", "/no.world'"),
    _refused("zteam up ~/no.toml", "team '/", "/no.toml'"),
    _usage("zteam up --speed fast", "speed 'fast'"),
    _team(
        "zteam up team.toml --speed 2",
        _TEAM.replace("arena", "${world:-arena}") + 'sped = 1\nspeed = "${speed:-0.3}"',
        *("the team's argument of this name has no dashes: speed=2", "unknown key"),
        lines=2,
    ),
    _team(
        "zteam up team.toml --lease 3",
        _TEAM + 'speed = "${lease:-0.3}"\nx = "${timeout:-1}"',
        *("the team's argument of this name has no dashes: lease=3", "unknown key"),
        lines=2,
    ),
    _team("zteam up team.toml", _TEAM.replace("arena", "offce"), "world 'offce': No such file", "did you mean office?"),
    _team("zteam up team.toml", _TEAM.replace("world", "worlds"), "team.toml:2: team.worlds: unknown key", "world?"),
    _team("zteam up team.toml", _TEAM.replace("[[robots", "[[robot"), "team.toml:3: robot:", "did you mean robots?"),
    _team("zteam up team.toml", "", "the key robots is missing", "team: the key world is missing", lines=2),
    _robot('behaviour = "wander"', "team.toml:5: robots[0].behaviour: unknown key", "did you mean behavior?"),
    # One process imports what both name.
    _team(
        "zteam up team.toml",
        f'{_TEAM}behavior = "wandr"\n[[robots]]\nid = 1\nbehavior = "mine:Robot"\n',
        *("team.toml:5: robots[0].behavior: no behaviour 'wandr'", "did you mean wander?"),
        *("team.toml:8: robots[1].behavior:", "No module named 'mine'", "beside the team file"),
        lines=2,
    ),
    _robot('behavior = "follow"', "team.toml:5:", "say follow = ID"),
    _robot("sped = 0.2", "team.toml:5: robots[0].sped: unknown key", "did you mean speed?"),
    _robot('speed = "fast"', "team.toml:5: robots[0].speed:", 'a number is expected, not "fast"'),
    _robot("leader = 1", "team.toml:5: robots[0].leader:", "follow = ID"),
    _robot('follow = "robot_0"', 'team.toml:5: robots[0].follow: a robot id or "previous" is expected'),
    _robot("[robots.base]\n[[robots]]\nid = true", "team.toml:7: robots[1].id: a whole number is expected, not true"),
    _team("zteam up team.toml", _TEAM.replace("[[robots]]", "[robots]"), "with two brackets, as in [[robots]]"),
    _robot("[nodes]", "team.toml:5: nodes: a list of tables is expected, written with two brackets, as in [[nodes]]"),
    _team("zteam up team.toml", f'include = ["chian"]\n{_TEAM}', "include[0]: team 'chian': No such file", "chain?"),
    _robot("follow = 8", "team.toml:5: robots[0].follow:", "no robot 8 in this team (it has 0)"),
    _robot("follow = 0", "team.toml:5: robots[0].follow:", "cannot follow itself"),
    _robot("follow = 1\n[[robots]]\nid = 1\nfollow = 0", "team.toml:5: robots[0].follow:", "circle"),
    _robot('[[nodes]]\nname = "a"\ncommand = ["python", "no.py"]', "team.toml:7: nodes[0].command[1]: ", "'no.py'"),
    _robot('[[nodes]]\nname = "a"\ncommand = "true"', "team.toml:7: nodes[0].command: a list is expected"),
    *(
        _robot(f'[[nodes]]\nname = "{name}"\ncommand = ["true"]', f"{name} is a process of the team", "another name")
        for name in ("sim", "map", "nav_0", "view")
    ),
    _robot('restart = "always"', "team.toml:5: robots[0].restart:", "one of no, on-failure"),
    _robot("[[robots]]\nid = 0", "team.toml:6: robots[1].id: robot 0 is robots[0] already", "its own id"),
    _robot("[[robots]]\nid = 5", "team.toml:6:", "the world has no robot 5 (it has 0, 1)", "model and pose add one"),
    _robot('[[robots]]\nid = 5\nmodel = "erratic"\npose = [1, 2, 90]', "team.toml:8:", "radians", "1.5708"),
    _team(
        "zteam up team.toml --in-process --for 1",
        f'{_TEAM}[[nodes]]\nname = "a"\ncommand = ["true"]\n',
        "team.toml:7: nodes[0].command: a node is a process",
        "say --bus too, or leave --in-process out",
    ),
    # World files.
    _usage("zteam-sim", "required: WORLD; see"),
    _usage("zteam-sim arena --gui", "no option '--gui'"),
    _refused("zteam-sim no.world", "No such file", "(arena, ", "office"),
    _usage("zteam-sim arena --add 7:erratic:1:1", "is not ID:MODEL:X:Y:YAW, e.g. 7:erratic:2.0:3.5:1.57"),
    _refused("zteam-sim arena --add 7:erratic:nan:0:0", "'nan': give metres and radians from"),
    _usage("zteam-sim arena --no-gate", "--no-gate needs --lockstep"),
    _usage("zteam-sim arena --expect planner", "--expect needs --lockstep"),
    _usage("zteam-sim arena --gap 1", "--gap: '1' is not FOLLOWER:LEADER, e.g. 1:0"),
    _refused("zteam-sim arena --gaussian-noise 1e308", "gaussian_noise: a number of at most 1000"),
    _refused("zteam-sim arena --odom-alphas 0,0,0,nan", "odom_alphas[3]: a number of at least 0"),
    _refused("zteam-sim arena --odom-alphas 0,0,0", "--odom-alphas takes four numbers"),
    _refused("zteam-sim arena --dazzle-angle inf", "dazzle_angle: a number of at most 6.28"),
    Mistake("zteam-sim my.world", ("my.world:1:9: this '(' is never closed",), file=("my.world", "position( \n")),
    Mistake("zteam up my.world", ("that is a world", "--world my.world"), file=("my.world", 'position( name "r0" )\n')),
    Mistake(
        "zteam up arena --world lost.world",
        ("lost.world:1:9: included file 'nowhere.inc' not found in . or $STAGEPATH",),
        file=("lost.world", 'include "nowhere.inc"\n'),
    ),
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
    _world('floorplan( bitmap "x.png" )\n', "my.world:1:1: unknown model type 'floorplan'", "'include'"),
    _world('model( bitmap "nothere.png" )\n', "my.world:1", "nothere.png", "not found"),
    _world("model( bitmap cave.png )\n", "my.world:1:15:", "quotes"),
    _world("position( pose [1 2 0] )\n", "my.world:1:11: pose takes 4 numbers, not 3"),
    _refused("zteam world scan arena --robot 5", "arena has these robots: 0, 1"),
    _usage("zteam world scan arena --robot 0 --pose nan 0 0", "give metres and degrees from"),
    _refused("zteam world show arena -o x.gif", "x.gif"),
    # Single processes and behaviours.
    _usage("zteam-robot", "required: --id; see"),
    _usage("zteam-robot --id -1", "--id: robot id '-1' is not a whole number from 0 to 9999"),
    _usage("zteam-robot --id 1 --follow 1", "--follow 1: a robot cannot follow itself"),
    _usage("zteam-robot --id 1 --follow 0 --param leader=2", "--follow names the leader already"),
    _usage("zteam-robot --id 1 --behavior follow", "leader is missing", "--follow"),
    _usage("zteam-robot --id 1 --law direct", "--law needs --follow"),
    _usage("zteam-robot --id 1 --follow 0 --law trail --param law=direct", "leave --param law out"),
    _usage("zteam-robot --id 1 --speed 0.2", "no option '--speed'"),
    _usage("zteam-robot --id 1 --behaviour wander", "did you mean --behavior?"),
    _usage("zteam-robot --id 1 --param speed 0.2", "--param: 'speed' is not KEY=VALUE, e.g. --param speed=0.4"),
    _usage("zteam-robot --id 1 --base max=a", "--base max"),
    _refused("zteam-robot --id 1 --param speed=fast", 'speed: a number is expected, not "fast"'),
    _refused("zteam-robot --id 1 --behavior mine.py:Mine", "did you mean mine:Mine?"),
    *(
        Mistake(f"zteam check {name}{spec}", (f"did you mean {meant}",), file=(name, f"{_BEHAVIOR}pass\n"))
        for name, spec, meant in (
            ("mine.py", "", "mine:CLASS?"),
            ("sub/mine.py", "", "mine:CLASS, with the folder on the path (--path sub)?"),
            ("sub/mine.py", ":Mine", "mine:Mine, with the folder on the path (--path sub)?"),
        )
    ),
    *(
        Mistake(f"zteam check {name}:Mine", ("it hides your ", f"{name}.py: give"), file=(f"{name}.py", _BEHAVIOR))
        for name in ("random", "queue")
    ),
    _module(_BEHAVIOR + "def step(self): return Twist()\n", "its step must take the view", "def step(self, view)"),
    _module("from geometry_msgs.msg import Twist\n", "mine.py:1:", "No module named 'geometry_msgs'", "zteam.messages"),
    _usage("zteam-monitor --ids 3-1", "--ids: '3-1': the first id is above the last"),
    _usage("zteam-monitor --ids 0 00", "--ids names a robot twice"),
    _usage("zteam-monitor --ids 0 1 --team-size 3", "--team-size: not allowed with argument --ids"),
    _usage("zteam-monitor --team-size 10001", "--team-size: '10001': give a whole number from 1 to 10000"),
    _usage("zteam-monitor --in-world", "--in-world needs --ids"),
    _usage("zteam-nav", "--id"),
    _usage("zteam-nav --id x", "robot id 'x' is not a whole number"),
    _usage("zteam-nav --ids 1 1", "--ids names a robot twice: 1"),
    _refused("zteam-nav --id 0 --param alpha1", "--param 'alpha1' is not NODE.NAME=VALUE"),
    _refused("zteam-nav --id 0 --params x.yaml --param params.a=1", "--param 'params.a=1' is not NODE.NAME=VALUE"),
    _refused("zteam-nav --id 0 --params no.yaml", "no.yaml: cannot read this parameter file"),
    _refused("zteam-nav --id 0 --param amcl.alpha1=fast", 'amcl.alpha1: a number is expected, not "fast"'),
    _refused(
        "zteam-nav --id 0 --param controller_server.FollowPath.plugin=dwb",
        "controller_server.FollowPath.plugin: there is no controller 'dwb'",
        "regulated_pure_pursuit",
    ),
    _team("zteam-nav team.toml --ids 0 3", f"{_TEAM}navigation = true\n", "team.toml has no robot 3"),
    _usage("zteam view --port 70000", "--port"),
    _refused("zteam behaviors wandr", "no behaviour 'wandr' (did you mean wander?)"),
    _refused("zteam check wandr", "no behaviour 'wandr' (did you mean wander?)"),
    _refused("zteam check wander --param speed=9", "behaviour wander: speed: "),
    _refused("zteam check path", "behaviour path needs waypoints: give --param waypoints=VALUE"),
    _refused("zteam new behavior my-robot", "cannot be the name of a Python module; did you mean my_robot?"),
    _refused("zteam new behavior ../robot.py", "cannot be the name of a Python module"),
    _refused("zteam new node 2robots", "'2robots' cannot be the name of a Python module"),
    _refused("zteam new node class", "'class' cannot be the name of a Python module"),
    *(_refused(f"zteam new node {name}", f"{name!r} is a module", "would hide it") for name in ("random", "numpy")),
    _refused("zteam new node robot_0", "'robot_0' is the name of a process of every team; choose another one"),
    _refused("zteam new node monitor", "'monitor' is the name of a process of every team; choose another one"),
    _refused("zteam new behavior view", "'view': the example cannot name its class 'View'; choose another name"),
    _refused("zteam new behavior _", "'_': the example cannot name its class '_'; choose another name"),
    # Nothing runs.
    _refused("zteam topic list --connect tcp/127.0.0.1:9", "no Zenoh router answers at tcp/127.0.0.1:9", code=1),
)
"""Mistakes that need no team. The router's address leads nowhere."""

BESIDE_A_TEAM = (
    Mistake(
        "python mine.py",
        ("mine.py:2: zteam.run(name, body): write",),
        2,
        ("mine.py", "import zteam\nzteam.run(print, 'mine')\n"),
    ),
    Mistake("zteam topic echo robot0/odom --once --timeout 1", ("did you mean robot_0/odom",), 1),
    Mistake("zteam topic echo robot_0/scan --once --timeout 1", ("did you mean robot_0/base_scan",), 1),
    Mistake("zteam topic echo map --type Odometry --once", ("map carries nav_msgs/msg/OccupancyGrid", "--type")),
    Mistake("zteam topic pub robot_0/cmd_vel Twst {}", ("no message type 'Twst'", "did you mean Twist")),
    Mistake("zteam topic pub robot_0/cmd_vel Twist '{linear: {q: 1}}'", ("no field 'q'", "x, y, z")),
    Mistake("zteam tf echo map base_link --once --timeout 1", ("'base_link'", "did you mean robot_0/base_link"), 1),
    Mistake("zteam tf echo map robot_9/base_link --once --timeout 1", ("robot_9/base_link", "did you mean robot_"), 1),
    Mistake("zteam sim move 0 1000 1000 0", ("outside of the world", "force it"), 1),
    Mistake("zteam sim spawn --pose 0 0 0 --model nomodel", ("nomodel", "erratic"), 1),
    Mistake("zteam param set robot_0 speed fast", ('a number is expected, not "fast"',)),
    Mistake("zteam goto 9 1 1", ("robot_9 is not in the world", "it has 0", "zteam sim spawn"), 1),
    Mistake("zteam log robot_9 --once", ("no process robot_9", "robot_0"), 1),
    Mistake("zteam-robot --id 0", ("robot_0 is taken by process", "another id"), 1),
    Mistake("zteam-sim arena", ("sim is taken by process", "--namespace"), 1),
    Mistake("zteam topic echo map --once --timeout 1 --namespace other", ("nothing publishes map", "zteam doctor"), 1),
    Mistake("zteam sim pause --namespace other", ("no simulator", "--namespace"), 1),
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
    _node("node.run(lambda: None)", "mine.py:4: node.run(", "def step(now)", exit_code=2),
)
"""Mistakes beside a running team of robots 0 and 1; robots 2 to 5 are in its world and have no process."""
