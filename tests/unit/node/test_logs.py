"""Where the log of a command goes."""

import json
import logging
from collections.abc import Iterator

import pytest

from zteam.node import logs
from zteam.node.logs import LogKeeper, start_logging


@pytest.fixture(autouse=True)
def keeper(monkeypatch: pytest.MonkeyPatch) -> Iterator[LogKeeper]:
    """What a command sets up comes back after the test: loggers, and how records are made."""
    made, factory = LogKeeper(), logging.getLogRecordFactory()
    monkeypatch.setattr(logs, "KEEPER", made)
    changed = [logging.getLogger(name) for name in ("zteam", "", "PIL")]
    before = [(log, log.level, [*log.handlers], log.propagate) for log in changed]
    yield made
    logging.setLogRecordFactory(factory)
    for log, level, handlers, propagate in before:
        log.setLevel(level)
        log.handlers, log.propagate = handlers, propagate


def test_a_users_module_logs_like_zteam(capsys: pytest.CaptureFixture[str]) -> None:
    """The loggers of zteam and of a behaviour's module write one line an event to stderr, from the same level up."""
    start_logging("robot_1", "info")
    for name in ("zteam", "my_behavior"):
        logging.getLogger(name).info("turns")
        logging.getLogger(name).debug("unseen")
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(" ")[2] for line in lines] == ["[robot_1] turns"] * 2


def test_a_second_start_replaces_the_first(capsys: pytest.CaptureFixture[str]) -> None:
    """A line is written once, under the last name, and the handlers of other code stay."""
    other = logging.NullHandler()
    logging.getLogger().addHandler(other)
    start_logging("one")
    start_logging("two", "debug", "json")
    logging.getLogger("my_behavior").debug("turns")
    (line,) = capsys.readouterr().err.splitlines()
    assert json.loads(line)["process"] == "two"
    assert other in logging.getLogger().handlers


def test_libraries_do_not_fill_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    """`--log-level debug` shows no debug lines of the library that reads pictures."""
    start_logging("sim", "debug")
    logging.getLogger("PIL.PngImagePlugin").debug("chunk")
    logging.getLogger("PIL.PngImagePlugin").info("chunk")
    assert capsys.readouterr().err == ""


def test_lines_are_kept_from_the_start(keeper: LogKeeper, capsys: pytest.CaptureFixture[str]) -> None:
    """A line from before the process has a session is there for the query."""
    start_logging("robot_1")
    logging.getLogger("my_behavior").info("imported %d", 7)
    assert keeper.kept("robot_1")[-1].text == "imported 7"
    assert "imported 7" in capsys.readouterr().err
