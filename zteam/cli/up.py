"""`zteam up [TEAM]`: start and supervise a whole team; Ctrl+C stops it in order, a second Ctrl+C at once."""

import argparse
import gc
import os
import shlex
import sys
from collections.abc import Callable, Iterable
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from zteam.bus.options import DEFAULT_ENDPOINT, DEFAULT_TLS_ENDPOINT, BusOptions, check_endpoint
from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.options import (
    Parser,
    add_bus_options,
    add_go_timeout_option,
    add_options,
    bus_options,
    check_together,
    parse_speed,
    run_tool,
)
from zteam.config.numbers import counted
from zteam.config.resources import find_team, find_world, names, shipped_team, teams_folder
from zteam.config.simulation_options import LockStepOptions, Options, SimOptions
from zteam.errors import UsageError, ZteamError, log
from zteam.names import VIEW
from zteam.node.logs import passing_lines
from zteam.node.output import print_block
from zteam.node.shutdown import Stop

if TYPE_CHECKING:
    from zteam.cli.up_display import RunDisplay
    from zteam.team.launch.plan import TeamLaunch
    from zteam.team.launch.warm_parent import WarmParent
    from zteam.team.run.report import RunReport
    from zteam.team.run.team_run import TeamRun


_SWITCHES = {
    "--help-args": "list the arguments that the team file takes, and end",
    "--compose": "print a compose file with a container for each process, and end",
    "--in-process": "run the whole team in this process, without a router (docs/time.md)",
    "--bus": "open a team with --in-process to tools and other processes, at a router",
    "--view": "show the team in the browser (docs/view.md)",
    "--no-browser": "with --view: print the page's address only",
    "--force": "with --record: replace the file if it exists",
    "--lockstep": "wait for every process in each tick: equal seeds give equal runs",
}
_WORDS = {
    "--world": ("FILE", "use this world file or shipped world (default: the team file's)"),
    "--report": ("FILE", "write the run's report as JSON; needs --for or --until"),
    "--record": ("FILE.mcap", "record the run (docs/recording.md)"),
    "--listen": (
        "ENDPOINT",
        f"let the team's router listen here (default: {DEFAULT_ENDPOINT}, or if that is taken any port)",
    ),
    "--only": ("NAME", "be this process of the team alone, such as robot_1; needs --connect"),
}
"""By option: what it takes, and the help."""
_NEEDS = {
    "--expect": ("--lockstep",),
    "--report": ("--for", "--until"),
    "--bus": ("--in-process",),
    "--force": ("--record",),
    "--no-browser": ("--view",),
    "--only": ("--connect",),
}
"""By option: one of those that it needs."""
_EXCLUDES = {
    "--only": ("--in-process", "--secure", "--chaos", "--report", "--record"),
    "--listen": ("--in-process", "--connect"),
    "--record": ("--compose",),
    "--secure": ("--in-process",),
}
"""By option: those that it cannot be given with."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam up", description=__doc__, epilog="docs/team-files.md has every key of a team file.")
    shipped = ", ".join(names(teams_folder(), ".toml"))
    text = f"a team file, or the name of a shipped one: {shipped} (default: %(default)s)"
    parser.add_argument("team", nargs="?", default="line", help=text)
    parser.takes_assignments = True
    text = "arguments of the team file, as in 'zteam up chain speed=0.3' (--help-args lists them)"
    parser.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help=text)
    for flag, (metavar, text) in _WORDS.items():
        parser.add_argument(flag, metavar=metavar, help=text)
    texts = {
        "seed": "use this seed (default: the team file's)",
        "run_for": "end this many simulated seconds after GO",
        "until": "end before this tick of the simulator",
    }
    add_options(parser, SimOptions, "speed", **texts)
    add_options(parser, Options, map_resolution="cell size of the simulator's map, metres (default: the team file's)")
    parser.set_defaults(seed=None, map_resolution=None)
    text = "give each process a certificate of this folder (default: certs), let nothing else in (docs/security.md)"
    parser.add_argument("--secure", nargs="?", type=Path, const=Path("certs"), metavar="FOLDER", help=text)
    for flag, text in _SWITCHES.items():
        parser.add_argument(flag, action="store_true", help=text)
    text = "give each process a link of its own for 'zteam chaos', and carry out a plan of faults"
    parser.add_argument("--chaos", nargs="?", const="", metavar="PLAN|SEED", help=text)
    add_go_timeout_option(parser)
    texts = {
        "timeout": "stop waiting for a live process that does not answer for so long",
        "expected": "wait for these nodes of your own before the first tick; needs --lockstep",
    }
    add_options(parser, LockStepOptions, **texts)
    add_bus_options(parser)
    return parser


def _check_options(args: argparse.Namespace) -> None:
    if "=" in args.team and not Path(args.team).exists():
        raise UsageError(f"{args.team}: name the team before its arguments, as in 'zteam up line {args.team}'")
    if args.arguments:
        from zteam.team.file.sources import parse_arguments

        parse_arguments(args.arguments)
    if args.speed is not None:
        parse_speed(args.speed)
    check_together(args, _NEEDS, _EXCLUDES)
    if args.listen:
        check_endpoint(args.listen)
    if args.secure is not None:
        if args.connect and not args.connect.startswith("tls/"):
            raise UsageError(f"--connect {args.connect}: with --secure the router is at tls/HOST:PORT")
        if args.secure.is_file() or (not args.secure.exists() and shipped_team(str(args.secure))):
            team = args.secure
            raise UsageError(f"--secure {team}: a folder of certificates follows here: say 'zteam up {team} --secure'")
    if args.in_process and not args.bus:
        # A view is another process, which joins over a router.
        args.bus = args.view
    asks_to_connect = (args.connect or "") != os.environ.get("ZTEAM_CONNECT", "")
    if args.in_process and not args.bus and (args.expected or asks_to_connect):
        raise UsageError("--expect and --connect need processes, or --bus: none can join a team with --in-process")


def _up(args: argparse.Namespace) -> int:
    if args.help_args:
        from zteam.cli.tables import format_table
        from zteam.team.file.reading import read_team_file
        from zteam.team.file.sources import describe_arguments

        rows = describe_arguments(read_team_file(find_team(args.team)).arguments)
        header = ("argument", "default", "read at")
        print_block(format_table(header, rows) if rows else f"{args.team} takes no arguments")
        return 0
    if args.compose:
        from zteam.team.launch.plan import compose_file

        is_shipped = find_team(args.team).parent == teams_folder()
        print_block(compose_file(_launch(args), [args.team, *args.arguments], is_shipped=is_shipped).rstrip())
        return 0
    if args.only is not None:
        from zteam.team.launch.plan import become
        from zteam.team.run.processes import lease_for, node_environment

        bus, launch = bus_options(args), _launch(args)
        bus = msgspec.structs.replace(bus, lease=lease_for(launch.pace, bus.lease))
        become(launch, args.only, node_environment(bus))
    if args.in_process:
        return run_launch(_launch(args), bus_options(args), args, None)
    from zteam.team.launch.warm_parent import WarmParent

    with closing(WarmParent()) as parent:
        # It imports while the team is checked.
        parent.prepare()
        return run_launch(_launch(args), bus_options(args), args, parent)


def _launch(args: argparse.Namespace) -> "TeamLaunch":
    """The run that the command line asks for. Raises UsageError."""
    from zteam.node.process_options import ViewOptions
    from zteam.team.file.reading import read_team_file, set_map_resolution
    from zteam.team.file.sources import parse_arguments
    from zteam.team.launch.check import check_team, refuse_nodes
    from zteam.team.launch.plan import Pace, TeamLaunch, with_recording
    from zteam.team.run.report import check_writable

    if args.report:
        check_writable(Path(args.report))
    file = read_team_file(find_team(args.team), parse_arguments(args.arguments))
    set_map_resolution(file, args.map_resolution)
    for name in {argument.name for argument in file.arguments} - {word.partition("=")[0] for word in args.arguments}:
        action = args.parser._option_string_actions.get(f"--{name}")
        if action is not None and (value := getattr(args, action.dest, action.default)) != action.default:
            text = "--%s is an option of zteam up itself; the team's argument of this name has no dashes: %s=%s"
            log.info(text, name, name, value)
    world = check_team(file, find_world(args.world) if args.world else None)
    if args.in_process and not args.bus:
        refuse_nodes(file, "say --bus too, or leave --in-process out")
    given = [args.run_for, args.until, args.speed, args.map_resolution, args.lockstep or None, args.in_process or None]
    if world is None and any(each is not None for each in given):
        flags = "--for, --until, --speed, --map-resolution, --lockstep and --in-process"
        raise UsageError(f'world = "none" has no simulator: leave {flags} out')
    resolved = world.resolve() if world else None
    pace = Pace(args.speed, args.lockstep, args.timeout, tuple(args.expected))
    view = None
    if args.view:
        # A script or a test reads the address, and wants no window.
        browser = not args.no_browser and sys.stdout.isatty()
        view = msgspec.structs.replace(ViewOptions.from_environment(), browser=browser, name=VIEW)
    launch = TeamLaunch(file.team, resolved, args.seed, file.path, args.run_for, args.until, pace, view)
    if args.record:
        command = shlex.join(["zteam", *sys.argv[1:]])
        launch = with_recording(launch, Path(args.record), command, force=args.force)
    if not args.chaos:
        return launch
    from zteam.team.chaos.means import describe
    from zteam.team.launch.plan import with_faults

    launch = with_faults(launch, args.chaos, here=args.in_process)
    log.info("%s", describe(launch.faults))
    return launch


def run_launch(
    launch: "TeamLaunch",
    bus: BusOptions,
    args: argparse.Namespace,
    parent: "WarmParent | None",
    on_start: "Callable[[TeamRun], None]" = lambda _: None,
) -> int:
    """Run the team as processes of `parent`, or without one in this process, with the same lines. `on_start(team_run)`
    is called when its members are started."""
    from zteam.cli.up_display import open_display
    from zteam.team.run.processes import Processes
    from zteam.team.run.team_run import TeamRun

    stop = Stop()
    with ExitStack() as stack:
        display = stack.enter_context(open_display(args.log_format, args.run_for))
        if parent is None:
            from zteam.team.run.threads import Threads

            # From the first `breakpoint()` on a debugger has the terminal. A hook of `breakpoint` itself would show up
            # in its stack.
            sys.addaudithook(lambda event, _: display.leave_terminal() if event == "builtins.breakpoint" else None)
            stack.enter_context(passing_lines(display.line))
            # After a second request nothing waits. Code of a behaviour that does not return holds the whole process.
            stack.enter_context(stop.install(on_repeat=lambda: os._exit(INTERRUPTED), hung=1))
            threads = Threads(None, bus if args.bus else None, stop, on_line=display.line)
            team_run, hangs = stack.enter_context(TeamRun(threads, launch, stop)), threads.hangs
            what = f"{counted(len(threads.parts), 'node')} in this process"
        else:
            links = None
            if args.chaos is not None:
                # It imports asyncio, and few teams have links of their own.
                from zteam.team.chaos.links import Links

                links = stack.enter_context(closing(Links()))
            processes = Processes(
                bus, parent, display.line, stop=stop, links=links, certificates=args.secure, listen=args.listen
            )
            team_run, hangs = stack.enter_context(TeamRun(processes, launch, stop)), processes.hangs
            stop.install(on_repeat=team_run.hurry, hung=None)
            what = counted(len(team_run.plan.jobs), "process", "processes")
        work = partial(_drive, team_run, display, args, what, on_start)
        try:
            if parent is None:
                team_run.open()
                report = threads.beside_simulator(work)
            else:
                report = work()
        except ZteamError:
            if not stop.requested:
                raise
            return 0
    return _conclude(team_run, report, stop, args.report, hangs.values())


def _drive(
    team_run: "TeamRun",
    display: "RunDisplay",
    args: argparse.Namespace,
    what: str,
    on_start: "Callable[[TeamRun], None]",
) -> "RunReport | None":
    from zteam.team.run.processes import warn_of_endpoint

    display.say(f"starting {what}")
    team_run.start()
    on_start(team_run)
    endpoint = team_run.members.endpoint
    log.info("%s, %s; Ctrl+C stops them", what, f"router at {endpoint}" if endpoint else "without a router")
    if args.secure is not None:
        from zteam.team.security.access import OPERATOR
        from zteam.team.security.certificates import files_of

        variables = files_of(args.secure, OPERATOR).environment
        if endpoint != DEFAULT_TLS_ENDPOINT:
            variables["ZTEAM_CONNECT"] = endpoint
        words = [f"{name}={shlex.quote(value)}" for name, value in variables.items()]
        log.info("for tools: export %s", " ".join(words))
    elif endpoint:
        warn_of_endpoint(endpoint, args.connect or args.listen)
    if args.in_process:
        gc.freeze()
    with display.following(team_run.team_overview):
        team_run.watch(args.go_timeout)
    display.say("stopping")
    return team_run.finish()


def _conclude(
    team_run: "TeamRun", report: "RunReport | None", stop: Stop, file: str | None, hangs: Iterable[str]
) -> int:
    """Print the report of the run, and write it to `file`; the exit code. Raises ZteamError if processes failed, with
    the texts of those that hang, or if a robot moved on without commands."""
    from zteam.team.run.report import format_report, write_report

    has_end, chaos = team_run.launch.has_end, team_run.chaos
    if chaos is not None:
        from zteam.cli.chaos import print_report

        print_report(chaos)
    if stop.requested and has_end:
        # There is no report: a script must not take this for success.
        return INTERRUPTED
    if report is not None and has_end:
        print_block(format_report(report))
        if file:
            write_report(Path(file), msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    if chaos is not None and chaos.violations:
        raise ZteamError("a robot moved longer than the watchdog allows: see above")
    if failed := {*team_run.failed, *(report.hung if report is not None else ())}:
        raise ZteamError("\n".join([*hangs, f"{', '.join(sorted(failed))} failed: see the log above"]))
    return 0


main = partial(run_tool, build_parser, _up, name="up", read=_check_options, needs_output=False)
