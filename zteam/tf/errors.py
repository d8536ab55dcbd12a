"""tf2's exceptions under tf2's names, with ROS 2's three kinds of extrapolation."""

from zteam.errors import ZteamError


class TransformException(ZteamError):  # noqa: N818 - tf2's name
    """Base of everything a look-up can raise."""


class LookupException(TransformException):
    """A frame does not exist."""


class ConnectivityException(TransformException):
    """Two frames are in trees that are not connected."""


class ExtrapolationException(TransformException):
    """The time asked for lies outside what the buffer holds."""


class BackwardExtrapolationException(ExtrapolationException):
    """It lies before the earliest data."""


class ForwardExtrapolationException(ExtrapolationException):
    """It lies after the latest data."""


class NoDataForExtrapolationException(ExtrapolationException):
    """There is one sample only, and it is of another time."""


class InvalidArgumentException(TransformException):
    """A frame name that no frame can have."""


class TimeoutException(TransformException):
    """A remote look-up did not answer in time."""
