"""Checks messages that are handed over: outside of tests nothing does, because it takes as long as their bytes."""

from typing import Any

import numpy as np
import pytest

from zteam.bus import memory
from zteam.errors import EncodeError
from zteam.messages import Message, cdr, decode, encode
from zteam.messages.geometry_msgs import TransformRows

_adopt = cdr.adopt


def check_adopted() -> None:
    """Let `adopt` raise EncodeError for a message that its bytes would change."""
    for module in (cdr, memory):
        pytest.MonkeyPatch().setattr(module, "adopt", _checked)


def _checked(message: Any) -> Any:
    adopted = _adopt(message)
    _compare(adopted, decode(type(message), encode(message)))
    return adopted


def _compare(given: Any, due: Any) -> None:
    """Raise EncodeError unless both are the same, types and precision included."""
    if isinstance(due, TransformRows):
        due = [*due]
    if type(given) is not type(due):
        raise EncodeError(f"{given!r} was handed over where a {type(due).__name__} is due")
    if isinstance(due, Message):
        for field in due.__struct_fields__:
            _compare(getattr(given, field), getattr(due, field))
    elif isinstance(due, list):
        for mine, other in zip(given, due, strict=True):
            _compare(mine, other)
    elif isinstance(due, np.ndarray):
        if given.dtype != due.dtype or given.flags.writeable:
            raise EncodeError("an array was handed over that can be written, or has another type")
    elif given != due and given == given:
        raise EncodeError(f"{given!r} was handed over where {due!r} is due")
