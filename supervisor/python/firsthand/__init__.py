"""Python access to robots that firsthand drives: live samples, states, recordings and fixes.

    for pose in firsthand.follow("x80", "pose"):
        print(pose.x_m, pose.y_m)

`firsthand.topics` has the structs of all topics, and `help(firsthand.topics.Pose)` explains the fields. Names end with units.
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
