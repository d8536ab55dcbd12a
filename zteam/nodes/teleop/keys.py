"""The keys of teleop_twist_keyboard and the arrows, and how a terminal's bytes become keys. Pure."""

import codecs
import re
from typing import NamedTuple


class Direction(NamedTuple):
    """Shares of the speed forwards and to the left, and of the turn rate to the left."""

    forward: float
    left: float
    turn: float


DIRECTIONS = {
    "u": Direction(1, 0, 1), "i": Direction(1, 0, 0), "o": Direction(1, 0, -1),
    "j": Direction(0, 0, 1), "l": Direction(0, 0, -1),
    "m": Direction(-1, 0, -1), ",": Direction(-1, 0, 0), ".": Direction(-1, 0, 1),
    "U": Direction(1, 1, 0), "I": Direction(1, 0, 0), "O": Direction(1, -1, 0),
    "J": Direction(0, 1, 0), "L": Direction(0, -1, 0),
    "M": Direction(-1, 1, 0), "<": Direction(-1, 0, 0), ">": Direction(-1, -1, 0),
    "up": Direction(1, 0, 0), "down": Direction(-1, 0, 0), "left": Direction(0, 0, 1), "right": Direction(0, 0, -1),
}  # fmt: skip
SPEED_FACTORS = {"q": (1.1, 1.1), "z": (0.9, 0.9), "w": (1.1, 1.0), "x": (0.9, 1.0), "e": (1.0, 1.1), "c": (1.0, 0.9)}
"""By what a key multiplies speed and turn rate."""
STOP, SPACE, NEXT, HELP = "k", "space", "tab", "?"
FOCUS_LOST, FOCUS_GAINED = "focus lost", "focus gained"
OTHER = "other"
"""Any sequence without a meaning here, such as that of a function key."""

HELP_TEXT = """\
u i o   forwards, with a turn to the left or right (up: i)
j   l   turn (left, right)
m , .   backwards, with a turn (down: ,)
With shift, for omnidirectional bases: J L sideways, U O M > at an angle, I < straight.
q z     both speeds 10 % up, down; w x: only the speed; e c: only the turn rate
k, space, any other key: stop    tab: stop, let go, next robot    ?: this help    Ctrl+C: stop and end
A key counts for 0.75 s after its first press and for 0.3 s after each repeat."""

_NAMES = {"\t": NEXT, " ": SPACE}
_SEQUENCES = {
    **{start + end: key for start in "[O" for end, key in {"A": "up", "B": "down", "C": "right", "D": "left"}.items()},
    "[I": FOCUS_GAINED,
    "[O": FOCUS_LOST,
}
_KEY = re.compile(r"\x1b(?P<sequence>\[[0-?]*[ -/]*[@-~]|O.|[^\[O])|(?P<plain>[^\x1b])", re.DOTALL)


class KeyDecoder:
    """Makes keys of what a terminal sends; a sequence may come in parts."""

    def __init__(self) -> None:
        self._characters = codecs.getincrementaldecoder("utf-8")("replace")
        self._rest = ""

    def feed(self, data: bytes) -> list[str]:
        """The keys that are whole now."""
        text = self._rest + self._characters.decode(data)
        keys, end = [], 0
        while found := _KEY.match(text, end):
            end = found.end()
            plain = found["plain"]
            keys.append(_NAMES.get(plain, plain) if plain else _SEQUENCES.get(found["sequence"], OTHER))
        self._rest = text[end:]
        return keys

    def flush(self) -> list[str]:
        """Nothing more has come for a while: a sequence that has only begun was a key, such as Esc."""
        begun, self._rest = self._rest, ""
        return [OTHER] if begun else []
