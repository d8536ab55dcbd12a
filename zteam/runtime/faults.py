"""How an error of a user's own code is shown: its traceback without the frames of zteam around it."""

import logging
import traceback
from pathlib import Path

log = logging.getLogger("zteam")

_OWN = str(Path(__file__).parents[1])
"""The folder of zteam."""


def fault_text(error: BaseException) -> str:
    """The traceback of `error` as text, cut to the user's frames; whole where there are none."""
    told = traceback.TracebackException.from_exception(error)
    links: list[traceback.TracebackException | None] = [told]
    while links:
        link = links.pop()
        if link is not None:
            mine = [frame for frame in link.stack if not frame.filename.startswith(_OWN)]
            link.stack = traceback.StackSummary.from_list(mine or link.stack)
            links += link.__cause__, link.__context__
    return "".join(told.format()).rstrip()


def log_fault(error: BaseException) -> int:
    """Log an error that ends the process; the exit code."""
    log.error("ended by an error:\n%s", fault_text(error))
    return 1
