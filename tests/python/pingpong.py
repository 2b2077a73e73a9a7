"""pingpong.py DAEMON PID: a call that blocks from Python, beside a ping-pong of the same bytes between two Python processes over a plain socket.
Prints microseconds of processor for both sides together, which on one processor is how long it takes, and the time that passed; the least
of some rounds. PID: of the daemon, whose time is counted."""
import os
import socket
import sys
import time

import sorma

CALLS, ROUNDS = 2000, 10


def ran(pid):
    with open(f"/proc/{pid}/schedstat") as file:
        return int(file.read().split()[0]) / 1000


def measured(server, once):
    best = [1e9, 1e9]
    for _ in range(ROUNDS):
        cpu, began = ran("self") + ran(server), time.perf_counter()
        for _ in range(CALLS):
            once()
        best = [min(best[0], (ran("self") + ran(server) - cpu) / CALLS), min(best[1], (time.perf_counter() - began) * 1e6 / CALLS)]
    return best


here, there = socket.socketpair()
child = os.fork()
if child == 0:
    here.close()
    while there.recv(65536):
        there.send(bytes(72))
    os._exit(0)
there.close()


def raw():
    here.send(bytes(88))
    here.recv(65536)


with sorma.connect(sys.argv[1]) as daemon:
    call = daemon["nop"].exec
    call()
    rows = [measured(child, raw), measured(sys.argv[2], call)]
for name, (cpu, wall) in zip(("raw", "call"), rows):
    print(f"{name} cpu_us {cpu:.1f} wall_us {wall:.1f}")
print(f"ratio {rows[1][0] / rows[0][0]:.2f}")
