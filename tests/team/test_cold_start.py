"""A team on a machine on which none has run yet."""

import os
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.team.launch.process import zteam_command


@pytest.mark.team
def test_a_first_start_compiles_nothing_and_leaves_nothing(tmp_path: Path) -> None:
    """With an empty home the shipped line drives and ends in order, without a word of compiling, and keeps no file."""
    home = tmp_path / "home"
    home.mkdir()
    done = subprocess.run(
        zteam_command("zteam", "up", "line", "--for", "1", "--lockstep"),
        cwd=tmp_path,
        env={**os.environ, "HOME": str(home), "XDG_CACHE_HOME": str(home / "cache")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "All robots GO!" in done.stdout
    assert "compil" not in done.stdout
    # The folder of the router's note stays.
    assert not [each for each in home.rglob("*") if not each.is_dir()]
