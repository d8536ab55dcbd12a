"""Every block of the pages is what it says: Python runs, team files are right. Tests of teams do the rest."""

import inspect
import re
import subprocess
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import pytest

from support.installed_packages import install
from support.pages import LANGUAGES, NOTES, PAGES, Block, all_blocks, blocks_of
from zteam.behaviors import Behavior
from zteam.config import entry_points
from zteam.config.resources import shipped_world
from zteam.robot.trials.check import PLACES, run_trials
from zteam.team.chaos.means import read_plan
from zteam.team.file.reading import read_team_file
from zteam.team.launch.check import check_team


def name_of(block: Block) -> str:
    """The block's place, as the name of its test."""
    return block.id


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_says_its_language(page: Path) -> None:
    """Each block has one of the known languages, and each comment above a block only known notes."""
    blocks = blocks_of(page)
    assert len(re.findall(r"^ *```", page.read_text(), re.MULTILINE)) == 2 * len(blocks)
    wrong = [
        f"{block.id}: {block.language or 'no language'} {sorted(block.notes)}"
        for block in blocks
        if block.language not in LANGUAGES or not set(block.notes) <= NOTES or (block.is_run and block.language != "sh")
    ]
    assert not wrong, f"blocks are {', '.join(LANGUAGES)}, notes {', '.join(sorted(NOTES))} (CONTRIBUTING.md)"


def test_the_pages_have_blocks() -> None:
    """The tests below cannot pass because nothing was found."""
    assert len([*all_blocks("python")]) > 20
    assert len([*all_blocks("toml")]) >= 5


def load(path: Path) -> ModuleType:
    """Import a saved block by its file's name."""
    import importlib

    importlib.invalidate_caches()
    return importlib.import_module(path.stem)


def try_behavior(module: ModuleType, kind: type[Behavior]) -> None:
    """The behaviour passes what `zteam check` tries without a simulator."""
    with patch.dict(PLACES, clear=True):
        results = [*run_trials(f"{module.__name__}:{kind.__name__}", kind, {})]
    assert not [fault for result in results for fault in result.faults]


@pytest.mark.few(6)
@pytest.mark.parametrize(
    "block", [b for b in all_blocks("python") if not b.needs_team and not b.has_team_tests], ids=name_of
)
def test_python_runs(block: Block, empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In an empty folder: its behaviours answer, its tests pass, everything else runs to its end. No process starts."""

    def refuse(*arguments: Any, **_: Any) -> None:
        raise AssertionError(f"{block.id} starts a process: {arguments}")

    module = None
    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", refuse)
        module = load(block.save(empty_folder))
        for test in block.tests:
            getattr(module, test)()
        for _, kind in inspect.getmembers(module, inspect.isclass):
            if issubclass(kind, Behavior) and kind.__module__ == module.__name__:
                try_behavior(module, kind)


@pytest.mark.few(6)
@pytest.mark.parametrize("block", [*all_blocks("toml")], ids=name_of)
def test_toml_is_right(block: Block, empty_folder: Path) -> None:
    """Team files pass the check of `zteam up`, plans of faults are read, and entry points are found by their names."""
    path = block.save(empty_folder)
    content = tomllib.loads(block.code)
    if "project" in content:
        check_entry_points(content["project"]["entry-points"], empty_folder)
        return
    if "faults" in content:
        assert read_plan(path)
        return
    file = read_team_file(path)
    world = None if file.team.team.world else shipped_world("office")
    check_team(file, world)


def check_entry_points(groups: dict[str, dict[str, str]], folder: Path) -> None:
    """Each group is one that zteam reads, and each name leads to what the block says."""
    known = {entry_points.BEHAVIORS, entry_points.MESSAGES}
    assert groups
    assert set(groups) <= known
    lines = [
        line for group, points in groups.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in points.items()))
    ]
    install(folder, "example", "\n".join(lines), {})
    for group, points in groups.items():
        for name in points:
            assert entry_points.load_offered(group, name) is not None
