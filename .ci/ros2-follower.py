"""Robots in random worlds that drive along the paths of `firsthand ros2 planner`, as Nav2 has its planner asked and followed.

    python3 .ci/ros2-follower.py EXECUTABLE [WORLDS] [FIRST SEED]

rclpy's ActionClient asks with Nav2's messages, again each second while the robot drives. A TurtleBot 4 is simulated, which follows by pure
pursuit. In every other world a drum appears on its way. This says by its own ground truth whether each robot arrives and what it touches.
"""

import heapq
import importlib.util
import math
import os
import random
import subprocess
import sys
import time

loaded = importlib.util.spec_from_file_location("bridge", os.path.join(os.path.dirname(__file__), "ros2-bridge.py"))
bridge = importlib.util.module_from_spec(loaded)
sys.modules["bridge"] = bridge
loaded.loader.exec_module(bridge)

import numpy as np
import rclpy
from bridge import Header, LATCHED, OccupancyGridUpdate, Plane, TFMessage, TransformStamped
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from nav2_msgs.action import ComputePathToPose
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient

CELL = 0.05
# A TurtleBot 4: m, m/s, rad/s, m/s^2, rad/s^2. Nav2's parameters for it have the larger radius. Pure pursuit cuts corners by some
# centimetres, which are the inflation.
BODY, RADIUS, INFLATION, SPEED, TURN, ACCELERATION, TURNING = 0.189, 0.22, float(os.environ.get("INFLATION", "0.05")), 0.31, 1.9, 0.9, 3.0
# As Nav2's regulated pure pursuit: m, and the angle beyond which it turns on the spot, rad.
LOOK_AHEAD, ON_THE_SPOT = 0.35, 0.785
ARRIVED, SEEN_AT, STEP = 0.1, 1.5, 0.05
# Mission seconds a second: ten robots are there in minutes.
PACE = float(os.environ.get("PACE", "4"))


