"""How an error of a user's own code is shown."""

import pytest

from support.log_capture import captured_log
from zteam.errors import UsageError
from zteam.names import parse_robot_id
from zteam.node.faults import fault_text, log_fault, shortage_text


def caught(call: object) -> BaseException:
    """What `call` raises."""
    assert callable(call)
    with pytest.raises(Exception) as info:
        call()
    return info.value


def deep(text: str) -> int:
    """Code of a user that calls zteam."""
    return parse_robot_id(text)


def test_frames_of_zteam_are_left_out() -> None:
    """The user's call is the last frame, though the error was raised further down."""
    text = fault_text(caught(lambda: deep("no number")))
    assert text.startswith("Traceback (most recent call last):\n")
    assert "in deep" in text
    assert "zteam/names.py" not in text
    assert "UsageError: " in text.splitlines()[-1]


def test_causes_are_cut_too() -> None:
    """Each link of a chain has the user's frames alone."""

    def chain() -> None:
        try:
            deep("no number")
        except UsageError as error:
            raise ValueError("no plan") from error

    text = fault_text(caught(chain))
    assert text.count("Traceback") == 2
    assert text.count("in deep") == 1
    assert "zteam/names.py" not in text
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
        (RuntimeError("can't start new thread"), "can't start new thread"),
        (OSError(12, "Cannot allocate memory"), "[Errno 12] Cannot allocate memory"),
        (
            ImportError("Error importing numpy:\nx.so: failed to map segment from shared object\n"),
            "x.so: failed to map segment from shared object",
        ),
        (BaseException("OS can't spawn worker thread: try again"), "OS can't spawn worker thread: try again"),
    ],
)
def test_too_little_memory_is_one_line(error: BaseException, reason: str) -> None:
    """Whatever said it, Python, Zenoh, the loader or the system, the line names the limits."""
    text = shortage_text(error)
    shown = f" ({reason})" if reason else ""
    assert text.startswith(f"the system gives no more memory or threads{shown}: raise the limit")
    assert "\n" not in text


@pytest.mark.parametrize("text", ["[Errno 24] Too many open files", "x.so: Too many open files", "Failed to init tx"])
def test_too_few_descriptors_are_one_line(text: str) -> None:
    """The line names the limit of open files."""
    assert shortage_text(BaseException(text)).startswith("the system gives no more open files")
    assert "'ulimit -n'" in shortage_text(BaseException(text))


def test_another_error_is_no_shortage() -> None:
    """Its traceback is needed."""
    assert shortage_text(RuntimeError("no way")) == ""
