"""Message types that a recording defines: a user's own that are not installed here, or those of another version."""

from typing import Annotated, Any

import msgspec
from numpy.typing import NDArray

from zteam.errors import UsageError
from zteam.messages import Message, type_of_encoding
from zteam.messages.message import CDR, RULE, definition_of


def type_of(name: str, definition: str) -> type[Message]:
    """The type of this ROS name and definition (`ros2msg`): zteam's own or an installed one where that has the same
    fields, else one that is made of them. Raises UsageError for fields that zteam does not read."""
    known = type_of_encoding(f"{CDR}{name}")
    if known is not None and definition_of(known) == definition:
        return known
    first, *held = definition.split(f"{RULE}\n")
    texts = {name.replace("/msg/", "/"): first}
    try:
        for each in held:
            head, _, text = each.partition("\n")
            texts[head.split()[-1]] = text
        made: type[Message] = _make(name.replace("/msg/", "/"), texts)
        # It looks at the fields of all types that it holds.
        definition_of(made)
        # Not before: a type with a ROS name is registered when it is made, and an installed one keeps its place.
        made.ros_type = name
    except (UsageError, ValueError, TypeError, IndexError, RecursionError):
        raise UsageError(f"{name} is not installed here, and has fields that zteam does not read") from None
    return made


def _make(name: str, texts: dict[str, str]) -> Any:
    fields: list[tuple[str, Any]] = []
    for line in texts[name].splitlines():
        text = line.partition("#")[0].strip()
        if text and "=" not in text:
            kind, field = text.split()
            fields.append((field, _hint(kind, texts)))
    return msgspec.defstruct(name.rpartition("/")[2], fields, bases=(Message,), module=__name__)


def _hint(kind: str, texts: dict[str, str]) -> Any:
    base, bracket, _ = kind.partition("[")
    if base == "string" or base in texts:
        single = str if base == "string" else _make(base, texts)
        if bracket and kind != f"{base}[]":
            raise ValueError(kind)
        return list[single] if bracket else single  # type: ignore[valid-type]
    if bracket:
        return Annotated[NDArray[Any], kind]
    return Annotated[bool if base == "bool" else float if base.startswith("float") else int, kind]
