"""The user's behaviours, imported in a process of their own."""

import os
from pathlib import Path

import pytest

from support.transports import wait_until_true
from zteam.team.launch import own_behaviors
from zteam.team.launch.own_behaviors import Question, asking


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("import sys; sys.exit('no GPU')", "bad.py:1: SystemExit: no GPU"),
        ("import os; print('far too old', flush=True); os._exit(7)", "ended the process (exit code 7): far too old"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "ended the process (killed by SIGSEGV)"),
        ("raise RuntimeError('two\\nlines')", "bad.py:1: RuntimeError: two lines"),
        ("import sys; sys.stdout.close()", "module bad"),
        ("import threading, time; threading.Thread(target=time.sleep, args=(600,)).start()", "has no Robot"),
    ],
)
def test_a_module_that_misbehaves_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, told: str
) -> None:
    """Whatever the import does, the launcher goes on, and the answer names the behaviour."""
    (tmp_path / "bad.py").write_text(code)
    monkeypatch.chdir("/")
    with asking([Question("bad:Robot", {})], [str(tmp_path)]) as answers:
        (answer,) = answers()
    assert told in answer.refused
    assert "bad:Robot" in answer.refused


def test_a_module_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the limit the check goes on, and the process that hangs is ended."""
    told = tmp_path / "pid"
    (tmp_path / "slow.py").write_text(
        f"import os, time\nwith open({str(told)!r}, 'w') as file: file.write(f'{{os.getpid()}} ')\ntime.sleep(600)"
    )
    monkeypatch.setattr(own_behaviors, "LIMIT", 0.5)
    with asking([Question("slow:Robot", {})] * 2, [str(tmp_path)]) as answers:
        wait_until_true(lambda: told.exists() and told.read_text().endswith(" "))
        first, _ = answers()
        assert first.refused == "behaviour 'slow:Robot': importing it is not done after 0.5 s"
    with pytest.raises(ProcessLookupError):
        os.kill(int(told.read_text()), 0)
