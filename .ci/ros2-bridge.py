"""What `firsthand ros2` publishes, heard and decoded by rclpy with Fast DDS and by Cyclone DDS, and what it lets others do.

    python3 .ci/ros2-bridge.py EXECUTABLE

The types of tf2 and map are not packed for pip, so they are declared here for Cyclone DDS. Nav2's own client, nav2_simple_commander, sends
goals; .ci/ros2-messages.py builds its messages.
"""

import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field

# All traffic stays on this machine.
os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))
os.environ.update(ROS_LOCALHOST_ONLY="1", RMW_IMPLEMENTATION="rmw_fastrtps_cpp")
LOOPBACK = '<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'
os.environ["CYCLONEDDS_URI"] = f"<CycloneDDS><Domain><General>{LOOPBACK}</General></Domain></CycloneDDS>"

import rclpy
from action_msgs.msg import GoalStatusArray
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int8, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, LaserScan, Range
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

try:
    from nav2_simple_commander.robot_navigator import BasicNavigator, TaskResult
except ImportError:
    # .ci/ros2 says so.
    BasicNavigator = None

ROBOT = f"ci-bridge-{os.getpid()}"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = "map"


@dataclass
class Plane(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    """A pose or a transform: x, y, z and a quaternion."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    i: float64 = 0.0
    j: float64 = 0.0
    k: float64 = 0.0
    w: float64 = 1.0


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Plane


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class OccupancyGridUpdate(IdlStruct, typename="map_msgs::msg::dds_::OccupancyGridUpdate_"):
    header: Header
    x: int32
    y: int32
    width: uint32
    height: uint32
    data: sequence[int8]


def cyclone_qos(latched=False):
    durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
    return Qos(Policy.Reliability.Reliable(1_000_000_000), durability, Policy.History.KeepLast(100))


class Heard:
    """All that is published, by rclpy and by Cyclone DDS."""

    def __init__(self):
        self.node = rclpy.create_node("hears")
        self.messages = {}
        for name, kind, quality in [
            ("pose", PoseWithCovarianceStamped, 10),
            ("odom", Odometry, 10),
            ("map", OccupancyGrid, LATCHED),
            ("path", Path, 10),
            ("field", MarkerArray, 10),
            ("scan", LaserScan, 10),
            ("range/front", Range, 10),
            ("battery_state", BatteryState, 10),
            ("diagnostics", DiagnosticArray, 10),
            ("/rosout", Log, QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)),
            ("/clock", Clock, 10),
            ("navigate_to_pose/_action/status", GoalStatusArray, LATCHED),
        ]:
            keep = lambda message, name=name: self.messages.setdefault(name, []).append(message)
            self.node.create_subscription(kind, name, keep, quality)
        self.participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
        self.readers = {
            "tf": self.reader("rt/tf", TFMessage),
            "tf_static": self.reader("rt/tf_static", TFMessage, True),
            "map_updates": self.reader("rt/map_updates", OccupancyGridUpdate),
        }

    def reader(self, name, kind, latched=False):
        return DataReader(self.participant, Topic(self.participant, name, kind), cyclone_qos(latched))

    def turn(self):
        rclpy.spin_once(self.node, timeout_sec=0.005)
        for name, reader in self.readers.items():
            self.messages.setdefault(name, []).extend(reader.take(N=100))

    def until(self, what, condition, seconds=60):
        end = time.monotonic() + seconds
        while not (found := condition()):
            assert time.monotonic() < end, f"in vain was waited for: {what}"
            self.turn()
        return found

    def newest(self, name):
        return self.messages.get(name, [None])[-1] if self.messages.get(name) else None


def check_parameters(heard, name, values, described):
    """A node's parameters have these values, and one of them this description; none can be set."""
    assert name in heard.node.get_node_names(), heard.node.get_node_names()
    client = AsyncParameterClient(heard.node, name)
    heard.until("services of parameters", client.services_are_ready)

    def answer(future):
        heard.until("their answer", future.done)
        return future.result()

    names = list(answer(client.list_parameters()).result.names)
    assert set(values) <= set(names), names
    got = [parameter_value_to_python(value) for value in answer(client.get_parameters(list(values))).values]
    assert got == list(values.values()), got
    kinds = [value.type for value in answer(client.get_parameters(names)).values]
    assert list(answer(client.get_parameter_types(names)).types) == kinds and 0 not in kinds
    about = {it.name: it for it in answer(client.describe_parameters(names)).descriptors}
    assert described in about[next(iter(values))].description and all(it.read_only for it in about.values())
    wanted = [Parameter(next(iter(values)), value=7), Parameter("other", value="x")]
    for result, reason in zip(answer(client.set_parameters(wanted)).results, ["start it with --", "no such parameter"]):
        assert not result.successful and reason in result.reason, result
    assert not answer(client.set_parameters_atomically(wanted)).result.successful
    print(f"the {len(names)} parameters of {name} are its options: {', '.join(names)}")


def status(firsthand):
    answer = subprocess.run([firsthand, "status", "--robot", ROBOT, "--json"], capture_output=True, text=True)
    return json.loads(answer.stdout) if answer.returncode == 0 else None


def turned(transform):
    return 2 * math.atan2(transform.k, transform.w)


def is_pose(heard):
    """Whether map to odom to base_link is a pose that was heard."""
    frames = {(t.header.frame_id, t.child_frame_id): t.transform for t in heard.newest("tf").transforms}
    origin, odom = frames["map", "odom"], frames["odom", "base_link"]
    angle = turned(origin)
    x = origin.x + math.cos(angle) * odom.x - math.sin(angle) * odom.y
    y = origin.y + math.sin(angle) * odom.x + math.cos(angle) * odom.y
    near = [pose.pose.pose.position for pose in heard.messages["pose"][-20:]]
    return min(math.hypot(at.x - x, at.y - y) for at in near) < 1e-9


def check_map(heard):
    """A map and its updates are the map that comes next."""
    first = heard.messages["map"][0]
    assert (first.header.frame_id, first.info.width * first.info.height) == ("map", len(first.data))
    assert set(first.data) <= {-1, 0, 99, 100}
    update = heard.newest("map_updates")
    assert len(update.data) == update.width * update.height and update.x + update.width <= first.info.width


def main(firsthand):
    rclpy.init()
    work = tempfile.mkdtemp()
    processes = []

    def start(*words, says=None):
        processes.append(subprocess.Popen([firsthand, *words], stdout=subprocess.PIPE, stderr=says))
        return processes[-1]

    def bridge(*words):
        return start("ros2", "--robot", ROBOT, *words)

    def mission(name, *words, speed=0.3):
        slow = ["--pace", "1", "--json", "--robot", ROBOT, "--out", f"{work}/{name}", "--set", f"controller.speed_m_s={speed}"]
        return start("run", "open-room", *slow, *words, says=subprocess.DEVNULL)

    def is_at(heard, x, y):
        path = heard.newest("path")
        return path and math.hypot(path.poses[-1].pose.position.x - x, path.poses[-1].pose.position.y - y) < 0.2

    try:
        heard = Heard()
        node = heard.node
        processes += [subprocess.Popen([sys.executable, __file__, role]) for role in ["--echo", "--latency"]]

        # No request is permitted by default, and everything is published.
        deaf = bridge()
        # It is slow, so that it is still on its way when the stop comes on a busy machine.
        run = mission("shown", "--set", "robot.model='kobuki'", "--set", "robot.rate_hz=10", speed=0.1)
        for name in ["pose", "odom", "map", "path", "field", "scan", "diagnostics", "tf", "tf_static", "map_updates"]:
            heard.until(name, lambda: heard.messages.get(name))
        heard.until("frames that are the pose", lambda: is_pose(heard))
        assert {t.child_frame_id for t in heard.newest("tf_static").transforms} >= {"laser"}
        heard.until("three maps", lambda: len(heard.messages["map"]) >= 3)
        check_map(heard)
        check_parameters(heard, "firsthand", {"robot": ROBOT, "accept": [], "clock": False, "frames": "all"}, "Name of the robot")
        names = {status.name for status in heard.newest("diagnostics").status}
        assert names >= {"firsthand: failsafe", "firsthand: planner"}, names
        odometry = heard.newest("odom")
        assert odometry.pose.covariance[0] > 0 and odometry.pose.covariance[14] == odometry.twist.covariance[14] == 1e6
        scan = heard.newest("scan")
        # REP 117: too near, too far, and no measurement.
        special = lambda range: math.isinf(range) or math.isnan(range)
        odd = [range for range in scan.ranges if not special(range) and not scan.range_min <= range <= scan.range_max]
        assert not odd, (odd, scan.range_min, scan.range_max)
        assert len(scan.ranges) > 100 and scan.header.frame_id == "laser"
        goals = node.create_publisher(PoseStamped, "goal_pose", 10)
        goal = PoseStamped()
        goal.header.frame_id, goal.pose.position.x, goal.pose.position.y = "map", 1.0, 1.0
        goal.pose.orientation.w = 1.0
        for _ in range(20):
            goals.publish(goal)
            heard.turn()
        assert not is_at(heard, 1.0, 1.0)
        # Killing the bridge harms nothing.
        deaf.send_signal(signal.SIGKILL)
        heard.until("the end of the mission", lambda: run.poll() is not None, 120)
        assert json.loads(run.stdout.read())["outcome"] == "reached"
        heard.messages.clear()

        # The requests are a goal, a place and a stop.
        bridged = bridge("--accept", "goals,pose,hand,stop")
        # It is still on its way when a busy machine asks for the next thing.
        run = mission("asked", "--timeout", "600", speed=0.15)
        heard.until("range, battery", lambda: heard.messages.get("range/front") and heard.messages.get("battery_state"))
        heard.until("movement", lambda: heard.newest("odom").twist.twist.linear.x > 0.1)
        goal.pose.position.x, goal.pose.position.y = 2.5, 0.8

        heard.until("a reader of goals", lambda: goals.get_subscription_count() > 0)
        goals.publish(goal)
        heard.until("the goal", lambda: is_at(heard, 2.5, 0.8))
        stops = node.create_publisher(Bool, "stop", 10)
        # This is what Ctrl-Z and `fg` do.
        bridged.send_signal(signal.SIGSTOP)
        bridged.send_signal(signal.SIGCONT)
        heard.messages.clear()
        heard.until("poses and a map again", lambda: heard.messages.get("pose") and heard.messages.get("map"))
        heard.until("a reader of stop", lambda: stops.get_subscription_count() > 0)
        stops.publish(Bool(data=True))
        heard.until("rest", lambda: (status(firsthand)["link"] or {}).get("cause") == "stopped by an operator")
        # Nav2's client is made while the robot stands: it would be at its target meanwhile.
        if BasicNavigator is not None:
            navigator = BasicNavigator()
            heard.until("the action", navigator.nav_to_pose_client.server_is_ready)
        stops.publish(Bool(data=False))
        heard.until("movement again", lambda: not status(firsthand)["link"]["stopped"])

        # Nav2's client: a goal is canceled, two are refused with reasons, one is reached.
        if BasicNavigator is None:
            run.terminate()
            heard.until("the end of the mission", lambda: run.poll() is not None, 60)
        else:
            def go(x, y, frame="map"):
                goal.header.frame_id, goal.pose.position.x, goal.pose.position.y = frame, x, y
                assert navigator.goToPose(goal)

            def result():
                heard.until("the end of the goal", navigator.isTaskComplete)
                return navigator.getResult(), *navigator.getTaskError()

            go(3.0, -0.8)
            heard.until("its path", lambda: is_at(heard, 3.0, -0.8))
            heard.until("feedback", lambda: navigator.isTaskComplete() or navigator.getFeedback())
            assert navigator.getFeedback().distance_remaining > 0
            navigator.cancelTask()
            assert result() == (TaskResult.CANCELED, 0, "")
            assert (status(firsthand)["link"] or {}).get("cause") == "stopped by an operator"
            canceled = navigator.goal_handle
            for x, frame, code, words in [(90.0, "map", 204, "outside the perimeter"), (1.0, "odom", 9002, 'give it in "map"')]:
                go(x, 0.0, frame)
                ended, was, text = result()
                assert (ended, was) == (TaskResult.FAILED, code) and words in text, text
            of = lambda message: [goal.status for goal in message.status_list]
            heard.until("their states", lambda: of(heard.newest("navigate_to_pose/_action/status")) == [5, 6, 6])
            told = {(log.name, log.level[0] if isinstance(log.level, bytes) else log.level) for log in heard.messages["/rosout"]}
            assert told >= {("supervisor", 20), ("failsafe", 40)}, told
            # The client of a goal that ends while the bridge is frozen has its result afterwards.
            go(2.6, 0.6)
            heard.until("its path", lambda: is_at(heard, 2.6, 0.6))
            bridged.send_signal(signal.SIGSTOP)
            subprocess.run([firsthand, "goto", "--robot", ROBOT, "3", "-0.5"], check=True, capture_output=True)
            bridged.send_signal(signal.SIGCONT)
            assert result()[0] == TaskResult.FAILED
            # The client of a goal that ends while there is no bridge has its result from the next one.
            go(3.0, 0.5)
            heard.until("its path", lambda: is_at(heard, 3.0, 0.5))
            bridged.send_signal(signal.SIGKILL)
            heard.until("the end of the mission", lambda: run.poll() is not None, 120)
            assert json.loads(run.stdout.read())["outcome"] == "reached" and not navigator.isTaskComplete()
            bridged = bridge("--accept", "goals,pose,hand,stop")
            assert result() == (TaskResult.SUCCEEDED, 0, "")

        # A robot that stands and is said to be elsewhere believes that.
        run = mission("placed")
        heard.messages.clear()
        heard.until("movement", lambda: heard.messages.get("odom") and heard.newest("odom").twist.twist.linear.x > 0.1)
        stops.publish(Bool(data=True))
        heard.until("rest", lambda: (status(firsthand)["link"] or {}).get("cause") == "stopped by an operator" and status(firsthand)["link"]["at_rest"])
        places = node.create_publisher(PoseWithCovarianceStamped, "initialpose", 10)
        heard.until("a reader of places", lambda: places.get_subscription_count() > 0)
        place = PoseWithCovarianceStamped()
        place.header.frame_id, place.pose.pose.position.y, place.pose.pose.orientation.w = "map", -2.0, 1.0
        # This is how RViz sends it.
        place.pose.covariance[0] = place.pose.covariance[7] = 0.25
        place.pose.covariance[35] = 0.0685
        places.publish(place)
        heard.until("the place", lambda: heard.newest("pose").pose.pose.position.y < -1.5)
        run.terminate()
        heard.until("the end of the mission", lambda: run.poll() is not None, 60)

        # A hand drives a robot that stays, and it stands when the hand has gone.
        run = mission("by-hand", "--stay", "--set", "target=[0.4,0]")
        heard.messages.clear()
        here = lambda: heard.newest("pose").pose.pose.position.x if heard.messages.get("pose") else 0.0
        heard.until("its target", lambda: here() > 0.2 and status(firsthand)["link"]["at_rest"])
        hands = node.create_publisher(Twist, "teleop", 10)
        heard.until("a reader of hands", lambda: hands.get_subscription_count() > 0)
        push, at = Twist(), time.monotonic()
        push.linear.x = 0.3

        def pushed():
            nonlocal at
            if time.monotonic() - at > 0.05:
                at = time.monotonic()
                hands.publish(push)
            return here() > 0.9

        heard.until("the way of the hand", pushed)
        heard.until("rest", lambda: status(firsthand)["link"]["at_rest"])
        run.terminate()
        heard.until("the end of the mission", lambda: run.poll() is not None, 60)

        # Another node has the robot's odometry, and time is the mission's.
        bridged.terminate()
        heard.until("the end of the bridge", lambda: bridged.poll() is not None)
        again = bridge("--frames", "map", "--clock", "--accept", "goals")
        heard.messages.clear()
        run = mission("beside", "--stay", "--set", "target=[0.4,0]")
        others = DataWriter(heard.participant, Topic(heard.participant, "rt/tf", TFMessage), cyclone_qos())
        place = TransformStamped(Header(frame_id="odom"), "base_link", Plane(x=7.0, y=-4.0, k=math.sin(-0.25), w=math.cos(-0.25)))

        def is_whole():
            others.write(TFMessage([place]))
            own = [message for message in heard.messages.get("tf", []) if message.transforms[0].child_frame_id == "odom"]
            assert all(len(message.transforms) == 1 for message in own)
            if not own or not heard.messages.get("pose"):
                return False
            origin, at = own[-1].transforms[0].transform, heard.newest("pose").pose.pose.position
            angle = turned(origin)
            x = origin.x + math.cos(angle) * 7.0 - math.sin(angle) * -4.0
            y = origin.y + math.sin(angle) * 7.0 + math.cos(angle) * -4.0
            return math.hypot(at.x - x, at.y - y) < 0.05

        heard.until("the frame of the map that makes up the pose", is_whole)
        ticks = lambda: [(message.clock.sec, message.clock.nanosec) for message in heard.messages.get("/clock", [])]
        stamp = lambda: heard.newest("pose").header.stamp
        heard.until("stamps of the clock", lambda: (stamp().sec, stamp().nanosec) in ticks())
        assert ticks() == sorted(ticks()) and ticks()[-1] < (60, 0), ticks()
        # Goals of two bridges before are remembered.
        if BasicNavigator is not None:
            asked = canceled.get_result_async()
            heard.until("the answer", lambda: rclpy.spin_once(navigator, timeout_sec=0.01) or asked.done(), 5)
            assert asked.result().status == 5
        print("every topic of the bridge was decoded, and what it lets in was done")
    finally:
        # A mission that is asked to end leaves no shared memory; nodes of rclpy may hang when they are asked.
        for process in processes:
            process.terminate() if process.args[0] == firsthand else process.kill()
        for process in processes:
            process.wait()


def echo():
    """Publishes poses of its own, for a latency to compare with."""
    rclpy.init()
    node = rclpy.create_node("echo")
    poses = node.create_publisher(PoseWithCovarianceStamped, "echo", 10)

    def publish():
        message = PoseWithCovarianceStamped()
        message.header.stamp = node.get_clock().now().to_msg()
        poses.publish(message)

    node.create_timer(0.1, publish)
    rclpy.spin(node)


def latency(count=100):
    """Hears poses of the bridge and of `echo`, and says how old they are."""
    rclpy.init()
    node, late = rclpy.create_node("latency"), {"pose": [], "echo": []}

    def came(name, message):
        stamp = message.header.stamp
        late[name].append(1e3 * (time.time() - stamp.sec - stamp.nanosec * 1e-9))

    for name in late:
        node.create_subscription(PoseWithCovarianceStamped, name, lambda message, name=name: came(name, message), 10)
    while min(map(len, late.values())) < count:
        rclpy.spin_once(node)
    for name, writer in [("pose", "the bridge"), ("echo", "rclpy")]:
        ms = sorted(late[name])
        print(f"a pose of {writer} is {ms[len(ms) // 2]:.2f} ms old in rclpy, at 99 % {ms[len(ms) * 99 // 100]:.2f} ms, of {len(ms)}", flush=True)


if __name__ == "__main__":
    {"--echo": echo, "--latency": latency}.get(sys.argv[1], lambda: main(sys.argv[1]))()
