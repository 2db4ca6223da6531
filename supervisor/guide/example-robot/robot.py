"""A robot of your own for firsthand: Python and its standard library, no code of firsthand.

    python3 robot.py 5600 &             # what it really does goes to standard output
    firsthand run robot.toml

`robot.py 5600 0.6 0.3` is heavier and later: its wheels gain and lose 0.6 m/s in a second, 0.3 s after they were told.

It simulates two wheels, a round body and three sonars in a small world. Yours replaces `Body` by what it is
made of; `serve` stays as it is. The words are in the guide, "Connect a JSON robot".
"""

import collections
import json
import math
import socket
import sys
import time

RADIUS, WHEEL, TRACK, REACH = 0.2, 0.08, 0.30, 2.5
SONARS = {"front": 0.0, "left": math.radians(35), "right": math.radians(-35)}
DRUMS = [(1.6, 0.15, 0.3), (2.9, -0.9, 0.3), (2.7, 1.0, 0.25)]  # x, y, radius, metres


class Body:
    """Wheels that turn as told, late and as fast as they accelerate, and what is around them."""

    def __init__(self, acceleration=20.0, delay=0.0):
        self.most, self.delay = acceleration / WHEEL, delay  # rad/s^2, s
        self.speeds = [0.0, 0.0]  # rad/s
        self.acting = [0.0, 0.0]
        self.waiting = collections.deque()  # when a command acts, and the command
        self.x = self.y = self.heading = 0.0
        self.turned = [0.0, 0.0]  # radians
        self.told = [0.0, 0.0]  # rad/s
        self.until = 0.0
        self.braked = True
        self.touches = 0

    def move(self, now, dt):
        if self.braked or now >= self.until:
            self.told = [0.0, 0.0]
        self.waiting.append((now + self.delay, self.told))
        while self.waiting and self.waiting[0][0] <= now:
            self.acting = self.waiting.popleft()[1]
        change = self.most * dt
        pairs = zip(self.speeds, self.acting)
        self.speeds = [speed + max(-change, min(change, told - speed)) for speed, told in pairs]
        left, right = self.speeds
        self.turned[0] += left * dt
        self.turned[1] += right * dt
        self.heading += (right - left) * WHEEL / TRACK * dt
        ahead = (left + right) / 2 * WHEEL * dt
        x, y = self.x + ahead * math.cos(self.heading), self.y + ahead * math.sin(self.heading)
        if any(math.hypot(x - a, y - b) < r + RADIUS for a, b, r in DRUMS):
            self.touches += 1
        else:
            self.x, self.y = x, y

    def range_of(self, bearing):
        """The nearest drum within 12 degrees of the sonar's axis, metres from the rim; None for none."""
        nearest = REACH
        for step in range(-6, 7):
            angle = self.heading + bearing + math.radians(2 * step)
            dx, dy = math.cos(angle), math.sin(angle)
            for a, b, r in DRUMS:
                along = (a - self.x) * dx + (b - self.y) * dy
                aside = (a - self.x) * dy - (b - self.y) * dx
                if along > 0 and abs(aside) < r:
                    nearest = min(nearest, along - math.sqrt(r * r - aside * aside) - RADIUS)
        return max(nearest, 0.0) if nearest < REACH else None


def serve(body, port):
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind(("127.0.0.1", port))
    link.settimeout(0.005)
    print(json.dumps({"port": link.getsockname()[1]}), flush=True)
    host, heard, period, said = None, 0, 0.1, 0.0
    before = time.monotonic()

    def report(**words):
        if host:
            link.sendto((json.dumps({"heard": heard, **words}) + "\n").encode(), host)

    while True:
        try:
            data, host = link.recvfrom(65536)
        except TimeoutError:
            data = b""
        now = time.monotonic()
        for line in data.splitlines():
            (word, value), = json.loads(line).items()
            heard += 1
            if word == "drive":
                body.told, body.until = value["wheels"], now + value["for_s"]
            elif word == "hello":
                body.braked, period = False, 1 / value["rate_hz"]
            elif word == "brake":
                body.braked = True
            report()
        while before + 0.005 <= now:
            before += 0.005
            body.move(before, 0.005)
        if now >= said + period:
            said = now
            ranges = {name: body.range_of(bearing) for name, bearing in SONARS.items()}
            report(wheels=body.turned, speeds=body.speeds, ranges=ranges, battery_v=12.4)
            truth = {"x": body.x, "y": body.y, "told": body.told, "touches": body.touches}
            print(json.dumps(truth), flush=True)


if __name__ == "__main__":
    serve(Body(*map(float, sys.argv[2:])), int(sys.argv[1]))
