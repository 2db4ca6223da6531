"""Robots that firsthand drives, for Python: their samples as they come, what they do, their recordings, and fixes for them.

    for pose in firsthand.follow("x80", "pose"):
        print(pose.x_m, pose.y_m)

`firsthand.topics` has the structs of all topics; `help(firsthand.topics.Pose)` says what each field means. Names end with units.
"""

from .live import NotRunning, RobotState, Stage, fix, follow, publish, robot_state, robots, turn
from .recorded import Recording, Slices, recording
from .samples import Map, Sliced

__all__ = [
    "Map",
    "NotRunning",
    "Recording",
    "RobotState",
    "Sliced",
    "Slices",
    "Stage",
    "fix",
    "follow",
    "publish",
    "recording",
    "robot_state",
    "robots",
    "turn",
]
