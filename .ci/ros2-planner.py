"""`firsthand ros2 planner` asked as Nav2 of each release asks its planner server: paths, stamps, error codes, a map that changes, and the time
to accept a goal.

    python3 .ci/ros2-planner.py EXECUTABLE

The map is published by rclpy with Fast DDS, in fragments; the types that are not packed for pip are declared for Cyclone DDS, as for the
bridge.
"""

import importlib.util
import math
import os
import subprocess
import sys
import time
import traceback
from dataclasses import dataclass, field
from types import SimpleNamespace

loaded = importlib.util.spec_from_file_location("bridge", os.path.join(os.path.dirname(__file__), "ros2-bridge.py"))
bridge = importlib.util.module_from_spec(loaded)
sys.modules["bridge"] = bridge
loaded.loader.exec_module(bridge)

import rclpy
from bridge import Header, IdlStruct, LATCHED, OccupancyGridUpdate, Plane, TFMessage, Time, TransformStamped
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl.types import array, int8, int16, int64, sequence, uint8, uint16, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Path
from rosgraph_msgs.msg import Clock

SIDE, CELL, RADIUS = 1000, 0.05, 0.22
UUID = array[uint8, 16]


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header = field(default_factory=Header)
    pose: Plane = field(default_factory=Plane)


def action(name, wanted, is_1_5):
    """The types of an action, of Nav2 from 1.5 on or before: a goal, its reply, the request for the result, the result."""
    of = lambda part: f"nav2_msgs::action::dds_::{name}_{part}_"

    @dataclass
    class Send(IdlStruct, typename=of("SendGoal_Request")):
        client: uint64
        number: int64
        goal_id: UUID
        goals: wanted
        start: Pose = field(default_factory=Pose)
        if is_1_5 and wanted is Pose:
            viapoints: sequence[Pose] = field(default_factory=list)
        planner_id: str = "GridBased"
        use_start: bool = False

    @dataclass
    class Sent(IdlStruct, typename=of("SendGoal_Response")):
        client: uint64
        number: int64
        accepted: bool
        stamp: Time

    @dataclass
    class Get(IdlStruct, typename=of("GetResult_Request")):
        client: uint64
        number: int64
        goal_id: UUID

    @dataclass
    class Result(IdlStruct, typename=of("GetResult_Response")):
        client: uint64
        number: int64
        status: int8
        header: Header
        poses: sequence[Pose]
        if is_1_5 and wanted is not Pose:
            last_reached_index: int16
        planning_time: Time
        error_code: uint16
        error_msg: str

    return Send, Sent, Get, Result


@dataclass
class Goals(IdlStruct, typename="nav_msgs::msg::dds_::Goals_"):
    header: Header
    goals: sequence[Pose]


# The type of several goals, and whether Nav2 is 1.5 or newer.
RELEASES = {"jazzy": (sequence[Pose], False), "kilted": (Goals, False), "lyrical": (Goals, True), "main": (Goals, True)}


class Client:
    def __init__(self, participant, name, kind, goals, is_1_5):
        self.Send, sent, self.Get, result = action(kind, goals, is_1_5)
        topic = lambda way, part, of: Topic(participant, f"{way}/{name}/_action/{part}", of)
        self.writers = [
            DataWriter(participant, topic("rq", f"{part}Request", of), bridge.cyclone_qos())
            for part, of in [("send_goal", self.Send), ("get_result", self.Get)]
        ]
        self.readers = [
            DataReader(participant, topic("rr", f"{part}Reply", of), bridge.cyclone_qos())
            for part, of in [("send_goal", sent), ("get_result", result)]
        ]
        # All clients hear the replies to all.
        self.client, self.number = int.from_bytes(os.urandom(7)), 0

    def call(self, which, request, turn):
        self.number += 1
        self.writers[which].write(request(self.client, self.number))
        end = time.monotonic() + 60
        while time.monotonic() < end:
            for reply in self.readers[which].take(N=10):
                if (reply.client, reply.number) == (self.client, self.number):
                    return reply
            turn()
        raise AssertionError(f"call {which} was not answered")

    def plan(self, turn, goals, start=None):
        """The seconds until the goal was accepted, and the result."""
        goal_id = list(os.urandom(16))
        begin = time.monotonic()
        more = {"start": start, "use_start": True} if start else {}
        sent = self.call(0, lambda client, number: self.Send(client, number, goal_id, goals, **more), turn)
        accepted = time.monotonic() - begin
        assert sent.accepted
        return accepted, self.call(1, lambda client, number: self.Get(client, number, goal_id), turn)


