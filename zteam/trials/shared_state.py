"""What all objects of a class share, and so survives a reset: attributes of the class and globals of its module."""

import pickle
import sys
from collections.abc import Iterator
from types import FunctionType, ModuleType
from typing import Any

from zteam.behaviors.behavior import Behavior

_NO_STATE = (type, ModuleType, FunctionType, classmethod, staticmethod, property)


def look(kind: type[Behavior]) -> dict[str, bytes]:
    """The values of now, by name, as bytes that differ when a value does."""
    return {name: _bytes_of(value) for name, value in _shared(kind)}


def changed(before: dict[str, bytes], after: dict[str, bytes]) -> list[str]:
    """The names whose values differ, or that have come."""
    return [name for name, value in after.items() if before.get(name) != value]


def _shared(kind: type[Behavior]) -> Iterator[tuple[str, Any]]:
    for owner in kind.__mro__[: kind.__mro__.index(Behavior)]:
        for name, value in vars(owner).items():
            if _is_state(name, value):
                yield f"{owner.__name__}.{name}", value
    for name, value in vars(sys.modules.get(kind.__module__, kind)).items():
        if _is_state(name, value):
            yield name, value


def _is_state(name: str, value: Any) -> bool:
    """Whether it can keep something; a generator of random numbers is chance, and a cache changes no answer."""
    if name.startswith("__") or isinstance(value, _NO_STATE) or hasattr(value, "cache_info"):
        return False
    return not type(value).__module__.startswith(("random", "numpy.random"))


def _bytes_of(value: Any) -> bytes:
    try:
        return pickle.dumps(value)
    except Exception:
        # Whatever an author's object raises: its text is better than nothing.
        return repr(value).encode()
