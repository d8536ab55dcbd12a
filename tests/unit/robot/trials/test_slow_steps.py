"""How long the steps of a behaviour under trial take, and one that does not return."""

import sys
from pathlib import Path

import pytest

from support.candidates import MINE, Candidate
from zteam.robot.trials import check


@pytest.mark.ci
def test_slow_steps_are_found(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The third step that works for longer than a tick ends the trials."""
    monkeypatch.setattr(check, "TICK", 0.001)
    mine = Candidate(folder, f"{MINE}sum(range(1_000_000))\n        return Twist()\n")
    (result,) = mine.try_it()
    (fault,) = result.faults
    assert fault.kind == "slow"
    assert fault.text.startswith("3 steps took longer than a tick of 0.001 s, the last 0.")
    assert fault.place == mine.place("def step")


@pytest.mark.parametrize(("steps", "patience", "is_slow"), [(2, 0.02, False), (3, 0.02, True), (3, 1.0, False)])
def test_steps_that_wait_are_the_machines(
    steps: int, patience: float, is_slow: bool, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps that wait without working are a fault only if they are many and long."""
    monkeypatch.setattr(check, "WAIT", patience)
    body = f"self.steps = getattr(self, 'steps', 0) + 1\n        time.sleep(0.03 * (self.steps <= {steps}))\n"
    mine = Candidate(folder, f"{MINE}{body}        return Twist()\n")
    trial = check.Trial("mine", mine.load(), {})
    try:
        trial.look(trial.moment.views())
    except check.TrialOver:
        pass
    assert [fault.kind for fault in trial.faults.values()] == ["slow"] * is_slow


def test_a_step_that_does_not_return_ends_the_trials(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop without end is said with its line, and no further trial begins."""
    monkeypatch.setattr(check, "HANGS_AFTER", 0.3)
    body = "while not Mine.is_free:\n            x = 1\n        return Twist()\n"
    mine = Candidate(folder, f"{MINE}{body}".replace("seen = []", "is_free = False"))
    try:
        (result,) = mine.try_it()
        assert [fault.text for fault in result.faults] == ["step did not return within 0.3 s"]
        assert result.faults[0].place in (mine.place("while not"), mine.place("x = 1"))
    finally:
        sys.modules[mine.module].Mine.is_free = True
