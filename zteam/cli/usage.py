"""The one-line answer to a mistake on a command line: what is wrong, what was meant, and the usage."""

import argparse
import difflib
import re
from collections.abc import Iterable

_SHARED = frozenset({"help", "connect", "namespace", "config", "lease", "log_level", "log_format"})
"""Options that a usage line leaves out: every command has them."""
_MAX_LINE = 190
"""Characters of an answer, as far as options can be left out of its usage."""
_REQUIRED = "the following arguments are required: "
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
    if not message.startswith(_REQUIRED):
        return message
    *first, last = message.removeprefix(_REQUIRED).split(", ")
    if any(isinstance(action, argparse._SubParsersAction) for action in parser._actions):
        last = "a subcommand"
    text = f"{', '.join(first)} and {last} are missing" if first else f"{last} is missing"
    # argparse does not come to tell of an option that it does not know if a required one is missing.
    unknown = [word for word in words if word.startswith("--") and not _is_known(parser, word)]
    return f"{text}; {unknown_words(parser, unknown)}" if unknown else text


def _is_known(parser: argparse.ArgumentParser, word: str) -> bool:
    name = word.partition("=")[0]
    return any(option.startswith(name) for option in parser._option_string_actions)


def unknown_words(parser: argparse.ArgumentParser, words: Iterable[str]) -> str:
    """What to say of words that a command does not take."""
    options = parser._option_string_actions
    names = [word.partition("=")[0] for word in words]
    return ", ".join(
        f"no option {name!r}{did_you_mean(name, options)}" if name.startswith("-") else f"{name!r} is too much"
        for name in names
    )


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`: did you mean X?`, or nothing where no known word is near."""
    near = difflib.get_close_matches(word, list(known), n=2, cutoff=0.7)
    return f": did you mean {' or '.join(near)}?" if near else ""
