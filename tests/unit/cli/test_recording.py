"""`zteam recording info | compare | export | plot | recover`, called with words as on a command line."""

import json
import shutil
from pathlib import Path

import pytest

from support.commands import Run
from support.recorded import drive, write


@pytest.fixture(autouse=True)
def files(empty_folder: Path) -> None:
    """Three runs where the user stands: one, the same again, and one that was cut off."""
    write(Path("a.mcap"), drive(8), ticks="7")
    write(Path("b.mcap"), drive(8, session="another"), ticks="7")
    write(Path("cut.mcap"), drive(6), finished=False)


def test_info_says_what_a_file_holds(run: Run) -> None:
    """The command, the figures, each topic and the files; of a cut file, the way out."""
    text = run("zteam recording info a.mcap").out
    for told in ("zteam up two --lockstep, seed 3", "lock-step, 7 ticks", "robot_1/done", "files/two.toml", "0.70 m"):
        assert told in text
    facts = json.loads(run("zteam recording info a.mcap --json").out)
    assert (facts["report"]["ticks"], facts["topics"]["sim/tick"]["messages"], facts["files"]["launch.json"]) == (
        7,
        8,
        2,
    )
    assert "'zteam recording recover cut.mcap'" in run("zteam recording info cut.mcap").out


def test_the_exit_code_of_compare(run: Run) -> None:
    """0 for the same run, 1 with the first difference for another one, 2 where nothing could be compared."""
    assert run("zteam recording compare a.mcap b.mcap").out.startswith("the same: 7 ticks, 32 messages on 5 topics\n")
    other = run("zteam recording compare a.mcap cut.mcap", 1).out
    assert other.startswith("tick 6: sim/tick of sim is in A alone\n") and "cut.mcap was cut off" in other
    found = json.loads(run("zteam recording compare a.mcap cut.mcap --json", 1).out)
    assert (found["difference"]["tick"], found["difference"]["b"]) == (6, None)
    write(Path("none.mcap"), [])
    for name in ("none.mcap", "missing.mcap"):
        mistake = run(f"zteam recording compare a.mcap {name}", 2)
        assert not mistake.out and name in mistake.err and mistake.err.count("\n") == 1


def test_ignored_keys_and_a_tolerance(run: Run) -> None:
    """What is ignored is no difference, and a wrong key expression is a mistake on the command line."""
    run("zteam recording compare a.mcap cut.mcap --ignore '**' --atol 1e-9", 2)
    assert "robot_0/done" in run("zteam recording compare a.mcap b.mcap --ignore robot_0/done").out.splitlines()[-1]
    assert "robot_$*" in run("zteam recording compare a.mcap b.mcap --ignore 'robot_*/done'", 2).err


def test_recover_leaves_the_file_as_it_is(run: Run) -> None:
    """The copy is finished and the same run; the file itself, whose recorder may be alive, is not written."""
    before = Path("cut.mcap").read_bytes()
    run("zteam recording recover cut.mcap")
    assert Path("cut.mcap").read_bytes() == before
    assert run("zteam recording compare cut.mcap cut.recovered.mcap").out.startswith("the same")
    assert "exists" in run("zteam recording recover cut.mcap", 2).err
    assert "finished" in run("zteam recording recover a.mcap", 2).err


def test_other_forms(run: Run) -> None:
    """Tables, a directory and a picture lie where they were asked for; what exists is kept without --force."""
    run("zteam recording export a.mcap robot_0/done --format csv -o out")
    assert [path.name for path in Path("out").iterdir()] == ["robot_0.done.csv"]
    assert len(Path("out/robot_0.done.csv").read_text().splitlines()) == 9
    run("zteam recording export a.mcap --format ros2bag -o bag")
    assert sorted(path.name for path in Path("bag").iterdir()) == ["bag.mcap", "metadata.yaml"]
    assert "exists" in run("zteam recording export a.mcap --format ros2bag -o bag", 2).err
    assert json.loads(run("zteam recording plot a.mcap -o run.png --json").out)["robots"] == [0, 1]
    assert Path("run.png").read_bytes().startswith(b"\x89PNG")
    shutil.rmtree("out")
    Path("out").touch()
    assert "out" in run("zteam recording export a.mcap --format csv -o out", 2).err
