"""Values on a command line: numbers within bounds, a speed, negative numbers that are not options."""

import argparse
import os
from collections.abc import Callable, Sequence
from typing import TypeVar

from zteam.config.numbers import is_number, parse_number, parse_whole
from zteam.errors import UsageError

T = TypeVar("T")

MIN_SEED, MAX_SEED = -(2**63), 2**63 - 1
MAX_RATE = 1e4
"""Hz at which a command can repeat something."""
MIN_RUN = 1e-6
"""Simulated seconds of the shortest `--for`: the run ends with the tick of GO."""
UNTIL_TICKS = (2, 10**12)
"""Bounds of `--until`: the first tick is sent in any case."""
GO_TIMEOUTS = (1e-3, 86400.0)
"""Bounds of `--go-timeout`, host seconds."""
LOCKSTEP_TIMEOUTS = (1e-3, 3600.0)
"""Bounds of `--lockstep-timeout`, host seconds."""


def number(low: float, high: float, what: str) -> Callable[[str], float]:
    """The `type` of an option: a number from `low` to `high`; the error asks for `what`, such as "seconds"."""
    return option_type(lambda text: parse_number(text, low, high, what))


def whole(low: int, high: int, what: str) -> Callable[[str], int]:
    """The `type` of an option: a whole number from `low` to `high`; the error asks for `what`."""
    return option_type(lambda text: parse_whole(text, low, high, what))


def one_of(choices: Sequence[str]) -> Callable[[str], str]:
    """The `type` of an option with `choices`: unlike these, it also checks a default from the environment."""

    def parse(text: str) -> str:
        if text not in choices:
            raise UsageError(f"{text!r}: give {', '.join(choices)}")
        return text

    return option_type(parse)


def option_type(parse: Callable[[str], T]) -> Callable[[str], T]:
    """The `type` of an option whose words `parse` reads, or refuses by a UsageError."""

    def parse_option(text: str) -> T:
        try:
            return parse(text)
        except UsageError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parse_option


def add_go_timeout_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--go-timeout",
        type=number(*GO_TIMEOUTS, "host seconds"),
        metavar="SECONDS",
        help="without GO after so many host seconds, name the robots that are missing and end with 1",
    )


def add_path_option(parser: argparse.ArgumentParser) -> None:
    """Add `--path`: folders for `zteam.robot.behaviors.registry.look_in`."""
    parser.add_argument(
        "--path",
        action="append",
        default=[],
        metavar="FOLDER",
        help="also search this folder for package.module (repeatable; $ZTEAM_PATH has more)",
    )


def folders_of(args: argparse.Namespace) -> tuple[str, ...]:
    """Where modules are looked for: the folders of `--path`, those of $ZTEAM_PATH, and the current one."""
    return (*args.path, *filter(None, os.environ.get("ZTEAM_PATH", "").split(os.pathsep)), "")


def add_seed_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seed",
        type=whole(MIN_SEED, MAX_SEED, "a seed"),
        default=1,
        help="seed of all random numbers (default: %(default)s)",
    )


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


def negative_numbers(words: Sequence[str]) -> list[str]:
    """The words of a command line, changed so that argparse takes no negative number for an option.

    argparse recognizes `-1`, but not `-1e-3` and `-inf`. A space in front hides the sign, and `float` accepts it.
    """
    return [f" {word}" if word.startswith("-") and is_number(word) else word for word in words]
