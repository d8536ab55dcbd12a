"""Presses as text."""

import pytest

from zteam.errors import UsageError
from zteam.nodes.teleop.script import parse_script


def test_words_are_presses() -> None:
    """A key, a key with a count, and names of keys that are no character."""
    assert parse_script("i*3 l*2 k") == ["i", "i", "i", "l", "l", "k"]
    assert parse_script(" up*2\n,  tab space > q ") == ["up", "up", ",", "tab", "space", ">", "q"]


@pytest.mark.parametrize(
    "text", ["", " ", "y", "i*0", "i*-1", "i*", "*3", "i**2", "i*1.5", "i*٣", "ii", "i*9999999", "?"]
)
def test_bad_scripts_are_refused(text: str) -> None:
    """One line that names the option, and the word if there is one."""
    with pytest.raises(UsageError) as caught:
        parse_script(text)
    assert str(caught.value).startswith("--script: ")
    assert "\n" not in str(caught.value)
    assert not text.strip() or repr(text.strip()) in str(caught.value)
