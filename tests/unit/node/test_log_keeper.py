"""What a process keeps of its log."""

import logging
import os
import threading
from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from zteam.node.logs import KEEPER, KEPT, MAX_TEXT, LogKeeper, LogLine

LOGGER = logging.getLogger("somewhere.deep")


@pytest.fixture
def keeper(monkeypatch: pytest.MonkeyPatch) -> Iterator[LogKeeper]:
    """A keeper that keeps the lines of this test, from a logger without any output."""
    monkeypatch.setattr(LOGGER, "propagate", False)
    monkeypatch.setattr(LOGGER, "handlers", [logging.NullHandler()])
    LOGGER.setLevel(logging.INFO)
    made = LogKeeper()
    end = made.begin()
    yield made
    end()
    LOGGER.setLevel(logging.NOTSET)


def texts(keeper: LogKeeper) -> list[str]:
    """The kept texts."""
    return [line.text for line in keeper.kept("p")]


def test_a_line_has_time_level_place_and_process(keeper: LogKeeper) -> None:
    """A kept line says when, where and by which process it was logged; its logger needs no handler."""
    LOGGER.warning("speed %.1f", 0.5)
    (line,) = keeper.kept("robot_1")
    assert (line.process, line.level, line.text) == ("robot_1", logging.WARNING, "speed 0.5")
    assert (line.file, line.function) == (__file__, "test_a_line_has_time_level_place_and_process")
    assert line.line > 0 and line.time_ns > 0


def test_the_newest_lines_are_kept(keeper: LogKeeper) -> None:
    """A long log costs bounded memory: the oldest lines are forgotten."""
    for number in range(KEPT + 5):
        LOGGER.info("%d", number)
    assert texts(keeper) == [str(number) for number in range(5, KEPT + 5)]


def test_times_are_in_order_and_differ(keeper: LogKeeper, monkeypatch: pytest.MonkeyPatch) -> None:
    """Equal lines within one step of the host's clock can be told apart."""
    monkeypatch.setattr("zteam.node.logs.wall_ns", lambda: 5)
    for _ in range(3):
        LOGGER.info("same")
    times = [line.time_ns for line in keeper.kept("p")]
    assert times == sorted(set(times))
    assert len(times) == 3


def test_a_level_that_is_off_is_not_kept(keeper: LogKeeper) -> None:
    """What a process keeps is what it logs: its log level decides."""
    LOGGER.debug("detail")
    assert texts(keeper) == []


def test_an_exception_comes_with_its_traceback(keeper: LogKeeper) -> None:
    """The text of a logged exception ends with the exception."""
    try:
        raise ValueError("out of plans")
    except ValueError:
        LOGGER.exception("failed")
    (text,) = texts(keeper)
    assert text.startswith("failed\nTraceback")
    assert text.endswith("ValueError: out of plans")


def test_a_text_of_any_length_and_alphabet_can_be_sent(keeper: LogKeeper) -> None:
    """A huge text is cut, and what UTF-8 or a C string cannot carry is escaped."""
    LOGGER.info("x" * (MAX_TEXT + 1))
    # Without handlers: pytest's own report cannot carry such a text.
    logging.getLogRecordFactory()(LOGGER.name, logging.INFO, __file__, 1, "ä \udcff \0", (), None)
    long, odd = texts(keeper)
    assert long == "x" * MAX_TEXT + f"… ({MAX_TEXT + 1} characters)"
    assert odd == r"ä \udcff \x00"


