"""wireCheck.py COMMAND WORD ...: does a client keep its calls at most once? This is a daemon that loses connections and lies; doc/wire.md
has the rules. COMMAND is the client in any language. It gets the address as its last word, 127.0.0.1:PORT. It makes five calls, one
after another, EXEC of the object echo, and prints a line after each: answered, never ran, or nobody knows. Prints what was wrong, or "all is well".
"""
import socket
import struct
import subprocess
import sys

HELLO, CALL, BOOT = 1, 2, 4711
wrong = []


def must(good, what):
    if not good:
        wrong.append(what)


def number(n):
    return struct.pack(">I", n)


def text(s):
    return number(len(s)) + s.encode() + bytes(-len(s) & 3)


def send(sock, xid, body):
    body = struct.pack(">6I", xid, 1, 0, 0, 0, 0) + body
    sock.sendall(number(0x80000000 | len(body)) + body)


def reply(sock, xid, length=0):
    send(sock, xid, bytes(16) + number(length) + bytes(24))


class Client:
    """A connection of the client that is judged."""

    def __init__(self):
        self.sock = listener.accept()[0]
        self.sock.settimeout(20)

    def bytes(self, size):
        data = b""
        while len(data) < size:
            more = self.sock.recv(size - len(data))
            if not more:
                raise EOFError
            data += more
        return data

    def record(self, wanted):
        """The xid and the arguments of the next record of that procedure; other ones are passed over."""
        while True:
            data, last = b"", False
            while not last:
                head = struct.unpack(">I", self.bytes(4))[0]
                last = bool(head >> 31)
                data += self.bytes(head & 0x7fffffff)
            xid, _, _, _, _, procedure, _, size = struct.unpack_from(">8I", data)
            if procedure == wanted:
                return xid, data[32 + (size + 3 & ~3) + 8:]

    def hello(self, boot, known):
        xid, data = self.record(HELLO)
        session = struct.unpack_from(">Q", data)[0]
        send(self.sock, xid, struct.pack(">Q", boot) + text("check") + text("") + text("") + bytes(8) + text("") +
             struct.pack(">IIqI", 1 << 20, 64, 0, known))
        return session

    def call(self):
        """xid, and slot and sequence."""
        xid, data = self.record(CALL)
        return xid, struct.unpack_from(">2I", data)

    def close(self):
        self.sock.close()


listener = socket.create_server(("127.0.0.1", 0))
listener.settimeout(20)
process = subprocess.Popen(sys.argv[1:] + ["127.0.0.1:%d" % listener.getsockname()[1]], stdout=subprocess.PIPE, text=True)


def said(wanted, after):
    line = process.stdout.readline().strip()
    must(line == wanted, f'after {after} the client must say "{wanted}", and it said "{line}"')


try:
    client = Client()
    session = client.hello(BOOT, 0)
    must(session != 0, "the number of the session in HELLO is 0; it must be random")
    xid, first = client.call()
    must(first[0] < 64, f"slot {first[0]} is not one of the 64 that the welcome offers")
    reply(client.sock, xid)
    said("answered", "a reply")

    xid, second = client.call()
    must(second[0] != first[0] or second[1] == (first[1] + 1) & 0xffffffff, f"slot and sequence {second} do not follow {first}")
    client.close()
    client = Client()
    must(client.hello(BOOT, 1) == session, "HELLO on a new connection has another number")
    xid, again = client.call()
    must(again == second, f"a call whose connection broke was sent again as {again}; it was {second}")
    reply(client.sock, xid)
    said("answered", "a reply on the second connection")

    client.call()
    client.close()
    client = Client()
    client.hello(BOOT + 1, 0)
    said("nobody knows", "a new boot number")

    xid, fourth = client.call()
    reply(client.sock, xid)
    said("answered", "a reply of the new daemon")

    xid, _ = client.call()
    reply(client.sock, xid, 1 << 30)
    said("nobody knows", "a text longer than its record")
except (OSError, EOFError, struct.error) as e:
    must(False, f"the client ended or said nothing: {e!r}")
finally:
    process.kill()
    process.wait()
print("\n".join(wrong) or "all is well")
sys.exit(bool(wrong))
