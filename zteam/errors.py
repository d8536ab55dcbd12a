"""Errors that a user may see. Each is one line that names the place and the fix."""

from collections import abc


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


class DuplicateNameError(BusError):
    """Another live process already has this process's name on the bus."""


class EncodeError(ZteamError):
    """A message has a value that its wire type cannot represent."""


def did_you_mean(word: str, known: abc.Iterable[str], *, most: int = 1, form: str = " (did you mean {}?)") -> str:
    """The end of an error's text with the `most` similar known words, or an empty text where none is similar."""
    import difflib

    near = difflib.get_close_matches(word.lower()[:60], known, n=most, cutoff=0.75)
    return form.format(" or ".join(near)) if near else ""
