"""What other installed packages offer to zteam, by entry points of the groups `zteam.behaviors` and `zteam.messages`.

Reading the metadata of all packages takes tens of milliseconds, so it is done only for a name that is not zteam's own.
"""

from typing import TYPE_CHECKING, Any

from zteam.errors import UsageError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

BEHAVIORS = "zteam.behaviors"
MESSAGES = "zteam.messages"


def offered(group: str) -> list[str]:
    """The names that installed packages offer in `group`, sorted."""
    return sorted({point.name for point in _points(group)})


def load_offered(group: str, name: str) -> Any:
    """What an installed package offers as `name` in `group`, imported; None if no package does.

    Raises UsageError if two packages offer different things by that name, or if the import fails.
    """
    found = {point.value: point for point in _points(group) if point.name == name}
    if not found:
        return None
    if len(found) > 1:
        offers = ", ".join(f"{_package(point)} ({value})" for value, point in sorted(found.items()))
        raise UsageError(f"{name!r} of the entry points {group} is offered by {offers}: uninstall one of them")
    ((value, point),) = found.items()
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        # Importing runs foreign code, which may raise anything.
        place, text = f"{name!r} of the entry points {group}", " ".join(str(error).split())
        what = f"cannot import {value} of {_package(point)}"
        raise UsageError(f"{place}: {what}: {type(error).__name__}: {text}") from error


def _points(group: str) -> "list[EntryPoint]":
    from importlib.metadata import entry_points

    return list(entry_points(group=group))


def _package(point: "EntryPoint") -> str:
    return point.dist.name if point.dist is not None else "an unnamed package"
