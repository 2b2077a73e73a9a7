"""day.py DAEMON PID: the newcomer's day, in Python alone. The daemon is killed in it. Prints what happened."""
import concurrent.futures
import os
import signal
import sys
import threading
import time

import sorma

daemon = sorma.connect(sys.argv[1], timeout=60)
echo, foo, door = daemon["echo"], daemon["foo.a"], daemon["door"]

print("call", echo.exec(text="h\u00e4llo\n", floats=[1.5, -2], ints=[-(1 << 63), 7], any=b"\0\xff"))
print("empty", daemon["nop"].exec())

foo["-tempo"] = "presto"
foo.ctrl("-where", "a \"quoted\" {place}")
print("options", foo["-tempo"], foo["-where"])
try:
    foo["-tempo"] = "backwards"
except sorma.Error as e:
    print("error", e.code, e.verdict, e.trail[0]["so"], e.trail[0]["severity"], e.text.startswith("foo.a: -tempo \"backwards\" is not one of"))

futures = [echo.exec_async(ints=[i]) for i in range(3000)]       # more than there are slots
print("futures", sum(f.result()["ints"][0] for f in concurrent.futures.as_completed(futures)))

with daemon["ticks.a"].events("tick*", keep=10) as events:
    daemon["ticks.a"].exec(ints=[3])
    for event in events:
        print("event", event.name, event.number, event.lost, event.content["ints"])
        if event.number == 3:
            break
heard, done = [], threading.Event()
subscription = daemon["ticks.a"].events("tick*", callback=lambda event: (heard.append(event.number), event.number == 5 and done.set()))
daemon["ticks.a"].exec(ints=[5])
done.wait(60)
print("callback", heard)
subscription.close()

with daemon["ticks.a"].events("tick*", keep=2) as events:
    daemon["ticks.a"].exec(ints=[100])
    numbers, lost = [], 0
    while not numbers or numbers[-1] < 100:
        event = events.next(60)
        numbers.append(event.number)
        lost += event.lost
    print("losses", lost + len(numbers))



def until(condition):
    """Tests wait for facts."""
    end = time.monotonic() + 60
    while not condition():
        if time.monotonic() > end:
            sys.exit("waited in vain")
        time.sleep(0.005)


def count(what):
    return int(door.dbx(what)["text"])


waiting = door.exec_async(text="mine")
until(lambda: count("-waiting") == 1)
door.ctrl("-open")
print("later", waiting.result(60)["text"])
waiting = door.exec_async()
until(lambda: count("-waiting") == 1)
waiting.cancel()
until(lambda: count("-cancelled") == 1)
print("cancelled", waiting.cancelled(), count("-waiting"))
try:
    door.exec(timeout=0.01)
except sorma.Error as e:
    print("deadline", e.code[:3], e.verdict in ("nobody knows", "never ran"))

until(lambda: count("-waiting") == 0)           # the daemon has its own clock
before = count("-cancelled")


def interrupt():
    other = sorma.connect(sys.argv[1])
    until(lambda: other["door"].dbx("-waiting")["text"] == "1")
    os.kill(os.getpid(), signal.SIGINT)


threading.Thread(target=interrupt).start()
try:
    door.exec(timeout=0)
except KeyboardInterrupt:
    until(lambda: count("-cancelled") > before)
    print("interrupt")
print("afterwards", echo.exec(text="still here")["text"])

waiting = [door.exec_async(timeout=0) for _ in range(3)]
until(lambda: count("-waiting") == 3)
os.kill(int(sys.argv[2]), signal.SIGKILL)
for future in waiting:
    e = future.exception(60)
    print("killed", e.code[:3], e.verdict)
try:
    echo.exec(timeout=0.3)
except sorma.Error as e:
    print("gone", e.code[:3], e.verdict)
