#!/usr/bin/env python3
"""The network between the two machines of `.ci/remote`: a cable between their network namespaces that delays, doubles, reorders and loses
packets, or none at all. Kernels without netem have it too.

    remote-link.py PID ADDRESS PID ADDRESS CONTROL

Each PID is in a namespace, which gets the ADDRESS. CONTROL is a file with four numbers: the delay and its spread, milliseconds, and the
shares of packets that are doubled and lost. A packet with less of the spread overtakes others."""
import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import time

TUNSETIFF, TUN_WITHOUT_HEADER, CLONE_NEWNET = 0x400454CA, 0x1001, 0x40000000
libc = ctypes.CDLL(None, use_errno=True)


def end(pid, address):
    namespace = os.open(f"/proc/{pid}/ns/net", os.O_RDONLY)
    if libc.setns(namespace, CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "setns")
    tun = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(tun, TUNSETIFF, struct.pack("16sH", b"cable", TUN_WITHOUT_HEADER))
    subprocess.check_call(["ip", "address", "add", f"{address}/24", "dev", "cable"])
    subprocess.check_call(["ip", "link", "set", "cable", "up"])
    return tun


ends = [end(*sys.argv[1:3]), end(*sys.argv[3:5])]
others = dict(zip(ends, reversed(ends)))
print("up", flush=True)
waiting, number = [], 0
while True:
    now = time.monotonic()
    while waiting and waiting[0][0] <= now:
        _, _, to, packet = heapq.heappop(waiting)
        os.write(to, packet)
    patience = waiting[0][0] - now if waiting else 0.2
    delay_ms, spread_ms, doubled, lost = map(float, open(sys.argv[5]).read().split())
    for ready in select.select(ends, [], [], patience)[0]:
        packet = os.read(ready, 65536)
        for _ in range(2 if random.random() < doubled else 1):
            if random.random() >= lost:
                number += 1
                due = time.monotonic() + (delay_ms + random.random() * spread_ms) / 1000
                heapq.heappush(waiting, (due, number, others[ready], packet))
