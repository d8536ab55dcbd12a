"""What comes from the bus neither commands the terminal of a command nor begins a line of its output."""

import io
import json
import logging
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import zteam.cli
from support.commands import run_here
from support.examples import examples
from support.named_sessions import open_named
from support.transforms import stamped
from zteam import names
from zteam.bus import MemoryHub, NoRequest
from zteam.cli.doctor import format_findings
from zteam.cli.options import fail
from zteam.cli.up_display import RunDisplay
from zteam.errors import ZteamError
from zteam.messages import Header, PoseStamped, TFMessage
from zteam.monitor.doctor.facts import problem
from zteam.monitor.process.display import JsonLines, Lines
from zteam.monitor.process.start_gate import Event
from zteam.node.logs import LogLine, start_logging
from zteam.node.output import Clean, print_block, print_json, print_line
from zteam.robot.client import DESCRIBE, DescribeReply
from zteam.robot.parameters import Parameter
from zteam.simulator.client import SimStatus
from zteam.transforms import FrameInfo

EVIL = "\x1b]0;owned\x07\x1b[2J\x1b[8m\u202e\x9b31m\x7f\u200b\u2028\r\n[up] all is well"
"""A title, an empty screen, hidden and turned text, a control character of eight bits, and a forged line."""
texts = st.text(st.characters() | st.sampled_from(EVIL)) | st.just(EVIL)


def assert_harmless(output: str) -> None:
    """Nothing in it is more than a character, and no line is forged."""
    assert output.replace("\n", "").replace("\t", "").isprintable(), repr(output)
    assert not [line for line in output.splitlines() if line.startswith("[up]")], output


def find_parameter(key: str) -> DescribeReply:
    """Of a robot whose every text is evil."""
    return DescribeReply(EVIL, [Parameter(EVIL, EVIL, {}, EVIL, default=EVIL)], {EVIL: [EVIL], "speed": EVIL})


@pytest.fixture
def hostile(tools: MemoryHub) -> None:
    """A team that lies in every name and every text; all commands look at it."""
    bus = open_named(tools, "robot_0")
    goal = PoseStamped(Header(frame_id=EVIL))
    bus.publisher(f"robot_0/{EVIL}/x", PoseStamped, latched=True).put(goal)
    bus.publisher("tf_static", TFMessage, latched=True).put(TFMessage([stamped("map", EVIL, 0), stamped(EVIL, "b", 0)]))
    info = {"name": EVIL, "host": EVIL, "pid": 7, "start": 0, "instance": EVIL, "version": EVIL}
    frames = {EVIL: FrameInfo(EVIL + "x", EVIL, False, 1.0, 0, 1, 2), "b": FrameInfo(EVIL, EVIL, True, 0.0, 0, 0, 1)}
    status = SimStatus(EVIL, [0], 1, 1, 1, 1, 1.0, lockstep=True, participants=[EVIL], waiting_for=EVIL, hung=[EVIL])
    answers: dict[str, object] = {
        names.info_key(EVIL): info,
        names.stats_key(EVIL): {f"robot_0/{EVIL}/x": {"received": 1, "dropped": 1, "reason": EVIL, "last": 0.0}},
        names.log_key("robot_0"): [LogLine(1, EVIL, 20, EVIL, EVIL, EVIL)],
        names.service_key(names.AGGREGATOR, "frames"): frames,
        names.service_key(names.AGGREGATOR, "conflicts"): [EVIL],
        names.service_key(names.SIMULATOR, "status"): status,
        names.service_key("robot_0", DESCRIBE): find_parameter("robot_0"),
    }
    for key, answer in answers.items():
        bus.serve(key, NoRequest, lambda _, answer=answer: answer)


