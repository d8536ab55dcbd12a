"""Errors that a user may see: each is one line that names the place and the fix. The log, and texts for a terminal."""

import contextlib
import logging
from collections import abc

log = logging.getLogger("zteam")


class ZteamError(Exception):
    """Base of all errors that zteam raises on purpose. A command prints it on one line and ends with `exit_code`."""

    exit_code = 1


class UsageError(ZteamError):
    """The command line or an argument is wrong."""

    exit_code = 2


class ConfigError(UsageError):
    """A team file is wrong; the text names file, key path and fix."""


class WorldError(UsageError):
    """A world file or its bitmap is wrong; the text begins with `file:line:column:` if known."""


class DecodeError(ZteamError):
    """A payload cannot be decoded as the expected message."""


class BehaviorError(ZteamError):
    """A behaviour, or a node of the user's own, breaks its contract."""


class BusError(ZteamError):
    """The bus failed: no router, another program on its port, a query without an answer."""


class QueryError(BusError):
    """The only answers to a query are errors."""

    def __init__(self, text: str, why: str) -> None:
        """`why` is what they say, without the keys that `text` names."""
        super().__init__(text)
        self.why = why


class QueryTimeoutError(QueryError):
    """No answer to a query came in time."""


class KeyExpressionError(BusError, UsageError):
    """A text is no key expression; the error names the right one where it can."""


class DuplicateNameError(BusError):
    """Another live process already has this process's name on the bus."""


class EncodeError(ZteamError):
    """A message has a value that its wire type cannot represent."""


def check_call(function: object, arguments: int, text: str) -> None:
    """Raise UsageError with `text` unless a user's `function` can be called with so many arguments, and is run then."""
    import inspect

    kinds = inspect.iscoroutinefunction, inspect.isasyncgenfunction, inspect.isgeneratorfunction
    if any(is_kind(function) for is_kind in kinds):
        raise UsageError(f"{text}; without 'async' and 'yield': a call of such a function does not run it")
    try:
        # Some built-in functions have no signature: a ValueError.
        with contextlib.suppress(ValueError):
            inspect.signature(function).bind(*[None] * arguments)  # type: ignore[arg-type]
    except TypeError:
        raise UsageError(text) from None


def did_you_mean(word: str, known: abc.Iterable[str], *, most: int = 1, form: str = " (did you mean {}?)") -> str:
    """The end of an error's text with the `most` similar known words, or an empty text where none is similar."""
    import difflib

    near = difflib.get_close_matches(word.lower()[:60], known, n=most, cutoff=0.75)
    return form.format(" or ".join(near)) if near else ""


def printable(text: str, kept: str = "") -> str:
    """The text without what would command a terminal or break a line; characters in `kept` stay.

    Control characters, those that change the direction of writing, invisible ones and lone surrogates become U+FFFD.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in kept else "\ufffd" for c in text)


def short(text: str, most: int = 2000) -> str:
    """What is shown of a text that another process sends again and again: no more than `most` characters, printable."""
    return printable(text if len(text) <= most else f"{text[:most]}…")


def printable_json(text: str) -> str:
    """The same JSON, with escapes for what a terminal must not get. It has no line breaks between its texts."""
    if text.isprintable():
        return text
    import json

    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in text)
