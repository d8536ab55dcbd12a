"""The one-line answer to a mistake on a command line: what is wrong, what was meant, and the usage."""

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path

from zteam.errors import did_you_mean

_DID_YOU_MEAN = ": did you mean {}?"
ENDS_TEAM = "to end a team, press Ctrl+C where 'zteam up' runs"


def answer(parser: argparse.ArgumentParser, mistake: str) -> str:
    """One line: the mistake, and the usage of the command."""
    return " ".join(f"{parser.prog}: {mistake.removeprefix('argument ')}; usage: {_usage(parser)}".split())


def _usage(parser: argparse.ArgumentParser) -> str:
    """What a command requires; its help has the options."""
    needed = [action for action in parser._actions if action.required or not action.option_strings]
    words = parser.usage or " ".join([parser.prog, *map(_word, needed)])
    return f"{words} … ({parser.prog} --help)"


def _word(action: argparse.Action) -> str:
    metavar = action.metavar or "|".join(map(str, action.choices or ())) or action.dest.upper()
    name = " ".join(metavar) if isinstance(metavar, tuple) else metavar
    name = {"?": f"[{name}]", "*": f"[{name} …]", "+": f"{name} …"}.get(str(action.nargs), name)
    return " ".join([*action.option_strings[-1:], name])


def unknown_words(parser: argparse.ArgumentParser, words: Sequence[str]) -> str:
    """What to say of words that a command does not take."""
    if not any(word.startswith("-") for word in words):
        return ", ".join(f"{word!r} is too much" for word in words)
    # The word behind an unknown option is its value.
    options = [word.partition("=") for word in words if word.startswith("-")]
    told = []
    for name, _, value in options:
        hint = did_you_mean(name, parser._option_string_actions, most=2, form=_DID_YOU_MEAN)
        if value and getattr(parser, "takes_assignments", False):
            hint += f"; an argument of the team file has no dashes: {name.lstrip('-')}={value}"
        told.append(f"no option {name!r}{hint}")
    return ", ".join(told)


def unknown_subcommand(word: str, known: Iterable[str]) -> str:
    """What to say of a word in the place of a subcommand."""
    return f"no subcommand {word!r}{did_you_mean(word, known, most=2, form=_DID_YOU_MEAN)}"


def unknown_command(name: str, rest: Sequence[str], known: Iterable[str]) -> str:
    """What to say of a word in the place of a command, before the words `rest`."""
    from zteam.config.resources import existing_file, shipped_team

    if shipped_team(name) or existing_file(Path(name)):
        hint = _DID_YOU_MEAN.format(f"'zteam {' '.join(['up', name, *rest])}'")
    elif name.startswith("-"):
        hint = ": options stand behind the command, e.g. 'zteam topic list --connect tcp/127.0.0.1:7447'"
    else:
        hint = did_you_mean(name, known, most=2, form=_DID_YOU_MEAN) or f": commands: {', '.join(known)}"
    return f"no command {name!r}{hint}"
