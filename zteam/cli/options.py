"""The command line that all commands share: the parser, the options that several take, and running a body."""

import argparse
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NoReturn, TypeVar, get_args, get_origin

import msgspec

from zteam.bus import BusOptions
from zteam.bus.options import FROM_STDIN, LEASE, LEASE_BOUNDS, check_endpoint, check_namespace
from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.other_words import commands_called
from zteam.config.numbers import parse_number
from zteam.errors import UsageError, ZteamError, did_you_mean
from zteam.node.faults import shortage_text
from zteam.node.leaving import show_name
from zteam.node.logs import LEVELS, start_logging
from zteam.node.output import OutputError, guarded, print_line

T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)

MAX_RATE = 1e4
"""Hz at which a command can repeat something."""
_DID_YOU_MEAN = ": did you mean {}?"


class Parser(argparse.ArgumentParser):
    """A command line that reports a mistake on one line."""

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
    ) -> "Parser":
        """Add a subcommand, whose `args.act` is `act`, with options that `shared` functions add."""
        if self._verbs is None:
            self._verbs = self.add_subparsers(dest="verb", required=True)
        verb = self._verbs.add_parser(name, help=text, description=text)
        verb.set_defaults(act=act)
        for add in shared:
            add(verb)
        self._verbs.metavar = "|".join(self._verbs.choices)
        return verb

    def error(self, message: str) -> NoReturn:
        """End with 2, and one line: the mistake, and where all that the command takes is listed."""
        text = f"{self.prog}: {message.removeprefix('argument ')}; see '{self.prog} --help'"
        self.exit(2, f"{' '.join(text.split())}\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does, and end with 2 on an unknown word: only this parser knows what was meant."""
        found, unknown = super().parse_known_args(args, namespace)
        if self.takes_assignments:
            found.arguments += [word for word in unknown if _is_assignment(word)]
            unknown = [word for word in unknown if not _is_assignment(word)]
        if unknown:
            self.error(self._unknown_words(unknown))
        # The parser of a subcommand has parsed before.
        found.parser = getattr(found, "parser", self)
        return found, unknown

    def _unknown_words(self, words: Sequence[str]) -> str:
        """What to say of words that the command does not take."""
        told = []
        for word, behind in zip(words, [*words[1:], "-"], strict=True):
            if not word.startswith("-"):
                # The value of an unknown option.
                continue
            name, _, value = word.partition("=")
            value = value or ("" if behind.startswith("-") else behind)
            hint = did_you_mean(name, self._option_string_actions, most=2, form=_DID_YOU_MEAN)
            if value and self.takes_assignments:
                hint += f"; an argument of the team file has no dashes: {name.lstrip('-')}={value}"
            told.append(f"no option {name!r}{hint}")
        return ", ".join(told or [f"{word!r} is too much" for word in words])

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            command = self.prog.removeprefix("zteam ") + " "
            meant = [own.removeprefix(command) for own in commands_called(value, command)][:1]
            near = did_you_mean(value, action.choices, most=2, form=_DID_YOU_MEAN)
            near = _DID_YOU_MEAN.format(meant[0]) if meant else near
            self.error(f"no subcommand {value!r}{near}")
        super()._check_value(action, value)


def _is_assignment(word: str) -> bool:
    return word.partition("=")[0].isidentifier() and "=" in word


def _one_of(text: str, choices: Sequence[str]) -> str:
    if text not in choices:
        raise UsageError(f"{text!r}: give {', '.join(choices)}")
    return text


def option_type(parse: Callable[..., T], *given: object) -> Callable[[str], T]:
    """The `type` of an option whose words `parse(word, *given)` reads, or refuses by a UsageError."""

    def parse_option(text: str) -> T:
        try:
            return parse(text, *given)
        except UsageError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parse_option


def add_option(
    parser: argparse._ActionsContainer, *flags: str, typed: tuple[Any, Any, str] | None = None, **keywords: Any
) -> None:
    """As `add_argument`; the help ends with the default. `typed` makes it a number, as in `zteam.config.option`.

    With `choices` a default from the environment is checked too.
    """
    default, text = keywords.get("default"), keywords["help"]
    if "choices" in keywords:
        keywords["type"] = option_type(_one_of, keywords["choices"])
    if typed is not None:
        keywords["type"] = option_type(parse_number, *typed)
    if default and "default" not in text and not isinstance(default, bool):
        keywords["help"] = f"{text} (default: %(default){'g' if isinstance(default, float) else 's'})"
    parser.add_argument(*flags, **keywords)


def add_repeated(parser: argparse._ActionsContainer, flag: str, metavar: str, text: str, **keywords: Any) -> None:
    """Add an option that may be given several times; its value is a list."""
    parser.add_argument(flag, action="append", default=[], metavar=metavar, help=f"{text} (repeatable)", **keywords)


def add_options(
    parser: argparse._ActionsContainer, options: msgspec.Struct | type[msgspec.Struct], *names: str, **texts: str
) -> None:
    """Add the options that a struct declares with its fields (`zteam.config.option`), or those of `names` and `texts`.

    `texts` replace help texts. If `options` is an instance, its values are the defaults.
    """
    kind = options if isinstance(options, type) else type(options)
    for field in msgspec.structs.fields(kind):
        name, metas = field.name, getattr(field.type, "__metadata__", ())
        if not metas or ((names or texts) and name not in (*names, *texts)):
            continue
        default = field.default if options is kind else getattr(options, name)
        keywords = {"dest": name, "default": default, "help": texts.get(name, metas[-1].description), **metas[-1].extra}
        flag = keywords.pop("flag", f"{'no-' if default is True else ''}{name.replace('_', '-')}")
        if field.type.__origin__ is float:
            keywords.setdefault("type", float)
        if isinstance(default, bool):
            keywords["action"] = f"store_{not default}".lower()
        for part in (field.type.__origin__, *get_args(field.type.__origin__)):
            if get_origin(part) is Literal:
                keywords["choices"] = get_args(part)
        add_option(parser, f"--{flag}", **keywords)


def read_options(kind: type[S], args: argparse.Namespace, **others: Any) -> S:
    """A struct of the values that a user gave to the options of `add_options`; `others` are its other fields."""
    typed = {name: getattr(args, name) for name in kind.__struct_fields__ if hasattr(args, name)}
    lists = {name: tuple(value) for name, value in typed.items() if isinstance(value, list)}
    return kind(**{**typed, **lists, **others})


def check_together(
    args: argparse.Namespace, needs: Mapping[str, Sequence[str]], excludes: Mapping[str, Sequence[str]]
) -> None:
    """Raise UsageError for an option without one of those that it `needs`, or with one that it `excludes`."""
    given = set()
    for action in args.parser._actions:
        value, is_switched_off = getattr(args, action.dest, None), action.default is True
        is_given = not (value is None or value is False or value in ((), []))
        if action.option_strings and is_given != is_switched_off:
            given.add(action.option_strings[-1])
    for flag, others in needs.items():
        if flag in given and not given.intersection(others):
            raise UsageError(f"{flag} needs {' or '.join(others)}")
    for flag, others in excludes.items():
        if flag in given and (unwanted := [other for other in others if other in given]):
            raise UsageError(f"{flag}: leave {', '.join(unwanted)} out")


def add_go_timeout_option(parser: argparse.ArgumentParser) -> None:
    text = "without GO after so many host seconds, name the robots that are missing and end with 1"
    add_option(parser, "--go-timeout", typed=(1e-3, 86400.0, "host seconds"), metavar="SECONDS", help=text)


def add_path_option(parser: argparse.ArgumentParser) -> None:
    """Add `--path`: folders for `zteam.robot.behaviors.registry.look_in`."""
    add_repeated(parser, "--path", "FOLDER", "also search this folder, as those of $ZTEAM_PATH, for package.module")


def folders_of(args: argparse.Namespace) -> tuple[str, ...]:
    """Where modules are looked for: the folders of `--path`, those of $ZTEAM_PATH, and the current one."""
    return (*args.path, *filter(None, os.environ.get("ZTEAM_PATH", "").split(os.pathsep)), "")


def parse_speed(text: str) -> float | None:
    """Simulated seconds per host second: a number, or None for `max`. Raises UsageError."""
    # Only the commands with a speed pay for this import.
    from zteam.simulator.client import MAX_SPEED, MIN_SPEED

    if text == "max":
        return None
    try:
        return parse_number(text, MIN_SPEED, MAX_SPEED, "simulated seconds a second")
    except UsageError as error:
        raise UsageError(f"speed {error}, or max") from None


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
    parser.add_argument("--json", action="store_true", help="print JSON")


def add_lease_option(parser: argparse._ActionsContainer) -> None:
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
    add_option(parser, "--log-format", choices=("text", "json"), default=default, help=text)


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
    namespace = check_namespace(args.namespace or "", "--namespace") or None
    # An empty value overrides the environment.
    connect, config = args.connect or None, args.config or None
    environment = BusOptions.from_environment()
    if connect not in (None, FROM_STDIN):
        check_endpoint(connect, environment.tls)
    return BusOptions(connect, namespace, config, small, args.lease, environment.tls, environment.give_up)


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
    """Be a tool, which is called `name`, by default as the option `process` says or as its parser; its exit code.

    Without a `body` it carries out a subcommand. None as its result is exit code 0. Before it runs, `read` replaces
    words of the command line by what they say; a UsageError of it ends with 2, on one line with the usage.
    """
    parser = build_parser()
    args = parser.parse_args(argv)
    if read is not None:
        checked(args, lambda: read(args))
    name = name or getattr(args, "process", parser.prog)
    return run(name, args, lambda: (body or args.act)(args) or 0, needs_output=needs_output)


def fail(name: str, error: ZteamError) -> int:
    """Print an error, one line for each mistake in it; return its exit code."""
    for line in str(error).splitlines():
        print_line(f"{name}: {line}", file=sys.stderr)
    return error.exit_code
