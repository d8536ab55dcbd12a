"""How an error of a user's own code is shown."""

import pytest

from zteam.errors import UsageError
from zteam.names import parse_robot_id
from zteam.runtime.faults import fault_text


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
