"""The routers of this machine."""

from pathlib import Path

import pytest

from support.limits import LIMIT
from support.transports import RouterProcess
from zteam.bus import BusOptions, connect
from zteam.bus.router import Router, find_local_routers


def test_a_router_is_found_as_long_as_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its endpoint is the one at which it listens; what a killed one has left behind is removed."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    router = RouterProcess()
    try:
        assert router.endpoint in find_local_routers()
    finally:
        router.kill()
    assert router.endpoint not in find_local_routers()
    assert not list((tmp_path / "zteam").iterdir())


@pytest.mark.parametrize("folder", ["missing", "closed"])
def test_a_router_works_without_a_folder_for_its_state(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is found by its endpoint only."""
    (tmp_path / "closed").write_text("no folder")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / folder / "below"))
    router = Router("tcp/127.0.0.1:0")
    try:
        connect(BusOptions(connect=router.endpoint), patience=LIMIT).close()
        assert find_local_routers() == ([router.endpoint] if folder == "missing" else [])
    finally:
        router.close()
    assert find_local_routers() == []
