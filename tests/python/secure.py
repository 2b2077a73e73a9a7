"""secure.py ADDRESS: a call by TLS, options, a long text both ways, an event, and how the daemon names the client. Prints what came, or the error's code."""
import sys
import threading
import sorma

try:
    with sorma.connect(sys.argv[1], timeout=20) as daemon:
        print("call", daemon["echo"].exec(text="hello")["text"])
        long = "0123456789abcdef" * 200000
        print("long", daemon["echo"].exec(text=long)["text"] == long)
        several = [daemon["echo"].exec_async(text=str(i) + long[:100000]) for i in range(20)]
        print("futures", all(f.result()["text"].startswith(str(i)) for i, f in enumerate(several)))
        board = daemon["blackboard.secure"]
        with board.events(callback=None) as events:
            board.exec("put", "x", text=long)
            print("event", len(events.next(timeout=20).content["text"]))
        print("who", [line.split()[0] for line in daemon["sorm"].dbx("-inventory", "connections")["text"].split("\n") if "cert" in line] != [])
except sorma.Error as e:
    print(*e.code, "|", e.verdict)
    if len(sys.argv) > 2:
        print(e.text)
