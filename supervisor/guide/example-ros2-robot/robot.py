"""A robot for firsthand that speaks ROS 2, with rclpy and no code of firsthand.

    python3 robot.py &                  # what it really does goes to standard output
    firsthand run robot.toml

It is like a TurtleBot 3, or with `--turtlebot4` like a TurtleBot 4: it publishes /odom at 20 Hz, /scan at 10 Hz with 360 beams, /imu at
100 Hz and /battery_state, obeys /cmd_vel, and stands after a quarter of a second without it. Its world is a few drums, other ones with
`--seed N`. `--stamped` takes TwistStamped. By its odometry it turns `--turns S` times as far as it does. Its time and its stamps go `--rate
R` times as fast as the clock on the wall, as those of a simulator may. After SIGUSR1 its odometry begins anew.
"""

import json
import math
import random
import signal
import sys
import time

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import BatteryState, Imu, LaserScan

TURTLEBOT4 = "--turtlebot4" in sys.argv
RADIUS, LEAST, REACH, BEAMS = 0.175 if TURTLEBOT4 else 0.105, 0.16, 8.0, 360
# How far its laser is from its centre, metres ahead, and by how much it is turned.
LASER = (-0.04, math.pi / 2) if TURTLEBOT4 else (-0.032, 0.0)
DRUMS = [(1.0, 0.1, 0.2), (2.0, -0.6, 0.25), (1.9, 0.7, 0.2), (-1.5, 1.0, 0.3)]  # x, y, radius, metres
TIMEOUT, STEP = 0.25, 0.01


def option(name, default):
    return float(sys.argv[sys.argv.index(name) + 1]) if name in sys.argv else default


TURNS, RATE = option("--turns", 1.0), option("--rate", 1.0)


def drums(seed):
    """Random drums; between any two, and around the start and the target, the robot has room."""
    chance, placed = random.Random(seed), [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)]
    for _ in range(100):
        x, y, r = chance.uniform(0.5, 2.6), chance.uniform(-1.3, 1.3), chance.uniform(0.1, 0.3)
        if all(math.hypot(x - a, y - b) - r - s > 0.6 for a, b, s in placed):
            placed.append((x, y, r))
    return placed[2:]


class Robot(Node):
    def __init__(self, stamped):
        super().__init__("drums_robot")
        self.x = self.y = self.heading = self.way = 0.0
        self.odometry = (0.0, 0.0, 0.0)
        self.told, self.told_at, self.touches, self.orders = (0.0, 0.0), 0.0, 0, 0
        self.before = self.now()
        if stamped:
            self.create_subscription(TwistStamped, "cmd_vel", lambda message: self.obey(message.twist), 10)
        else:
            self.create_subscription(Twist, "cmd_vel", self.obey, 10)
        self.odom = self.create_publisher(Odometry, "odom", 10)
        self.scan = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        self.battery = self.create_publisher(BatteryState, "battery_state", 10)
        self.imu = self.create_publisher(Imu, "imu", qos_profile_sensor_data)
        self.create_timer(STEP / RATE, self.publish_imu)
        self.create_timer(0.05 / RATE, self.publish_odom)
        self.create_timer(0.1 / RATE, self.publish_scan)
        self.create_timer(1.0, lambda: self.battery.publish(BatteryState(voltage=12.1)))

    def now(self):
        return time.monotonic() * RATE

    def stamp(self):
        return Time(nanoseconds=int(self.now() * 1e9)).to_msg()

    def obey(self, twist):
        self.told, self.told_at = (twist.linear.x, twist.angular.z), self.now()
        self.orders += 1

    def move(self):
        now = self.now()
        if now - self.told_at > TIMEOUT:
            self.told = (0.0, 0.0)
        while self.before + STEP <= now:
            self.before += STEP
            ahead, turn = self.told[0] * STEP, self.told[1] * STEP
            heading = self.heading + turn / 2
            x, y = self.x + ahead * math.cos(heading), self.y + ahead * math.sin(heading)
            self.heading += turn
            if any(math.hypot(x - a, y - b) < r + RADIUS for a, b, r in DRUMS):
                self.touches += 1
            else:
                self.x, self.y, self.way = x, y, self.way + abs(ahead)
                a, b, heading = self.odometry
                middle = heading + TURNS * turn / 2
                self.odometry = (a + ahead * math.cos(middle), b + ahead * math.sin(middle), heading + TURNS * turn)

    def restart_odom(self, *_):
        self.odometry = (0.0, 0.0, 0.0)

    def publish_odom(self):
        self.move()  # The stamp is that of the pose.
        (x, y, heading), message = self.odometry, Odometry()
        message.header.stamp = self.stamp()
        message.header.frame_id, message.child_frame_id = "odom", "base_footprint"
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = math.sin(heading / 2), math.cos(heading / 2)
        twist.linear.x, twist.angular.z = self.told
        self.odom.publish(message)
        truth = {"x": self.x, "y": self.y, "way": self.way, "told": self.told}
        print(json.dumps({**truth, "touches": self.touches, "orders": self.orders}), flush=True)

    def publish_imu(self):
        self.move()
        message = Imu()
        message.header.stamp = self.stamp()
        message.header.frame_id = "imu_link"
        message.orientation_covariance[0] = -1.0  # It has none.
        message.angular_velocity.z = random.gauss(self.told[1], 0.005)
        message.angular_velocity_covariance[8] = 0.005**2
        self.imu.publish(message)

    def range_at(self, angle):
        """The nearest drum along a beam, metres; infinite for none."""
        ahead, turned = LASER
        x, y = self.x + ahead * math.cos(self.heading), self.y + ahead * math.sin(self.heading)
        dx, dy = math.cos(self.heading + turned + angle), math.sin(self.heading + turned + angle)
        nearest = math.inf
        for a, b, r in DRUMS:
            along = (a - x) * dx + (b - y) * dy
            aside = (a - x) * dy - (b - y) * dx
            if along > 0 and abs(aside) < r:
                nearest = min(nearest, along - math.sqrt(r * r - aside * aside))
        return random.gauss(nearest, 0.005) if nearest < REACH else math.inf

    def publish_scan(self):
        message = LaserScan(range_min=LEAST, range_max=REACH, scan_time=0.1)
        message.header.stamp = self.stamp()
        message.header.frame_id = "base_scan"
        # As the driver of the LDS does, the first beam looks ahead.
        message.angle_max, message.angle_increment = 2 * math.pi, 2 * math.pi / BEAMS
        message.ranges = [self.range_at(beam * message.angle_increment) for beam in range(BEAMS)]
        message.intensities = [0.0] * BEAMS
        self.scan.publish(message)


if __name__ == "__main__":
    if "--seed" in sys.argv:
        DRUMS = drums(int(sys.argv[sys.argv.index("--seed") + 1]))
    rclpy.init()
    robot = Robot("--stamped" in sys.argv)
    signal.signal(signal.SIGUSR1, robot.restart_odom)
    rclpy.spin(robot)
