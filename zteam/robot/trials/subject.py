"""One object of a behaviour under trial: it is asked as a robot asks it, and watched; what it does wrong is a fault."""

import inspect
import linecache
import math
import os
import pickle
import random
import sys
import threading
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import FrameType, FunctionType, ModuleType
from typing import Any, Literal, NamedTuple, TypeVar

import msgspec

from zteam.clock import monotonic, thread_time
from zteam.errors import BehaviorError, EncodeError
from zteam.messages import Message, Twist
from zteam.messages.cdr import encode
from zteam.node.faults import dump_stacks, stacks_in
from zteam.robot.behaviors.behavior import Behavior, View
from zteam.robot.behaviors.registry import error_text, is_own, read_params
from zteam.robot.safety.layer import ask
from zteam.robot.safety.motion import BaseLimits, Motion
from zteam.robot.trials.situations import ROBOT

Kind = Literal[
    "raises", "type", "number", "limit", "ignored", "changed", "slow", "hangs", "clock", "random", "state", "old",
    "touched",
]  # fmt: skip


class Fault(msgspec.Struct, frozen=True):
    """One thing that a behaviour does wrong in one trial."""

    kind: Kind
    text: str
    """What it does, with the behaviour as the subject that is left out: `step raises …`."""
    hint: str = ""
    """What to do instead."""
    place: str = ""
    """`file:line: source` of the author's own line; empty where there is none."""
    is_remark: bool = False
    """Whether no robot ever gets there, so that it is not wrong."""


def place_in(stack: traceback.StackSummary, kind: type[Behavior]) -> str:
    """The author's innermost line in a stack; where there is none, that of its `step`."""
    own = [frame for frame in stack if is_authors(frame.filename, kind)]
    return _line_text(own[-1].filename, own[-1].lineno or 0) if own else place_of_step(kind)


def place_of_step(kind: type[Behavior], method: str = "step") -> str:
    code = getattr(inspect.unwrap(getattr(kind, method)), "__code__", None)
    return "" if code is None else _line_text(code.co_filename, code.co_firstlineno)


def is_authors(filename: str, kind: type[Behavior]) -> bool:
    """Whether the author wrote this file of code: that of the class counts also where it is installed or shipped."""
    return is_own(filename) or filename == getattr(sys.modules.get(kind.__module__), "__file__", "")


def _line_text(file: str, line: int) -> str:
    source = linecache.getline(file, line).strip()
    path = Path(file)
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return f"{os.fspath(shown)}:{line}: {source}".removesuffix(": ")


_CLOCKS = {
    *(("time", name) for name in ("time", "time_ns", "monotonic", "monotonic_ns", "sleep")),
    *(("datetime", name) for name in ("now", "utcnow", "today")),
}
"""(module or class, function). `time.perf_counter` only measures."""


class HeardCalls:
    """The calls that were heard: by what was called, the author's line."""

    def __init__(self, kind: type[Behavior]) -> None:
        self._kind = kind
        self.clocks: dict[str, str] = {}
        self.chance: dict[str, str] = {}

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Within, listen to what this thread calls."""
        before = sys.getprofile()
        sys.setprofile(self._take)
        try:
            yield
        finally:
            sys.setprofile(before)

    def _take(self, frame: FrameType, event: str, called: Any) -> None:
        if event != "c_call":
            return
        owner = getattr(called, "__self__", None)
        asked = getattr(owner, "__name__", ""), getattr(called, "__name__", "")
        if isinstance(owner, random.Random):
            heard, name = self.chance, "random"
        elif asked in _CLOCKS and is_authors(frame.f_code.co_filename, self._kind):
            # A library such as `logging` may look at the clock.
            heard, name = self.clocks, ".".join(asked)
        else:
            return
        if name not in heard:
            heard[name] = place_in(traceback.extract_stack(frame), self._kind)


_NO_STATE = (type, ModuleType, FunctionType, classmethod, staticmethod, property)


def shared_state(kind: type[Behavior]) -> dict[str, bytes]:
    """What all objects of a class share, and so survives a reset: attributes of the class and globals of its module.

    By name, as bytes that differ when a value does.
    """
    classes = kind.__mro__[: kind.__mro__.index(Behavior)]
    owners = [*((f"{each.__name__}.", each) for each in classes), ("", sys.modules.get(kind.__module__, kind))]
    return {
        prefix + name: _pickled(value)
        for prefix, owner in owners
        for name, value in vars(owner).items()
        if _is_state(name, value)
    }


def _is_state(name: str, value: Any) -> bool:
    """Whether it can keep something; a generator of random numbers is chance, and a cache changes no answer."""
    if name.startswith("__") or isinstance(value, _NO_STATE) or hasattr(value, "cache_info"):
        return False
    return not type(value).__module__.startswith(("random", "numpy.random"))


def _pickled(value: Any) -> bytes:
    try:
        return pickle.dumps(value)
    except Exception:
        # Whatever an author's object raises: its text is better than nothing.
        return repr(value).encode()


TICK = 0.1
"""Seconds of processor time that a step may take: a scan of Stage's worlds comes every 0.1 s."""
WAIT = 1.0
"""Seconds of the host's clock that a step may take: on a crowded machine a step waits for the processor."""
SLOW_STEPS = 3
"""So many steps above TICK are the behaviour's fault; a single one may be the machine's."""
HANGS_AFTER = 5.0
"""Seconds after which a step counts as one that does not return."""