def test_arguments_that_do_not_fit_do_not_break_the_call(
    keeper: LogKeeper, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong log call keeps its bare text; Python's own handler reports the mistake."""
    monkeypatch.setattr(LOGGER, "handlers", [logging.StreamHandler()])
    LOGGER.info("speed %d", "fast")
    assert texts(keeper) == ["speed %d"]
    assert "Logging error" in capsys.readouterr().err


def test_a_record_of_another_process_is_not_a_line(keeper: LogKeeper) -> None:
    """`logging.makeLogRecord` fills in a record that was logged elsewhere, such as in a worker process."""
    logging.makeLogRecord({"msg": "elsewhere"})
    assert texts(keeper) == []


def test_each_new_line_is_passed_on(keeper: LogKeeper) -> None:
    """A sink gets each line, in the thread that logs, until it is taken away."""
    passed: list[tuple[str, int]] = []
    end = keeper.pass_to(lambda line: passed.append((line.text, threading.get_ident())))
    LOGGER.info("one")
    end()
    LOGGER.info("two")
    assert passed == [("one", threading.get_ident())]


def test_a_sink_that_logs_ends(keeper: LogKeeper) -> None:
    """A line about a line that could not be sent is kept and not passed on, so that there is an end."""
    passed: list[str] = []

    def sink(line: LogLine) -> None:
        passed.append(line.text)
        LOGGER.warning("cannot send %s", line.text)

    keeper.pass_to(sink)
    LOGGER.info("one")
    LOGGER.info("two")
    assert passed == ["one", "two"]
    assert texts(keeper) == ["one", "cannot send one", "two", "cannot send two"]


def test_a_sink_that_fails_does_not_break_the_call(keeper: LogKeeper) -> None:
    """The error of a sink does not reach the code that logs, and the next line is passed on again."""
    passed: list[str] = []

    def sink(line: LogLine) -> None:
        passed.append(line.text)
        raise RuntimeError("no room")

    keeper.pass_to(sink)
    LOGGER.info("one")
    LOGGER.info("two")
    assert passed == texts(keeper) == ["one", "two"]


def test_an_argument_that_logs_does_not_block(keeper: LogKeeper) -> None:
    """Code that makes a line's text may wait for another thread that logs: no lock is held meanwhile."""
    logged = threading.Event()

    class Argument:
        def __str__(self) -> str:
            thread = threading.Thread(target=lambda: (LOGGER.info("other"), logged.set()))
            thread.start()
            assert logged.wait(LIMIT)
            return "argument"

    LOGGER.info("%s", Argument())
    assert texts(keeper)[0] == "other"
    assert "argument" in texts(keeper)


def test_threads_log_together(keeper: LogKeeper) -> None:
    """Lines of several threads are all passed on, and kept in the order of their times."""
    passed: list[LogLine] = []
    keeper.pass_to(passed.append)
    threads = [
        threading.Thread(target=lambda n=n: [LOGGER.info("%d %d", n, i) for i in range(40)])  # type: ignore[misc]
        for n in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    times = [line.time_ns for line in keeper.kept("p")]
    assert len(passed) == len(times) == 160
    assert times == sorted(times)


def test_a_second_begin_changes_nothing(keeper: LogKeeper) -> None:
    """A command keeps its lines from its start on; the node within it neither doubles nor ends that."""
    end = keeper.begin()
    LOGGER.info("one")
    end()
    LOGGER.info("two")
    assert texts(keeper) == ["one", "two"]


def test_the_last_end_counts() -> None:
    """Of two nodes in one program the second one keeps its lines when the first one ends; afterwards none are kept."""
    before = logging.getLogRecordFactory()
    keeper = LogKeeper()
    end_first, end_second = keeper.begin(), keeper.begin()
    end_first()
    LOGGER.warning("still here")
    assert texts(keeper) == ["still here"]
    end_second()
    LOGGER.warning("over")
    assert texts(keeper) == []
    assert logging.getLogRecordFactory() is before


def test_the_end_gives_the_record_factory_back() -> None:
    """After the end Python makes its records as before; other code's wrapper of the factory stays, and does no harm."""
    before = logging.getLogRecordFactory()
    keeper = LogKeeper()
    keeper.begin()()
    assert logging.getLogRecordFactory() is before
    end = keeper.begin()
    ours = logging.getLogRecordFactory()
    logging.setLogRecordFactory(lambda *a, **k: ours(*a, **k))
    end()
    keeper.begin()
    LOGGER.warning("once")
    assert texts(keeper) == ["once"]
    logging.setLogRecordFactory(before)


def test_the_end_forgets_the_lines(keeper: LogKeeper) -> None:
    """What one node of a program logged is not in the log of its next one."""
    other = LogKeeper()
    end = other.begin()
    LOGGER.info("one")
    end()
    end = other.begin()
    LOGGER.info("two")
    assert texts(other) == ["two"]
    end()
    assert texts(keeper) == ["one", "two"]


@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_forked_child_sends_nothing() -> None:
    """A forked child that logs neither uses its parent's session nor waits for a lock that a lost thread held."""
    passed: list[str] = []
    ends = KEEPER.begin(), KEEPER.pass_to(lambda line: passed.append(line.text))
    with KEEPER._lock:
        child = os.fork()
        if child == 0:
            logger = threading.Thread(target=LOGGER.warning, args=("child",), daemon=True)
            logger.start()
            logger.join(LIMIT)
            os._exit(len(passed) + 2 * logger.is_alive())
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    LOGGER.warning("parent")
    for end in ends:
        end()
    assert passed == ["parent"]
