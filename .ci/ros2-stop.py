"""How long a stop takes that a new node publishes once, as `ros2 topic pub --once` does: it looks for a reader every 0.1 s, and ends 0.1 s
after it published.

    python3 .ci/ros2-stop.py EXECUTABLE [NODES]     NODES of Fast DDS and as many of Cyclone DDS, 10 each if not said
"""

import json
import os
import subprocess
import sys
import tempfile
import time

os.environ.setdefault("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))
os.environ.update(ROS_LOCALHOST_ONLY="1", RMW_IMPLEMENTATION="rmw_fastrtps_cpp")
LOOPBACK = '<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces>'
os.environ["CYCLONEDDS_URI"] = f"<CycloneDDS><Domain><General>{LOOPBACK}</General></Domain></CycloneDDS>"
LONGEST_S = 1.0
LOOKS_S = 0.1
LINGERS_S = 0.1


def publish(readers, write):
    """Print the time at which the message was written."""
    end = time.monotonic() + 20
    while not readers():
        assert time.monotonic() < end, "no reader of stop"
        time.sleep(LOOKS_S)
    write()
    print(time.monotonic(), flush=True)
    time.sleep(LINGERS_S)


def by_fast_dds():
    import rclpy
    from std_msgs.msg import Bool

    rclpy.init()
    node = rclpy.create_node("once")
    publisher = node.create_publisher(Bool, "stop", 10)
    publish(publisher.get_subscription_count, lambda: publisher.publish(Bool(data=True)))
    node.destroy_node()
    rclpy.shutdown()


def by_cyclone_dds():
    from dataclasses import dataclass

    from cyclonedds.core import Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.idl import IdlStruct
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    @dataclass
    class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
        data: bool

    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    quality = Qos(Policy.Reliability.Reliable(10**9), Policy.Durability.Volatile, Policy.History.KeepLast(10))
    writer = DataWriter(participant, Topic(participant, "rt/stop", Bool), quality)
    publish(writer.get_matched_subscriptions, lambda: writer.write(Bool(True)))


NODES = {"Fast DDS": by_fast_dds, "Cyclone DDS": by_cyclone_dds}


def measure(firsthand, count):
    robot = f"ci-stop-{os.getpid()}"

    def order(*words):
        return subprocess.run([firsthand, *words, "--robot", robot], capture_output=True, text=True)

    def link():
        said = order("status", "--json")
        return (json.loads(said.stdout)["link"] or {}) if said.returncode == 0 else {}

    def is_stopped():
        return link().get("cause") == "stopped by an operator"

    with tempfile.TemporaryDirectory() as work:
        said = open(f"{work}/said", "w")
        mission = [firsthand, "run", "open-room", "--robot", robot, "--pace", "1", "--stay", "--json", "--out", f"{work}/run"]
        run = subprocess.Popen(mission, stdout=said, stderr=said)
        bridge = subprocess.Popen([firsthand, "ros2", "--robot", robot, "--accept", "stop"], stdout=said, stderr=said)
        try:
            # A stop waits for the encoders, which a robot that starts has not reported yet.
            while not link().get("at_rest"):
                time.sleep(0.2)
            for name in NODES:
                took = []
                for _ in range(count):
                    node = subprocess.Popen([sys.executable, __file__, name], stdout=subprocess.PIPE, text=True)
                    at = float(node.stdout.readline())
                    while not is_stopped():
                        assert time.monotonic() < at + 20, f"{name}: a stop was lost after {took}"
                    took.append(round(time.monotonic() - at, 3))
                    node.wait()
                    order("resume")
                took.sort()
                print(f"{name}: {count} new nodes stopped the robot within {took[count // 2]} s in the median, {took[-1]} s at most", flush=True)
                assert took[-1] <= LONGEST_S, took
        finally:
            bridge.terminate()
            run.terminate()
            bridge.wait()
            run.wait()


if sys.argv[1] in NODES:
    NODES[sys.argv[1]]()
else:
    measure(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 10)
