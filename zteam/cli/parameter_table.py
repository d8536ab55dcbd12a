"""The parameters of a behaviour as a table for people."""

from collections.abc import Mapping, Sequence
from typing import Any

from zteam.behaviors.registry import Parameter
from zteam.cli.tables import format_table, terminal_width

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


def format_parameters(parameters: Sequence[Parameter], values: Mapping[str, Any] | None = None) -> str:
    """A table of the parameters, indented; with `values` their present values, else their defaults."""
    rows = [
        (each.name, default_text(each) if values is None else value_text(values.get(each.name)), *_about(each))
        for each in parameters
    ]
    header = ("parameter", "default" if values is None else "value", "type", "allowed", "description")
    return format_table(header, rows, "  ", width=terminal_width())


def default_text(parameter: Parameter) -> str:
    """Its default value, or `required`."""
    return "required" if parameter.required else value_text(parameter.default)


def value_text(value: Any) -> str:
    """A value on one line, numbers without noise digits; `none` for None."""
    from zteam.toml_values import toml_text

    if isinstance(value, float):
        return f"{value:g}"
    return "none" if value is None else toml_text(value)


def limits_text(limits: Mapping[str, Any]) -> str:
    """`0 to 1`, `at least 0`, …; empty without limits."""
    left = dict(limits)
    texts = []
    if "ge" in left and "le" in left:
        texts.append(f"{value_text(left.pop('ge'))} to {value_text(left.pop('le'))}")
    return ", ".join([*texts, *(_SINGLE[name].format(value_text(limit)) for name, limit in left.items())])


def _about(parameter: Parameter) -> tuple[str, str, str]:
    return parameter.type, limits_text(parameter.limits), parameter.description
