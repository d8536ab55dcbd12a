"""Presses as text: `i*10 l*5 k` is ten presses of `i`, five of `l`, and one of `k`, at 10 Hz."""

import re

from zteam.errors import UsageError
from zteam.nodes.teleop.keys import DIRECTIONS, NEXT, SPACE, SPEED_FACTORS, STOP

PERIOD = 0.1
"""Seconds from one press to the next."""
MAX_PRESSES = 1_000_000
_KEYS = (*DIRECTIONS, *SPEED_FACTORS, STOP, SPACE, NEXT)
_WORD = re.compile(r"(?P<key>[^*\s]+)(?:\*(?P<count>[1-9][0-9]{0,6}))?", re.ASCII)


def parse_script(text: str) -> list[str]:
    """The keys in their order. Raises UsageError that names the word."""
    presses: list[str] = []
    for word in text.split():
        found = _WORD.fullmatch(word)
        if found is None or found["key"] not in _KEYS:
            raise UsageError(f"--script: {word[:20]!r}: give keys such as i, i*10 or up*10; keys: {' '.join(_KEYS)}")
        count = int(found["count"] or "1")
        if len(presses) + count > MAX_PRESSES:
            raise UsageError(f"--script: {word[:20]!r}: more than {MAX_PRESSES} presses")
        presses += [found["key"]] * count
    if not presses:
        raise UsageError("--script: no key is given: give keys such as 'i*10 l*5 k'")
    return presses
