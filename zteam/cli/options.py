"""Options that all commands share."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn, TypeVar

from zteam.bus import BusOptions
from zteam.bus.options import FROM_STDIN, LEASE_BOUNDS, check_endpoint
from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.output import OutputError, guarded
from zteam.errors import UsageError, ZteamError
from zteam.names import strip_slash
from zteam.numbers import is_number, parse_number, parse_whole
from zteam.runtime.logs import LEVELS, start_logging

T = TypeVar("T")

MIN_SEED, MAX_SEED = -(2**63), 2**63 - 1
MAX_RATE = 1e4
"""Hz of what a tool does again and again."""


class Parser(argparse.ArgumentParser):
    """A command line whose mistakes are told on one line."""

    def error(self, message: str) -> NoReturn:
        """End with 2."""
        self.exit(2, f"{self.prog}: {message} (see '{self.prog} --help')\n")


def number(low: float, high: float, what: str) -> Callable[[str], float]:
    """The `type` of an option: a number from `low` to `high`; the error asks for `what`, such as "seconds"."""
    return _option_type(lambda text: parse_number(text, low, high, what))


def whole(low: int, high: int, what: str) -> Callable[[str], int]:
    """The `type` of an option: a whole number from `low` to `high`; the error asks for `what`."""
    return _option_type(lambda text: parse_whole(text, low, high, what))


def _option_type(parse: Callable[[str], T]) -> Callable[[str], T]:
    def parse_option(text: str) -> T:
        try:
            return parse(text)
        except UsageError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parse_option


def add_bus_options(parser: argparse.ArgumentParser) -> None:
    """Add the connection and logging options; the environment gives their defaults."""
    group = parser.add_argument_group("connection")
    group.add_argument(
        "--connect",
        metavar="ENDPOINT",
        default=os.environ.get("ZTEAM_CONNECT") or None,
        help="router to use, e.g. tcp/10.0.0.1:7447 (default: the local one, started if there is none; $ZTEAM_CONNECT)",
    )
    group.add_argument(
        "--namespace",
        default=os.environ.get("ZTEAM_NAMESPACE") or None,
        help="keep this team apart from others on the same router ($ZTEAM_NAMESPACE)",
    )
    group.add_argument(
        "--config",
        metavar="FILE.json5",
        default=os.environ.get("ZTEAM_CONFIG") or None,
        help="Zenoh configuration to start from ($ZTEAM_CONFIG)",
    )
    group.add_argument(
        "--lease",
        type=number(*LEASE_BOUNDS, "seconds"),
        metavar="SECONDS",
        default=os.environ.get("ZTEAM_LEASE", "2"),
        help="silence after which this process counts as gone (2; longer than a lock-step's time-out, if it shall be "
        "named as hung before; $ZTEAM_LEASE)",
    )
    group.add_argument(
        "--log-level", choices=LEVELS, default=os.environ.get("ZTEAM_LOG_LEVEL", "info"), help="($ZTEAM_LOG_LEVEL)"
    )
    group.add_argument(
        "--log-format",
        choices=("text", "json"),
        default=os.environ.get("ZTEAM_LOG_FORMAT", "text"),
        help="($ZTEAM_LOG_FORMAT)",
    )


def add_clock_option(parser: argparse.ArgumentParser, default: str = "auto") -> None:
    """Add `--clock`."""
    parser.add_argument(
        "--clock",
        choices=("auto", "sim", "wall"),
        default=default,
        help="whose time to work in: the simulator's if there is one (auto), the simulator's in any case (sim), or the "
        "host's (wall) (default: %(default)s)",
    )


def negative_numbers(words: Sequence[str]) -> list[str]:
    """The words of a command line so that argparse takes no negative number for an option, `-1e-3` and `-inf` included.

    They get a space in front, which `float` does not mind.
    """
    return [f" {word}" if word.startswith("-") and is_number(word) else word for word in words]


def bus_options(args: argparse.Namespace, *, small: bool = False) -> BusOptions:
    """The connection options of a parsed command line; `small` as in BusOptions."""
    namespace = strip_slash(args.namespace) if args.namespace else None
    if namespace and any(c in "*$?#" or c.isspace() for c in namespace):
        raise UsageError(f"--namespace {namespace!r}: use letters, digits, '_', '-' and '/'")
    # An empty value overrides the environment.
    connect, config = args.connect or None, args.config or None
    if connect not in (None, FROM_STDIN):
        check_endpoint(connect)
    return BusOptions(connect=connect, namespace=namespace, config=config, small=small, lease=args.lease)


def run(name: str, args: argparse.Namespace, body: Callable[[], int], *, needs_output: bool = True) -> int:
    """Run a command's body with logging on; a ZteamError becomes one line and its exit code.

    A command that is of use without what it prints does not need its output.
    """
    start_logging(name, args.log_level, args.log_format)

    def told() -> int:
        try:
            return body()
        except OutputError:
            raise
        except ZteamError as error:
            return fail(name, error)
        except KeyboardInterrupt:
            return INTERRUPTED

    return guarded(name, told, needs_output=needs_output)


def fail(name: str, error: ZteamError) -> int:
    """Print an error, one line for each mistake that it tells; its exit code."""
    for line in str(error).splitlines():
        print(f"{name}: {line}", file=sys.stderr)
    return error.exit_code
