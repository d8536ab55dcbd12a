"""One figure of the study `nav`."""

from collections.abc import Callable

import msgspec


class NavFigure(msgspec.Struct):
    """One figure."""

    what: str
    value: float
    unit: str
    must: float | None = None
    """At most this; for shares, at least."""
    detail: str = ""


Progress = Callable[[str, int, int], None]
