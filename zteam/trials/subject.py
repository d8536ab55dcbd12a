"""One object of a behaviour under trial: it is asked as a robot asks it, and what it answers is looked at."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.registry import read_params
from zteam.behaviors.safety.asking import ask
from zteam.behaviors.safety.limits import Limits
from zteam.behaviors.safety.swept import Motion
from zteam.behaviors.view import View
from zteam.errors import BehaviorError, EncodeError
from zteam.messages import Message, Twist
from zteam.messages.cdr import encode
from zteam.trials.fault import Fault, place_of_error, place_of_step
from zteam.trials.watch import Watch

T = TypeVar("T")

_TOLERANCE = 1e-6
"""m/s and rad/s above a limit that are rounding."""


class TrialOver(Exception):  # noqa: N818 - it is no error
    """The behaviour cannot go on in this trial."""


class Answer(NamedTuple):
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

    def __init__(
        self, candidate: Candidate, robot_id: int, watch: Watch, blame: Callable[[Fault], None], **params: Any
    ) -> None:
        """With these `params` besides those of the candidate. Raises UsageError if it does not take them."""
        self._candidate, self._robot_id = candidate, robot_id
        self._watch, self._blame = watch, blame
        self._label = ""
        """What stands behind the text of its faults: the parameters that are not the candidate's."""
        given = self._read(**params)
        self._behavior = self._guarded("__init__", lambda: candidate.kind(given))

    def _read(self, **params: Any) -> Any:
        spec, kind, given = self._candidate
        self._label = "".join(f", with {name} = {value}" for name, value in params.items())
        return read_params(spec, kind, {**given, **params}, self._robot_id)

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
            text = f"before its first scan step raises {_text(error)}; no robot asks it then, but a test may"
            place = place_of_error(error, self._candidate.kind)
            self._blame(Fault("raises", text, _hint(error), place, is_remark=True))

    def step(self, view: View) -> Answer:
        """Ask for a velocity."""
        before = _bytes_of(view)
        with self._watch.step():
            answer = self._guarded("step", lambda: Answer(*ask(self._behavior, view)))
        for what, content in _bytes_of(view).items():
            if content != before[what]:
                self._accuse("changed", f"step changed view.{what}", f"copy it first: copy.deepcopy(view.{what})")
        self._check(answer, view)
        return answer

    def _check(self, answer: Answer, view: View) -> None:
        wanted, motion = answer.wanted, answer.motion
        if not isinstance(answer.reason, str):
            self._accuse("type", f"self.reason is {answer.reason!r}", 'it is a text: "" while the robot drives')
            raise TrialOver
        if not (math.isfinite(motion.x) and math.isfinite(motion.turn)):
            hint = "nan comes of beams that say nothing, of 0/0 and of inf - inf: test with math.isfinite"
            self._accuse("number", f"step asks for {velocity_text(motion)}", hint)
            return
        most = Limits(view.base).clamp(motion)
        if abs(most.x - motion.x) > _TOLERANCE or abs(most.turn - motion.turn) > _TOLERANCE:
            hint = "limit it, for example max(-1.0, min(1.0, speed)); view.base has the limits"
            self._accuse("limit", f"step asks for {velocity_text(motion)}, this robot does {velocity_text(most)}", hint)
        for name, value in _ignored(wanted):
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
            text = f"{method} raises {_text(error)}{self._label}"
            self._blame(Fault("raises", text, _hint(error), place_of_error(error, self._candidate.kind)))
        raise TrialOver


def _text(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


def velocity_text(motion: Motion) -> str:
    """A velocity, for people."""
    return f"{motion.x:.3g} m/s, {motion.turn:.3g} rad/s"


def _ignored(wanted: Twist) -> list[tuple[str, float]]:
    """The parts of a velocity that reach no wheel and are not zero."""
    parts = [("linear.y", wanted.linear.y), ("linear.z", wanted.linear.z)]
    parts += [("angular.x", wanted.angular.x), ("angular.y", wanted.angular.y)]
    return [(name, value) for name, value in parts if isinstance(value, int | float) and value]


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
