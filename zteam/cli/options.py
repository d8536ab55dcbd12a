"""Options that all commands share."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence

from zteam.bus import BusOptions
from zteam.cli.output import OutputError, guarded
from zteam.errors import UsageError, ZteamError
from zteam.names import strip_slash
from zteam.nodes.logs import LEVELS, start_logging


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
        type=float,
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
    return [f" {word}" if word.startswith("-") and _is_number(word) else word for word in words]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def bus_options(args: argparse.Namespace, *, small: bool = False) -> BusOptions:
    """The connection options of a parsed command line; `small` as in BusOptions."""
    namespace = strip_slash(args.namespace) if args.namespace else None
    if namespace and any(c in "*$?#" or c.isspace() for c in namespace):
        raise UsageError(f"--namespace {namespace!r}: use letters, digits, '_', '-' and '/'")
    if not 0.1 <= args.lease <= 3600.0:
        raise UsageError(f"--lease {args.lease:g}: give seconds from 0.1 to 3600")
    # Empty ones too are none: they take back what the environment says.
    connect, config = args.connect or None, args.config or None
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
            return 130

    return guarded(name, told, needs_output=needs_output)


def fail(name: str, error: ZteamError) -> int:
    """Print an error, one line for each mistake that it tells; its exit code."""
    for line in str(error).splitlines():
        print(f"{name}: {line}", file=sys.stderr)
    return error.exit_code
