"""Imports the user's behaviours and nodes and checks the behaviours' parameters, in a child process.

Importing runs foreign code: it may hang, end the process, write to standard output, or take a gigabyte. The launcher
must survive that. `Inquiry` sends the questions; this module, run as a program, reports each answer.
"""

import base64
import os
import sys
from collections.abc import Sequence
from typing import Any

import msgspec

from zteam.clock import HOST_FACTOR
from zteam.config.problems import problems_of
from zteam.errors import UsageError
from zteam.node.launcher import Report, report
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.registry import find_behavior, look_in
from zteam.team.launch.process import Process, exit_text
from zteam.team.launch.supervisor import Job, Supervisor
from zteam.team.own_code import find_body

LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for all imports together: a large library takes ten on a slow disk."""


class Question(msgspec.Struct, frozen=True):
    """A behaviour by name, or the body of a node; the behaviour's parameters from the team file, and further words that
    an unknown key may stand for.
    """

    spec: str
    params: dict[str, Any]
    near: list[str] = []
    node: str = ""
    """With a name, `spec` is the body of that node."""

    @property
    def subject(self) -> str:
        """What an error calls it."""
        return f"node {self.node!r}: {self.spec!r}" if self.node else f"behaviour {self.spec!r}"


class Answer(msgspec.Struct, frozen=True):
    """Why it cannot be used, empty if it can; of a behaviour, the mistakes in its parameters as (path, text), and the
    topics of the inputs that it declares."""

    refused: str = ""
    mistakes: list[tuple[list[str | int], str]] = []
    topics: list[str] = []


def answer(question: Question) -> Answer:
    """Import what is asked for in this process, and check the parameters of a behaviour."""
    try:
        if question.node:
            find_body(question.node, question.spec)
            return Answer()
        kind = find_behavior(question.spec)
    except UsageError as error:
        return Answer(str(error))
    found = problems_of(question.params, kind.Params, takes=f"{question.spec} takes", near=question.near)
    topics = [topic for topic, _ in kind.inputs.values()]
    return Answer(mistakes=[(list(problem.path), problem.text) for problem in found], topics=topics)


class Inquiry:
    """Questions that a child process answers in the background. Leaving the context ends the child."""

    def __init__(self, questions: Sequence[Question], folders: Sequence[str]) -> None:
        """The child imports from `folders` besides the installed packages and the current folder."""
        self._questions = questions
        self._answers: list[Answer] = []
        self._last_line = ""
        self._supervisor = Supervisor(self._take_line)
        self._process: Process | None = None
        if questions:
            command = [sys.executable, "-P", "-m", "zteam.team.launch.own_behaviors", *folders]
            self._process = self._supervisor.start_job("behaviours", Job(command, learn=self._take_answer))
            self._process.write_line(base64.b64encode(msgspec.msgpack.encode(questions)).decode())

    def __enter__(self) -> "Inquiry":
        return self

    def __exit__(self, *_: object) -> None:
        self._supervisor.close()

    def _take_answer(self, _job: Job, report: Report) -> None:
        if report.answer is not None:
            self._answers.append(msgspec.convert(report.answer, Answer))

    def _take_line(self, _name: str, line: str) -> None:
        self._last_line = line.strip() or self._last_line

    def answers(self, limit: float = LIMIT) -> list[Answer]:
        """Wait for the answers: one for each question. `limit` is in host seconds."""
        process = self._process
        if process is None:
            return []
        ended = process.join(limit)
        answers = [*self._answers]
        missing = len(self._questions) - len(answers)
        if missing:
            subject = self._questions[len(answers)].subject
            why = f"ended the process ({exit_text(process.exit_code)}): {self._last_line}".removesuffix(": ")
            text = why if ended else f"is not done after {limit:g} s"
            refusal = Answer(f"{subject}: importing it {text}")
            # The questions after this one were not answered.
            return [*answers, refusal, *[Answer()] * (missing - 1)]
        return answers


def main() -> None:
    """Answer the questions on standard input."""
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
