"""Keys: what each of them asks for, and how a terminal's bytes become keys."""

import pytest

from zteam.nodes.teleop.keys import DIRECTIONS, FOCUS_GAINED, FOCUS_LOST, HELP_TEXT, NEXT, OTHER, SPACE, KeyDecoder

TELEOP_TWIST_KEYBOARD = {
    "i": (1, 0, 0), "o": (1, 0, -1), "j": (0, 0, 1), "l": (0, 0, -1), "u": (1, 0, 1), ",": (-1, 0, 0),
    ".": (-1, 0, 1), "m": (-1, 0, -1), "O": (1, -1, 0), "I": (1, 0, 0), "J": (0, 1, 0), "L": (0, -1, 0),
    "U": (1, 1, 0), "<": (-1, 0, 0), ">": (-1, -1, 0), "M": (-1, 1, 0),
}  # fmt: skip
"""x, y and turn of its table of moves."""


def test_the_keys_are_those_of_teleop_twist_keyboard() -> None:
    """Each of its keys in the plane means the same; the arrows are i, comma, j and l."""
    arrows = {"up": "i", "down": ",", "left": "j", "right": "l"}
    expected = {**TELEOP_TWIST_KEYBOARD, **{arrow: TELEOP_TWIST_KEYBOARD[key] for arrow, key in arrows.items()}}
    assert dict(DIRECTIONS) == expected


@pytest.mark.parametrize("key", ["i", "j", "l", "u", "o", "m", ",", ".", "k", "q", "z", "w", "x", "e", "c", "?", "tab"])
def test_the_help_names_every_key(key: str) -> None:
    """A user finds each key in the help."""
    assert key in HELP_TEXT.replace(":", " ").replace(";", " ").split() or f" {key}" in HELP_TEXT


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"iI,", ["i", "I", ","]),
        (b"\t \x1b[A", [NEXT, SPACE, "up"]),
        (b"\x1b[B\x1bOC\x1b[D", ["down", "right", "left"]),
        (b"\x1b[O\x1b[I", [FOCUS_LOST, FOCUS_GAINED]),
        (b"\x1b[15~\x1b[1;2A\x1bOPi", [OTHER, OTHER, OTHER, "i"]),
        (b"\x1bi", [OTHER]),
        ("é".encode(), ["é"]),
        (b"\xff", ["\ufffd"]),
    ],
)
def test_bytes_become_keys(data: bytes, keys: list[str]) -> None:
    """Plain keys, arrows in both modes of a terminal, its focus, and sequences without a meaning."""
    assert KeyDecoder().feed(data) == keys


def test_a_sequence_may_come_in_parts() -> None:
    """A loss of the focus that comes byte by byte is one key, not three."""
    decoder = KeyDecoder()
    assert [decoder.feed(bytes([byte])) for byte in b"\x1b[Oi"] == [[], [], [FOCUS_LOST], ["i"]]


def test_escape_alone_is_a_key() -> None:
    """Esc has no meaning, so it stops; it does not swallow the next key."""
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b") == []
    assert decoder.flush() == [OTHER]
    assert decoder.flush() == []
    assert decoder.feed(b"i") == ["i"]
