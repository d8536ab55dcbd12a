"""The team of a test in the test's own process: its lines come from Python's log."""

import logging
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, wait
from contextlib import contextmanager
from threading import Thread

from zteam.in_process.run import Body, InProcessRun
from zteam.in_process.user_calls import UserCall, user_calls
from zteam.launch.kinds import TeamLaunch
from zteam.launch.supervisor import GRACE
from zteam.runtime.logs import KEEPER
from zteam.runtime.shutdown import Stop
from zteam.services.logs import LogLine

log = logging.getLogger("zteam")

_TRIES = 3


@contextmanager
def open_team(
    launch: TeamLaunch,
    nodes: Mapping[str, Body] | None,
    take_line: Callable[[str, str], None],
    take_hang: Callable[[UserCall], bool],
) -> Iterator[InProcessRun]:
    """A team that is not started yet; `take_line(name, line)` gets what its nodes say.

    `take_hang(call)` gets the calls of the nodes' own code that last too long, and says whether to end them.
    """
    level = log.level
    # As a process of the team logs.
    log.setLevel(logging.INFO)
    try:
        with InProcessRun(launch, Stop(), _say_nothing, nodes, take_hang=take_hang) as run:
            end = KEEPER.pass_to(lambda line: take_line(line.process, _text(line)))
            try:
                yield run
            finally:
                end()
    finally:
        log.setLevel(level)


def close_in_time(run: InProcessRun, close: Callable[[], None]) -> None:
    """Call `close()`, which ends the team, and end the calls that hold it up; a node that cannot be ended is left."""
    done = Future[None]()

    def work() -> None:
        try:
            close()
            done.set_result(None)
        except BaseException as error:
            done.set_exception(error)

    # The locks of a node that hangs would hold this thread for ever.
    Thread(target=work, name="end of the team", daemon=True).start()
    for _ in range(_TRIES):
        wait([done], GRACE)
        if done.done():
            break
        for call in user_calls():
            call.end()
    if done.done():
        done.result()


def _say_nothing(_name: str, _text: str) -> None:
    """The monitor's events are in the log too."""


def _text(line: LogLine) -> str:
    level = logging.getLevelName(line.level).lower()
    return line.text if line.level == logging.INFO else f"{level}: {line.text}"
