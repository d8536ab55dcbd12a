"""How an error of a user's own code is shown."""

import sys
from collections.abc import Sequence
from traceback import FrameSummary, StackSummary

import pytest

from support.log_capture import captured_log
from zteam.errors import UsageError
from zteam.names import parse_robot_id
from zteam.node.faults import fault_text, log_fault, place_in, shortage_text


def caught(call: object) -> BaseException:
    """What `call` raises."""
    assert callable(call)
    with pytest.raises(Exception) as info:
        call()
    return info.value


def deep(text: str) -> int:
    """Code of a user that calls zteam."""
    return parse_robot_id(text)


INSTALLED = f"{sys.prefix}/lib/python3/site-packages/planner.py"


@pytest.mark.parametrize(
    ("files", "place"),
    [
        (["/me/main.py", fault_text.__code__.co_filename], "/me/main.py:1"),
        (["/me/main.py", INSTALLED, fault_text.__code__.co_filename], "/me/main.py:1"),
        ([INSTALLED, fault_text.__code__.co_filename], f"{INSTALLED}:1"),
        ([fault_text.__code__.co_filename], ""),
    ],
)
def test_the_line_of_an_error_is_the_users_own(files: Sequence[str], place: str) -> None:
    """The innermost one that is neither zteam's nor, where there is another one, of an installed package."""
    assert place_in(StackSummary.from_list([FrameSummary(file, 1, "f") for file in files])) == place


def test_frames_of_zteam_are_left_out() -> None:
    """The user's call is the last frame, though the error was raised further down, in each link of a chain."""

    def chain() -> None:
        try:
            deep("no number")
        except UsageError as error:
            raise ValueError("no plan") from error

    text = fault_text(caught(chain))
    assert text.startswith("Traceback (most recent call last):\n")
    assert (text.count("Traceback"), text.count("in deep"), text.count("zteam/names.py")) == (2, 1, 0)
    assert text.endswith("ValueError: no plan")


def test_an_error_of_zteam_itself_is_shown_whole() -> None:
    """Without a frame of the user's there is nothing to cut to."""
    error = caught(lambda: parse_robot_id("no number"))
    below = error.__traceback__
    while below is not None and not below.tb_frame.f_code.co_filename.endswith("zteam/names.py"):
        below = below.tb_next
    text = fault_text(error.with_traceback(below))
    assert "zteam/names.py" in text
    assert "test_faults.py" not in text


def test_a_users_own_demand_for_memory_shows_its_line() -> None:
    """An array of a wrong size is a mistake of the user's code: its frames come before the word about limits."""

    def allocate() -> None:
        raise MemoryError("Unable to allocate 728 TiB")

    with captured_log() as log:
        log_fault(caught(allocate))
    assert "in allocate" in log.lines[0]
    assert "raise the limit" in log.lines[0]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (MemoryError(), ""),
        (RuntimeError("can't start new thread"), " (can't start new thread)"),
        (OSError(12, "Cannot allocate memory"), " ([Errno 12] Cannot allocate memory)"),
        (ImportError("Error importing numpy:\nx.so: failed to map segment\n"), " (x.so: failed to map segment)"),
        (BaseException("OS can't spawn worker thread: no"), " (OS can't spawn worker thread: no)"),
        (OSError(24, "Too many open files"), " ([Errno 24] Too many open files)"),
        (BaseException("Failed to init tx"), " (Failed to init tx)"),
        (RuntimeError("no way"), None),
    ],
)
def test_a_shortage_is_one_line(error: BaseException, reason: str | None) -> None:
    """Whatever said it, Python, Zenoh, the loader or the system, the line names the limits. The traceback of another
    error is needed."""
    told = f"the system gives no more memory, threads or open files{reason}: raise the limit ('ulimit -v', "
    assert shortage_text(error)[: len(told)] == ("" if reason is None else told)
