"""The map, with the one argument `map`, or the client of `.ci/ros2-lossy`: ros2-lossy.py CONTROL GOALS."""

import os
import statistics
import sys
import time

import rclpy
from nav2_msgs.action import ComputePathToPose
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile

SIDE = 400
rclpy.init()
node = rclpy.create_node("lossy_" + os.path.basename(sys.argv[1]))

if sys.argv[1] == "map":
    grid = OccupancyGrid()
    grid.header.frame_id, grid.info.resolution = "map", 0.05
    grid.info.width = grid.info.height = SIDE
    # Three walls, round the ends of which the way winds.
    wall = lambda row, col: col in (100, 300) and row <= 370 or col == 200 and row >= 30
    grid.data = [100 * wall(row, col) for row in range(SIDE) for col in range(SIDE)]
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(OccupancyGrid, "/map", latched).publish(grid)
    rclpy.spin(node)

client = ActionClient(node, ComputePathToPose, "/firsthand/compute_path_to_pose")
assert client.wait_for_server(60)


def after(future):
    rclpy.spin_until_future_complete(node, future, timeout_sec=60)
    return future.result()


def ask(nth):
    goal = ComputePathToPose.Goal(use_start=True)
    for pose, y in (goal.start, 1.0), (goal.goal, 1.0 + nth % 5 * 0.05):
        pose.header.frame_id, pose.pose.orientation.w = "map", 1.0
        pose.pose.position.x, pose.pose.position.y = 1.0 if pose is goal.start else 19.0, y
    began = time.monotonic()
    handle = after(client.send_goal_async(goal))
    result = handle and after(handle.get_result_async())
    return result and (time.monotonic() - began, len(result.result.path.poses), result.result.error_code)


# Code 207: the planner has no map yet.
while (ask(0) or [207])[-1] == 207:
    time.sleep(0.2)
for lost in 0.0, 0.01, 0.02, 0.05:
    with open(sys.argv[1] + ".next", "w") as control:
        control.write(f"1 1 0 {lost}\n")
    os.rename(sys.argv[1] + ".next", sys.argv[1])
    time.sleep(1)
    answers = [ask(nth) for nth in range(int(sys.argv[2]))]
    times, poses, codes = zip(*filter(None, answers))
    print(
        f"{100 * lost:.0f} % of packets lost: {len(times)} of {len(answers)} answered, {poses[-1]} poses; "
        f"{1e3 * statistics.median(times):.0f} ms in the median, {1e3 * max(times):.0f} at most",
        flush=True,
    )
    assert len(times) == len(answers) and not any(codes), codes
# rclpy may wait for ever in its own shutdown.
os._exit(0)
