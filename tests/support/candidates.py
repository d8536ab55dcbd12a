"""Behaviours of students, made by a test, and what `run_trials` finds in them."""

import importlib
import itertools
from pathlib import Path
from typing import Any
from unittest.mock import patch

from zteam.behaviors import Behavior
from zteam.robot.behaviors.registry import find_behavior
from zteam.robot.trials.check import PLACES, Fault, TrialResult, run_trials

HEAD = """\
import math, random, time
import msgspec
import numpy as np
from typing import Annotated
from msgspec import Meta
from zteam import Behavior, Pose2, View
from zteam.behaviors import look_ahead
from zteam.messages import Odometry, PoseStamped, RobotStatus, Twist, Vector3
"""
NUMBERS = itertools.count()
MINE = "class Mine(Behavior):\n    seen = []\n\n    def step(self, view: View) -> Twist:\n        "
"""Before the body of `step`."""


class Candidate:
    """A behaviour `Mine` of a student, in a module of its own."""

    def __init__(self, folder: Path, code: str) -> None:
        self.module = f"mine_{next(NUMBERS)}"
        self.lines = (HEAD + code).splitlines()
        (folder / f"{self.module}.py").write_text(HEAD + code)

    def try_it(self, *, in_worlds: bool = False, **params: Any) -> list[TrialResult]:
        """The results of the trials; those in the simulator only if asked for, because they take longest."""
        with patch.dict(PLACES, clear=not in_worlds):
            return [*run_trials(f"{self.module}:Mine", self.load(), params)]

    def load(self) -> type[Behavior]:
        """Its class."""
        importlib.invalidate_caches()
        return find_behavior(f"{self.module}:Mine")

    def place(self, source: str) -> str:
        """The place of a line of it."""
        at = next(n for n, line in enumerate(self.lines, 1) if source in line)
        return f"{self.module}.py:{at}"


def faults_of(results: list[TrialResult]) -> dict[str, list[Fault]]:
    """What is wrong, by trial."""
    return {result.name: result.faults for result in results if result.faults}


def only_fault(results: list[TrialResult], kind: str) -> Fault:
    """The fault of this kind that was found first; nothing of another kind is wrong."""
    faults = [fault for result in results for fault in result.faults]
    assert {fault.kind for fault in faults} == {kind}, faults
    return faults[0]
