"""Values on a command line: numbers within bounds, a speed, the options that a struct declares."""

import argparse
import os
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal, TypeVar, get_args, get_origin

import msgspec

from zteam.config.numbers import parse_number, parse_whole
from zteam.errors import UsageError

T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)

MAX_RATE = 1e4
"""Hz at which a command can repeat something."""


def number(low: float, high: float, what: str) -> Callable[[str], float]:
    """The `type` of an option: a number from `low` to `high`; the error asks for `what`, such as "seconds"."""
    return option_type(lambda text: parse_number(text, low, high, what))


def whole(low: int, high: int, what: str) -> Callable[[str], int]:
    """The `type` of an option: a whole number from `low` to `high`; the error asks for `what`."""
    return option_type(lambda text: parse_whole(text, low, high, what))


def _one_of(text: str, choices: Sequence[str]) -> str:
    if text not in choices:
        raise UsageError(f"{text!r}: give {', '.join(choices)}")
    return text


def option_type(parse: Callable[[str], T]) -> Callable[[str], T]:
    """The `type` of an option whose words `parse` reads, or refuses by a UsageError."""

    def parse_option(text: str) -> T:
        try:
            return parse(text)
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
        keywords["type"] = option_type(partial(_one_of, choices=keywords["choices"]))
    if typed is not None:
        keywords["type"] = (whole if isinstance(typed[0], int) else number)(*typed)
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
        keywords = {"dest": name, "default": default, "help": texts.get(name, metas[0].description), **metas[0].extra}
        flag = keywords.pop("flag", f"{'no-' if default is True else ''}{name.replace('_', '-')}")
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
