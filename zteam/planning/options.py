"""Parameters as mappings, such as a YAML file gives them, become the options of this package."""

import math
from collections.abc import Mapping
from typing import Any, TypeVar, get_type_hints

from zteam.errors import UsageError

T = TypeVar("T", bound=tuple[Any, ...])


def read_options(kind: type[T], parameters: Mapping[str, Any], where: str = "") -> tuple[T, list[str]]:
    """Options of a class such as AmclOptions from `parameters`, and the names that it does not know.

    Raises UsageError for a value of another type; the text begins with `where`.
    """
    defaults: dict[str, Any] = kind._field_defaults  # type: ignore[attr-defined]
    hints = get_type_hints(kind)
    known = {name: _convert(f"{where}{name}", parameters[name], hints[name]) for name in defaults if name in parameters}
    return kind(**known), sorted(set(parameters) - set(defaults))


def _convert(name: str, value: Any, kind: Any) -> Any:
    if kind is bool:
        if not isinstance(value, bool):
            raise UsageError(f"{name} is true or false, not {value!r}")
        return value
    if kind is str:
        if not isinstance(value, str):
            raise UsageError(f"{name} is a text, not {value!r}")
        return value
    if kind in (int, float, float | None):
        if value is None and kind not in (int, float):
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise UsageError(f"{name} is a finite number, not {value!r}")
        if kind is int and value != int(value):
            raise UsageError(f"{name} is a whole number, not {value!r}")
        return int(value) if kind is int else float(value)
    if not isinstance(value, list | tuple) or not all(isinstance(part, str) for part in value):
        raise UsageError(f"{name} is a list of names, not {value!r}")
    return tuple(value)
