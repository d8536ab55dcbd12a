"""A process and the launcher that has started it, and what that has started again.

Their link is one inherited descriptor, a socket. The process writes reports to it, one line of JSON each. Its reads end
when the launcher is gone.
"""

import contextlib
import os
import stat
from collections.abc import Mapping
from typing import Any

import msgspec

from zteam.config.numbers import counted

LINK = "ZTEAM_LAUNCHER_LINK"
"""Environment: the number of the descriptor."""


class Page(msgspec.Struct, frozen=True):
    """Where a view serves its page."""

    port: int
    token: str


class Report(msgspec.Struct, frozen=True, omit_defaults=True, kw_only=True):
    """What a process reports to its launcher; fields that do not apply are left out."""

    listening: str = ""
    """The endpoint of a router."""
    page: Page | None = None
    fault: str = ""
    """The text of the error that ends the process."""
    answer: Any = None
    """To a question of the launcher."""


_link: int | None = None


def take_link() -> int | None:
    """The descriptor of the link, None without a launcher; the children of this process do not inherit it."""
    global _link
    number = os.environ.pop(LINK, "")
    # A program between the launcher and this process may have closed the descriptor and passed on the variable.
    with contextlib.suppress(OSError):
        if number.isdigit() and stat.S_ISSOCK(os.fstat(int(number)).st_mode):
            _link = int(number)
            os.set_inheritable(_link, False)
    return _link


def report(**fields: Any) -> None:
    """Send a `Report` with these fields to the launcher, if there is one."""
    link = take_link()
    if link is not None:
        # It may be gone.
        with contextlib.suppress(OSError):
            os.write(link, msgspec.json.encode(Report(**fields)) + b"\n")


class Restarted(msgspec.Struct, frozen=True):
    """A process that was started again; `up/restarts` answers with all of them by name."""

    count: int
    """How often it was started again."""
    seconds: float | None = None
    """Host seconds from its failure until it was back, the longest of them; None if it never was."""


def restarts_text(restarts: Mapping[str, Restarted]) -> str:
    """In one line; empty if there are none."""
    told = []
    for name, each in sorted(restarts.items()):
        back = "" if each.seconds is None else f" (back after {each.seconds:.1f} s)"
        told.append(f"{name} {counted(each.count, 'time')}{back}")
    return f"started again: {', '.join(told)}" if told else ""