class TrialWatch:
    """Watches the thread that steps a behaviour, from another one."""

    def __init__(self, kind: type[Behavior]) -> None:
        self._kind = kind
        self._thread = 0
        self._began: float | None = None
        """When the step began that is under way."""
        self._slow: list[float] = []
        """Seconds of the steps above TICK or WAIT since `slowness` was asked for."""
        self.lost = 0.0
        """Seconds of all of them."""
        self._places: Counter[str] = Counter()
        """Where the author's code was in them, and in how many looks."""
        self.heard: HeardCalls | None = None
        """Takes what steps call; None while none is wanted."""

    @contextmanager
    def step(self) -> Iterator[None]:
        """Within, the behaviour has the thread."""
        self._thread = threading.get_ident()
        began = self._began = monotonic()
        worked = thread_time()
        try:
            with nullcontext() if self.heard is None else self.heard.listening():
                yield
        finally:
            self._began = None
            seconds, worked = monotonic() - began, thread_time() - worked
            if worked > TICK or seconds > WAIT:
                self._slow.append(seconds)
                self.lost += seconds

    def look(self) -> Fault | None:
        """Note where a slow step is; the fault of one that does not return. Called by the other thread."""
        began = self._began
        seconds = 0.0 if began is None else monotonic() - began
        stack = stacks_in(dump_stacks()).get(self._thread) if seconds > TICK else None
        if stack is None or self._began != began:
            return None
        place = place_in(stack, self._kind)
        self._places[place] += 1
        if seconds < HANGS_AFTER:
            return None
        text = f"step did not return within {HANGS_AFTER:g} s"
        return Fault("hangs", text, "do one thing and return: step is called anew for each scan", place)

    def slowness(self) -> Fault | None:
        """The fault of the steps since the last call, if too many were slow."""
        slow, self._slow = self._slow, []
        if len(slow) < SLOW_STEPS:
            return None
        text = f"{len(slow)} steps took longer than a tick of {TICK:g} s, the longest {max(slow):.2f} s"
        hint = "do less in a step, and never sleep: count view.dt until it is time"
        places = [place for place, _looks in self._places.most_common(1)] or [place_of_step(self._kind)]
        return Fault("slow", text, hint, places[0])


T = TypeVar("T")

_TOLERANCE = 1e-6
"""m/s and rad/s above a limit that are rounding."""


class TrialOver(Exception):  # noqa: N818 - it is no error
    """The behaviour cannot go on in this trial."""


class StepAnswer(NamedTuple):
    """What a step answered."""

    wanted: Twist
    reason: str

    @property
    def motion(self) -> Motion:
        """What of it reaches the wheels."""
        return Motion(self.wanted.linear.x, self.wanted.angular.z)


class Candidate(NamedTuple):
    """What is tried: a behaviour with its parameters."""

    spec: str
    kind: type[Behavior]
    params: dict[str, Any]


