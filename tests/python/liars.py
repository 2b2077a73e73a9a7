"""liars.py ?COUNT? ?SEED?: servers that lie to sorma.py; then COUNT replies that are not what they were. Each has to become an error, or a
reply, soon and without much memory. Prints what came."""
import random
import resource
import socket
import struct
import sys
import threading

import sorma

U = struct.Struct(">I").pack


def text(s):
    b = s if isinstance(s, bytes) else s.encode()
    return U(len(b)) + b + bytes(-len(b) & 3)


def record(body):
    return U(0x80000000 | len(body)) + body


def head(xid):
    return struct.pack(">6I", xid, 1, 0, 0, 0, 0)


def welcome(xid, end=b"", known=0):
    return record(head(xid) + struct.pack(">Q", 4711) + text("liar") + text("nobody") + text("nowhere") + struct.pack(">q", 0) + text("lies") +
                  struct.pack(">IIqI", 1 << 20, 64, 0, known) + end)


def message(words=b"\0\0\0\0", string=b"\0\0\0\0", floats=b"\0\0\0\0"):
    return string + floats + bytes(8) + words


def reply(xid, body=message(), trail=bytes(8), code=0):
    return record(head(xid) + struct.pack(">i3I", code, 0, 0, 0) + body + trail)


def entry(string, symbol=b"LIAR SAYS"):
    return U(2) + text(symbol) + U(0) + text(string) + text("") * 3 + struct.pack(">iq", 0, 0) + text("")


class Liar:
    """Greets clients with greet(xid), and answers their calls with answer(xid). Ends after a call when once, or when there is no answer."""

    def __init__(self, answer, greet=welcome, once=False):
        self.once = False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listener.getsockname()[1]
        self.answer, self.greet = answer, greet
        threading.Thread(target=self.accept, args=(once,), daemon=True).start()

    def accept(self, once):
        try:
            while True:
                threading.Thread(target=self.serve, args=(self.listener.accept()[0], once), daemon=True).start()
        except OSError:
            pass

    def serve(self, sock, once):
        with sock, sock.makefile("rb") as file:
            try:
                while True:
                    data = file.read(struct.unpack(">I", file.read(4))[0] & 0x7fffffff)
                    xid, _, _, _, _, procedure = struct.unpack_from(">6I", data)
                    self.once = once and procedure == sorma.CALL
                    out = (self.greet if procedure == sorma.HELLO else self.answer)(xid) if procedure in (1, 2, 5) else b"-"
                    sock.sendall(out or b"")
                    if not out or self.once:
                        self.listener.close()
                        return sock.shutdown(socket.SHUT_RDWR)
            except (OSError, struct.error):
                pass


def tried(what, answer, greet=welcome, once=False, timeout=60, **settings):
    liar = Liar(answer, greet, once)
    try:
        with sorma.connect(liar.address, timeout=timeout, **settings) as daemon:
            said = daemon["echo"].exec()
    except sorma.Error as e:
        said = f"{' '.join(e.code[1:3])}, {e.verdict}"
    liar.listener.close()
    print(f"{what}: {said}")


tried("a text longer than its record", lambda xid: reply(xid, message(string=U(1 << 30))))
tried("more numbers than there are bytes", lambda xid: reply(xid, message(floats=U(1 << 29))))
tried("more words than there are bytes", lambda xid: reply(xid, message(words=U(0xffffffff))))
tried("more entries than there are bytes", lambda xid: reply(xid, trail=U(0) + U(1 << 31)))
tried("a record that ends early", lambda xid: record(head(xid)))
tried("a text that is not UTF-8", lambda xid: reply(xid, message(string=text(b"\xff\xfe"))))
tried("a trail that is not UTF-8", lambda xid: reply(xid, trail=U(0) + U(1) + entry(b"\xff"), code=-1))
tried("a failure without a reason", lambda xid: reply(xid, code=-1))
tried("a trail of 20000", lambda xid: reply(xid, trail=U(0) + U(20000) + entry("a lie") * 20000, code=-1))
tried("a refusal of ONC RPC", lambda xid: record(struct.pack(">6I", xid, 1, 0, 0, 0, 4)))
tried("a record of 2 GB", lambda xid: U(0xffffffff) + bytes(1000))
tried("a record of half a GB that never comes", lambda xid: U(0x80000000 | 1 << 29) + bytes(1000), timeout=1, maxmessage=1 << 30)
tried("several pieces", lambda xid: U(100) + bytes(100))
tried("a reply to nobody", lambda xid: reply(9 << 16 | 77))
tried("HTTP", lambda xid: b"HTTP/1.1 400 Bad Request\r\n\r\n")
tried("half a reply, and its end", lambda xid: reply(xid)[:-9], once=True)
tried("half a reply, and silence", lambda xid: reply(xid)[:-9], timeout=1)
tried("an end instead of a reply", lambda xid: None)
tried("HTTP as a welcome", reply, lambda xid: b"HTTP/1.1 400 Bad Request\r\n\r\n")
tried("half a welcome, and its end", reply, lambda xid: None)
tried("a welcome that ends early", reply, lambda xid: record(head(xid) + bytes(8)))
tried("a GOODBYE as a welcome", reply, lambda xid: record(struct.pack(">10I", 0, 0, 2, sorma.PROGRAM, 1, sorma.GOODBYE, 0, 0, 0, 0) + text("no")))
tried("an older wire, whose welcome has no clock", reply)
tried("this wire", reply, lambda xid: welcome(xid, text("") + text("")))
for name, string in (("a surrogate", "\ud800"), ("bytes that are no text", b"\xff")):
    try:
        sorma._message(text=string)
    except sorma.Error as e:
        print(f"{name}: {' '.join(e.code[1:3])}, {e.verdict}")

chance = random.Random(int((sys.argv[2:] or ["4711"])[0]))


def damaged(xid):
    whole = bytearray(reply(xid, message(words=U(2) + text("a") + text("b"), string=text("hello")), U(0) + U(1) + entry("a lie"), code=chance.choice((0, -1))))
    for _ in range(chance.randint(1, 4)):
        whole[chance.randrange(8, len(whole))] = chance.choice((0, 1, 0x7f, 0x80, 0xff, chance.randrange(256)))
    return bytes(whole)


before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
liar, counts, count = Liar(damaged), {"replies": 0, "errors": 0}, int((sys.argv[1:] or ["300"])[0])
daemon = sorma.connect(liar.address, timeout=5)
for _ in range(count):
    try:
        daemon["echo"].exec()
        counts["replies"] += 1
    except sorma.Error:
        counts["errors"] += 1
print("damaged", sum(counts.values()) == count, min(counts.values()) > 0, "less than 50 MB more", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50000)
