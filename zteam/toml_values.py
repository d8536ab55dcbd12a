"""Single values in TOML: those that a user types on a command line, and their text on one line."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from zteam.toml_lines import TooDeepError, key_lines


def parse_value(text: str) -> Any:
    """The value as in a team file: TOML (0.4, true, "text", [1, 2]), else the text itself."""
    # Imported here, because robots import this module and few of them have a parameter.
    import tomllib

    line = f"v = {text}"
    try:
        key_lines(line)
        found = tomllib.loads(line)
    except (TooDeepError, ValueError):
        # Also a number of thousands of digits.
        return text
    # Further lines would be further keys.
    return found["v"] if len(found) == 1 else text


def toml_text(value: Any) -> str:
    """The value as TOML on one line. Raises TypeError for a value that no parameter can have, such as a date."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**63):
        return repr(value)
    if isinstance(value, str):
        # A JSON string is a TOML string, except that TOML requires DEL to be escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_text(key)} = {toml_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(toml_text, value)) + "]"
    raise TypeError(value)
