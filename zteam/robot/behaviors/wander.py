"""The lectures' behaviours, mended: stand, drive straight on, stop in front of obstacles, drive about at random."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from zteam.messages import LaserScan, RobotDriver, Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.escape import Escape
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.behaviors.trail import LineMember
from zteam.robot.view import Cone, View, is_clear, is_seen, look_ahead, look_along


class Idle(Behavior):
    """Zero velocity for ever: for a robot that teleop or navigation drives."""

    def step(self, view: View) -> Twist:
        return Twist()

    def why_it_rests(self) -> str:
        return "idle: only teleop or navigation drives it"


class ForwardParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `forward`."""

    speed: Annotated[float, Meta(ge=-1.0, le=1.0, description="m/s; below 0 backwards, where no laser looks")] = 0.2


class Forward(Behavior):
    """The same speed for ever; only the safety layer stops it."""

    Params = ForwardParams
    params: ForwardParams

    def step(self, view: View) -> Twist:
        return Twist(linear=Vector3(x=self.params.speed))

    def why_it_rests(self) -> str:
        return "its base does not drive backwards" if self.params.speed else "its parameter speed is 0"


class AvoidParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `avoid`."""

    speed: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.2
    stop_distance: Annotated[
        float, Meta(ge=0.0, le=100.0, description="m to the laser; it stands while something is nearer")
    ] = 0.5
    half_angle: Annotated[float, Meta(ge=0.0, le=math.pi, description="rad; it looks this far to either side")] = (
        math.radians(60.0)
    )
    max_invalid: Annotated[
        float, Meta(ge=0.0, le=1.0, description="it stands while a larger share of beams says nothing")
    ] = 0.25


class Avoid(Behavior):
    """Forward while the cone ahead is known to be free; goes on when it is free again."""

    Params = AvoidParams
    params: AvoidParams

    def step(self, view: View) -> Twist:
        self.reason = self._obstruction(view)
        return Twist() if self.reason else Twist(linear=Vector3(x=self.params.speed))

    def why_it_rests(self) -> str:
        return "its parameter speed is 0"

    def _obstruction(self, view: View) -> str:
        if view.scan is None:
            return "no scan yet"
        cone = look_ahead(view.scan, self.params.half_angle)
        if cone is None:
            return "no beam of the scan looks ahead"
        if cone.invalid > self.params.max_invalid:
            return "too many beams say nothing"
        return "obstacle ahead" if cone.nearest < self.params.stop_distance else ""


HALF_ANGLE = math.radians(45.0)
"""It looks this far to either side."""
REACTION_TIME = 0.2
"""Seconds from something coming into reach until the wheels obey: one scan and one command at 10 Hz."""
BRAKING = 1.0
"""m/s²: a base may not stop at once."""
MAX_TURN = math.radians(120.0)
"""A turn goes at least as far as an angle drawn from 0 to this, and on until the way is free."""
LEAST_TURN = math.radians(60.0)
"""The same where the laser sees nothing that it could turn away from."""
AWAY = 0.8
"""How often it turns away from what is nearest; always would be a circle in many a room."""
SHORT_DRIVE = 1.0
"""Metres: where it has to turn again after less than this, the place is narrow."""
HEADINGS = tuple(math.radians(10.0 * step) for step in range(-17, 19))
"""Of which it draws one in a narrow place: always the first free one would be to and fro between two walls."""
ROOMY = 3.0
"""Metres; more room counts no more."""
STUCK_AFTER = 1.0
"""Seconds without moving, though it wants to drive, after which it turns: the safety layer knows more than it does."""
MOVED = 0.02
"""Metres of odometry that are a move."""
LIMITS = SpeedLimits(0.7, math.pi)
"""As the last of a line whose other end leads."""
SIDE_MARGIN = 0.015
"""Metres on either side of the circle that the base's corners describe when it turns: what it needs to squeeze
through."""


class WanderParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `wander`."""

    speed: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.4
    turn_rate: Annotated[float, Meta(ge=0.1, le=math.pi, description="rad/s")] = 1.0
    stop_distance: Annotated[float, Meta(ge=0.0, le=100.0, description="m; left ahead of the laser when it stands")] = (
        0.5
    )
    max_invalid: Annotated[
        float, Meta(ge=0.0, le=1.0, description="it turns while a larger share of beams says nothing")
    ] = 0.25
    hand_over: Annotated[
        bool, Meta(description="whether its line may be led from the other end where it gets on no more")
    ] = True


