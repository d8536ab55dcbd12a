"""What `zteam up` notes before a team starts."""

from pathlib import Path

import pytest

from zteam.cli import up
from zteam.team.run.team_run import TeamRun

TEAM = '[team]\nworld = "arena"\n[[robots]]\n'


@pytest.mark.parametrize(
    ("arguments", "count"),
    [("ok.toml --seed 7", 1), ("ok.toml", 0), ("mine.toml --seed 7", 0), ("real.toml --seed 7", 1)],
)
def test_a_seed_that_changes_nothing_is_noted_once(
    arguments: str,
    count: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A note that says what a seed is for, and the team starts; none without --seed or where something is random."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(TeamRun, "start", lambda _run: pytest.fail("a process was started"))
    for name in ("ZTEAM_CONNECT", "ZTEAM_NAMESPACE"):
        monkeypatch.delenv(name, raising=False)
    (tmp_path / "ok.toml").write_text(TEAM + "id = 0\n")
    (tmp_path / "mine.toml").write_text(TEAM + 'id = 0\nbehavior = "wander"\n')
    (tmp_path / "real.toml").write_text(TEAM.replace("arena", "none") + "id = 0\n")
    with pytest.raises(pytest.fail.Exception, match="a process was started"):
        up.main(arguments.split())
    told = capsys.readouterr().err
    assert told.count("[up] --seed 7 changes nothing: this team draws no random numbers (noise of lasers") == count
    assert told.count("--seed") == count
