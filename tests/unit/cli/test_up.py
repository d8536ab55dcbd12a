"""The command line of `zteam up`, and its output."""

from pathlib import Path

import pytest

from support.commands import exit_code
from zteam.cli import up
from zteam.config.resources import names, teams_folder, worlds_folder


@pytest.fixture(autouse=True)
def nothing_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail a test if its command line starts a process."""

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr("zteam.team.run.team_run.TeamRun.start", refuse)
    for name in ("ZTEAM_CONNECT", "ZTEAM_NAMESPACE"):
        monkeypatch.delenv(name, raising=False)


def test_the_default_is_the_shipped_line() -> None:
    """`zteam up` alone starts the four-robot line."""
    assert up.build_parser().parse_args([]).team == "line"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nowhere.toml"], "nowhere.toml"),
        (["willow"], "--world"),
        (["arena", "--world", "nowhere"], "nowhere"),
        (["arena", "--speed", "1e-300"], "speed"),
        (["arena", "--lockstep", "--lockstep-timeout", "nan"], "--lockstep-timeout"),
        (["arena", "--lockstep", "--lockstep-timeout", "inf"], "--lockstep-timeout"),
        (["arena", "--seed", "9" * 30], "--seed"),
        (["arena", "--connect", "tcp/127.0.0.1:99999"], "port"),
        (["arena", "--secure", "--in-process"], "--secure needs processes: leave --in-process out"),
        (["arena", "--secure", "--connect", "tcp/127.0.0.1:7447"], "with --secure the router is at tls/HOST:PORT"),
        (["--secure", "arena"], "say 'zteam up arena --secure'"),
        (["arena", "--for", "0"], "--for"),
        (["arena", "--for", "-1"], "--for"),
        (["arena", "--for", "nan"], "--for"),
        (["arena", "--for", "inf"], "--for"),
        (["arena", "--report", "r.json"], "--for"),
        (["real.toml", "--for", "3"], "simulator"),
        (["circle.toml"], "circle"),
        (["extra.toml"], "extra.toml:2: team.worlds: unknown key (did you mean world?)"),
        (["arena", "--namespace", "a*"], "--namespace"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str],
    text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A wrong command line or team file ends with 2 and one line that names the place; no process starts."""
    monkeypatch.chdir(tmp_path)
    robot = "[[robots]]\nid = {0}\n{1}\n"
    (tmp_path / "real.toml").write_text('[team]\nworld = "none"\n' + robot.format(0, ""))
    circle = robot.format(0, "follow = 2") + robot.format(1, "follow = 0") + robot.format(2, "follow = 1")
    (tmp_path / "circle.toml").write_text('[team]\nworld = "office"\n' + circle)
    (tmp_path / "extra.toml").write_text('[team]\nworlds = "arena"\n' + robot.format(0, ""))
    assert exit_code(up.main, arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert text in line


TEAM = '[team]\nworld = "arena"\n[[robots]]\n'
FILES = {
    "ok.toml": TEAM + "id = 0\n",
    "empty.toml": "",
    "ids.toml": TEAM + "id = 7\n[[robots]]\nid = 0\n[[robots]]\nid = 0\n",
    "wonder.toml": TEAM + 'id = 0\nbehavior = "wonder"\n',
    "garden.toml": TEAM.replace("arena", "aren") + "id = 0\n",
    "bare.toml": TEAM.replace('"', "") + "id = 0\n",
    "boom.toml": TEAM + 'id = 0\nbehavior = "boom_at_import:Boom"\n',
    "boom_at_import.py": "raise ValueError('the map is missing')\n",
    "utf16.toml": TEAM + "id = 0\n",
    "lost.world": 'include "nowhere.inc"\n',
    "folder/team.toml": TEAM + "id = 0\n",
}
"""What a new user has in the current folder."""
TEAMS = ", ".join(names(teams_folder(), ".toml"))
WORLDS = ", ".join(names(worlds_folder(), ".world"))


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("arguments", "lines"),
    [
        ("aren", [f"team 'aren': no such file, nor a shipped team ({TEAMS}); did you mean arena?"]),
        ("no/team.toml", [f"team 'no/team.toml': no such file, nor a shipped team ({TEAMS})"]),
        ("office", ["team 'office': that is a world; say 'zteam up --world office' or 'zteam-sim office'"]),
        (
            "worlds/office.world",
            ["team 'worlds/office.world': that is a world; say 'zteam up --world worlds/office.world' or"],
        ),
        (
            "lost.world",
            ["team 'lost.world': that is a world; say 'zteam up --world lost.world' or 'zteam-sim lost.world'"],
        ),
        ("folder", ["team 'folder': that is a folder; name the team file in it (*.toml)"]),
        (
            "ok.toml --world ofice",
            [f"world 'ofice': no such file, nor a shipped world ({WORLDS}); did you mean"],
        ),
        ("ok.toml --world folder", ["world 'folder': that is a folder; name the world file in it (*.world)"]),
        ("line --world ok.toml", ["world 'ok.toml': that is a team; say 'zteam up ok.toml'"]),
        ("ok.toml --world lost.world", ["lost.world:1:9: included file 'nowhere.inc' not found in . or $STAGEPATH"]),
        (
            "garden.toml",
            ["garden.toml:2: team.world: 'aren' is neither a file beside the team file nor a ship"],
        ),
        (
            "empty.toml",
            [
                "empty.toml: the key robots is missing: add a table [[robots]]",
                "empty.toml: team: the key world is missing",
            ],
        ),
        (
            "ids.toml",
            [
                "ids.toml:4: robots[0].id: the world has no robot 7 (it has 0, 1); model and pose add one",
                "ids.toml:8: robots[2].id: robot 0 is robots[1] already; give each robot its own id",
            ],
        ),
        ("wonder.toml", ["wonder.toml:5: robots[0].behavior: no behaviour 'wonder' (did you mean wander?): use"]),
        (
            "boom.toml",
            ["boom.toml:5: robots[0].behavior: behaviour 'boom_at_import:Boom': cannot import boom"],
        ),
        ("bare.toml", ["bare.toml:2:9: not TOML: Invalid value; text needs quotes"]),
        ("utf16.toml", ["utf16.toml: not UTF-8 text (byte 0); save it as UTF-8"]),
        ("ok.toml --for 1 --report no/r.json", ["--report no/r.json: cannot write: "]),
        ("ok.toml --for 1 --report folder", ["--report folder: cannot write: "]),
        (
            "ok.toml --for 1 --report /proc/r.json",
            ["--report /proc/r.json: cannot write: "],
        ),
    ],
)
def test_a_new_users_mistakes_are_named_with_the_way_out(
    arguments: str,
    lines: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Each mistake is one line with its place, its cause and what to do; the command ends with 2 and starts nothing."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-16" if name == "utf16.toml" else "utf-8")
    assert exit_code(up.main, arguments.split()) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    told = captured.err.splitlines()
    assert len(told) == len(lines), told
    assert all(line.startswith(f"up: {start}") for line, start in zip(told, lines, strict=True)), told
