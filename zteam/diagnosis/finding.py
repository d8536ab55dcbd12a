"""The result of one check."""

from typing import Literal

import msgspec

Level = Literal["ok", "note", "problem"]


class Finding(msgspec.Struct, frozen=True):
    """One check."""

    what: str
    good: bool
    """False for a problem that exists now."""
    text: str
    next_step: str = ""
    """What to do about it; empty where there is nothing to do."""
    level: Level = "ok"
    """A note is good: history, or a state that may be intended."""


def ok(what: str, text: str) -> Finding:
    """A check without a problem."""
    return Finding(what, True, text)


def note(what: str, text: str, next_step: str = "") -> Finding:
    """A state that may be intended, or a problem of the past."""
    return Finding(what, True, text, next_step, "note")


def problem(what: str, text: str, next_step: str = "") -> Finding:
    """A problem that exists now."""
    return Finding(what, False, text, next_step, "problem")
