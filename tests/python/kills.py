"""kills.py TCLSH KILLER SCRIPT LEDGER NAME KILLS ?SEED?: 4 clients call a daemon that is killed again and again; each call's verdict is judged
by a ledger that outlives the daemons. Two of the clients wait for each call, two have eight futures at a time. Prints what it counted.

By hand, in the build folder, with 200 kills:   ./env tclsh8.6 ../tests/python/kills.tcl 200
"""
import collections
import os
import subprocess
import sys
import threading
import time

import sorma

tclsh, killer, script, ledger, name, kills = sys.argv[1:7]
process = subprocess.Popen([tclsh, killer, name, script, kills, (sys.argv[7:] or ["4711"])[0]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
over = threading.Event()
results = [{} for _ in range(4)]           # of each client: number -> verdict, or "answered"


def patient():
    while True:
        try:
            return sorma.connect(name)
        except sorma.Error:
            time.sleep(0.01)


def judge(into, number, ask):
    try:
        into[number] = "answered" if ask()["ints"] == [number] else "answered wrongly"
    except sorma.Error as e:
        into[number] = e.verdict if e.code[1:3] == ["COMM", "LOST"] or e.verdict == sorma.NEVER else f"{e.code} {e.text}"


def blocking(client):
    ledger_object, into, number = patient()["ledger"], results[client], client
    while not over.is_set():
        number += 4
        judge(into, number, lambda: ledger_object.exec(ints=[number], timeout=60))


def futures(client):
    ledger_object, into, number, waiting = patient()["ledger"], results[client], client, collections.deque()
    while not over.is_set() or waiting:
        if not over.is_set() and len(waiting) < 8:
            number += 4
            waiting.append((number, ledger_object.exec_async(ints=[number], timeout=60)))
        else:
            judge(into, waiting[0][0], waiting[0][1].result)
            waiting.popleft()


threads = [threading.Thread(target=blocking if client < 2 else futures, args=(client,)) for client in range(4)]
for thread in threads:
    thread.start()
line = process.stdout.readline().strip()
over.set()
for thread in threads:
    thread.join()
process.communicate("end\n")
with open(ledger) as file:
    executed = collections.Counter(map(int, file.read().split()))
told = {number: verdict for into in results for number, verdict in into.items()}
counts = collections.Counter(told.values())
print(line)
print("doubled", sum(n > 1 for n in executed.values()))
print("answered but not executed", sum(v == "answered" and not executed[n] for n, v in told.items()))
print("said never to have run, and executed", sum(v == sorma.NEVER and executed[n] > 0 for n, v in told.items()))
print("other results", {v: n for v, n in counts.items() if v not in ("answered", sorma.NEVER, sorma.UNKNOWN)})
print("each client was answered", all("answered" in into.values() for into in results))
print("lost where it is unknown, but executed", sum(v == sorma.UNKNOWN and executed[n] > 0 for n, v in told.items()), "of", counts[sorma.UNKNOWN],
      "; never ran", counts[sorma.NEVER], "; answered", counts["answered"], file=sys.stderr)
