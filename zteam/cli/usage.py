"""The one-line answer to a mistake on a command line: what is wrong, what was meant, and the usage."""

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path

from zteam.errors import did_you_mean

_DID_YOU_MEAN = ": did you mean {}?"
ENDS_TEAM = "to end a team, press Ctrl+C where 'zteam up' runs"
_MEANT = {
    "up": "run start launch roslaunch team",
    "topic": "rostopic topics",
    "topic echo": "echo print cat show",
    "topic hz": "hz",
    "topic pub": "pub publish send",
    "tf echo": "tf_echo tf2_echo",
    "tf tree": "view_frames rqt_tf_tree frames",
    "tf monitor": "tf_monitor tf2_monitor",
    "tf static": "static_transform_publisher",
    "node": "rosnode",
    "param": "rosparam params dynparam",
    "sim pause": "pause stop halt",
    "sim resume": "resume unpause play start continue",
    "sim step": "step",
    "sim reset": "reset",
    "sim spawn": "spawn add create",
    "sim remove": "remove delete kill",
    "sim move": "move teleport place",
    "sim status": "status",
    "teleop": "teleop_twist_keyboard key_teleop keyboard drive",
    "map save": "map_saver map_saver_cli",
    "goals": "send_goals waypoints patrol",
    "goto": "navigate move_base send_goal navigate_to_pose",
    "log": "rosout logs",
    "doctor": "roswtf wtf",
    "stop": "estop emergency_stop down end halt kill quit shutdown",
    "stop --release": "release",
    "world show": "draw view",
}
"""What ROS and other programs call a command or a subcommand. Of a word in several rows the shortest command counts."""


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


def unknown_subcommand(parser: argparse.ArgumentParser, word: str, known: Iterable[str]) -> str:
    """What to say of a word in the place of a subcommand of `zteam COMMAND`."""
    command = parser.prog.removeprefix("zteam ")
    verbs = [verb for verb in known if word in _MEANT.get(f"{command} {verb}", "").split()]
    hint = _DID_YOU_MEAN.format(verbs[0]) if verbs else did_you_mean(word, known, most=2, form=_DID_YOU_MEAN)
    return f"no subcommand {word!r}{hint}"


def unknown_command(name: str, rest: Sequence[str], known: Iterable[str]) -> str:
    """What to say of a word in the place of a command, before the words `rest`."""
    from zteam.config.resources import existing_file, shipped_team

    meant = sorted((command for command, words in _MEANT.items() if name in words.split()), key=len)
    if shipped_team(name) or existing_file(Path(name)):
        meant = [f"up {name}"]
    if meant:
        hint = _DID_YOU_MEAN.format(f"'zteam {' '.join([meant[0], *rest])}'")
        hint += f" ({ENDS_TEAM})" if meant[0] == "stop" else ""
    elif name.startswith("-"):
        hint = ": options stand behind the command, e.g. 'zteam topic list --connect tcp/127.0.0.1:7447'"
    else:
        hint = did_you_mean(name, known, most=2, form=_DID_YOU_MEAN) or f": commands: {', '.join(known)}"
    return f"no command {name!r}{hint}"
