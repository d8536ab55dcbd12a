"""`zteam behaviors [NAME]`: list the behaviours that robots can run, and the parameters of one of them."""

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from zteam.cli.options import Parser, add_log_options, add_path_option, folders_of, run_tool
from zteam.cli.tables import format_table, terminal_width
from zteam.config.toml_values import toml_text
from zteam.errors import UsageError
from zteam.node.output import print_block, print_json
from zteam.robot.behaviors.registry import BehaviorInfo, behavior_names, describe_behavior, look_in
from zteam.robot.parameters import Parameter

_SINGLE = {
    "ge": "at least {}",
    "gt": "above {}",
    "le": "at most {}",
    "lt": "below {}",
    "multiple_of": "multiples of {}",
    "pattern": "like {}",
    "min_length": "at least {} long",
    "max_length": "at most {} long",
}


def build_parser() -> Parser:
    parser = Parser(prog="zteam behaviors", description=__doc__)
    text = "a behaviour, also package.module:Class: what it does, and its parameters (default: list all)"
    parser.add_argument("name", nargs="?", metavar="NAME", help=text)
    add_path_option(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_log_options(parser)
    return parser


def _show(args: argparse.Namespace) -> None:
    """Show one behaviour, or list all; one that cannot be imported is an error, after the others."""
    look_in(folders_of(args))
    if args.name is not None:
        info = describe_behavior(args.name)
        print_json(info) if args.json else print_block(format_behavior(info))
        return
    found, broken = [], []
    for name in behavior_names():
        try:
            found.append(describe_behavior(name))
        except UsageError as error:
            broken.append(str(error))
    if args.json:
        print_json(found)
    else:
        rows = [(info.name, info.summary) for info in found]
        print_block(format_table(("behaviour", "does"), rows, width=terminal_width()))
        print_block("\nParameters: zteam behaviors NAME. A class of your own: zteam behaviors module:Class")
    if broken:
        raise UsageError("\n".join(broken))


def format_behavior(info: BehaviorInfo) -> str:
    lines = [f"{info.name}: {info.summary or 'its class has no docstring'}", f"class {info.source}", ""]
    lines.append(format_parameters(info.parameters) if info.parameters else "  no parameters")
    return "\n".join(lines)


def format_parameters(parameters: Sequence[Parameter], values: Mapping[str, Any] | None = None) -> str:
    """A table of the parameters, indented; with `values` their present values, else their defaults."""
    shown = {each.name: each.default for each in parameters} if values is None else values
    rows = []
    for each in parameters:
        value = "required" if values is None and each.required else value_text(shown.get(each.name))
        rows.append((each.name, value, each.type, limits_text(each.limits), each.description))
    header = ("parameter", "default" if values is None else "value", "type", "allowed", "description")
    return format_table(header, rows, "  ", width=terminal_width())


def value_text(value: Any) -> str:
    """A value on one line, numbers without noise digits; `none` for None."""
    return f"{value:g}" if isinstance(value, float) else exact_text(value)


def exact_text(value: Any) -> str:
    return "none" if value is None else toml_text(value)


def limits_text(limits: Mapping[str, Any]) -> str:
    """`0 to 1`, `at least 0`, …; empty without limits."""
    left = dict(limits)
    texts = []
    if "ge" in left and "le" in left:
        texts.append(f"{value_text(left.pop('ge'))} to {value_text(left.pop('le'))}")
    return ", ".join([*texts, *(_SINGLE[name].format(value_text(limit)) for name, limit in left.items())])


main = partial(run_tool, build_parser, _show)
