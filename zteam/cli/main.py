"""`zteam COMMAND`, and the entry points of all commands. Only the module of the command that runs is imported."""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NoReturn

from zteam import __version__
from zteam.cli.interrupts import INTERRUPTED, ignore_from_now, leave_at_once
from zteam.errors import did_you_mean
from zteam.node.leaving import leave
from zteam.node.output import guarded, print_block, print_line

COMMANDS = {
    "up": ("up", "start and supervise a whole team"),
    "topic": ("topic", "list | echo | hz | info | pub: inspect and publish messages"),
    "view": ("zteam-view", "see the team in a browser, and drive it with the mouse"),
    "record": ("zteam-record", "record a running team"),
    "replay": ("zteam-replay", "publish a recording under its names, for tools and the view"),
    "rerun": ("rerun", "run a recording again, and compare each tick"),
    "recording": ("recording", "info | compare | export | plot | recover: what recorded runs hold"),
    "tf": ("tf", "echo | tree | monitor | positions | static: show and set transforms"),
    "sim": ("sim", "control the simulator: status, pause, step, reset, spawn, …"),
    "goto": ("goto", "send a robot to a pose in the map, wait, and say how it ended"),
    "goals": ("goals", "send goals from a file to robots, in turn"),
    "map": ("map", "save: write the map that is on the bus to a file"),
    "teleop": ("teleop", "drive robots with the keyboard"),
    "stop": ("stop", "stop robots, whatever drives them, until --release"),
    "param": ("param", "list | get | set | dump: a behaviour's parameters while it runs"),
    "behaviors": ("behaviors", "list the behaviours, and the parameters of each"),
    "check": ("check", "try a behaviour in awkward moments and say what it does wrong"),
    "new": ("new", "behavior | node: write a working example and its test"),
    "node": ("node", "list: list the processes that are alive"),
    "log": ("log", "print the logs of all processes in order of time, and follow them"),
    "world": ("world", "check | show | scan | new: check, draw, scan and make world files"),
    "chaos": ("chaos", "kill | pause | cut | slow a process, and see the team recover"),
    "certs": ("certs", "init | issue | list | renew | revoke | explain: certificates"),
    "doctor": ("doctor", "diagnose problems and print the next step for each"),
    "bench": ("bench", "measure zteam on this machine"),
}
"""Command -> (module in zteam.cli, or the command of a process; one line)."""
PROCESSES = tuple(
    f"zteam-{name}" for name in ("sim", "robot", "nav", "map", "tf", "monitor", "record", "replay", "view", "router")
)
"""The commands of the processes of a team."""


def start_command(name: str) -> NoReturn:
    """Run `zteam` or the command of a process, including its imports, and end the process with its exit code."""
    try:
        import fcntl  # noqa: F401
    except ImportError:
        # Python has it on every system but Windows.
        text = "zteam needs Linux or macOS: on Windows, use WSL 2, or a container ('docker compose')"
        print_line(f"{name}: {text}", file=sys.stderr)
        leave(2)
    leave_at_once()
    try:
        code = guarded(name, lambda: _run("main" if name == "zteam" else name, sys.argv[1:]))
    except KeyboardInterrupt:
        code = INTERRUPTED
    except (ImportError, MemoryError) as error:
        # A library that is imported may find no room.
        from zteam.node.faults import shortage_text

        if not (text := shortage_text(error)):
            raise
        print_line(f"{name}: {text}", file=sys.stderr)
        code = 1
    finally:
        ignore_from_now()
    leave(code)


def _run(module: str, arguments: Sequence[str]) -> int:
    import importlib

    if module in PROCESSES and module != "zteam-router":
        from zteam.cli.processes import main as be_process

        return be_process(module, arguments)
    module = module.replace("-", "_")
    return int(importlib.import_module(f"zteam.cli.{module}").main(arguments))


start = partial(start_command, "zteam")
start_simulator = partial(start_command, "zteam-sim")
start_robot = partial(start_command, "zteam-robot")
start_aggregator = partial(start_command, "zteam-tf")
start_monitor = partial(start_command, "zteam-monitor")
start_view = partial(start_command, "zteam-view")
start_recorder = partial(start_command, "zteam-record")
start_replay = partial(start_command, "zteam-replay")
start_map_server = partial(start_command, "zteam-map")
start_navigation = partial(start_command, "zteam-nav")
start_router = partial(start_command, "zteam-router")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line that follows `zteam`."""
    arguments = sys.argv[1:] if argv is None else argv
    if not arguments or arguments[0] in {"-h", "--help", "help"}:
        rows = "\n".join(f"  {name:11}{text}" for name, (_, text) in COMMANDS.items())
        print_block(f"usage: zteam COMMAND ... (zteam COMMAND --help tells more)\n\n{rows}")
        others = [each for each in PROCESSES if all(each != command for command, _ in COMMANDS.values())]
        print_line(f"Processes: {', -'.join(others).replace('-zteam', '')}")
        return 0 if arguments else 2
    if arguments[0] == "--version":
        print_line(f"zteam {__version__}")
        return 0
    name, *rest = arguments
    if name in COMMANDS:
        return _run(COMMANDS[name][0], rest)
    print_line(f"zteam: {_unknown(name, rest)}", file=sys.stderr)
    return 2


def _unknown(name: str, rest: Sequence[str]) -> str:
    """What to say of a word in the place of a command, before the words `rest`."""
    from zteam.cli.other_words import commands_called
    from zteam.config.resources import existing_file, shipped_team

    if shipped_team(name) or existing_file(Path(name)):
        return f"no command {name!r}: did you mean 'zteam {' '.join(['up', name, *rest])}'?"
    meant = commands_called(name)
    if meant:
        hint = f": did you mean 'zteam {' '.join([meant[0], *rest])}'?"
        hint += " (to end a team, press Ctrl+C where 'zteam up' runs)" if "stop" in meant else ""
    elif name.startswith("-"):
        hint = ": options stand behind the command, e.g. 'zteam topic list --connect tcp/127.0.0.1:7447'"
    else:
        near = did_you_mean(name, COMMANDS, most=2, form=": did you mean {}?")
        hint = near or f": commands: {', '.join(COMMANDS)}"
    return f"no command {name!r}{hint}"
