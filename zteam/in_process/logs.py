"""The log of several nodes in one process: whose line it is."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from zteam import names
from zteam.in_process.delivery import current_owner
from zteam.runtime.logs import KEEPER, node_of


@contextmanager
def naming_nodes() -> Iterator[None]:
    """Within, each record of the log has the name of its node as `node`; that of the launcher for all other code."""
    end, before = KEEPER.begin(), KEEPER.owner
    KEEPER.owner = lambda: current_owner(sys._getframe(), names.LAUNCHER)
    try:
        yield
    finally:
        KEEPER.owner = before
        end()


@contextmanager
def prefixing_lines() -> Iterator[None]:
    """Within, the text of each record of a node begins with the node's name: for programs with a log of their own."""
    make = logging.getLogRecordFactory()

    def make_record(*args: Any, **kwargs: Any) -> logging.LogRecord:
        record = make(*args, **kwargs)
        if node_of(record) not in ("", names.LAUNCHER):
            record.msg = f"[{node_of(record)}] {record.msg}"
        return record

    logging.setLogRecordFactory(make_record)
    try:
        yield
    finally:
        if logging.getLogRecordFactory() is make_record:
            logging.setLogRecordFactory(make)
