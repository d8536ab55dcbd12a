"""Errors that a user may see: each is one line that names the place and the way out."""


class ZteamError(Exception):
    """Base of all errors zteam raises on purpose. A command prints it on one line and ends with `exit_code`."""

    exit_code = 1


class UsageError(ZteamError):
    """The command line or an argument is wrong."""

    exit_code = 2


class ConfigError(UsageError):
    """A team file is wrong; the text names file, key path and the fix."""


class WorldError(UsageError):
    """A world file or its bitmap is wrong; the text begins with `file:line:column:` where known."""


class DecodeError(ZteamError):
    """A payload is not the message it should be."""


class BehaviorError(ZteamError):
    """A behaviour, or a robot's own process, does not do what it has to."""


class BusError(ZteamError):
    """The bus cannot do what was asked: no router, a foreign program on its port, a query without an answer."""


class DuplicateNameError(BusError):
    """Another live process holds this process's name on the bus."""


class EncodeError(ZteamError):
    """A message holds a value that its type on the wire cannot carry."""