def clients(participant, release, namespace=""):
    several, is_1_5 = RELEASES[release]
    return [
        Client(participant, f"{namespace}firsthand/compute_path_to_pose", "ComputePathToPose", Pose, is_1_5),
        Client(participant, f"{namespace}firsthand/compute_path_through_poses", "ComputePathThroughPoses", several, is_1_5),
    ]


def ask_as_each_release(until, turn, now, namespace=""):
    """Clients of each release have 20 paths each that begin at the robot and have stamps of the time `now`."""
    for release, (several, is_1_5) in RELEASES.items():
        # The planner tells clients apart by their participants.
        to_pose, through = clients(DomainParticipant(int(os.environ["ROS_DOMAIN_ID"])), release, namespace)
        until(f"the servers of {release}", lambda: all(w.get_matched_subscriptions() for c in [to_pose, through] for w in c.writers))

        def first():
            result = to_pose.plan(turn, at(-9.0, 5.0))[1]
            return result.error_code == 0 and result.header.stamp.sec >= now() - 5

        until(f"a path for {release}", first)
        for n in range(20):
            begin, goal = now(), at(-9.0 + 0.4 * n, 5.0)
            if n % 2 == 0:
                result = to_pose.plan(turn, goal)[1]
            else:
                goals = [at(-9.0, 4.0), goal]
                result = through.plan(turn, goals if several is not Goals else Goals(Header(), goals))[1]
                assert not is_1_5 or result.last_reached_index == -1, result.last_reached_index
            assert (result.status, result.error_code, result.error_msg) == (4, 0, ""), (release, n, result.error_code, result.error_msg)
            places = [(pose.pose.x, pose.pose.y) for pose in result.poses]
            assert math.dist(places[0], (-10.0, -2.0)) < 1e-6 and math.dist(places[-1], (goal.pose.x, 5.0)) < 1e-6, (release, n, places)
            stamps = {(stamp.sec, stamp.nanosec) for stamp in [result.header.stamp, *(pose.header.stamp for pose in result.poses)]}
            assert len(stamps) == 1 and begin - 5 <= stamps.copy().pop()[0] <= now(), (release, n, begin, stamps)
    print(f"clients of {', '.join(RELEASES)} have 20 paths each from the robot, the last with the stamp {stamps.pop()[0]} s")


def at(x, y, heading=0.0, frame="map"):
    return Pose(Header(frame_id=frame), Plane(x=x, y=y, k=math.sin(heading / 2), w=math.cos(heading / 2)))


def commander(is_free):
    """Nav2's client asks, by the planner's names."""
    # It turns only while it asks, so it says where the robot is.
    navigator = bridge.BasicNavigator(namespace="firsthand")

    def stamped(x, y):
        pose = PoseStamped()
        pose.header.frame_id, pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = "map", x, y, 1.0
        return pose

    def check(path, *places):
        poses = [pose.pose.position for pose in path.poses]
        assert all(is_free(at.x, at.y) for at in poses)
        for x, y in places:
            assert min(math.hypot(at.x - x, at.y - y) for at in poses) < 1e-6, (x, y)
        return len(poses)

    start, goal = stamped(-10.0, -2.0), stamped(10.0, 0.0)
    count = check(navigator.getPath(start, goal, use_start=True), (-10.0, -2.0), (10.0, 0.0))
    assert navigator.getTaskError() == (0, "")
    check(navigator.getPathThroughPoses(start, [stamped(-5.0, 5.0), goal], use_start=True), (-5.0, 5.0), (10.0, 0.0))
    assert navigator.getPath(start, stamped(-19.8, -19.8), use_start=True) is None
    code, text = navigator.getTaskError()
    assert code == 206 and "(-19.80, -19.80) is occupied" in text, (code, text)
    assert navigator.getPathThroughPoses(start, [stamped(30.0, 0.0)], use_start=True) is None
    assert navigator.getTaskError()[0] == 304
    print(f"nav2_simple_commander has a path of {count} poses, one by way of another goal, and the codes of two that have none")