class Subject:
    """An object of the behaviour. Its faults go to `blame`; it raises TrialOver after one that ends a robot."""

    def __init__(self, candidate: Candidate, watch: TrialWatch, blame: Callable[[Fault], None], **params: Any) -> None:
        """With these `params` besides those of the candidate. Raises UsageError if it does not take them."""
        self._candidate, self._watch, self._blame = candidate, watch, blame
        self._label = ""
        """What stands behind the text of its faults: the parameters that are not the candidate's."""
        given = self._read(**params)
        self._behavior = self._guarded("__init__", lambda: candidate.kind(given))

    def _read(self, **params: Any) -> Any:
        spec, kind, given = self._candidate
        self._label = "".join(f", with {name} = {value}" for name, value in params.items())
        return read_params(spec, kind, {**given, **params}, ROBOT)

    def set_params(self, **params: Any) -> None:
        """Set parameters as `zteam param set` does. Raises UsageError."""
        self._behavior.params = self._read(**params)
        self._guarded("on_params", self._behavior.on_params)

    def prepare(self, view: View) -> None:
        """Ask what it lacks before it is ready."""
        lacks: Any = self._guarded("missing", lambda: self._behavior.missing(view))
        if not (isinstance(lacks, list) and all(isinstance(noun, str) for noun in lacks)):
            self._accuse("type", f"missing returned {lacks!r}", "return a list of texts, [] for ready", "missing")
            raise TrialOver

    def step_anyhow(self, view: View) -> None:
        """Ask for a velocity where no robot does: an error is a remark."""
        try:
            self._behavior.step(view)
        except BaseException as error:
            text = f"before its first scan step raises {error_text(error)}; no robot asks it then, but a test may"
            place = place_in(traceback.extract_tb(error.__traceback__), self._candidate.kind)
            self._blame(Fault("raises", text, _hint(error), place, is_remark=True))

    def step(self, view: View) -> StepAnswer:
        before = _bytes_of(view)
        with self._watch.step():
            answer = self._guarded("step", lambda: StepAnswer(*ask(self._behavior, view)))
        for what, content in _bytes_of(view).items():
            if content != before[what]:
                self._accuse("changed", f"step changed view.{what}", f"copy it first: copy.deepcopy(view.{what})")
        self._check(answer, view)
        return answer

    def _check(self, answer: StepAnswer, view: View) -> None:
        wanted, motion = answer.wanted, answer.motion
        if not isinstance(answer.reason, str):
            self._accuse("type", f"self.reason is {answer.reason!r}", 'it is a text: "" while the robot drives')
            raise TrialOver
        if not (math.isfinite(motion.x) and math.isfinite(motion.turn)):
            hint = "nan comes of beams that say nothing, of 0/0 and of inf - inf: test with math.isfinite"
            self._accuse("number", f"step asks for {velocity_text(motion)}", hint)
            return
        most = BaseLimits(view.base).clamp(motion)
        if abs(most.x - motion.x) > _TOLERANCE or abs(most.turn - motion.turn) > _TOLERANCE:
            hint = "limit it, for example max(-1.0, min(1.0, speed)); view.base has the limits"
            self._accuse("limit", f"step asks for {velocity_text(motion)}, this robot does {velocity_text(most)}", hint)
        linear, angular = wanted.linear, wanted.angular
        ignored = {"linear.y": linear.y, "linear.z": linear.z, "angular.x": angular.x, "angular.y": angular.y}
        for name, value in ignored.items():
            if not isinstance(value, int | float) or not value:
                continue
            hint = (
                "a robot only drives forward (linear.x) and turns (angular.z): Twist(Vector3(speed), Vector3(z=turn))"
            )
            self._accuse("ignored", f"step sets {name} = {value:g}, which moves nothing", hint)

    def _accuse(self, kind: Any, text: str, hint: str, method: str = "step") -> None:
        self._blame(Fault(kind, text + self._label, hint, place_of_step(self._candidate.kind, method)))

    def _guarded(self, method: str, call: Callable[[], T]) -> T:
        """What the author's method returns; TrialOver if it raises."""
        try:
            return call()
        except BehaviorError as error:
            self._blame(Fault("type", str(error) + self._label, place=place_of_step(self._candidate.kind)))
        except BaseException as error:
            # The author's own code may raise anything, also SystemExit.
            text = f"{method} raises {error_text(error)}{self._label}"
            self._blame(
                Fault(
                    "raises",
                    text,
                    _hint(error),
                    place_in(traceback.extract_tb(error.__traceback__), self._candidate.kind),
                )
            )
        raise TrialOver


def velocity_text(motion: Motion) -> str:
    return f"{motion.x:.3g} m/s, {motion.turn:.3g} rad/s"


def _bytes_of(view: View) -> dict[str, bytes]:
    """The messages of a view, by the name of its field."""
    found = {"scan": _encoded(view.scan), "odom": _encoded(view.odom)}
    for name, message in view.inputs.items():
        messages = [*message.values()] if isinstance(message, Mapping) else [message]
        found[f'inputs["{name}"]'] = b"".join(map(_encoded, messages))
    return found


def _encoded(message: Message | None) -> bytes:
    try:
        return b"" if message is None else encode(message)
    except EncodeError as error:
        return str(error).encode()


def _hint(error: BaseException) -> str:
    """What mostly is behind an error."""
    text = str(error)
    if "read-only" in text:
        return "the scan is not yours to change: take ranges = view.scan.ranges.copy()"
    if "mappingproxy" in text or "immutable type" in text:
        return "the view is not yours to change: keep what you need in self"
    if "NoneType" in text:
        return "what has not come yet, or is unknown, is None: test it with `if x is None`"
    if isinstance(error, ZeroDivisionError):
        return "view.dt is 0 on the first step, and a range may be 0"
    if "NaN" in text or "infinity" in text:
        return "beams that say nothing are nan, those that meet nothing inf: zteam.behaviors.look_ahead sorts them out"
    if isinstance(error, IndexError) or "zero-size" in text or "empty" in text:
        return "a laser may have any number of beams: take angles (zteam.behaviors.look_ahead), not places in the list"
    return ""
