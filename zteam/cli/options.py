"""The command line that all commands share: the parser, connection and logging options, and running a body."""

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeVar

from zteam.bus import BusOptions
from zteam.bus.options import FROM_STDIN, LEASE, LEASE_BOUNDS, TlsFiles, check_endpoint, give_up_from_environment
from zteam.cli.arguments import add_option
from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.usage import answer, unknown_subcommand, unknown_words
from zteam.errors import UsageError, ZteamError
from zteam.names import strip_slash
from zteam.node.faults import shortage_text
from zteam.node.logs import LEVELS, start_logging
from zteam.node.output import OutputError, guarded, print_line
from zteam.node.ps_name import show_name

T = TypeVar("T")

FORMATS = ("text", "json")
"""Values of `--log-format`."""


class Parser(argparse.ArgumentParser):
    """A command line that reports a mistake on one line."""

    _words: Sequence[str] = ()
    """What is being parsed."""
    takes_assignments = False
    """Whether words NAME=VALUE may stand anywhere: argparse takes only those that stand together."""
    _verbs: "argparse._SubParsersAction[Parser] | None" = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        # argparse recognizes -1, but not -1e-3 and -inf.
        self._negative_number_matcher = re.compile(r"-(\d|\.\d|inf$|nan$)")

    def add_verb(
        self,
        name: str,
        act: Callable[..., object],
        text: str,
        *shared: "Callable[[Parser], object]",
        usage: str = "",
    ) -> "Parser":
        """Add a subcommand, whose `args.act` is `act`, with options that `shared` functions add."""
        if self._verbs is None:
            self._verbs = self.add_subparsers(dest="verb", required=True)
        verb = self._verbs.add_parser(name, help=text, description=text, usage=usage or None)
        verb.set_defaults(act=act)
        for add in shared:
            add(verb)
        self._verbs.metavar = "|".join(self._verbs.choices)
        return verb

    def error(self, message: str) -> NoReturn:
        """End with 2. Options that are not known are named too: argparse does not come to them after a mistake."""
        names = [(word, word.partition("=")[0]) for word in self._words if word.startswith("--")]
        unknown = [word for word, name in names if not any(o.startswith(name) for o in self._option_string_actions)]
        text = f"{message}; {unknown_words(self, unknown)}" if unknown else message
        self.exit(2, answer(self, text) + "\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does, and end with 2 on an unknown word: only this parser knows what was meant."""
        self._words = list(sys.argv[1:] if args is None else args)
        found, unknown = super().parse_known_args(self._words, namespace)
        self._words = ()
        if self.takes_assignments:
            found.arguments += [word for word in unknown if _is_assignment(word)]
            unknown = [word for word in unknown if not _is_assignment(word)]
        if unknown:
            self.error(unknown_words(self, unknown))
        # The parser of a subcommand has parsed before.
        found.parser = getattr(found, "parser", self)
        return found, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            # Its options are not known.
            self._words = ()
            self.error(unknown_subcommand(self, value, action.choices))
        super()._check_value(action, value)


def _is_assignment(word: str) -> bool:
    return word.partition("=")[0].isidentifier() and "=" in word


def add_bus_options(parser: argparse.ArgumentParser) -> None:
    """Add the connection and logging options; the environment gives their defaults."""
    group = parser.add_argument_group("connection")
    for name, metavar, text in (
        ("connect", "ENDPOINT", "use this router, e.g. tcp/10.0.0.1:7447 (default: the local one, started on demand; "),
        ("namespace", "NAMESPACE", "separate this team from others on the same router ("),
        ("config", "FILE.json5", "read Zenoh settings from this file first ("),
    ):
        variable = f"ZTEAM_{name.upper()}"
        default = os.environ.get(variable) or None
        group.add_argument(f"--{name}", metavar=metavar, default=default, help=f"{text}${variable})")
    add_lease_option(group)
    add_log_options(group)


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add `--json`."""
    parser.add_argument("--json", action="store_true", help="print JSON")


def add_lease_option(parser: argparse._ActionsContainer) -> None:
    """Add `--lease`; the environment gives its default."""
    text = "declare this process lost after this silence on the link (default: 2; $ZTEAM_LEASE)"
    default = os.environ.get("ZTEAM_LEASE", f"{LEASE:g}")
    add_option(parser, "--lease", typed=(*LEASE_BOUNDS, "seconds"), metavar="SECONDS", default=default, help=text)


def add_log_options(parser: argparse._ActionsContainer, level: str = "info") -> None:
    """Add `--log-level`, by default `level`, and `--log-format`; the environment overrides the defaults."""
    text = "log from this level up (default: %(default)s; $ZTEAM_LOG_LEVEL)"
    default = os.environ.get("ZTEAM_LOG_LEVEL", level)
    add_option(parser, "--log-level", choices=LEVELS, default=default, help=text)
    text = "log as text or as JSON lines (default: %(default)s; $ZTEAM_LOG_FORMAT)"
    default = os.environ.get("ZTEAM_LOG_FORMAT", "text")
    add_option(parser, "--log-format", choices=FORMATS, default=default, help=text)


def add_clock_option(parser: argparse.ArgumentParser, default: str = "auto") -> None:
    text = "use simulated time (sim), the host's time (wall), or simulated time if a simulator runs (auto)"
    add_option(parser, "--clock", choices=("auto", "sim", "wall"), default=default, help=text)


def checked(args: argparse.Namespace, parse: Callable[[], T]) -> T:
    """What `parse()` makes of words of a parsed command line; a UsageError ends with 2, on one line with the usage."""
    parser: Parser = args.parser
    try:
        return parse()
    except UsageError as error:
        parser.error(str(error))


def bus_options(args: argparse.Namespace, *, small: bool = False) -> BusOptions:
    """The connection options of a parsed command line; `small` as in BusOptions."""
    namespace = strip_slash(args.namespace) if args.namespace else None
    if namespace and any(c in "*$?#" or c.isspace() for c in namespace):
        raise UsageError(f"--namespace {namespace!r}: use letters, digits, '_', '-' and '/'")
    # An empty value overrides the environment.
    connect, config = args.connect or None, args.config or None
    tls = TlsFiles.from_environment()
    if connect not in (None, FROM_STDIN):
        check_endpoint(connect, tls)
    return BusOptions(connect, namespace, config, small, args.lease, tls, give_up_from_environment())


def run(name: str, args: argparse.Namespace, body: Callable[[], int], *, needs_output: bool = True) -> int:
    """Run a command's body with logging on; its exit code. A ZteamError becomes one line and its own exit code.

    Set `needs_output` to False for a command that is useful without what it prints.
    """
    show_name(args.parser.prog.partition(" ")[0])
    start_logging(name, args.log_level, args.log_format)

    def reported() -> int:
        try:
            return body()
        except OutputError:
            raise
        except ZteamError as error:
            return fail(name, error)
        except KeyboardInterrupt:
            return INTERRUPTED
        except BaseException as error:
            # Zenoh's panics are no Exception.
            if text := shortage_text(error):
                return fail(name, ZteamError(text))
            raise

    return guarded(name, reported, needs_output=needs_output)


def run_tool(
    build_parser: Callable[[], Parser],
    body: Callable[[argparse.Namespace], int | None] | None = None,
    argv: Sequence[str] | None = None,
    *,
    name: str = "",
    read: Callable[[argparse.Namespace], None] | None = None,
    needs_output: bool = True,
) -> int:
    """Be a tool, which is called `name`, by default as its parser; its exit code.

    Without a `body` it carries out a subcommand. None as its result is exit code 0. Before it runs, `read` replaces
    words of the command line by what they say; a UsageError of it ends with 2, on one line with the usage.
    """
    parser = build_parser()
    args = parser.parse_args(argv)
    if read is not None:
        checked(args, lambda: read(args))
    return run(name or parser.prog, args, lambda: (body or args.act)(args) or 0, needs_output=needs_output)


def fail(name: str, error: ZteamError) -> int:
    """Print an error, one line for each mistake in it; return its exit code."""
    for line in str(error).splitlines():
        print_line(f"{name}: {line}", file=sys.stderr)
    return error.exit_code
