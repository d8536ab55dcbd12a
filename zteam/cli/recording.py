"""`zteam recording info | compare | export | plot | recover`: what recorded runs hold, and whether two are the same."""

import argparse
from functools import partial
from pathlib import Path
from shlex import quote

from zteam.cli.listening import check_key
from zteam.cli.options import Parser, add_json, add_log_options, add_option, add_repeated, option_type, run_tool
from zteam.cli.tables import format_table
from zteam.config.numbers import counted
from zteam.errors import UsageError
from zteam.node.output import print_block, print_json, print_line
from zteam.record.recording import Recording, RecordingReport

FORMATS = ("csv", "ros2bag")
_MOST = 1e6
"""The largest tolerance, in units of a field."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam recording", description=__doc__)
    info = parser.add_verb("info", _info, "say what a recording holds", _add_file)
    text = "compare what two runs in lock-step have published; exit code 1: they differ"
    compare = parser.add_verb("compare", _compare, text)
    compare.add_argument("a", type=Path, metavar="A.mcap", help="a recording")
    compare.add_argument("b", type=Path, metavar="B.mcap", help="another one")
    text = "numbers may differ by X in their own units"
    add_option(compare, "--atol", typed=(0.0, _MOST, "a number"), default=0.0, metavar="X", help=f"{text} (default: 0)")
    text = "leave out a key or key expression, such as 'robot_0/**'"
    add_repeated(compare, "--ignore", "KEY", text, type=option_type(check_key))
    export = parser.add_verb("export", _export, "write tables, or a directory for ros2 bag", _add_file)
    text = "csv: a topic (default: all)"
    export.add_argument("keys", nargs="*", metavar="KEY", type=option_type(check_key), help=text)
    text = "csv: a file for each topic; ros2bag: a directory that 'ros2 bag' opens"
    add_option(export, "--format", choices=FORMATS, required=True, help=text)
    export.add_argument("-o", "--output", type=Path, required=True, metavar="DIRECTORY", help="made if it is not there")
    plot = parser.add_verb("plot", _plot, "draw the ways of all robots on the map", _add_file)
    plot.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.svg|png", help="picture to write")
    add_option(plot, "--width", typed=(50, 20_000, "pixels"), default=1200, metavar="PIXELS", help="width")
    recover = parser.add_verb("recover", _recover, "finish the recording of a recorder that was killed", _add_file)
    recover.add_argument(
        "-o", "--output", type=Path, metavar="FILE.mcap", help="default: FILE.recovered.mcap beside it"
    )
    for each in (info, compare, export, plot, recover):
        add_json(each)
        add_log_options(each, "warning")
    for each in (export, recover):
        each.add_argument("--force", action="store_true", help="replace files that exist")
    return parser


def _add_file(parser: Parser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE.mcap", help="a recording")


def _info(args: argparse.Namespace) -> None:
    recording = Recording(args.file)
    report, topics = recording.report, recording.topics
    if args.json:
        sizes = {name: len(data) for name, data in recording.contents.items()}
        print_json({"file": str(args.file), "report": report, "topics": topics, "files": sizes})
        return
    seed = "" if report.seed is None else f", seed {report.seed}"
    print_line(f"{args.file}: zteam {report.version}, {report.command}{seed}", _state(report, args.file))
    rows = [(key, topic.type, f"{topic.messages}") for key, topic in topics.items()]
    print_block(format_table(("topic", "type", "messages"), rows, "  ", numbers_from=2))
    if recording.contents:
        print_line(f"files: {', '.join(recording.contents)}")
    for robot in report.robots:
        if robot.distance_m is not None:
            print_line(f"robot_{robot.id} has driven {robot.distance_m:.2f} m")
    print_line(*report.gaps, *(f"{name} publishes {key} outside of its steps" for name, key in report.stray.items()))


def _state(report: RecordingReport, path: Path) -> str:
    """How long the run was, and whether anything is missing."""
    pace = f"lock-step, {counted(report.ticks, 'tick')}" if report.lockstep else "no lock-step"
    text = f"{pace}, {counted(report.seconds, 'second')}, {counted(report.messages, 'message')}"
    if report.lost:
        text += f", {report.lost} more are lost"
    if report.missed:
        text += f", of {counted(report.missed, 'tick')} no clock has come"
    if not report.is_finished:
        return f"{text}; it was cut off: 'zteam recording recover {quote(str(path))}' makes it whole for other readers"
    if report.lockstep and report.is_whole is not None:
        missing = "messages are missing" if report.gaps else "it began in the middle of the run"
        text += f"; {'all messages of each tick' if report.is_whole else missing}"
    return text


def _compare(args: argparse.Namespace) -> int:
    from zteam.record.comparing import compare

    found = compare(args.a, args.b, args.atol, tuple(args.ignore))
    difference = found.difference
    if args.json:
        print_json(found)
        return int(difference is not None)
    if difference is None:
        messages = counted(sum(topic.a for topic in found.topics), "message")
        print_line(f"the same: {counted(found.ticks, 'tick')}, {messages} on {counted(len(found.topics), 'topic')}")
    else:
        print_line(difference.text)
    rows = [
        (topic.key, f"{topic.a}", f"{topic.b}", f"{topic.differing}", "" if topic.first is None else f"{topic.first}")
        for topic in found.topics
    ]
    print_block(format_table(("topic", "in A", "in B", "ticks that differ", "first"), rows, "  ", numbers_from=1))
    if found.left_out:
        print_line(f"left out, as nothing of it belongs to a tick, or by --ignore: {', '.join(found.left_out)}")
    print_line(*found.notes)
    return int(difference is not None)


def _export(args: argparse.Namespace) -> None:
    from zteam.record.exporting import write_csv, write_ros2_bag

    recording = Recording(args.file)
    if args.format == "csv":
        written = write_csv(recording, args.keys or recording.topics, args.output, force=args.force)
        _say(args, {"files": [str(path) for path in written]}, f"{args.output}: {counted(len(written), 'file')}")
        return
    if args.keys:
        raise UsageError("a directory for ros2 bag has all topics: leave the keys out")
    count = write_ros2_bag(recording, args.output, force=args.force)
    _say(args, {"directory": str(args.output), "messages": count}, f"{args.output}: {counted(count, 'message')}")


def _plot(args: argparse.Namespace) -> None:
    from zteam.record.exporting import draw_tracks

    robots = draw_tracks(Recording(args.file), args.output, width=args.width)
    _say(args, {"file": str(args.output), "robots": robots}, f"{args.output}: {counted(len(robots), 'robot')}")


def _recover(args: argparse.Namespace) -> None:
    from zteam.record.exporting import write_copy

    recording = Recording(args.file)
    if recording.is_finished:
        raise UsageError(f"{args.file} is finished: nothing is to be recovered")
    # Never the file itself: its recorder may be alive.
    output = args.output or args.file.with_suffix(".recovered.mcap")
    count = write_copy(recording, output, force=args.force)
    _say(args, {"file": str(output), "messages": count}, f"{output}: {counted(count, 'message')}")


def _say(args: argparse.Namespace, facts: object, text: str) -> None:
    if args.json:
        print_json(facts)
    else:
        print_line(text)


main = partial(run_tool, build_parser, None)
