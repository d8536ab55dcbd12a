"""tf2's exceptions under tf2's names, with ROS 2's three kinds of extrapolation."""

from zteam.errors import ZteamError


class TransformException(ZteamError):  # noqa: N818 - tf2's name
    """The base class of all exceptions of a look-up."""


class LookupException(TransformException):
    """A frame does not exist."""


class ConnectivityException(TransformException):
    """Two frames are in trees that are not connected."""


class ExtrapolationException(TransformException):
    """The time asked for lies outside what the buffer holds."""


class BackwardExtrapolationException(ExtrapolationException):
    """The time asked for lies before the earliest data."""


class ForwardExtrapolationException(ExtrapolationException):
    """The time asked for lies after the latest data."""


class NoDataForExtrapolationException(ExtrapolationException):
    """The buffer holds no sample, or only one, which has another time."""


class InvalidArgumentException(TransformException):
    """An argument is invalid, such as an empty frame name or one with a leading slash."""


class TimeoutException(TransformException):
    """A remote look-up did not answer in time."""
