"""Running robots: their samples, their state, and samples that programs publish for them."""

from __future__ import annotations

import difflib
import math
import os
import threading
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from . import topics
from .samples import Sliced, dtype_of
from .topics import TOPICS, Action, Cause, Follower, HoldReason, Order, StageState

Byte = TypeVar("Byte", bound=IntEnum)

# How long a robot that runs has to publish each of its topics.
PATIENCE_S = 2.0


class NotRunning(RuntimeError):
    """The robot does not run on this machine. `robots` names those that do."""

    def __init__(self, robot: str) -> None:
        self.robots = robots()
        others = f"running: {', '.join(self.robots)}" if self.robots else "you run no robot on this machine"
        super().__init__(f"robot {robot!r} is not running on this machine; {others}")


def robots() -> list[str]:
    """Names of the robots that you run on this machine."""
    names = {name for place in topics.places() if os.path.isdir(place) for name in os.listdir(place)}
    return sorted(name for name in names if Follower(name)._supervised())


def _sliced(element: Any, sample: Any) -> Any:
    """A sample with its array as a view of NumPy."""
    if element is None:
        return sample
    header, elements = sample
    view = np.ndarray(len(elements), dtype_of(element), elements)
    view.flags.writeable = False
    return Sliced(header, view)


if TYPE_CHECKING:
    follow: topics.Follow
else:

    def follow(robot, *topics, events=False, name="python"):
        """Yield the samples of a robot over all its runs. Wait for a robot that does not run.

        `follow("x80", "pose")` yields structs; the names of their fields end with the unit. `follow("x80", "grid")` yields `Sliced`.
        For several topics, or with `events`, it yields (topic, sample). `events` adds ("here", None), ("gone", None) and, after a
        second without a sample, ("nothing", None). `name` names this program on the robot's bus.
        """
        for topic in topics or [""]:
            if topic not in TOPICS:
                meant = difflib.get_close_matches(topic, TOPICS, 1)
                raise ValueError(f"no topic {topic!r}; " + (f"did you mean {meant[0]!r}?" if meant else f"the topics are {', '.join(TOPICS)}"))
        return _follow(Follower(robot, topics, name), len(topics) == 1 and not events, events)


def _follow(follower: Follower, alone: bool, events: bool) -> Iterator[Any]:
    for event, sample in follower:
        if event in TOPICS:
            sample = _sliced(TOPICS[event][1], sample)
            yield sample if alone else (event, sample)
        elif events:
            yield event, None


class _Joined:
    """The bus of a robot that runs now."""

    def __init__(self, robot: str, topics: Iterable[str]) -> None:
        self.follower = Follower(robot, tuple(topics))
        until = time.monotonic() + PATIENCE_S
        readers = None
        while readers is None:
            self.instance = self.follower._instance()
            if not self.is_there() or self.instance is None or time.monotonic() > until:
                raise NotRunning(robot)
            readers = self.follower._join(self.instance)
        self.follower.node, self.listener, self.subscribers = readers
        self.newest: dict[str, Any] = {}
        self.turns = 0

    def is_there(self) -> bool:
        return self.follower._instance() == self.instance and self.follower._supervised()

    def read(self) -> dict[str, Any]:
        """Return the newest sample of each topic. Wait for the first ones."""
        until = time.monotonic() + PATIENCE_S
        while True:
            for topic, sample in self.follower._take(self.subscribers):
                sample = _sliced(TOPICS[topic][1], sample)
                self.newest[topic] = sample.copy() if isinstance(sample, Sliced) else sample
            if len(self.newest) == len(self.follower.topics) or time.monotonic() > until:
                return self.newest
            self.follower._wait_for(self.listener)


# A thread does not publish through what another has opened.
_publishers = threading.local()


def _joined(robot: str) -> _Joined:
    joined: dict[str, _Joined] = _publishers.__dict__.setdefault("joined", {})
    if robot not in joined or not joined[robot].is_there():
        joined.pop(robot, None)
        joined[robot] = _Joined(robot, ["pose"])
    return joined[robot]


def _now_ns(joined: _Joined) -> int:
    newest = joined.read()
    if "pose" not in newest:
        raise TimeoutError(f"robot {joined.follower.robot!r} has no pose yet, so the mission time is unknown; give capture_ns")
    return int(newest["pose"].stamp.stamp_ns)


def publish(robot: str, topic: str, sample: topics.Struct) -> None:
    """Publish a sample on a topic that consumers may write, such as `beacon`. Raises NotRunning."""
    _joined(robot).follower.publish(topic, sample)