class Wander(LineMember):
    """Forward while the way is free; else turn by a random angle, mostly away from what is nearest, till it is free.

    It keeps the side until it drives again, so it does not swing in a corner. Where it gets on badly (a short drive,
    or a full turn without a free cone) it squeezes: the next heading will do that leaves room for the robot alone.
    """

    Params = WanderParams
    params: WanderParams

    def __init__(self, params: WanderParams) -> None:
        super().__init__(params)
        self._side = 0.0
        """1 while turning left, -1 while turning right, 0 while driving."""
        self._turned = self._wanted = 0.0
        """Radians turned since it stopped, and how many there are to be at least."""
        self._squeezing = False
        self._driven = SHORT_DRIVE
        """Metres since the last turn."""
        self._stuck = 0.0
        """Seconds for which it has not moved, though it wants to drive."""
        self._place = math.nan, math.nan
        """In odometry, where it has moved last."""
        self._escape = Escape()

    def on_release(self) -> None:
        """See Behavior: it was not stuck."""
        super().on_release()
        self._stuck = 0.0
        self._escape.rest()

    def step(self, view: View) -> Twist:
        """Straight on or a turn on the spot; zero without a scan. With a line behind it, as its head or its tail."""
        if view.scan is None:
            self.reason = "no scan yet"
            return Twist()
        self.reason = ""
        status = (view.inputs.get("statuses") or {}).get(view.robot_id)
        is_driven = status is not None and status.driver not in ("", RobotDriver.NONE, RobotDriver.BEHAVIOR)
        role = self._find_role(view, None)
        # Alone it drives by its laser, and needs no transforms.
        self.uses_tf = self.params.hand_over and not is_driven and (role.ahead is not None or role.may_turn)
        if not self.uses_tf:
            super().on_release()
            self._line.turns, self.follows = 0, None
            return self._step_alone(view, view.scan)
        return self._drive_in_line(view, role, LIMITS, self.params.speed, self.params.turn_rate)

    def why_it_rests(self) -> str:
        return super().why_it_rests() if self.params.speed or self.follows is not None else "its parameter speed is 0"

    def _step_alone(self, view: View, scan: LaserScan) -> Twist:
        if self._side:
            self._turned += self.params.turn_rate * view.dt
            self._stuck = 0.0
        else:
            self._driven += self.params.speed * view.dt
            self._watch_for_stuck(view)
        cone = look_ahead(scan, HALF_ANGLE)
        mate = self._bearing_of_teammate(view)
        if self._stuck > STUCK_AFTER and self.params.speed > 0.0:
            self._start_turn(view, -1.0 if mate is None else mate)
            self._wanted = max(self._wanted, LEAST_TURN)
        elif cone and mate is None and self._may_drive(cone, scan, view.base.radius + SIDE_MARGIN):
            self._driven = 0.0 if self._side else self._driven
            self._side = 0.0
            return Twist(linear=Vector3(x=self.params.speed))
        if not self._side:
            self._start_turn(view, mate if mate is not None else cone.bearing if cone else -1.0)
        return self._escape.free(view, Twist(angular=Vector3(z=self._side * self.params.turn_rate)))

    def _bearing_of_teammate(self, view: View) -> float | None:
        """Of one ahead (rad) within the room that both need to turn in, which the laser may look over; or None."""
        found = None
        for mate in view.teammates:
            x, y, room = mate.pose.x, mate.pose.y, view.base.radius + mate.base.radius + SIDE_MARGIN
            if 0.0 < x < room + self._reach and abs(y) < room:
                found = math.atan2(y, x)
        return found

    def _watch_for_stuck(self, view: View) -> None:
        if view.odom is None:
            return
        place = view.odom.pose.pose.position
        if math.dist(self._place, (place.x, place.y)) < MOVED:
            self._stuck += view.dt
        else:
            self._place, self._stuck = (place.x, place.y), 0.0

    def _start_turn(self, view: View, bearing: float) -> None:
        """Turn, mostly away from what is in this direction (rad)."""
        away = -math.copysign(1.0, bearing)
        self._side = away if view.random(0) < AWAY else -away
        self._wanted = MAX_TURN * view.random(1)
        self._turned = 0.0
        self._squeezing = self._driven < SHORT_DRIVE
        if self._squeezing:
            heading = draw_heading(view)
            self._side, self._wanted = math.copysign(1.0, heading), abs(heading)

    def _may_drive(self, cone: Cone, scan: LaserScan, half_width: float) -> bool:
        reach = self._reach
        if cone.invalid > self.params.max_invalid:
            return False
        if self._side and self._turned >= math.tau:
            self._squeezing = True
        clear = is_clear(scan, half_width, reach) and (self._squeezing or cone.nearest >= reach)
        return clear and (not self._side or self._turned >= self._wanted)

    @property
    def _reach(self) -> float:
        """Metres ahead of the laser that have to be free."""
        speed = self.params.speed
        return self.params.stop_distance + REACTION_TIME * speed + 0.5 * speed * speed / BRAKING


def draw_heading(view: View) -> float:
    """Of those that the laser sees (rad); the more room there is, the likelier."""
    best, most = math.pi, -1.0
    for draw, heading in enumerate(HEADINGS, 2):
        if view.scan is not None and is_seen(view.scan, heading):
            room = min(look_along(view.scan, view.base.radius + SIDE_MARGIN, heading), ROOMY)
            weight = room * view.random(draw)
            best, most = (heading, weight) if weight > most else (best, most)
    return best