def main(firsthand):
    rclpy.init()
    node = rclpy.create_node("asks")
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    writer = lambda name, kind, latched=False: DataWriter(participant, Topic(participant, name, kind), bridge.cyclone_qos(latched))
    frames = writer("rt/tf", TFMessage)
    updates = writer("rt/map_updates", OccupancyGridUpdate)
    maps = node.create_publisher(OccupancyGrid, "map", LATCHED)
    clock = node.create_publisher(Clock, "/clock", 10)
    plans = []
    node.create_subscription(Path, "plan", plans.append, LATCHED)
    told = 0.0

    # A wall with a door divides the map, and a box is closed.
    cells = bytearray(SIDE * SIDE)

    def fill(col, row, width, height, value):
        for r in range(row, row + height):
            cells[r * SIDE + col : r * SIDE + col + width] = bytes([value]) * width

    fill(500, 0, 4, SIDE, 100)
    fill(500, 700, 4, 40, 0)
    fill(100, 100, 60, 60, 100)
    fill(110, 110, 40, 40, 0)
    grid = OccupancyGrid()
    grid.header.frame_id, grid.info.resolution, grid.info.width, grid.info.height = "map", CELL, SIDE, SIDE
    grid.info.origin.position.x, grid.info.origin.position.y, grid.info.origin.orientation.w = -25.0, -25.0, 1.0
    grid.data = [int(value) for value in cells]
    maps.publish(grid)

    def turn():
        nonlocal told
        rclpy.spin_once(node, timeout_sec=0.0005)
        if time.monotonic() - told > 0.05:
            told = time.monotonic()
            robot = [("map", "odom", Plane(x=-10.0)), ("odom", "base_link", Plane(y=-2.0))]
            frames.write(TFMessage([TransformStamped(Header(frame_id=parent), child, place) for parent, child, place in robot]))
            message = Clock()
            message.clock.sec = int(simulated())
            clock.publish(message)

    # A clock of a simulation, seconds.
    simulated = lambda: 1000 + time.monotonic() - started
    started = time.monotonic()

    words = ["ros2", "planner", "--map", "map", "--robot-radius", str(RADIUS), "--max-planning-time", "60", "--transform-tolerance", "60"]
    server = subprocess.Popen([firsthand, *words])
    try:
        to_pose, through = clients(participant, "kilted")

        def until(what, condition):
            end = time.monotonic() + 60
            while not condition():
                assert time.monotonic() < end, f"in vain was waited for: {what}"
                turn()

        until("the servers", lambda: all(w.get_matched_subscriptions() for c in [to_pose, through] for w in c.writers))
        until("the map's and the frames' reader", lambda: maps.get_subscription_count() and frames.get_matched_subscriptions())

        # Until the map is there, 207 says so.
        def first():
            result = to_pose.plan(turn, at(10.0, 0.0, 1.0))[1]
            assert result.error_code in (0, 202, 207), result.error_msg
            return result.error_code == 0

        until("a path", first)

        def is_free(x, y):
            col, row = (x + 25.0) / CELL - 0.5, (y + 25.0) / CELL - 0.5
            reach = math.ceil(RADIUS / CELL)
            for r in range(max(0, round(row) - reach), min(SIDE, round(row) + reach + 1)):
                for c in range(max(0, round(col) - reach), min(SIDE, round(col) + reach + 1)):
                    if cells[r * SIDE + c] and math.hypot(c - round(col), r - round(row)) * CELL <= RADIUS:
                        return False
            return True

        def check(result, *places):
            assert (result.status, result.error_code, result.error_msg) == (4, 0, ""), result.error_msg
            assert result.header.frame_id == "map" and result.planning_time.sec + result.planning_time.nanosec > 0
            poses = [pose.pose for pose in result.poses]
            assert all(is_free(pose.x, pose.y) for pose in poses)
            steps = [math.hypot(b.x - a.x, b.y - a.y) for a, b in zip(poses, poses[1:])]
            assert max(steps) < 3 * CELL, max(steps)
            for x, y in places:
                assert min(math.hypot(pose.x - x, pose.y - y) for pose in poses) < 1e-6, (x, y)
            return sum(steps)

        _, result = to_pose.plan(turn, at(10.0, 0.0, 1.0))
        length = check(result, (-10.0, -2.0), (10.0, 0.0))
        assert abs(bridge.turned(result.poses[-1].pose) - 1.0) < 1e-6
        until("the path on its topic", lambda: plans and len(plans[-1].poses) == len(result.poses))
        print(f"a path of {length:.1f} m and {len(result.poses)} poses on {SIDE} x {SIDE} cells")
        # A goal may be in the robot's frame.
        check(to_pose.plan(turn, at(1.0, 0.0, frame="base_link"))[1], (-9.0, -2.0))
        check(through.plan(turn, Goals(Header(), [at(-5.0, 5.0), at(10.0, 0.0)]))[1], (-5.0, 5.0), (10.0, 0.0))

        ask_as_each_release(until, turn, time.time)
        words[words.index("map")] = "/map"
        simulation = subprocess.Popen([firsthand, *words, "--namespace", "simulation", "--tf", "/tf", "--use-sim-time"])
        try:
            ask_as_each_release(until, turn, simulated, "simulation/")
        finally:
            simulation.terminate()
            simulation.wait()

        for code, goal, start in [
            (202, at(1.0, 0.0, frame="nowhere"), None),
            (203, at(1.0, 0.0), at(30.0, 0.0)),
            (204, at(30.0, 0.0), None),
            (205, at(1.0, 1.0), at(-19.8, -19.8)),
            (206, at(-19.8, -19.8), None),
            (208, at(-18.5, -18.5), None),
        ]:
            result = to_pose.plan(turn, goal, start)[1]
            assert (result.status, result.error_code) == (6, code), (code, result.error_code, result.error_msg)
            print(f"{code}: {result.error_msg}")
        assert through.plan(turn, Goals(Header(), []))[1].error_code == 309
        heard = SimpleNamespace(node=node, until=until)
        bridge.check_parameters(heard, "firsthand_planner", {"robot_radius": RADIUS, "map": "map", "occupied": 99}, "Radius")
        if bridge.BasicNavigator is not None:
            commander(is_free)

        # The door is shut but for a part by an update.
        fill(500, 720, 4, 20, 100)
        updates.write(OccupancyGridUpdate(Header(), 500, 720, 4, 20, [100] * 80))
        until("the change", lambda: all(is_free(p.pose.x, p.pose.y) for p in to_pose.plan(turn, at(10.0, 0.0))[1].poses))
        waits, times = [], []
        for n in range(100):
            fill(300 + n, 300, 1, 1, 100)
            updates.write(OccupancyGridUpdate(Header(), 300 + n, 300, 1, 1, [100]))
            accepted, result = to_pose.plan(turn, at(10.0, 0.0))
            assert result.error_code == 0
            waits.append(1e3 * accepted)
            times.append(1e3 * result.planning_time.sec + 1e-6 * result.planning_time.nanosec)
        for what, ms in [("a goal was accepted", waits), ("a path on a changed map was there", times)]:
            ms.sort()
            print(f"{what} after {ms[50]:.1f} ms, at 99 % {ms[98]:.1f} ms, of {len(ms)}")
        # The door is shut.
        updates.write(OccupancyGridUpdate(Header(), 500, 700, 4, 20, [100] * 80))
        until("no way", lambda: to_pose.plan(turn, at(10.0, 0.0))[1].error_code == 208)
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except BaseException:
        traceback.print_exc()
        # Threads of DDS, with readers still open, would keep a failed check from ending.
        sys.stderr.flush()
        os._exit(1)
