"""The contract of recordings: a recorded run is the same on every machine."""

import hashlib
from pathlib import Path

import zteam
from zteam import names
from zteam.record.comparing import compare

CONTENT = "b66cd547e216e15c93d86715561d24f2dd9a7a367e82d973769c864064b8515b"
"""SHA-256 of key, tick and bytes of all that processes publish in the ticks of the run below."""


def test_a_recorded_run_is_the_same_everywhere(tmp_path: Path) -> None:
    """All that is published in ticks has these very bytes, whatever the machine; and a second run has them too."""
    files = tmp_path / "first.mcap", tmp_path / "second.mcap"
    for file in files:
        zteam.run_team("arena", seconds=3.0, record=file)
    found = {(e.tick, e.key, e.data) for e in zteam.Recording(files[0]).entries() if 1 < e.tick < 30}
    # They hold ids of sessions.
    kept = sorted(each for each in found if each[1] != names.TICK)
    content = hashlib.sha256()
    for tick, key, data in kept:
        content.update(f"{tick} {key} {len(data)} ".encode() + data)
    assert (len(kept), content.hexdigest()) == (560, CONTENT)
    assert compare(*files).difference is None