def fix(
    robot: str,
    x_m: float,
    y_m: float,
    *,
    sd_m: float,
    heading_rad: float | None = None,
    sd_rad: float | None = None,
    shared_sd_m: float = 0.0,
    capture_ns: int | None = None,
    source: str = "python",
) -> None:
    """Publish a fix: the pose of a robot from an external source such as a camera. Metres in the mission's frame, radians
    counter-clockwise from x.

    `sd_m` is the standard deviation of x and of y, `sd_rad` that of the heading. `shared_sd_m` is the part of `sd_m` that all fixes
    of the source share. `capture_ns` is the mission time of the measurement, at most 2 s and 64 ticks ago; the default is that of the
    newest pose. `pose.fixes`, `pose.fixes_refused` and `pose.refusal` show whether the robot uses the fix. Raises NotRunning.
    """
    if (heading_rad is None) != (sd_rad is None):
        raise ValueError("one of heading_rad and sd_rad is missing; give both or neither")
    joined = _joined(robot)
    sample = topics.Fix(x_m=x_m, y_m=y_m, heading_rad=math.nan if heading_rad is None else heading_rad, source=source.encode()[:24])
    sample.capture_ns = _now_ns(joined) if capture_ns is None else capture_ns
    sample.covariance[0] = sample.covariance[3] = sd_m**2
    sample.covariance[5] = 0.0 if sd_rad is None else sd_rad**2
    sample.shared[0] = shared_sd_m**2
    joined.follower.publish("fix", sample)


def turn(robot: str, turn_rad: float, *, sd_rad: float, capture_ns: int | None = None) -> None:
    """Publish the turn of a robot's gyro since the previous call: radians counter-clockwise, with their standard deviation.

    `capture_ns` is the mission time at which the turn ends; the default is that of the newest pose. Call it from one thread. Raises
    NotRunning.
    """
    joined = _joined(robot)
    joined.turns += 1
    sample = topics.Turn(sequence=joined.turns, turn_rad=turn_rad, variance_rad2=sd_rad**2)
    sample.capture_ns = _now_ns(joined) if capture_ns is None else capture_ns
    joined.follower.publish("turn", sample)


@dataclass
class Stage:
    state: StageState | int
    generation: int
    restarts: int
    pid: int
    """0 without a process."""


@dataclass
class RobotState:
    """State of a robot. None stands for a value that it has not published."""

    robot: str
    t_s: float = math.nan
    """Mission time."""
    pose: topics.Pose | None = None
    order: Order | int | None = None
    """Order of the supervisor."""
    reason: HoldReason | int | None = None
    """Reason why the supervisor does not order the robot to drive."""
    target: topics.Target | None = None
    action: Action | int | None = None
    """Action of the link's failsafe."""
    cause: Cause | int | None = None
    stages: dict[str, Stage] = field(default_factory=dict)

    def __repr__(self) -> str:
        said = [f"robot {self.robot} at {self.t_s:.1f} s", f"{_words(self.order)} ({_words(self.reason)})", f"link: {_words(self.action)} ({_words(self.cause)})"]
        if self.pose is not None:
            said.append(f"at ({self.pose.x_m:.3f}, {self.pose.y_m:.3f}) m, heading {math.degrees(self.pose.heading_rad):.1f} degrees")
        if self.target is not None:
            point = self.target.target
            said.append(f"target {self.target.number} of {self.target.last}: ({point.x_m:.3f}, {point.y_m:.3f}) m")
        stages = (f"{name} {_words(stage.state)} in generation {stage.generation}" for name, stage in self.stages.items())
        return f"<{'; '.join([*said, *stages])}>"


def _words(value: Any) -> str:
    name = getattr(value, "name", str(value))
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()


def _named(kind: type[Byte], byte: int) -> Byte | int:
    """Any process may have written the byte."""
    return kind(byte) if byte in list(kind) else byte


def robot_state(robot: str = "x80") -> RobotState:
    """Return the current state of a robot. Raises NotRunning, which names the running robots."""
    newest = _Joined(robot, ["pose", "target", "roster", "link"]).read()
    state = RobotState(robot, pose=newest.get("pose"), target=newest.get("target"))
    if "link" in newest:
        link = newest["link"]
        state.t_s = link.stamp.stamp_ns * 1e-9
        state.action, state.cause = _named(Action, link.action), _named(Cause, link.cause)
    if "roster" in newest:
        header, entries = newest["roster"]
        state.order, state.reason = _named(Order, header.order), _named(HoldReason, header.reason)
        for entry in entries:
            stage = Stage(_named(StageState, int(entry["state"])), int(entry["generation"]), int(entry["restarts"]), int(entry["pid"]))
            state.stages[entry["stage"].decode(errors="replace")] = stage
    return state
