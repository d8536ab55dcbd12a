"""The user's own code by its name, and the folders in which a process finds modules."""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.errors import UsageError
from zteam.team.launch.own_behaviors import find_body
from zteam.team.testing.team import _SITE, search_folders


@pytest.fixture
def lab(empty_folder: Path) -> Path:
    """A folder of the search path with a module."""
    (empty_folder / "single.py").write_text(
        "def main(node):\n    pass\n\n\nTEXT = 'no function'\n\n\nasync def late(node):\n    pass\n"
    )
    return empty_folder


def test_only_folders_of_the_project_are_handed_on(lab: Path) -> None:
    """What Python has installed is left out: another Python would be spoilt by it."""
    folders = search_folders()
    assert folders[0] == str(lab)
    assert not {*sysconfig.get_paths().values()} & {*folders}


@pytest.mark.parametrize(
    ("spec", "told"),
    [
        ("single", r"'single' is no function: give package.module:function, such as 'crowd:main'"),
        ("single.py:main", "cannot import single.py: ModuleNotFoundError"),
        ("single:mian", r"module single \(.*single.py\) has no mian \(did you mean main\?\)"),
        ("single:TEXT", "'single:TEXT' is no function 'def main"),
        ("single:late", "without 'async' and 'yield'"),
        ("nowhere:main", "cannot import nowhere: ModuleNotFoundError"),
    ],
)
def test_a_body_that_is_not_there_is_told(lab: Path, spec: str, told: str) -> None:
    """In one line, with the node's name."""
    with pytest.raises(UsageError, match=r"^node 'crowd': ") as error:
        find_body("crowd", spec)
    assert "\n" not in str(error.value)
    assert error.match(told)


def test_a_started_python_looks_behind_its_own_modules(lab: Path) -> None:
    """In the folders of $ZTEAM_PATH: nothing of Python, of PYTHONPATH and of the script is hidden, and another
    `sitecustomize` still runs."""
    for name in ("json.py", "single.py", "site/sitecustomize.py", "site/first.py", "first.py"):
        path = lab / "far" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"print({name!r})")
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([_SITE, str(lab / "far" / "site")]),
        "ZTEAM_PATH": str(lab / "far"),
    }
    done = subprocess.run(
        [sys.executable, "-P", "-c", "import first, single, json, sys; json.dumps(1); print(sys.path[-1])"],
        env=environment, capture_output=True, text=True, timeout=LIMIT, check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["site/sitecustomize.py", "site/first.py", "single.py", str(lab / "far")]
    assert done.stderr == ""
