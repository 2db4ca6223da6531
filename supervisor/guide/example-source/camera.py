"""A camera that sees a simulated robot, by the ground truth in the directory of its run: python camera.py ROBOT DIRECTORY

The module is printed by `firsthand topic list --python > firsthand_topics.py`.
"""

import json, math, random, sys
from firsthand_topics import Fix, Follower

robot, run = sys.argv[1:]
camera, truth, due = Follower(robot, ["pose"], "camera"), None, 0
for event, pose in camera:
    if event == "here":
        truth, ticks, due = open(f"{run}/ground_truth.jsonl"), [], 0
    elif event == "pose":
        ticks = [*ticks, *map(json.loads, truth)][-64:]
        counts = pose.left_counts, pose.right_counts
        seen = [tick for tick in ticks if (tick["left_counts"], tick["right_counts"]) == counts]
        if seen and pose.stamp.stamp_ns >= due:
            due = pose.stamp.stamp_ns + 1_000_000_000
            x, y = (random.gauss(seen[-1][axis], 0.05) for axis in "xy")
            fix = Fix(capture_ns=pose.stamp.stamp_ns, x_m=x, y_m=y, heading_rad=math.nan)
            fix.source, fix.covariance[0], fix.covariance[3] = b"camera", 0.0025, 0.0025
            camera.publish("fix", fix)