class World:
    """Cells of a random world; its rows go along x."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        pick = self.random.uniform
        self.height, self.width = (int(pick(8, 14) / CELL) for _ in "yx")
        self.cells = np.zeros((self.height, self.width), bool)
        self.rows, self.cols = np.mgrid[: self.height, : self.width]
        size = self.width * CELL, self.height * CELL
        self.box(0, 0, *size, 0.1)
        kind = ("drums", "rooms", "both")[seed % 3]
        if kind != "drums":
            self.rooms(0, 0, *size)
        for _ in range({"drums": 40, "rooms": 0, "both": 14}[kind]):
            x, y = pick(0, size[0]), pick(0, size[1])
            if self.random.random() < 0.5:
                self.drum(x, y, pick(0.1, 0.35))
            else:
                self.box(x, y, x + pick(0.1, 0.8), y + pick(0.1, 0.8))
        self.kind = kind

    def drum(self, x, y, radius):
        self.cells |= np.hypot((self.cols + 0.5) * CELL - x, (self.rows + 0.5) * CELL - y) <= radius

    def box(self, left, low, right, high, wall=None):
        part = self.cells[int(low / CELL) : int(high / CELL), int(left / CELL) : int(right / CELL)]
        if wall is None:
            part[:] = True
        else:
            wide = int(wall / CELL)
            part[:wide] = part[-wide:] = part[:, :wide] = part[:, -wide:] = True

    def rooms(self, left, low, right, high):
        """Walls with a door each divide a room until the parts are small."""
        pick = self.random.uniform
        if max(right - left, high - low) < 4.5:
            return
        is_wide, door = right - left > high - low, pick(0.65, 1.1)
        at = pick(0.35, 0.65)
        if is_wide:
            x, y = left + at * (right - left), pick(low + 0.3, high - 0.3 - door)
            self.box(x, low, x + 0.15, y)
            self.box(x, y + door, x + 0.15, high)
            self.rooms(left, low, x, high)
            self.rooms(x, low, right, high)
        else:
            y, x = low + at * (high - low), pick(left + 0.3, right - 0.3 - door)
            self.box(left, y, x, y + 0.15)
            self.box(x + door, y, right, y + 0.15)
            self.rooms(left, low, right, y)
            self.rooms(left, y, right, high)

    def inflated(self, radius):
        reach = int(radius / CELL)
        wide = np.pad(self.cells, reach, constant_values=True)
        blocked = np.zeros_like(self.cells)
        for r in range(-reach, reach + 1):
            for c in range(-reach, reach + 1):
                if math.hypot(r, c) * CELL <= radius:
                    blocked |= wide[reach + r :, reach + c :][: self.height, : self.width]
        return blocked

    def lengths(self, goal):
        """The shortest ways of a point as wide as the planner's robot from all cells to `goal`, metres; a knight's moves are taken too."""
        free = ~self.inflated(RADIUS + INFLATION)
        moves = [(r, c, math.hypot(r, c) * CELL) for r in range(-2, 3) for c in range(-2, 3) if math.gcd(r, c) == 1]
        found = np.full(free.shape, math.inf)
        found[goal] = 0.0
        queue = [(0.0, goal)]
        while queue:
            length, (row, col) = heapq.heappop(queue)
            if length > found[row, col]:
                continue
            for r, c, more in moves:
                to, half = (row + r, col + c), (row + int(r / 2), col + int(c / 2))
                if free[to] and free[half] and length + more < found[to]:
                    found[to] = length + more
                    heapq.heappush(queue, (length + more, to))
        return found

    def leads(self, start, goal):
        """Whether there is a way for the planner's robot."""
        free, queue = ~self.inflated(RADIUS + INFLATION), [goal]
        while queue:
            row, col = queue.pop()
            if free[row, col]:
                free[row, col] = False
                if (row, col) == start:
                    return True
                queue += [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        return False

    def clearance(self, x, y):
        """From a point to the nearest occupied cell's edge, metres."""
        col, row, reach = int(x / CELL), int(y / CELL), 20
        low, left = max(0, row - reach), max(0, col - reach)
        rows, cols = np.nonzero(self.cells[low : row + reach, left : col + reach])
        beside = lambda cells, first, at: np.maximum(abs((cells + first + 0.5) * CELL - at) - CELL / 2, 0)
        return np.hypot(beside(cols, left, x), beside(rows, low, y)).min(initial=reach * CELL)


def cell(x, y):
    return int(y / CELL), int(x / CELL)


class Robot:
    def __init__(self, x, y, heading):
        self.x, self.y, self.heading, self.speed, self.turn, self.way = x, y, heading, 0.0, 0.0, 0.0

    def step(self, speed, turn):
        towards = lambda now, want, most: now + min(max(want - now, -most), most)
        self.speed = towards(self.speed, speed, ACCELERATION * STEP)
        self.turn = towards(self.turn, turn, TURNING * STEP)
        self.heading += self.turn * STEP
        self.x += self.speed * STEP * math.cos(self.heading)
        self.y += self.speed * STEP * math.sin(self.heading)
        self.way += abs(self.speed) * STEP

    def follow(self, path):
        """Speed and turn by pure pursuit."""
        if path is None:
            return 0.0, 0.0
        distances = np.hypot(path[:, 0] - self.x, path[:, 1] - self.y)
        ahead = path[int(distances.argmin()) :]
        far = np.nonzero(np.hypot(ahead[:, 0] - self.x, ahead[:, 1] - self.y) > LOOK_AHEAD)[0]
        to = ahead[far[0]] if len(far) else ahead[-1]
        dx, dy = to[0] - self.x, to[1] - self.y
        angle = math.remainder(math.atan2(dy, dx) - self.heading, math.tau)
        if abs(angle) > ON_THE_SPOT:
            return 0.0, math.copysign(min(TURN, 2.0 * abs(angle)), angle)
        curvature = 2.0 * math.sin(angle) / max(math.hypot(dx, dy), 0.1)
        speed = min(SPEED, SPEED / max(1e-9, 0.9 * abs(curvature)), 0.05 + 1.5 * math.hypot(*(path[-1] - (self.x, self.y))))
        return speed, max(-TURN, min(TURN, speed * curvature))


class Network:
    """What the planner reads, and its client."""

    def __init__(self):
        self.node = rclpy.create_node("follows")
        participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
        writer = lambda name, kind: DataWriter(participant, Topic(participant, name, kind), bridge.cyclone_qos())
        self.frames, self.updates = writer("rt/tf", TFMessage), writer("rt/map_updates", OccupancyGridUpdate)
        self.maps = self.node.create_publisher(OccupancyGrid, "map", LATCHED)
        self.client = ActionClient(self.node, ComputePathToPose, "firsthand/compute_path_to_pose")

    def is_whole(self):
        readers = self.maps.get_subscription_count(), self.updates.get_matched_subscriptions(), self.frames.get_matched_subscriptions()
        return self.client.server_is_ready() and all(readers)


class Drive:
    def __init__(self, network, seed):
        self.network, self.world, self.seed = network, World(seed), seed
        # The map of another world does not answer for it.
        self.frame = f"map{seed}"
        world, pick = self.world, self.world.random
        free = np.argwhere(~world.inflated(0.35))
        while True:
            goal, start = (tuple(int(i) for i in pick.choice(free)) for _ in "gs")
            if math.dist(goal, start) * CELL > 5 and math.isfinite((lengths := world.lengths(goal))[start]):
                break
        self.shortest = lengths[start]
        self.goal = [(i + 0.5) * CELL for i in goal[::-1]]
        self.robot = Robot(*[(i + 0.5) * CELL for i in start[::-1]], pick.uniform(-math.pi, math.pi))
        self.path, self.asked, self.refused, self.plans, self.late = None, False, {}, 0, 0.0

    def publish_map(self):
        grid, world = OccupancyGrid(), self.world
        grid.header.frame_id, grid.info.resolution, grid.info.width, grid.info.height = self.frame, CELL, world.width, world.height
        grid.info.origin.orientation.w = 1.0
        grid.data = (world.cells.ravel() * np.int8(100)).tolist()
        self.network.maps.publish(grid)

    def publish_frames(self):
        robot = self.robot
        place = Plane(x=robot.x, y=robot.y, k=math.sin(robot.heading / 2), w=math.cos(robot.heading / 2))
        self.network.frames.write(TFMessage([TransformStamped(Header(frame_id=self.frame), "base_link", place)]))

    def ask(self):
        goal = ComputePathToPose.Goal()
        goal.goal.header.frame_id, goal.goal.pose.orientation.w = self.frame, 1.0
        goal.goal.pose.position.x, goal.goal.pose.position.y = self.goal
        self.asked, began = True, time.monotonic()

        def ended(future):
            result, self.asked = future.result().result, False
            if result.error_code:
                self.refused[result.error_msg] = self.refused.get(result.error_msg, 0) + 1
                self.path = None
            else:
                self.plans, self.late = self.plans + 1, max(self.late, time.monotonic() - began)
                self.path = np.array([(p.pose.position.x, p.pose.position.y) for p in result.path.poses])

        self.network.client.send_goal_async(goal).add_done_callback(lambda sent: sent.result().get_result_async().add_done_callback(ended))

    def obstruct(self):
        """Put a drum on the way ahead if another way is left. Returns whether one was put there."""
        world, robot = self.world, self.robot
        distances = np.hypot(self.path[:, 0] - robot.x, self.path[:, 1] - robot.y)
        ahead = self.path[int(distances.argmin()) :]
        far = ahead[np.hypot(ahead[:, 0] - robot.x, ahead[:, 1] - robot.y) > SEEN_AT]
        radius = world.random.uniform(0.1, 0.25)
        if not len(far) or math.dist(far[0], self.goal) < radius + 0.6:
            return False
        before = world.cells.copy()
        world.drum(*far[0], radius)
        rows, cols = np.nonzero(world.cells ^ before)
        if not (len(rows) and world.leads(cell(robot.x, robot.y), cell(*self.goal))):
            world.cells = before
            return False
        low, left, high, right = rows.min(), cols.min(), rows.max() + 1, cols.max() + 1
        window = world.cells[low:high, left:right].ravel() * 100
        self.network.updates.write(OccupancyGridUpdate(Header(), int(left), int(low), int(right - left), int(high - low), window.tolist()))
        return True

    def turn(self):
        self.publish_frames()
        end = time.monotonic() + STEP / PACE
        while (left := end - time.monotonic()) > 0:
            rclpy.spin_once(self.network.node, timeout_sec=left)

    def run(self):
        """Whether the robot arrives without a contact."""
        self.publish_map()
        end = time.monotonic() + 60
        while not self.network.is_whole():
            assert time.monotonic() < end, "the planner was not found"
            self.turn()
        robot, clock, asked, drums, contacts, least = self.robot, 0.0, -math.inf, 0, 0, math.inf
        most = 60 + 4 * self.shortest / SPEED
        while clock < most and math.dist((robot.x, robot.y), self.goal) > ARRIVED:
            # No map or transform may have come yet when it is asked at first.
            if clock - asked >= 1 and not self.asked:
                asked = clock
                self.ask()
            robot.step(*robot.follow(self.path))
            near = self.world.clearance(robot.x, robot.y) - BODY
            least, contacts = min(least, near), contacts + (near < 0)
            if self.seed % 2 and self.path is not None and drums < 2 and robot.way > (0.3 + 0.3 * drums) * self.shortest:
                drums += self.obstruct()
            self.turn()
            clock += STEP
        arrived = clock < most
        print(
            f"world {self.seed} ({self.world.kind}, {self.world.width} x {self.world.height}): {'reached' if arrived else 'NOT REACHED'}, "
            f"{contacts} contacts, {100 * least:.1f} cm beside it at least, {robot.way / self.shortest:.2f} of the shortest {self.shortest:.1f} m, "
            f"{clock:.0f} s, {drums} drums appeared, {self.plans} plans, at most {1e3 * self.late:.0f} ms, refused {self.refused or 0}",
            flush=True,
        )
        return arrived and not contacts


def main(firsthand, worlds=10, first=1):
    rclpy.init()
    network = Network()
    words = ["--map", "map", "--robot-radius", str(RADIUS), "--inflation", str(INFLATION)]
    server = subprocess.Popen([firsthand, "ros2", "planner", *words])
    try:
        right = sum(Drive(network, seed).run() for seed in range(int(first), int(first) + int(worlds)))
    finally:
        server.terminate()
        server.wait()
    print(f"{right} of {worlds} robots arrived and touched nothing", flush=True)
    # rclpy may wait for ever in its own shutdown.
    os._exit(0 if right == int(worlds) else 1)


if __name__ == "__main__":
    main(*sys.argv[1:])
