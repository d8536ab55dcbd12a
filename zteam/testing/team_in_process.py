"""The team of a test in the test's own process: its lines come from Python's log."""

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from zteam.in_process.run import Body, InProcessRun
from zteam.launch.arguments import TeamLaunch
from zteam.runtime.log_keeper import KEEPER
from zteam.runtime.shutdown import Stop
from zteam.services.log_lines import LogLine


@contextmanager
def open_team(
    launch: TeamLaunch, nodes: Mapping[str, Body] | None, take_line: Callable[[str, str], None]
) -> Iterator[InProcessRun]:
    """A team that is not started yet; `take_line(name, line)` gets what its nodes say."""
    log = logging.getLogger("zteam")
    level = log.level
    # As a process of the team logs.
    log.setLevel(logging.INFO)
    try:
        with InProcessRun(launch, Stop(), _say_nothing, nodes) as run:
            end = KEEPER.pass_to(lambda line: take_line(line.process, _text(line)))
            try:
                yield run
            finally:
                end()
    finally:
        log.setLevel(level)


def _say_nothing(_name: str, _text: str) -> None:
    """The monitor's events are in the log too."""


def _text(line: LogLine) -> str:
    level = logging.getLevelName(line.level).lower()
    return line.text if line.level == logging.INFO else f"{level}: {line.text}"
