"""A command in a fork of a warm parent ends as `subprocess.run` would show it."""

import subprocess
from collections.abc import Iterator

import pytest

from zteam.launch.process import zteam_command
from zteam.launch.warm_command import run_command
from zteam.launch.warm_parent import NO_FORK, WarmParent

LIMIT = 60.0


@pytest.fixture
def warm() -> Iterator[WarmParent]:
    """A warm parent."""
    with WarmParent() as parent:
        yield parent


@pytest.mark.few(1)
@pytest.mark.parametrize("fork", [True, False])
def test_output_error_and_exit_code_are_apart(warm: WarmParent, monkeypatch: pytest.MonkeyPatch, fork: bool) -> None:
    """Forked or spawned, a command has its own streams and exit code, and no input."""
    if not fork:
        monkeypatch.setenv(NO_FORK, "1")
    found = run_command(warm, zteam_command("zteam", "behaviors"), {}, LIMIT)
    assert (found.returncode, found.stderr) == (0, "")
    assert "wander" in found.stdout
    wrong = run_command(warm, zteam_command("zteam", "world", "chekc"), {}, LIMIT)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "did you mean check?" in wrong.stderr


@pytest.mark.few(1)
@pytest.mark.parametrize("fork", [True, False])
def test_the_environment_of_one_command_is_its_own(
    warm: WarmParent, monkeypatch: pytest.MonkeyPatch, fork: bool
) -> None:
    """A command gets what was given for it; the next one does not."""
    if not fork:
        monkeypatch.setenv(NO_FORK, "1")
    command = zteam_command("zteam", "node", "list")
    nowhere = run_command(warm, command, {"ZTEAM_LEASE": "soon"}, LIMIT)
    assert (nowhere.returncode, "--lease: 'soon'" in nowhere.stderr) == (2, True)
    other = run_command(warm, zteam_command("zteam", "behaviors"), {}, LIMIT)
    assert (other.returncode, other.stderr) == (0, "")


@pytest.mark.parametrize("fork", [True, False])
def test_a_command_that_does_not_end_is_killed(warm: WarmParent, monkeypatch: pytest.MonkeyPatch, fork: bool) -> None:
    """The caller gets TimeoutExpired, and the process is gone."""
    if not fork:
        monkeypatch.setenv(NO_FORK, "1")
    with pytest.raises(subprocess.TimeoutExpired):
        run_command(warm, zteam_command("zteam-router", "--listen", "tcp/127.0.0.1:0"), {}, 0.5)
    assert not [child for child in warm._children if child.returncode is None]
