"""Imports the user's behaviours and checks their parameters, in a child process.

Importing runs foreign code: it may hang, end the process, write to standard output, or take a gigabyte. The launcher
must survive that. `asking` sends the questions; this module, run as a program, reports each answer.
"""

import base64
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from typing import Any

import msgspec

from zteam.clock import HOST_FACTOR
from zteam.config.problems import problems_of
from zteam.errors import UsageError, check_call
from zteam.node.launcher import Report, report
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.registry import find_behavior, load_named, look_in
from zteam.team.launch.process import Job, exit_text
from zteam.team.launch.supervisor import Supervisor

LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for all imports together: a large library takes ten on a slow disk."""


def find_body(name: str, spec: str) -> Callable[[Any], None]:
    """The function `module:function` that is the body of the node `name`. Imports its module. Raises UsageError."""
    what = f"node {name!r}: {spec!r}"
    module, _, function = spec.partition(":")
    if not (function.isidentifier() and all(part.isidentifier() for part in module.split("."))):
        raise UsageError(f"{what} is no function: give package.module:function, such as 'crowd:main'")
    body = load_named(f"node {name!r}", module, function)
    check_call(body, 1, f"{what} is no function 'def main(node): …'")
    return body  # type: ignore[no-any-return]


class Question(msgspec.Struct, frozen=True):
    """A behaviour by name, its parameters from the team file, and further words that an unknown key may stand for."""

    spec: str
    params: dict[str, Any]
    near: list[str] = []


class Answer(msgspec.Struct, frozen=True):
    """Why it cannot be used, empty if it can; its parameters' mistakes as (path, text); the topics of its inputs."""

    refused: str = ""
    mistakes: list[tuple[list[str | int], str]] = []
    topics: list[str] = []


def answer(question: Question) -> Answer:
    """Import a behaviour in this process, and check its parameters."""
    try:
        kind = find_behavior(question.spec)
    except UsageError as error:
        return Answer(str(error))
    found = problems_of(question.params, kind.Params, takes=f"{question.spec} takes", near=question.near)
    topics = [topic for topic, _ in kind.inputs.values()]
    return Answer(mistakes=[(list(problem.path), problem.text) for problem in found], topics=topics)


@contextmanager
def asking(questions: Sequence[Question], folders: Sequence[str]) -> Iterator[Callable[[], list[Answer]]]:
    """Has a child process answer questions in the background, until the end of the context. The child imports from
    `folders` besides the installed packages and the current folder. What this gives waits for one answer a question."""
    answers = list[Answer]()

    def on_answer(_job: Job, report: Report) -> None:
        if report.answer is not None:
            answers.append(msgspec.convert(report.answer, Answer))

    def wait() -> list[Answer]:
        if not questions:
            return []
        ended = process.join(LIMIT)
        found = [*answers]
        missing = len(questions) - len(found)
        if missing:
            last = next(filter(None, map(str.strip, reversed(process.lines))), "")
            why = f"ended the process ({exit_text(process.exit_code)}): {last}".removesuffix(": ")
            text = why if ended else f"is not done after {LIMIT:g} s"
            refusal = Answer(f"behaviour {questions[len(found)].spec!r}: importing it {text}")
            # The questions after this one were not answered.
            found += [refusal, *[Answer()] * (missing - 1)]
        return found

    with closing(Supervisor(lambda _name, _line: None)) as supervisor:
        if questions:
            command = [sys.executable, "-P", "-m", "zteam.team.launch.own_behaviors", *folders]
            words = base64.b64encode(msgspec.msgpack.encode(questions)).decode()
            process = supervisor.start_job("behaviours", Job(command, words=words, learn=on_answer))
            # However it ends, the answer says so.
            process.stopping = True
        yield wait


def main() -> None:
    stop = Stop()
    stop.install()
    look_in([*sys.argv[1:], ""])
    questions = msgspec.msgpack.decode(base64.b64decode(sys.stdin.readline()), type=list[Question])
    for question in questions:
        report(answer=answer(question))
    # A thread that a module started must not keep this process alive.
    os._exit(0)


if __name__ == "__main__":
    main()