@pytest.mark.parametrize("form", ["", " --json"])
@pytest.mark.parametrize(
    "command",
    [
        "node list", "topic list", "topic info **", "topic echo robot_0/** --once", "tf tree", "tf monitor --for 0.02",
        f"topic hz 'robot_0/{EVIL}/x' --timeout 0.05", "tf positions", "tf echo map b --once", "param list",
        "tf echo map c --timeout 0.05", "param get 0 speed", "param get 0 sped", "param dump 0", "sim status",
        "log --once", "log robot_9 --once",
    ],
)  # fmt: skip
@pytest.mark.usefixtures("hostile")
def test_no_text_of_a_team_reaches_the_terminal_as_it_is(
    command: str, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every command, as text and as JSON, which has the very text."""
    run_here(f"zteam {command}{form}")
    output, errors = capsys.readouterr()
    assert output or errors
    assert_harmless(output + errors)
    if form and output:
        for line in output.splitlines():
            json.loads(line)


@examples(100)
@given(st.lists(texts))
def test_a_line_is_one_line(lines: list[str]) -> None:
    """Whatever is printed; what is ready for the terminal comes as it is."""
    out = io.StringIO()
    print_line(*lines, file=out)
    assert out.getvalue().count("\n") == len(lines)
    assert_harmless(out.getvalue().replace("[up]", ""))
    ready = Clean("\033[31mred\033[0m\nsecond")
    out = io.StringIO()
    print_block(ready, file=out)
    assert out.getvalue() == f"{ready}\n"


@examples(100)
@given(st.recursive(texts, lambda inner: st.lists(inner) | st.dictionaries(texts, inner)))
def test_json_is_the_same_value_in_harmless_characters(value: object) -> None:
    """Scripts get what was sent, in one line."""
    out, stdout = io.StringIO(), pytest.MonkeyPatch()
    with stdout.context() as patch:
        patch.setattr("sys.stdout", out)
        print_json(value)
    assert json.loads(out.getvalue()) == value
    assert out.getvalue().count("\n") == 1
    assert_harmless(out.getvalue())


def test_what_children_and_nodes_print_is_shown_line_by_line(capsys: pytest.CaptureFixture[str]) -> None:
    """`zteam up` shows the lines of processes and of nodes in its own process with their names, and nothing else."""
    RunDisplay(None).line("tf", f"12:00:00 [tf] {EVIL}\tend")
    shown = capsys.readouterr().out.splitlines()
    assert [line[:5] for line in shown] == ["[tf] ", "[tf] "]
    assert_harmless("\n".join(shown))
    assert shown[-1].endswith("\tend")


def test_errors_findings_events_and_logs_are_harmless(capsys: pytest.CaptureFixture[str]) -> None:
    """An error that a peer has sent, what doctor finds, what the monitor sees, and what a process logs."""
    fail("zteam topic", ZteamError(EVIL))
    print_block(format_findings([problem(EVIL, EVIL, EVIL)]))
    Lines().show(Event("lost", 1, EVIL))
    JsonLines().show(Event("lost", 1, EVIL))
    before = [(each, each.handlers[:], each.level, each.propagate) for each in map(logging.getLogger, ("", "zteam"))]
    for form in ("text", "json"):
        start_logging("tf", "info", form)
        logging.getLogger("zteam").warning("frame %s", EVIL)
    for logger, handlers, level, propagate in before:
        logger.handlers[:], logger.propagate = handlers, propagate
        logger.setLevel(level)
    output, errors = capsys.readouterr()
    assert "[tf] warning: frame" in errors and "zteam topic: " in errors
    assert_harmless(output + errors)


def test_commands_print_in_no_other_way() -> None:
    """The linter finds `print`; the streams are written to by argparse's help and the terminal of keys alone."""
    found = [
        (path.name, line.strip())
        for path in Path(zteam.cli.__file__).parent.glob("*.py")
        for line in path.read_text("utf-8").splitlines()
        if re.search(r"std(out|err)\.write\(|os\.write\(", line)
    ]
    assert found == [("teleop.py", "sys.stdout.write(text)")]
