"""Mistakes of new users: what they type, and what the answer must name."""

from typing import NamedTuple

_TEAM = '[team]\nworld = "arena"\n[[robots]]\nid = 0\n'


class Mistake(NamedTuple):
    """One command, its exit code, and texts that its answer holds: the cause, and the way out."""

    command: str
    told: tuple[str, ...]
    exit_code: int = 2
    file: tuple[str, str] = ("", "")
    """Name and text of a file that lies in the user's folder."""


def _team(command: str, text: str, *told: str) -> Mistake:
    return Mistake(command, told, file=("team.toml", text))


def _robot(line: str, *told: str) -> Mistake:
    return _team("zteam up team.toml", f"{_TEAM}{line}\n", "team.toml:5: robots[0].", *told)


ALONE = (
    # The command line.
    Mistake("zteam", ("usage: zteam COMMAND",)),
    Mistake("zteam ups", ("no command 'ups'", "did you mean up?")),
    Mistake("zteam --connect tcp/localhost:7447 topic list", ("behind the command",)),
    Mistake("zteam topic", ("zteam topic", "usage:")),
    Mistake("zteam topic ecko map", ("'ecko'", "did you mean echo?")),
    Mistake("zteam topic pub robot_0/cmd_vel", ("TYPE", "usage: zteam topic pub")),
    Mistake("zteam bench sm", ("'sm'", "did you mean sim?")),
    Mistake("zteam topic list --connect 127.0.0.1:7447", ("give PROTOCOL/ADDRESS", "tcp/127.0.0.1:7447")),
    Mistake("zteam topic list --config no.json5", ("--config no.json5: no such file",)),
    # Team files.
    Mistake("zteam up missing.toml", ("no such file", "arena, line, willow")),
    _team("zteam up team.toml", "[team\n", "team.toml:1:6: not TOML"),
    _robot('behaviour = "wander"', "behaviour: unknown key", "did you mean behavior?"),
    _robot('behavior = "wandr"', "no behaviour 'wandr'", "did you mean wander?"),
    _robot('behavior = "mine:Robot"', "No module named 'mine'", "beside the team file"),
    _robot("sped = 0.2", "sped: unknown key", "did you mean speed?"),
    _robot('speed = "fast"', 'a number is expected, not "fast"'),
    _robot("follow = 8", "no robot 8 in this file (it has 0)"),
    _robot("follow = 0", "cannot follow itself"),
    _robot("[[robots]]\nid = 0", "robot 0 is robots[0] already", "its own id")._replace(
        told=("team.toml:6: robots[1].id: robot 0 is robots[0] already", "its own id")
    ),
    _robot("[[robots]]\nid = 5", "")._replace(
        told=("the world has no robot 5 (it has 0, 1)", "model and pose add one")
    ),
    _team(
        "zteam up team.toml",
        '[team]\nworld = "offce"\n[[robots]]\nid = 0\n',
        "team.toml:2: team.world",
        "arena, office",
    ),
    Mistake("zteam up --for abc", ("--for", "'abc'", "simulated seconds")),
    Mistake("zteam up --report no/such/run.json --for 1", ("--report no/such/run.json",)),
    Mistake("zteam up my.world", ("--world my.world",), file=("my.world", 'position( name "r0" )\n')),
    # World files.
    Mistake("zteam-sim", ("WORLD", "usage: zteam-sim")),
    Mistake("zteam-sim no.world", ("no such file", "arena, office")),
    Mistake("zteam-sim my.world", ("my.world:1:9: this '(' is never closed",), file=("my.world", "position( \n")),
    Mistake(
        "zteam world check my.world",
        ("my.world:1:1: unknown model type 'floorplan'", "include"),
        file=("my.world", 'floorplan( bitmap "x.png" )\n'),
    ),
    Mistake(
        "zteam world check my.world",
        ("my.world:1", "nothere.png"),
        file=("my.world", 'model( bitmap "nothere.png" )\n'),
    ),
    # Single processes.
    Mistake("zteam-robot", ("--id",)),
    Mistake("zteam-robot --id -1", ("--id", "0 to 9999")),
    Mistake("zteam-robot --id 1 --follow 1", ("cannot follow itself",)),
    Mistake("zteam-robot --id 1 --behavior follow", ("leader is missing", "--follow")),
    Mistake("zteam-robot --id 1 --param speed=fast", ('speed: a number is expected, not "fast"',)),
    Mistake("zteam-monitor", ("--team-size 4", "--ids")),
    Mistake("zteam-monitor --ids 3-1", ("--ids", "3-1")),
    Mistake("zteam behaviors wandr", ("'wandr'", "did you mean wander?")),
    # Nothing runs.
    Mistake("zteam topic list", ("no router", "zteam up"), exit_code=1),
    Mistake("zteam sim pause", ("no router",), exit_code=1),
)
"""Mistakes that need no team. The router's address leads nowhere."""

BESIDE_A_TEAM = (
    Mistake("zteam topic echo robot0/odom --once --timeout 1", ("did you mean robot_0/odom",), 1),
    Mistake("zteam topic echo robot_0/scan --once --timeout 1", ("did you mean robot_0/base_scan",), 1),
    Mistake("zteam topic echo robot_*/odom --once", ("robot_$*/odom",)),
    Mistake("zteam topic pub robot_0/cmd_vel Twst {}", ("no message type 'Twst'", "did you mean Twist")),
    Mistake("zteam topic pub robot_0/cmd_vel LaserScan {} --once", ("robot_0/cmd_vel", "geometry_msgs/msg/Twist")),
    Mistake("zteam topic pub robot_0/cmd_vel Twist '{linear: {q: 1}}'", ("no field 'q'", "x, y, z")),
    Mistake("zteam topic pub robot_9/cmd_vel Twist {} --once", ("robot_9/cmd_vel", "no subscriber"), 0),
    Mistake("zteam tf echo map robot_9/base_link --once --timeout 1", ("robot_9/base_link",), 1),
    Mistake("zteam sim move 0 1000 1000 0", ("outside of the world", "--force"), 1),
    Mistake("zteam sim remove 42", ("no robot 42", "it has"), 1),
    Mistake("zteam sim spawn --pose 0 0 0 --model nomodel", ("nomodel", "erratic"), 1),
    Mistake("zteam sim speed -3", ("'-3'", "or max")),
    Mistake("zteam param set robot_0 sped 0.5", ("sped", "did you mean speed?")),
    Mistake("zteam param set robot_0 speed fast", ('a number is expected, not "fast"',)),
    Mistake("zteam param get robot_7 speed", ("robot_7",), 1),
    Mistake("zteam log robot_9 --once", ("robot_9", "robot_0")),
    Mistake("zteam-robot --id 0", ("robot_0 is taken by process",), 1),
    Mistake("zteam-sim arena", ("sim is taken by process",), 1),
    Mistake(
        "zteam tf static 1 0 0 0 0 0 robot_0/odom robot_0/base_footprint", ("robot_0/base_footprint", "robot_0"), 1
    ),
)
"""Mistakes beside a running team of two robots in the arena."""
