"""The user's behaviours, imported in a process of their own."""

import os
from pathlib import Path

import pytest

from zteam.team.launch.own_behaviors import Inquiry, Question


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
    with Inquiry([Question("bad:Robot", {})], [str(tmp_path)]) as inquiry:
        (answer,) = inquiry.answers()
    assert told in answer.refused
    assert "bad:Robot" in answer.refused


def test_a_module_that_hangs_is_given_up(tmp_path: Path) -> None:
    """After the limit the check goes on, and the process that hangs is ended."""
    (tmp_path / "slow.py").write_text("import time; time.sleep(600)")
    with Inquiry([Question("slow:Robot", {})] * 2, [str(tmp_path)]) as inquiry:
        assert inquiry._process is not None
        pid = inquiry._process.pid
        first, _ = inquiry.answers(limit=0.5)
        assert first.refused == "behaviour 'slow:Robot': importing it is not done after 0.5 s"
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
