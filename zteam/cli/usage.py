"""The one-line answer to a mistake on a command line: what is wrong, what was meant, and the usage."""

import argparse
import re
from collections.abc import Iterable
from itertools import product

from zteam.errors import did_you_mean

MEANT = ": did you mean {}?"
ENDS_TEAM = "to end a team, press Ctrl+C where 'zteam up' runs"
_SHARED = frozenset({"help", "connect", "namespace", "config", "lease", "log_level", "log_format"})
"""Options that a usage line leaves out: every command has them."""
_MAX_LINE = 190
"""Characters of an answer, as far as options can be left out of its usage."""
_NO_WINDOW = "there is no window; 'zteam world show' draws a world, 'zteam tf positions' prints the poses"
_PARAMETERS = ("speed", "leader", "turn_rate", "stop_distance", "min_dist", "max_linear", "max_angular")
_MEANT = {
    **dict.fromkeys(
        product(("zteam up",), ("--robots", "--ids")), "a team file lists the robots, one table [[robots]] each"
    ),
    **dict.fromkeys(
        product(("zteam up", "zteam-sim", "zteam-monitor"), ("--gui", "--headless", "--rviz", "--display")), _NO_WINDOW
    ),
    **{("zteam-robot", f"--{name}"): f"say --param {name}=VALUE" for name in _PARAMETERS},
}
"""What an option that a command lacks may stand for."""
_VERBS = {
    **dict.fromkeys(("unpause", "play", "start", "continue"), "resume"),
    **dict.fromkeys(("stop", "halt"), "pause"),
    **dict.fromkeys(("add", "create"), "spawn"),
    **dict.fromkeys(("delete", "kill"), "remove"),
    **dict.fromkeys(("teleport", "place"), "move"),
    **dict.fromkeys(("publish", "send"), "pub"),
    **dict.fromkeys(("print", "cat", "show"), "echo"),
    **dict.fromkeys(("frames", "view_frames"), "tree"),
    **dict.fromkeys(("draw", "view"), "show"),
}
"""What other programs call a subcommand."""
_REQUIRED = "the following arguments are required: "
_ONE_OF = re.compile(r"one of the arguments (.+) is required")
_SHORT_NAME = re.compile(r"(?<!\S)-\w/--")
"""Of an option that argparse names as `-o/--output`."""


def answer(parser: argparse.ArgumentParser, mistake: str) -> str:
    """One line: the mistake, and the usage of the command."""
    text = " ".join(f"{parser.prog}: {mistake}; usage:".split())
    return f"{text} {_usage(parser, _MAX_LINE - len(text))}"


def _usage(parser: argparse.ArgumentParser, room: int) -> str:
    """What a command requires, and the options that `room` characters hold."""
    if parser.usage:
        return " ".join(parser.usage.split())
    shown = [action for action in parser._actions if action.dest not in _SHARED and action.help != argparse.SUPPRESS]
    positional = [action for action in shown if not action.option_strings]
    options = sorted((action for action in shown if action.option_strings), key=lambda action: not action.required)
    words = [parser.prog, *map(_argument, positional)]
    for option in options:
        if not option.required and len(" ".join([*words, _option(option), "…"])) > room:
            return " ".join([*words, "…"])
        words.append(_option(option))
    return " ".join(words)


def _option(action: argparse.Action) -> str:
    word = action.option_strings[-1]
    if action.nargs != 0:
        word += " " + _argument(action)
    return word if action.required else f"[{word}]"


def _argument(action: argparse.Action) -> str:
    if isinstance(action.metavar, tuple):
        return " ".join(action.metavar)
    name = action.metavar or ("|".join(map(str, action.choices)) if action.choices else action.dest.upper())
    return {"?": f"[{name}]", "*": f"[{name} …]", "+": f"{name} …"}.get(str(action.nargs), name)


def in_short(parser: argparse.ArgumentParser, message: str, words: Iterable[str]) -> str:
    """A message of argparse about `words` in fewer words: `TYPE is missing`."""
    message = _SHORT_NAME.sub("--", message.removeprefix("argument "))
    if choice := _ONE_OF.fullmatch(message):
        text = f"{' or '.join(choice[1].split())} is missing"
    elif message.startswith(_REQUIRED):
        *first, last = message.removeprefix(_REQUIRED).split(", ")
        if any(isinstance(action, argparse._SubParsersAction) for action in parser._actions):
            last = "a subcommand"
        text = f"{', '.join(first)} and {last} are missing" if first else f"{last} is missing"
    else:
        return message
    # argparse does not come to tell of an option that it does not know if a required one is missing.
    known = list(parser._option_string_actions)
    unknown = [
        word for word in words if word.startswith("--") and not any(o.startswith(word.partition("=")[0]) for o in known)
    ]
    return f"{text}; {unknown_words(parser, unknown)}" if unknown else text


def unknown_words(parser: argparse.ArgumentParser, words: Iterable[str]) -> str:
    """What to say of words that a command does not take."""
    told, after_option = [], False
    for word in words:
        if word.startswith("-"):
            told.append(_unknown_option(parser, *word.partition("=")[::2]))
        elif not after_option:
            told.append(f"{word!r} is too much")
        # The word behind an unknown option is its value.
        after_option = word.startswith("-") and "=" not in word
    return ", ".join(told)


def _unknown_option(parser: argparse.ArgumentParser, name: str, value: str = "") -> str:
    meant = _MEANT.get((parser.prog, name))
    hint = f": {meant}" if meant else did_you_mean(name, parser._option_string_actions, most=2, form=MEANT)
    if value and parser.prog == "zteam up" and not meant:
        hint += f"; an argument of the team file has no dashes: {name.lstrip('-')}={value}"
    return f"no option {name!r}{hint}"


def unknown_subcommand(word: str, known: Iterable[str]) -> str:
    """What to say of a word in the place of a subcommand."""
    verb = _VERBS.get(word, "")
    hint = f": did you mean {verb}?" if verb in known else did_you_mean(word, known, most=2, form=MEANT)
    return f"no subcommand {word!r}{hint}"
