"""The one-line answer to a mistake on a command line: what is wrong, what was meant, and the usage."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from zteam.errors import did_you_mean

_DID_YOU_MEAN = ": did you mean {}?"
ENDS_TEAM = "to end a team, press Ctrl+C where 'zteam up' runs"
_SHARED = frozenset({"help", "connect", "namespace", "config", "lease", "log_level", "log_format"})
"""Options that a usage line leaves out: every command has them."""
_MAX_LINE = 190
"""Characters of an answer, as far as options can be left out of its usage."""
_NO_WINDOW = "there is no window; 'zteam world show' draws a world, 'zteam tf positions' prints the poses"
_WINDOW = {_NO_WINDOW: "--gui --headless --rviz --display"}
_OPTIONS = {
    "zteam up": {"a team file lists the robots, one table [[robots]] each": "--robots --ids", **_WINDOW},
    "zteam-sim": _WINDOW,
    "zteam-monitor": _WINDOW,
    "zteam-robot": {
        "say --param {}=VALUE": "speed leader turn_rate stop_distance min_dist max_linear max_angular",
    },
}
"""By command: what an option that it lacks may stand for; {} is the option."""
_COMMANDS = {
    "up": "run start launch roslaunch team",
    "topic": "rostopic topics",
    "topic {}": "echo hz pub",
    "tf echo": "tf_echo tf2_echo",
    "tf tree": "view_frames rqt_tf_tree",
    "tf monitor": "tf_monitor tf2_monitor",
    "tf static": "static_transform_publisher",
    "node": "rosnode",
    "param": "rosparam params dynparam",
    "sim {}": "pause resume step reset spawn remove move status",
    "teleop": "teleop_twist_keyboard key_teleop keyboard drive",
    "map save": "map_saver map_saver_cli",
    "goals": "send_goals waypoints patrol",
    "goto": "navigate move_base send_goal navigate_to_pose",
    "log": "rosout logs",
    "doctor": "roswtf wtf",
    "stop": "estop emergency_stop",
    "stop --release": "release",
}
"""What ROS and other programs call a command, and words that are a subcommand; {} is the word itself."""
_ENDS = "down end halt kill quit shutdown"
"""Words for the end of a team, which is no command."""
_SUBCOMMANDS = {
    "resume": "unpause play start continue",
    "pause": "stop halt",
    "spawn": "add create",
    "remove": "delete kill",
    "move": "teleport place",
    "pub": "publish send",
    "echo": "print cat show",
    "tree": "frames view_frames",
    "show": "draw view",
}
"""What other programs call a subcommand."""


def _meant(word: str, words: Mapping[str, str]) -> str:
    """What a word stands for in one of these tables; empty if it is not there."""
    return next((meant.format(word) for meant, others in words.items() if word in others.split()), "")


def answer(parser: argparse.ArgumentParser, mistake: str) -> str:
    """One line: the mistake, and the usage of the command."""
    text = " ".join(f"{parser.prog}: {mistake.removeprefix('argument ')}; usage:".split())
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
    words = _OPTIONS.get(parser.prog, {})
    meant = _meant(name, words) or _meant(name.lstrip("-"), words)
    hint = f": {meant}" if meant else did_you_mean(name, parser._option_string_actions, most=2, form=_DID_YOU_MEAN)
    if value and parser.prog == "zteam up" and not meant:
        hint += f"; an argument of the team file has no dashes: {name.lstrip('-')}={value}"
    return f"no option {name!r}{hint}"


def unknown_subcommand(word: str, known: Iterable[str]) -> str:
    """What to say of a word in the place of a subcommand."""
    verb = _meant(word, {verb: words for verb, words in _SUBCOMMANDS.items() if verb in known})
    hint = _DID_YOU_MEAN.format(verb) if verb else did_you_mean(word, known, most=2, form=_DID_YOU_MEAN)
    return f"no subcommand {word!r}{hint}"


def unknown_command(name: str, rest: Sequence[str], known: Iterable[str]) -> str:
    """What to say of a word in the place of a command, before the words `rest`."""
    from zteam.config.resources import existing_file, shipped_team

    meant = _meant(name, _COMMANDS)
    if name.startswith("-"):
        hint = ": options stand behind the command, e.g. 'zteam topic list --connect tcp/127.0.0.1:7447'"
    elif name in _ENDS.split():
        hint = f": 'zteam stop' stops the robots; {ENDS_TEAM}"
    elif name.startswith("zteam-"):
        hint = f": the processes are separate commands: {' '.join([name, *rest])}"
    elif name.endswith(".world"):
        hint = f": a team drives in a world: 'zteam up --world {name}'"
    elif meant:
        hint = _DID_YOU_MEAN.format(f"'zteam {' '.join([meant, *rest])}'")
    elif shipped_team(name) or existing_file(Path(name)):
        hint = _DID_YOU_MEAN.format(f"'zteam {' '.join(['up', name, *rest])}'")
    else:
        hint = did_you_mean(name, known, most=2, form=_DID_YOU_MEAN) or f": commands: {', '.join(known)}"
    return f"no command {name!r}{hint}"
