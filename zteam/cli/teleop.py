"""`zteam teleop --id 0`: drive robots with the keyboard, with the keys of teleop_twist_keyboard and the arrows."""

import argparse
import math
import os
import select
import sys
import termios
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial

from zteam import names
from zteam.bus import Bus, connect
from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.listening import PATIENCE
from zteam.cli.options import Parser, add_bus_options, add_clock_option, add_option, bus_options, run_tool
from zteam.cli.tool_clock import open_clock, still_text
from zteam.clock import AutoClock, Every, Rate, monotonic, to_ns, to_seconds
from zteam.config.robot_ids import parse_robot_ids
from zteam.errors import UsageError, ZteamError
from zteam.messages import RobotDriver, Twist
from zteam.node.live_line import LiveLine, has_live_line
from zteam.node.output import Clean, print_block, print_line
from zteam.node.shutdown import Stop
from zteam.node.stopping import STOPPED
from zteam.robot.teleop import HELP, HELP_TEXT, MAX_SPEED, MIN_SPEED, PERIOD, KeyDecoder, Pilot, drive, parse_script
from zteam.robot.wheels import Wheels

_KEYS_PERIOD = 0.05
"""Host seconds from one command to the next: the robot and the simulator stop when none comes for a while."""
_FOCUS_ON, _FOCUS_OFF = "\x1b[?1004h", "\x1b[?1004l"
"""From then on the terminal tells when it gets and loses the focus."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam teleop", description=__doc__, epilog=f"keys:\n{HELP_TEXT}")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    text = "drive these robots, e.g. 0 or 0-2"
    parser.add_argument("--id", dest="ids", nargs="+", required=True, metavar="ID", help=text)
    bounds = (MIN_SPEED, MAX_SPEED, "a speed")
    add_option(parser, "--speed", typed=bounds, default=0.5, metavar="M/S", help="begin with this speed")
    add_option(parser, "--turn", typed=bounds, default=1.0, metavar="RAD/S", help="begin with this turn rate")
    text = "let a key count so long after each press and repeat (default: 0.75 after a first press, 0.3 after a repeat)"
    add_option(parser, "--key-timeout", typed=(0.1, 10.0, "seconds"), metavar="SECONDS", help=text)
    text = "press these keys at 10 Hz and end, without a terminal, e.g. 'i*10 l*5 k'"
    parser.add_argument("--script", metavar="KEYS", help=text)
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> None:
    """Read robots and script. Raises UsageError where there is neither a script nor a terminal."""
    args.ids = parse_robot_ids(args.ids, "--id")
    if args.script is not None:
        args.script = parse_script(args.script)
        if args.key_timeout is not None:
            raise UsageError("--key-timeout is for a keyboard: leave it out with --script")
    elif not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("standard input and output are no terminal: give the keys with --script 'i*10 l*5 k'")


def _teleop(args: argparse.Namespace) -> int:
    pilot, stop = Pilot(args.ids, args.speed, args.turn, args.key_timeout), Stop()
    with stop.install(), ExitStack() as ends:
        try:
            bus = connect(bus_options(args), patience=PATIENCE, stopping=stop)
            ends.callback(bus.close)
            wheels = {robot_id: Wheels(bus, robot_id, stop) for robot_id in args.ids}
            for each in wheels.values():
                ends.callback(each.close)
                each.take()
        except ZteamError:
            if not stop.requested:
                raise
            return INTERRUPTED
        if args.script is None:
            return _drive_by_hand(pilot, wheels, stop)
        return _drive_by_script(pilot, wheels, bus, args, stop)


def _drive_by_hand(pilot: Pilot, wheels: Mapping[int, Wheels], stop: Stop) -> int:
    print_block(HELP_TEXT)
    with _key_terminal() as terminal, LiveLine(sys.stdout) as live:
        shown = ""

        def show() -> None:
            nonlocal shown
            line = describe(pilot, wheels[pilot.robot_id])
            if line != shown and has_live_line(sys.stdout):
                live.show(line)
            shown = line

        drive(pilot, wheels, _presses(terminal, stop, live), show)
    return 0


def _drive_by_script(pilot: Pilot, wheels: Mapping[int, Wheels], bus: Bus, args: argparse.Namespace, stop: Stop) -> int:
    driven: set[int] = set()

    def note() -> None:
        if pilot.holds:
            driven.add(pilot.robot_id)

    drive(pilot, wheels, _typed(args.script, open_clock(bus, args.clock), stop), note)
    if stop.requested:
        return INTERRUPTED
    unheard = [wheels[robot_id].unheard for robot_id in sorted(driven) if wheels[robot_id].unheard]
    if unheard:
        raise ZteamError(f"nothing subscribes to {', '.join(unheard)}: see 'zteam doctor'")
    held = [wheels[robot_id].name for robot_id in sorted(driven) if wheels[robot_id].is_stopped]
    if held:
        raise ZteamError(f"{', '.join(held)}: {STOPPED}")
    return 0


def _typed(script: Sequence[str], clock: AutoClock, stop: Stop) -> Iterator[tuple[list[str], float]]:
    """The keys, each at its moment of `clock`; the last one counts until the moment after it."""
    stopped = threading.Event()
    stop.on_request(stopped.set)
    rate, nag = Rate(to_ns(PERIOD), clock.steady()), Every(math.inf)
    for key in script:
        yield [key], to_seconds(clock.steady())
        while left := rate.left(now := clock.steady()):
            if stopped.is_set():
                return
            if not clock.simulated:
                stopped.wait(to_seconds(left))
            elif not clock.wait_for_change(now, PERIOD) and clock.stands and nag.due():
                print_line(f"teleop: {still_text(clock)}", file=sys.stderr)
        rate.take(clock.steady())


def describe(pilot: Pilot, wheels: Wheels) -> str:
    """The robot and the speeds of the keys, then what drives it, how fast, and what keeps it from driving."""
    keys = f"{names.robot_name(pilot.robot_id)}: keys {pilot.speed:.2f} m/s, {pilot.turn:.2f} rad/s"
    if wheels.unheard:
        return f"{keys} | nothing hears {wheels.unheard}"
    if wheels.is_stopped:
        return f"{keys} | {STOPPED}"
    others = ", ".join(wheels.others)
    if others and wheels.gives_way:
        return f"{keys} | driven by {others}; a key takes it back"
    if others:
        return f"{keys} | also driven by {others}"
    if wheels.direct:
        return f"{keys} | {_velocity(wheels.command)} straight to the base, no safety layer"
    status = wheels.status
    if status is None:
        return f"{keys} | no status yet"
    driven, wanted = _velocity(wheels.driven), _velocity(wheels.command)
    # The robot's safety layer may drive more slowly than the keys want.
    limited = f", wanted {wanted}" if status.driver == RobotDriver.TELEOP and driven != wanted else ""
    why = f": {status.reason}" if status.reason else ""
    return f"{keys} | {status.driver} drives {driven}{limited}{why}"


def _velocity(command: Twist) -> str:
    return f"{command.linear.x:.2f} m/s, {command.angular.z:.2f} rad/s"


@contextmanager
def _key_terminal() -> Iterator[int]:
    """Standard input, which delivers each key at once. Ctrl+C remains a signal; Ctrl+Z and Ctrl+\\ are keys."""
    terminal = sys.stdin.fileno()
    before, mode = termios.tcgetattr(terminal), termios.tcgetattr(terminal)
    # Ctrl+S would stop the output, and with it this process.
    mode[0] &= ~termios.IXON
    mode[3] &= ~(termios.ECHO | termios.ICANON)
    mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
    # A process that is suspended or dumps its core cannot stop its robots or restore the terminal.
    mode[6][termios.VSUSP] = mode[6][termios.VQUIT] = b"\0"
    # What was typed before must not drive a robot.
    termios.tcsetattr(terminal, termios.TCSAFLUSH, mode)
    try:
        _write(_FOCUS_ON)
        yield terminal
    finally:
        try:
            _write(_FOCUS_OFF)
        finally:
            # A closed terminal cannot be restored.
            with suppress(termios.error):
                # The shell must not get the repeats of the last key.
                termios.tcflush(terminal, termios.TCIFLUSH)
                termios.tcsetattr(terminal, termios.TCSANOW, before)


def _write(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def _presses(terminal: int, stopping: Callable[[], bool], live: LiveLine) -> Iterator[tuple[list[str], float]]:
    """Keys and the host's time, when a key comes and every _KEYS_PERIOD, until the stop or the terminal's end."""
    decoder, due = KeyDecoder(), monotonic()
    while not stopping():
        # Host time: neither a key nor the next command may wait for the other.
        if select.select([terminal], [], [], max(0.0, due - monotonic()))[0]:  # noqa: TID251
            try:
                data = os.read(terminal, 1024)
            except OSError:
                # The terminal is gone.
                return
            if not data:
                return
            keys = decoder.feed(data)
            if HELP in keys:
                live.print(Clean(HELP_TEXT))
            yield keys, monotonic()
        else:
            yield decoder.flush(), monotonic()
            due = monotonic() + _KEYS_PERIOD


main = partial(run_tool, build_parser, _teleop, name="teleop", read=_read, needs_output=False)
