"""SORMA for Python: calls to service objects in other processes, by the wire of generic/comm/sorma.x.

    import sorma
    robot = sorma.connect("robot")              # or "@/run/robot.sock", "lab:7014", "lab:0x14"
    reply = robot["carry.slow"].exec(floats=[1, 2, 3])
    print(reply["code"], reply.get("text"))
    robot["carry.slow"].ctrl("-speed", 2)       # options: also robot["carry.slow"]["-speed"] = 2
    later = robot["carry.slow"].exec_async(floats=[1, 2, 3])     # a concurrent.futures.Future
    for event in robot["carry.slow"].events("moved*", keep=100): print(event.name, event.content)

A call is executed at most once, whatever happens to the connection: doc/wire.md says how. Every failure is a sorma.Error.
This file needs Python 3.9 and its standard library, and may be copied. By TCP it speaks TLS as other clients do: with the keys of
sorma-keys, or never in clear where the dictionary says -tls yes.
"""
import array
import collections
import concurrent.futures
import contextlib
import getpass
import logging
import os
import secrets
import select
import socket
import ssl
import stat
import struct
import sys
import threading
import time
import types
import weakref

PROGRAM, PROGRAM_BASE = 0x20534f52, 0x20000000
EXEC, CTRL, DBX = 0, 1, 2
HELLO, CALL, CANCEL, HEALTH, SUBSCRIBE, UNSUBSCRIBE, CLOCK, GOODBYE, EVENT = 1, 2, 3, 4, 5, 6, 8, 16, 17
CONTROL = 0xffff                    # in an xid, in place of the slot: the record is no call
NEVER, RAN, UNKNOWN = "never ran", "ran", "nobody knows"        # verdicts
MOST_WELCOME = 1 << 20              # bytes of a daemon's first record
MOST_ENTRIES = 200                  # of a trail
FIRST_PAUSE, LAST_PAUSE, ABSENCE, OPEN_TIME, LOOK = 0.002, 0.1, 5.0, 5.0, 0.1     # [s]
DONE, FREE, UNWANTED, UNSENT, SENT = range(5)       # states of a slot; from UNSENT on somebody waits for it

_U, _UU, _SIX, _Q = struct.Struct(">I"), struct.Struct(">II"), struct.Struct(">6I"), struct.Struct(">q")
_I, _UUUU = struct.Struct(">i"), struct.Struct(">4I")
_CALL = struct.Struct(">15I")       # mark, header of the call, slot, sequence, deadline, method
_EMPTY, _EMPTY_REPLY = bytes(20), bytes(28)


class Error(Exception):
    """A failure. code: as Tcl's errorCode, a list such as ["SORMA", "OPTION", "RANGE", ...]. trail: its messages, a list of
    dicts. verdict: what became of the call, "never ran", "ran" or "nobody knows"."""

    def __init__(self, text, code, verdict=NEVER, trail=()):
        super().__init__(text)
        self.text, self.code, self.verdict = text, list(code), verdict
        self.trail = list(trail) or [{"severity": "error", "code": self.code, "text": text, "so": "", "daemon": "", "file": "", "line": 0,
                                      "time": time.time_ns() // 1000}]

    def __reduce__(self):
        return Error, (self.text, self.code, self.verdict, self.trail)


def _error(symbol, who, text, verdict=NEVER):
    return Error(f"{who}: {text}", ["SORMA", *symbol.split(), who], verdict)


# ---- bytes ----

def _text(s):
    try:
        b = s.encode() if isinstance(s, str) else bytes(s)
        b.decode()
    except UnicodeError as e:
        raise _error("REQUEST SYNTAX", repr(s)[:60], f"no text of UTF-8: {e}; bytes belong into any=") from None
    return _U.pack(len(b)) + b + bytes(-len(b) & 3)


def _word(x):
    if isinstance(x, (str, bytes)):
        return _text(x)
    if isinstance(x, bool):
        return _text(str(int(x)))
    if isinstance(x, (list, tuple, dict, set)):
        raise TypeError(f"a word is a text or a number, not {type(x).__name__}: {x!r}")
    return _text(str(x))


def _message(text="", floats=(), ints=(), any=b"", words=()):
    if not text and not words and not any and len(floats) == 0 and len(ints) == 0:
        return _EMPTY
    try:
        numbers = struct.pack(f">I{len(floats)}dI{len(ints)}q", len(floats), *floats, len(ints), *ints)
    except struct.error as e:
        raise _error("REQUEST SYNTAX", "floats or ints", str(e)) from None
    return b"".join([_text(text), numbers, _U.pack(len(any)), bytes(any), bytes(-len(any) & 3), _U.pack(len(words)), *map(_word, words)])


def _record(xid, procedure, body):
    return struct.pack(">11I", 0x80000000 | 40 + len(body), xid, 0, 2, PROGRAM, 1, procedure, 0, 0, 0, 0) + body


class _Reader:
    """Takes apart one record. What is not there, or is no text, is a struct.error or a ValueError."""

    def __init__(self, record, at=0):
        self.record, self.at = record, at

    def take(self, form):
        values = struct.unpack_from(form, self.record, self.at)
        self.at += struct.calcsize(form)
        return values[0] if len(values) == 1 else values

    def bytes(self):
        n = self.take(">I")
        begin, end = self.at, self.at + n
        self.at = end + (-n & 3)
        if self.at > len(self.record):
            raise ValueError("a length that is more than there is")
        return self.record[begin:end]

    def text(self, errors="strict"):
        return str(self.bytes(), "utf-8", errors)

    def numbers(self, kind):
        n = self.take(">I")
        if 8 * n > len(self.record) - self.at:
            raise ValueError("a length that is more than there is")
        values = array.array(kind, self.record[self.at:self.at + 8 * n])
        self.at += 8 * n
        if sys.byteorder == "little":
            values.byteswap()
        return values.tolist()

    def count(self, least):
        n = self.take(">I")
        if least * n > len(self.record) - self.at:
            raise ValueError("a length that is more than there is")
        return n

    def message(self):
        parts = {"text": self.text(), "floats": self.numbers("d"), "ints": self.numbers("q"), "any": bytes(self.bytes())}
        parts["words"] = [self.text() for _ in range(self.count(4))]
        return {key: value for key, value in parts.items() if value}

    def trail(self):
        """The first error, and the last entries up to MOST_ENTRIES."""
        dropped, n = self.take(">I"), self.count(48)
        cause, entries = None, collections.deque(maxlen=MOST_ENTRIES)
        for _ in range(n):
            entry = {"severity": ("verbose", "warning", "error")[self.take(">I")]}
            symbol = self.text("replace")
            details = [self.text("replace") for _ in range(self.count(4))]
            entry["code"] = details[1:] if symbol == "SERVICE CODE" and len(details) > 1 else ["SORMA", *symbol.split(), *details]
            for key in ("text", "so", "daemon", "file"):
                entry[key] = self.text("replace")
            entry["line"], entry["time"] = self.take(">iq")
            request = self.text("replace")
            if request:
                entry["request"] = request
            if cause is None and entry["severity"] == "error":
                cause = entry
            entries.append(entry)
        out = list(entries)
        if cause and not any(entry is cause for entry in out):
            out[0] = cause
        return out, cause or (out[-1] if out else None), dropped + n - len(out)


def _refusal(record):
    """Why a reply of ONC RPC has no result; None when it has one."""
    _, kind, denied, a, b, status = _SIX.unpack_from(record)
    if kind != 1:
        return "it is no reply"
    if denied:
        return "its RPC version or credentials are refused"
    if b:
        return "it has a verifier, which was not asked for"
    names = ("", "the program is not there", "the program has another version", "the procedure is not there", "the arguments could not be read")
    return None if status == 0 else names[status] if status < len(names) else f"status {status}"


def _verdict(whom, cause):
    """What a daemon's error says of the call. Errors of calls that the service has made itself bear other names."""
    symbol, text = cause["code"][1:3], cause["text"]
    if symbol[:1] == ["NAME"]:
        return NEVER
    if symbol[:1] != ["COMM"] or not text.startswith(whom):
        return RAN
    if symbol[1:] == ["TOO_BIG"]:
        return NEVER if "the request" in text else RAN
    if symbol[1:] in (["DENIED"], ["LIMIT"], ["PROTOCOL"]) or "not executed" in text:
        return NEVER
    return RAN if "was executed" in text else UNKNOWN


# ---- addresses ----

def _runtime_folder():
    folder = os.environ.get("SORMA_RUNTIME_DIR") or (os.environ["XDG_RUNTIME_DIR"] + "/sorma" if os.environ.get("XDG_RUNTIME_DIR")
                                                     else f"/tmp/sorma-{os.getuid()}")
    facts = os.lstat(folder) if os.path.lexists(folder) else None       # None: then nothing listens in it
    if facts and (not stat.S_ISDIR(facts.st_mode) or facts.st_uid != os.geteuid() or facts.st_mode & 0o066):
        raise _error("COMM DENIED", folder, "is no folder of your own with mode 0700; set SORMA_RUNTIME_DIR to one")
    return folder


def _dictionary():
    """Entries @NAME of the files in SORMA_DICT and of variables SORMA_ENTRY_@NAME: lists of words. They need no quotes."""
    lines = []
    for path in filter(None, os.environ.get("SORMA_DICT", "").split(":")):
        try:
            with open(path, encoding="utf-8-sig", errors="replace") as file:
                lines += file.read(1 << 24).replace("\\\n", " ").split("\n")
        except OSError:
            pass                        # left out, as in Tcl
    lines += [key[12:] + " " + os.environ[key] for key in sorted(os.environ) if key.startswith("SORMA_ENTRY_@")]
    entries = {}
    for words in map(str.split, lines):
        end = next((i for i, word in enumerate(words) if word[0] == "#"), len(words))
        if words and words[0][0] == "@":
            entries[words[0]] = words[1:end]
    return entries


def _resolve(address):
    """Where what stands after @ in a name leads: .target for connect(), a path or (host, port); .wait; .tls, what the dictionary says of
    it; .name, which the daemon's certificate must have."""
    entries, chain, wait, tls, where = _dictionary(), [], False, "", address
    while True:
        where = where[1:] if where[:1] == "@" else where
        where = where[5:] if where.startswith("unix:") else where
        if where[:1] == "/":
            return types.SimpleNamespace(target=where, wait=wait, tls="no", name="")
        if ":" in where:
            break
        if not where or where == "self" or "/" in where:
            raise _error("NAME SYNTAX", address, "an address of a daemon is HOST:PORT, /PATH or a name")
        key = "@" + where
        if key not in entries:
            return types.SimpleNamespace(target=f"{_runtime_folder()}/{where}.sock", wait=wait, tls="no", name="")
        chain.append(key)
        if key in chain[:-1]:
            raise _error("DICT LOOP", address, "addresses in the dictionary lead in a circle: " + " -> ".join(chain))
        words = entries[key]
        if not words or words[0] == "-SUBST":
            raise _error("ADDRESS UNRESOLVED", address, f"the dictionary's entry {key} holds no address")
        if "-tls" in words:
            tls = (words + [""])[words.index("-tls") + 1]
            if tls not in ("yes", "no", "try"):
                raise _error("DICT SYNTAX", address, f"the dictionary's entry {key}: -tls expects yes, no or try, got {tls!r}")
        where, wait = words[0], wait or "-wait" in words
    host, _, port = where.rpartition(":")
    if not port.isdecimal() or not 0 < int(port) < 65536:
        raise _error("NAME SYNTAX", address, f"no port: {port!r}; numbers of rpcbind are not looked up, rpcinfo -p {host} shows the port")
    host = host[1:-1] if host[:1] == "[" else host
    return types.SimpleNamespace(target=(host, int(port)), wait=wait, tls=tls, name=chain[-1][1:] if chain else host)


def _open_socket(place, who, deadline):
    """A connected socket."""
    left = _left(deadline)
    tcp = isinstance(place.target, tuple)
    context = _context(who) if tcp and _wants_tls(place, who) else None
    s = socket.create_connection(place.target, left) if tcp else socket.socket(socket.AF_UNIX)
    try:
        if not tcp:
            s.settimeout(left)
            s.connect(place.target)
            return s
        s.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return _secured(s, context, place, who, deadline) if context else s
    except BaseException:
        s.close()
        raise


def _left(deadline):
    return max(min(deadline - time.monotonic(), 1e6), 0.001)


# ---- TLS: RFC 9289, with the keys that sorma-keys keeps ----

def _key_file(name):
    folder = os.environ.get("SORMA_KEYS") or (os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")) + "/sorma/keys"
    return os.path.join(folder, name)


def _lines(name):
    try:
        with open(_key_file(name), errors="replace") as file:
            return [line.split() for line in file if line.strip()]
    except OSError:
        return []


def _pinned(name):
    """The date since when a daemon is known to speak TLS."""
    return next((line[1] for line in _lines("pins") if line[0] == name and len(line) > 1), "")


def _pin(name):
    if not _pinned(name):
        with contextlib.suppress(OSError):
            file = os.open(_key_file("pins"), os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
            os.write(file, f"{name} {time.strftime('%Y-%m-%d', time.gmtime())}\n".encode())
            os.close(file)


def _wants_tls(place, who):
    since = _pinned(place.name)
    if since and place.tls == "no":
        raise _error("TLS PINNED", who, f"{place.name} has spoken TLS since {since}, and the dictionary says -tls no; nothing was sent in clear; remove "
                     f"-tls no there, or: sorma-keys forget {place.name}")
    return bool(place.tls == "yes" or since or (place.tls != "no" and any(os.path.exists(_key_file(f)) for f in ("own", "authority.pem"))))


def _context(who):
    own = (_lines("own") or [[""]])[0][0]
    file = _key_file(own + ".pem")
    if not own or not os.path.exists(file):
        raise _error("TLS MISSING", who, f"TLS needs a certificate, and there is none in {_key_file('')}; where the authority is: sorma-keys give NAME FILE; "
                     "here: sorma-keys take FILE")
    facts = os.stat(file)
    if facts.st_uid not in (0, os.geteuid()) or facts.st_mode & 0o077:
        raise _error("TLS KEY", who, f"the key file {file} cannot be used: others than its owner may read it: chmod 600 {file}")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.minimum_version = context.maximum_version = ssl.TLSVersion.TLSv1_3
        context.set_alpn_protocols(["sunrpc"])
        context.load_cert_chain(file, password=lambda: "")
        for name in filter(os.path.exists, map(_key_file, ("authority.pem", "trusted.pem"))):       # an empty list trusts nobody
            context.load_verify_locations(name)
        if os.path.exists(_key_file("crl.pem")):
            context.load_verify_locations(_key_file("crl.pem"))
            context.verify_flags |= ssl.VERIFY_CRL_CHECK_LEAF
    except (OSError, ValueError) as e:
        raise _error("TLS KEY", who, f"the key file {file} cannot be used, or another one beside it: {e}") from None
    return context


def _secured(sock, context, place, who, deadline):
    """This socket with TLS; itself where the daemon cannot, and -tls try allows that."""
    sock.settimeout(_left(deadline))
    sock.sendall(_UU.pack(0x80000028, 0x544c5331) + struct.pack(">9I", 0, 2, PROGRAM, 1, 0, 7, 0, 0, 0))
    data, size = b"", 4
    while len(data) < size:             # nothing but the answer
        sock.settimeout(_left(deadline))
        got = sock.recv(size - len(data))
        if not got:
            raise ConnectionError("it closed the connection after the probe")
        data += got
        if len(data) == 4:
            size += _U.unpack(data)[0] & 0x7fffffff
            if size > 1024:
                raise _error("COMM PROTOCOL", who, "it does not answer the probe of TLS as ONC RPC does; is the address right?")
    if data[4:] != _UUUU.pack(0x544c5331, 1, 0, 0) + _text("STARTTLS") + bytes(4):
        since = _pinned(place.name)
        if since:
            raise _error("TLS STRIPPED", who, f"{place.name} has spoken TLS since {since}, and now its answer says that it cannot: somebody between may have "
                         f"changed it; nothing was sent in clear; if it is meant: sorma-keys forget {place.name}")
        if place.tls == "try":
            return sock
        raise _error("TLS PLAIN", who, f"{place.name} speaks in clear alone; nothing was sent to it; let it have keys (sorma-keys give), or write -tls no "
                     "after its address in the dictionary")
    tls = _Tls(sock, context, place.name)
    try:
        tls.handshake(deadline)
    except ssl.SSLError as e:
        raise _tls_error(e, who) from None
    names = [value for kind, value in tls.tls.getpeercert().get("subjectAltName", ()) if kind == "DNS"] + [tls.tls.getpeercert().get("serialNumber")]
    if any(line[0] in names for line in _lines("revoked")):
        raise _error("TLS REVOKED", who, f"the daemon's certificate ({names[0]}) is revoked ({_key_file('revoked')}); nothing was sent; where the authority is: "
                     f"sorma-keys new {names[0]}")
    _pin(place.name)
    return tls


def _tls_error(e, who):
    """What the ssl module says, as one of SORMA's errors."""
    clock, again = f"; the clock here says {time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime())}", "; where the authority is: sorma-keys new NAME"
    check, reason = getattr(e, "verify_code", 0), getattr(e, "reason", "") or ""
    kinds = {10: ("EXPIRED", again), 9: ("NOTYET", "; set the clock that is wrong"), 23: ("REVOKED", again),
             62: ("NAME", "; a daemon is called by the name in its certificate: write @NAME and its address into the dictionary")}
    if check:
        kind, mend = kinds.get(check, ("AUTHORITY", "; keys of one authority are given by: sorma-keys give NAME FILE"))
        return _error("TLS " + kind, who, f"the daemon's certificate: {e.verify_message}{clock}{mend}; nothing was sent")
    for word, kind in (("CERTIFICATE_EXPIRED", "EXPIRED"), ("CERTIFICATE_REVOKED", "REVOKED"), ("UNKNOWN_CA", "AUTHORITY"), ("CERTIFICATE_REQUIRED", "MISSING"),
                       ("BAD_CERTIFICATE", "NOTYET")):
        if word in reason:
            return _error("TLS " + kind, who, f"the daemon does not take our certificate: {reason}{clock}{again}")
    return _error("TLS REFUSED", who, f"no TLS with the daemon: {reason or e}; nothing was sent in clear")


class _Tls:
    """A socket whose bytes are encrypted. It has those methods of a socket that this file calls, and the rest is the socket's own.
    Threads: one sends while another one receives."""
    def __init__(self, sock, context, name):
        self.sock, self.lock = sock, threading.Lock()
        self.incoming, self.outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self.tls = context.wrap_bio(self.incoming, self.outgoing, server_hostname=name)
        self.plain, self.waiting, self.owed = bytearray(), b"", 0      # read, not asked for; encrypted, not sent; of how much

    def __getattr__(self, name):
        return getattr(self.sock, name)

    def handshake(self, deadline):
        while True:
            try:
                self.tls.do_handshake()
                break
            except ssl.SSLWantReadError:
                self.sock.sendall(self.outgoing.read())
                self.sock.settimeout(_left(deadline))
                got = self.sock.recv(65536)
                if not got:
                    raise ConnectionError("it closed the connection in the handshake of TLS") from None
                self.incoming.write(got)
            except ssl.SSLError:
                with contextlib.suppress(OSError):
                    self.sock.sendall(self.outgoing.read())        # the alert: the daemon's log says what was wrong, too
                raise
        self.sock.sendall(self.outgoing.read())
        if self.tls.selected_alpn_protocol() != "sunrpc":
            raise ssl.SSLError("it does not speak sunrpc (ALPN)")

    def recv(self, size, flags=0):
        while True:
            with self.lock:
                try:
                    self.plain += b"" if self.plain else self.tls.read(65536)
                except ssl.SSLWantReadError:
                    pass
                except (ssl.SSLZeroReturnError, ssl.SSLEOFError):
                    return b""
                if self.plain:
                    data = bytes(self.plain[:size])
                    if not flags & socket.MSG_PEEK:
                        del self.plain[:size]
                    return data
            got = self.sock.recv(65536, flags & ~socket.MSG_PEEK)
            if not got:
                return b""
            with self.lock:
                self.incoming.write(got)

    def send(self, data, flags=0):
        """As a socket's; after a BlockingIOError the caller comes again with the same."""
        with self.lock:
            if not self.owed:
                self.owed = self.tls.write(data[:16384])
            self.waiting += self.outgoing.read()
        self.waiting = self.waiting[self.sock.send(self.waiting, flags):]
        if self.waiting:
            raise BlockingIOError
        owed, self.owed = self.owed, 0
        return owed

    def sendall(self, data):
        at = 0
        while at < len(data):
            with contextlib.suppress(BlockingIOError):
                at += self.send(memoryview(data)[at:])


def _seen(link):
    """The kernel's boot and a namespace in it: who sees the same has the same clock, or the same process numbers."""
    try:
        with open("/proc/sys/kernel/random/boot_id") as file:
            return file.read().strip() + " " + os.readlink(link)
    except OSError:
        return ""


def _has_ended(process, processes):
    if process <= 0 or not processes or processes != _seen("/proc/self/ns/pid"):
        return False
    try:
        with open(f"/proc/{process}/stat", errors="replace") as file:
            return file.read().rpartition(")")[2].split()[0] in "ZX"
    except (OSError, IndexError):
        return not os.path.exists(f"/proc/{process}")


# ---- a connection ----

class _Slot:
    def __init__(self, index):
        self.index, self.sequence, self.state, self.request, self.cut, self.unsure = index, 0, DONE, b"", False, False
        self.future = self.result = self.error = None


class Call(concurrent.futures.Future):
    """The future of exec_async() and its like. cancel() tells the daemon, and its service may stop early."""

    def cancel(self):
        if not super().cancel():
            return False
        self._connection.abandon(self._slot, self)
        if self.__dict__.setdefault("_told", me := object()) is me:
            self.set_running_or_notify_cancel()         # once: whoever waits for it hears of it
        return True


class _Connection:
    """A session with one daemon. A caller that waits reads by itself, so that a call needs no other thread. A thread of its own reads while
    there are futures, subscriptions, or several callers. Locks: leader (who reads), sending (whose bytes go out; which socket), lock (slots)."""

    def __init__(self, address, timeout, maxmessage):
        self.address, self.timeout, self.maxmessage, self.clock = address, timeout, maxmessage, _seen("/proc/self/ns/time")
        self.fresh()
        _connections.add(self)

    def fresh(self):
        """As at the start. Also in a child after fork(), which must not go on with its parent's session."""
        self.leader, self.sending, self.lock, self.news = threading.Lock(), threading.RLock(), threading.Lock(), threading.Event()
        self.client, self.boot, self.sock, self.closed, self.thread, self.pending = secrets.randbits(64), 0, None, False, None, 0
        self.slots, self.free, self.input, self.controls, self.lastxid = [], [], bytearray(), {}, 0
        self.finished, self.subscriptions, self.lastid = collections.deque(), {}, 0
        self.heard = self.since = self.said = self.patience = self.absent = self.pause = 0.0
        self.where, self.name, self.how, self.goodbye, self.hung_up, self.answered = self.address, "", "", "", False, False
        self.most, self.mostbytes, self.wait, self.process, self.processes, self.theirclock = 1, 65536, False, 0, "", ""

    # -- calls --

    def begin(self, name, method, body, timeout, future=None):
        """Take a slot and send. name: of the object, and the same as bytes. Without a future the caller leads."""
        now = time.monotonic()
        timeout = self.timeout if timeout is None else timeout
        deadline = now + timeout if timeout else float("inf")
        if self.closed:
            raise _error("COMM LOST", name[0] + "@" + self.address, "this connection has been closed on this side; never sent")
        if future is None and now - self.heard > 0.001:
            self.check_idle()
        if not self.boot:               # a child after fork()
            with self.leader if future else contextlib.nullcontext():
                self.boot or self.open(deadline)
        slot = self.acquire(name[0], deadline, future)
        try:
            size = 56 + len(name[1]) + len(body)
            slot.name, slot.deadline, slot.timeout, slot.future, slot.error, slot.cut = name[0], deadline, timeout, future, None, False
            if size > self.mostbytes:
                raise _error("COMM TOO_BIG", self.who(slot), f"the request has {size} bytes, at most {self.mostbytes} are taken; never sent; "
                             "raise it there: sorma::configure -maxmessage BYTES")
            slot.sequence = slot.sequence + 1 & 0xffffffff
            slot.request = _CALL.pack(0x80000000 | size, (slot.sequence & 0xffff) << 16 | slot.index, 0, 2, PROGRAM, 1, CALL, 0, 0, 0, 0,
                                      slot.index, slot.sequence, self.mark(deadline, now), method) + name[1] + body
            if future:
                future._slot, future._connection = slot, self
                with self.lock:
                    self.pending, slot.state = self.pending + 1, UNSENT
                self.start_thread()
            else:
                slot.state = UNSENT
            with self.sending:
                if self.theirclock != self.clock and self.theirclock and now - self.said > 1:
                    self.said = now
                    self.control(CLOCK, _Q.pack(time.monotonic_ns()))
                if self.sock:
                    self.transmit(slot, future is None)
            return slot
        except BaseException:
            self.give_up(slot, future)
            raise

    def mark(self, deadline, now):
        """A deadline as the wire has it: a time of the clock that HELLO named, or the time left for a daemon that knows no clocks."""
        if deadline - now > 1728000:
            return 0
        return int(deadline * 1000 + 1) & 0xffffffff or 1 if self.theirclock else max(int((deadline - now) * 1000), 0) + 1

    def acquire(self, name, deadline, future):
        while True:
            try:
                slot = self.free.pop()
                slot.state, slot.unsure = DONE, False       # in use, and nothing sent yet
                return slot
            except IndexError:
                pass
            with self.lock:
                if len(self.slots) < self.most:
                    self.slots.append(_Slot(len(self.slots)))
                    return self.slots[-1]
                gone = all(s.state == UNWANTED for s in self.slots)
            now = time.monotonic()
            if gone and not self.answered and now - self.since > 5:     # a new connection finds out which can be used again
                self.break_off(self.sock)
            if now > deadline:
                raise _error("COMM LIMIT", name + "@" + self.address, f"{self.most} calls are in flight already; never sent")
            if future is None:
                self.read(min(deadline, now + LOOK))
            elif self.leader.acquire(False):
                self.lead(lambda: self.read(min(deadline, now + LOOK)))
            else:
                time.sleep(FIRST_PAUSE)

    def call(self, name, method, body, timeout):
        """A call that blocks."""
        other = self.thread is not None and self.thread is not threading.current_thread()
        if other or not self.leader.acquire(False):
            future = self.call_async(name, method, body, timeout)
            try:
                while not other and self.thread is threading.current_thread() and not future.done():
                    self.turn()         # a callback calls
                return future.result()
            finally:
                future.cancel()         # an interrupt; otherwise it does nothing
        slot = None
        try:
            slot = self.begin(name, method, body, timeout)
            while slot.state >= UNSENT:
                if not self.read(slot.deadline) and slot.state >= UNSENT and time.monotonic() >= slot.deadline:
                    raise self.late(slot)
                if self.finished and self.thread:
                    self.news.set()
            error, result, slot.result = slot.error, slot.result, None
            self.release(slot)
        except BaseException:
            if slot:
                self.give_up(slot)
            raise
        finally:
            self.leader.release()
            if self.thread:
                self.news.set()
            elif self.finished:
                self.deliver()
        if error:
            raise error
        return result

    def call_async(self, name, method, body, timeout):
        future = Call()
        self.begin(name, method, body, timeout, future)
        return future

    def who(self, slot):
        return f"{slot.name}@{self.address}"

    def late(self, slot):
        if slot.state == SENT:
            return _error("COMM TIMEOUT", self.who(slot), f"no answer in {slot.timeout:g} s from {self.where}; the request was sent and may have run", UNKNOWN)
        what = "only a part of the request was sent, so it did not run" if slot.cut else "the request was never sent"
        return _error("COMM TIMEOUT", self.who(slot), f"the daemon did not come back in {slot.timeout:g} s ({self.how}); {what}")

    def release(self, slot):
        """The slot of a call that is done. unsure: its reply may still come, if the daemon comes back."""
        if slot.state == DONE:          # otherwise an interrupt came when it had been released already
            slot.state = UNWANTED if slot.unsure else FREE
            if not slot.unsure:
                self.free.append(slot)

    def give_up(self, slot, future=None):
        self.abandon(slot, future) or self.release(slot)

    def abandon(self, slot, future=None):
        """Nobody waits for this call any more: tell the daemon. False: it had ended already."""
        with self.lock:
            if slot.state < UNSENT or slot.future is not future:
                return False
            sent, slot.state, slot.future = slot.state == SENT, UNWANTED if slot.state == SENT else FREE, None
            self.pending -= future is not None
            if not sent:
                self.free.append(slot)
        if sent and self.sending.acquire(timeout=LOOK):
            try:
                self.control(CANCEL, _UU.pack(slot.index, slot.sequence))
            finally:
                self.sending.release()
        return True

    # -- sending: the caller has self.sending --

    def transmit(self, slot, leading):
        """Send a call. It counts as sent when the kernel has taken its last byte."""
        with self.lock:
            sock = self.sock
            if slot.state != UNSENT or not sock:
                return
            slot.state = SENT           # before its reply can come
        done = self.send(sock, slot.request, slot.deadline, leading)
        if done < len(slot.request):
            with self.lock:
                slot.cut = done > 0
                slot.state = UNSENT if slot.state == SENT else slot.state

    def send(self, sock, data, deadline, leading):
        """How many bytes were taken. When fewer than all, the connection is broken."""
        at, poll = 0, None
        try:
            while True:
                try:
                    at += sock.send(memoryview(data)[at:] if at else data, socket.MSG_DONTWAIT)
                    if at == len(data):
                        return at
                except BlockingIOError:
                    pass
                left = min(deadline - time.monotonic(), LOOK)
                if left <= 0 or self.sock is not sock:
                    break               # half a record: nothing else can follow it
                if not poll:
                    poll = select.poll()
                    poll.register(sock, select.POLLOUT | (select.POLLIN if leading else 0))
                if any(what & select.POLLIN for _, what in poll.poll(left * 1000)):
                    self.read(time.monotonic() + LOOK)      # the daemon may wait until we take its replies
        except OSError as e:
            self.how = str(e)
        except BaseException:           # an interrupt: who knows how much was taken
            self.break_off(sock)
            raise
        self.break_off(sock)
        return at

    def control(self, procedure, body, handler=None):
        """Send a record that is no call of a slot, if there is a connection."""
        self.lastxid = self.lastxid + 1 & 0xffff
        xid = self.lastxid << 16 | CONTROL
        if handler:
            self.controls[xid] = handler
        record = _record(xid if handler else 0, procedure, body)
        if self.sock:
            self.send(self.sock, record, time.monotonic() + 1, False)

    @staticmethod
    def break_off(sock):
        """End the connection, so that whoever reads sees its end."""
        try:
            if sock:
                sock.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass

    # -- reading: the caller has self.leader --

    def read(self, deadline):
        """Take what comes until the deadline, once. Without a connection: try to make it again. False: nothing came."""
        sock, left = self.sock, deadline - time.monotonic()
        if left <= 0:
            return False
        if sock is None:
            return self.reconnect(deadline)
        if self.patience == 0 or self.patience > left:      # the socket's own timeout, so that a call costs no poll
            self.patience = max(min(left, 3600), 0.001)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", int(self.patience), int(self.patience % 1 * 1e6)))
        try:
            data = sock.recv(65536)
        except BlockingIOError:
            self.patience = 0           # it was shorter than the deadline, or that is here
            return False
        except OSError as e:
            return self.lost(str(e))
        if not data:
            return self.lost(self.how or "the daemon closed it")
        self.heard = time.monotonic()
        if not self.input and len(data) >= 4 and _U.unpack_from(data)[0] == 0x80000000 | len(data) - 4:
            return self.take(data[4:])
        self.input += data
        at = 0
        while len(self.input) - at >= 4:
            mark = _U.unpack_from(self.input, at)[0]
            if mark < 0x80000000 or mark - 0x80000000 > self.maxmessage:
                return self.lost(f"no record of ONC RPC, or one beyond maxmessage ({bytes(self.input[at:at + 40])!r})")
            end = at + 4 + mark - 0x80000000
            if end > len(self.input):
                break
            self.take(bytes(memoryview(self.input)[at + 4:end]))
            at = end
            if self.sock is not sock:
                return True
        del self.input[:at]
        return True

    def take(self, record):
        """One record. What is no record of SORMA's ends the connection."""
        try:
            xid, kind, denied, _, verifier, status = _SIX.unpack_from(record)
            if kind == 0:
                self.called(_Reader(record, 40), status)
                return True
            index = xid & CONTROL
            if index == CONTROL:
                handler = self.controls.pop(xid, None)
                if handler:
                    handler(record)
                return True
            slot = self.slots[index]
        except (struct.error, ValueError, IndexError):
            return self.lost(f"a record that is no reply to any call ({record[:40]!r})")
        if slot.state not in (SENT, UNWANTED) or slot.sequence & 0xffff != xid >> 16:
            return True                 # late, and nobody waits
        self.answered, self.pause = True, 0
        if slot.state == SENT:
            try:
                if kind == 1 and not denied and not verifier and not status and record[40:] == _EMPTY_REPLY:
                    result, error = {"code": _I.unpack_from(record, 24)[0]}, None
                    if result["code"] < 0:
                        result, error = self.result(slot, record)
                else:
                    result, error = self.result(slot, record)
            except (struct.error, ValueError, IndexError) as e:
                result, error = None, _error("COMM PROTOCOL", self.who(slot), f"the reply of {self.where} could not be decoded: {e}", UNKNOWN)
            if self.done(slot, result, error):
                return True
        with self.lock:
            if slot.state == UNWANTED:
                slot.state = FREE
                self.free.append(slot)
        return True

    def result(self, slot, record):
        why = _refusal(record)
        if why:
            return None, _error("COMM PROTOCOL", self.who(slot), f"{self.where} does not answer like a SORMA daemon: {why}", NEVER)
        r = _Reader(record, 24)
        code = r.take(">i")
        r.at += 12
        result = r.message()
        trail, cause, dropped = r.trail()
        if dropped:
            trail.insert(0, {"severity": "verbose", "code": ["SORMA", "TRAIL", "DROPPED"], "text": f"{dropped} older messages were dropped",
                             "so": "", "daemon": "", "file": "", "line": 0, "time": 0})
        if code >= 0:
            result["code"] = code
            if trail:
                result["trail"] = trail
            return result, None
        if not cause:
            return None, _error("SERVICE FAILED", self.who(slot), f"EXEC returned code {code}", RAN)
        return None, Error(cause["text"], cause["code"], _verdict((slot.name + ": ", self.name + ": "), cause), trail)

    def done(self, slot, result, error):
        """A call that was sent, or never will be, has its result. False: nobody waits for it any more."""
        with self.lock:
            if slot.state < UNSENT:
                return False
            slot.state, slot.result, slot.error = DONE, result, error
            future, slot.future = slot.future, None
            self.pending -= future is not None
        if future:
            self.finished.append((future, result, error))
            slot.result = None
            self.release(slot)
        return True

    def called(self, r, procedure):
        if procedure == GOODBYE:
            self.goodbye = r.text("replace")
        elif procedure == EVENT:
            subscription = self.subscriptions.get(r.take(">I"))
            if subscription:
                subscription.take(r)

    def check_idle(self):
        """A quiet connection may have been closed by the other side, and would still take our bytes: look first."""
        while self.sock:
            try:
                if self.sock.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT):
                    self.read(time.monotonic() + LOOK)
                    continue
                self.lost("the daemon closed it")
            except BlockingIOError:
                return
            except OSError as e:
                self.lost(str(e))

    # -- the connection itself: the caller has self.leader --

    def lost(self, how):
        sock = self.sock
        self.break_off(sock)            # a sender that waits for it goes away
        with self.sending:
            self.how = f"the daemon said: {self.goodbye}" if self.goodbye else how
            self.sock, self.patience = None, 0
            self.input.clear()
            self.controls.clear()
            if sock:
                sock.close()
        return True

    def reconnect(self, deadline):
        began = time.monotonic()
        if self.closed:
            return self.fail_all("it was closed on this side", _error("COMM LOST", self.address, "it was closed on this side; never sent"))
        if self.pause:                  # it was not there, or broke off without an answer
            time.sleep(max(0, min(self.pause, deadline - began)))
        self.pause = min(max(FIRST_PAUSE, 2 * self.pause), LAST_PAUSE)
        try:
            self.open(min(deadline, began + OPEN_TIME))
            return True
        except Error as e:
            absent = e.code[1:3] in (["COMM", "REFUSED"], ["ADDRESS", "UNRESOLVED"]) and not self.hung_up
            if e.code[1:3] == ["COMM", "PROTOCOL"]:
                self.fail_sent("something else answers there now", False)
            elif absent:
                self.absent = self.absent or began
                if self.goodbye or _has_ended(self.process, self.processes):
                    self.fail_sent("the daemon has ended, and nothing listens there now", True)
                elif began - self.absent > ABSENCE:
                    self.fail_sent(f"nothing has listened there for {ABSENCE:g} s", False)
            comes = self.wait or not self.goodbye if absent else self.hung_up or e.code[2:3] in (["LIMIT"], ["TIMEOUT"])
            if not comes:
                self.fail_all("there is no way back to it: " + e.text, e)
            self.how = e.text
        return True

    def open(self, deadline):
        """Connect, and say HELLO. Fails with COMM REFUSED, TIMEOUT, LIMIT, PROTOCOL or with an address that leads nowhere."""
        self.hung_up = False
        place = _resolve(self.address)
        self.wait = place.wait
        self.where = place.target if isinstance(place.target, str) else f"{place.target[0]}:{place.target[1]}"
        try:
            sock = _open_socket(place, self.address, deadline)
        except (TimeoutError, socket.timeout):          # one and the same from Python 3.10 on
            raise _error("COMM TIMEOUT", self.address, f"no connection to {self.where} within the deadline; never sent") from None
        except OSError as e:
            lacks = isinstance(e, socket.gaierror) or (isinstance(e, FileNotFoundError) and "/" not in self.address)
            symbol = "ADDRESS UNRESOLVED" if lacks else "COMM REFUSED"
            raise _error(symbol, self.address, f"cannot connect to {self.where}: {e}; never sent; is the daemon started?") from None
        try:
            self.absent = 0
            texts = [_text(t[:80]) for t in (_user(), socket.gethostname())]
            hello = _record(0, HELLO, struct.pack(">Q", self.client) + b"".join(texts) + struct.pack(">q", os.getpid()) + _text("python3") +
                            _U.pack(self.maxmessage) + _text(self.clock) + struct.pack(">q", time.monotonic_ns()))
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):    # a daemon that has hung up has perhaps said why
                sock.sendall(hello)
            record, rest = self.first_record(sock, deadline)
            self.welcome(sock, record, rest)
        except BaseException as e:
            if self.sock is not sock:
                sock.close()
            if isinstance(e, (TimeoutError, socket.timeout)):
                raise _error("COMM TIMEOUT", self.address, f"{self.where} is connected, but does not answer; never sent") from None
            if isinstance(e, ssl.SSLError):
                raise _tls_error(e, self.address) from None
            if isinstance(e, OSError):
                self.hung_up = True
                raise _error("COMM REFUSED", self.address, f"{self.where} broke off: {e}; it may be ending, or full; never sent") from None
            if isinstance(e, (ValueError, struct.error)):
                raise _error("COMM PROTOCOL", self.address, f"{self.where} does not answer like a SORMA daemon: {e}; is the address right?") from None
            raise

    @staticmethod
    def first_record(sock, deadline):
        data, end = bytearray(), 4
        while len(data) < end:
            sock.settimeout(max(min(deadline - time.monotonic(), 1e6), 0.001))
            got = sock.recv(65536)
            if not got:
                raise ConnectionError(f"it closed the connection after {bytes(data[:40])!r}")
            data += got
            if len(data) >= 4:
                end = 4 + _U.unpack_from(data)[0] - 0x80000000
                if not 4 <= end <= MOST_WELCOME:
                    raise ValueError(f"it said {bytes(data[:40])!r}")
        return bytes(data[4:end]), data[end:]

    def welcome(self, sock, record, rest):
        """The daemon's answer to HELLO says which daemon this is, and so what became of calls without a reply."""
        if _U.unpack_from(record, 4)[0] == 0:
            raise _error("COMM LIMIT", self.address, f"refused by {self.where}: {_Reader(record, 40).text('replace')}; never started")
        why = _refusal(record)
        if why:
            raise ValueError(why)
        r = _Reader(record, 24)
        boot, name, _, _, process, _, mostbytes, slots, _, known = (r.take(">Q"), r.text(), r.text(), r.text(), r.take(">q"), r.text(), r.take(">I"),
                                                                    r.take(">I"), r.take(">q"), r.take(">I"))
        clock, processes = (r.text(), r.text()) if r.at < len(record) else ("", "")      # an older one ends before them
        if self.boot and boot != self.boot:
            self.fail_sent("the daemon has ended, and another one answers there now", True)
        elif self.boot and not known:
            self.fail_sent("the daemon does not know this client any more", False)
        with self.sending:
            same, self.boot = boot == self.boot, boot
            self.name, self.process, self.processes, self.theirclock = name, process, processes, clock
            self.most, self.mostbytes = min(slots, CONTROL - 1) or 1, min(mostbytes, self.maxmessage)
            sock.setblocking(True)
            self.sock, self.patience, self.goodbye, self.how, self.answered, self.input = sock, 0, "", "", False, rest
            self.since = self.heard = time.monotonic()
            for subscription in list(self.subscriptions.values()):
                subscription.ask(same)
            for slot in list(self.slots):
                with self.lock:
                    state = slot.state
                    if state == UNWANTED:       # a question with the same number: its answer is that of the lost call, or that call never runs
                        head = struct.pack(">II", slot.sequence << 16 & 0xffff0000 | slot.index, 0)
                        body = _UUUU.pack(slot.index, slot.sequence, 0, DBX) + _text("sorm") + _message(words=("-info", "name"))
                        slot.request = _record(0, CALL, body)[:4] + head + _record(0, CALL, body)[12:]
                    elif state >= UNSENT:
                        slot.state = UNSENT
                        slot.request = slot.request[:52] + _U.pack(self.mark(slot.deadline, time.monotonic())) + slot.request[56:]
                if state == UNWANTED:           # that it is given up may have been lost with the old connection
                    cancel = _record(0, CANCEL, _UU.pack(slot.index, slot.sequence))
                    self.send(sock, slot.request + cancel, time.monotonic() + 1, True)
                elif state >= UNSENT:
                    self.transmit(slot, True)

    def fail_sent(self, why, ended):
        """Calls that were sent will get no reply. ended: the daemon that they were sent to is gone, so their slots are free."""
        for slot in list(self.slots):
            if slot.state == SENT:
                slot.unsure = not ended
                self.done(slot, None, _error("COMM LOST", self.who(slot), f"the connection to {self.where} (daemon {self.name}) was lost: {self.how}; "
                                             f"the request was sent and {why}, so whether it ran is unknown", UNKNOWN))
            elif slot.state == UNWANTED and ended:
                slot.state, slot.unsure = DONE, False
                self.release(slot)

    def fail_all(self, why, unsent):
        self.fail_sent(why, True)
        for slot in list(self.slots):
            if slot.state == UNSENT:
                self.done(slot, None, Error(unsent.text, unsent.code, NEVER))
        return True

    # -- the thread, while there are futures and subscriptions --

    def lead(self, body):
        """Run body as the leader, which this thread has just become."""
        try:
            body()
        finally:
            self.leader.release()
            if self.finished:
                self.deliver()

    def start_thread(self):
        with self.lock:
            if self.thread is None and not self.closed:
                self.thread = threading.Thread(target=self.run, name="sorma " + self.address, daemon=True)
                self.thread.start()

    def turn(self):
        """Read for a moment, or wait while a caller reads. That one tells when there is news."""
        if self.leader.acquire(False):
            self.lead(lambda: self.read(time.monotonic() + LOOK))
        else:
            self.news.wait(LOOK)
            self.news.clear()
            self.deliver()

    def run(self):
        while True:
            with self.lock:
                if self.closed or not (self.pending or self.subscriptions or self.finished):
                    self.thread = None
                    return
            self.turn()
            now = time.monotonic()
            for slot in list(self.slots):
                future = slot.future
                if future and slot.deadline < now:
                    error = self.late(slot)
                    if self.abandon(slot, future):
                        self.finished.append((future, None, error))
            self.deliver()

    def deliver(self):
        """Tell futures and callbacks. They may call us again."""
        while self.finished:
            try:
                future, result, error = self.finished.popleft()
            except IndexError:
                return
            try:
                if not isinstance(future, Call):
                    future(result)
                elif error:
                    future.set_exception(error)
                else:
                    future.set_result(result)
            except concurrent.futures.InvalidStateError:
                pass                    # cancelled meanwhile

    def close(self):
        self.closed = True
        self.break_off(self.sock)
        with self.leader:
            if self.sock:
                self.lost("it was closed on this side")
            self.reconnect(0)           # which fails all
            for subscription in list(self.subscriptions.values()):
                subscription.push(Event(subscription.name, "sorma.gone", {}, 0, 0, time.time_ns() // 1000, 0))
        self.deliver()


# ---- events ----

Event = collections.namedtuple("Event", "object name content number lost time request")
Event.__doc__ = """An event. number counts those of its subscription, lost ones included; lost: between the one before and this one, -1: an
unknown number, after another daemon has come ("sorma.reconnected"). "sorma.gone" and "sorma.refused" are the last ones."""


class Events:
    """A subscription: iterate over it, or give a callback. Of the events that nobody takes, the oldest are dropped, and counted in lost."""

    def __init__(self, connection, name, pattern, keep, callback, timeout):
        self.connection, self.name, self.pattern, self.keep, self.callback = connection, name, pattern, max(keep, 1), callback
        self.waiting, self.there, self.last, self.dropped, self.ended, self.objection = collections.deque(), threading.Condition(), 0, 0, False, None
        deadline = time.monotonic() + (connection.timeout if timeout is None else timeout or 1e6)
        self.answered, self.pumping = threading.Event(), threading.Lock()
        connection.lastid += 1
        self.id = connection.lastid
        connection.subscriptions[self.id] = self
        with connection.sending:
            self.ask(False)
        connection.start_thread()
        if not self.answered.wait(max(0, deadline - time.monotonic())):
            self.close()
            raise _error("COMM TIMEOUT", name, f"{connection.where} did not answer to SUBSCRIBE; it is cancelled")
        if self.objection:
            self.close()
            raise self.objection

    def ask(self, same):
        body = _U.pack(self.id) + _text(self.name) + _text(self.pattern) + _U.pack(self.keep)
        self.connection.control(SUBSCRIBE, body, lambda record: self.told(record, same))

    def told(self, record, same):
        """The reply to SUBSCRIBE, at first and on each new connection."""
        slot = _Slot(0)
        slot.name = self.name
        result, objection = self.connection.result(slot, record)
        ints = result.get("ints", ()) if result else ()
        if not objection and len(ints) < 3:
            objection = _error("COMM PROTOCOL", self.name, "SUBSCRIBE was not answered with three numbers")
        if not self.answered.is_set():
            self.objection = objection
            self.last = max(self.last, ints[0]) if not objection else 0
            self.answered.set()
        elif objection:
            self.push(Event(self.name, "sorma.refused", {"text": objection.text}, self.last, -1, time.time_ns() // 1000, 0))
        else:
            missed = ints[0] - self.last if same and ints[2] == 1 and ints[0] >= self.last else -1
            self.last = ints[0]
            self.push(Event(self.name, "sorma.reconnected", {}, self.last, missed, time.time_ns() // 1000, 0))

    def take(self, r):
        number, lost, when = r.take(">QQq")
        name, content = r.text(), r.message()
        self.last = number
        self.push(Event(self.name, name, content, number, lost, when, r.take(">Q") if r.at < len(r.record) else 0))

    def push(self, event):
        if event.name in ("sorma.gone", "sorma.refused"):
            self.connection.subscriptions.pop(self.id, None)
        with self.there:
            if len(self.waiting) >= self.keep:
                lost = self.waiting.popleft().lost
                self.dropped = -1 if lost < 0 or self.dropped < 0 else self.dropped + 1 + lost
            self.waiting.append(event)
            self.there.notify()
            if self.callback and len(self.waiting) == 1:
                self.connection.finished.append((self.pump, None, None))

    def pump(self, _):
        """Call the callback for what waits. When a callback has called us, and so we are in this already, that one goes on."""
        while self.waiting and self.pumping.acquire(False):
            try:
                self.callback(self.next(0))
            except Exception:           # the next ones are told all the same
                logging.getLogger("sorma").exception("the callback of events of %s failed", self.name)
            finally:
                self.pumping.release()

    def next(self, timeout=None):
        """The next event; None when none comes in that time [s], or none will ever come."""
        with self.there:
            self.there.wait_for(lambda: self.waiting or self.ended, timeout)
            if not self.waiting:
                return None
            event, dropped, self.dropped = self.waiting.popleft(), self.dropped, 0
            self.ended = self.ended or event.name in ("sorma.gone", "sorma.refused")
            return event._replace(lost=-1 if dropped < 0 or event.lost < 0 else event.lost + dropped)

    def __iter__(self):
        return self

    def __next__(self):
        event = None if self.ended and not self.waiting else self.next()
        if event is None:
            raise StopIteration
        return event

    def close(self):
        """End it. Whoever iterates over it comes to the end."""
        connection = self.connection
        if connection.subscriptions.pop(self.id, None):
            with connection.sending:
                connection.control(UNSUBSCRIBE, _U.pack(self.id))
        with self.there:
            self.ended = True
            self.there.notify_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


# ---- daemons and objects ----

class Object:
    """A service object of a daemon. It is made there when it is first called."""

    def __init__(self, connection, name):
        self._connection, self._name = connection, (name, _text(name))

    def exec(self, *words, text="", floats=(), ints=(), any=b"", timeout=None):
        """EXEC. Gives a dict of code, and of text, floats, ints, any, words and trail when they are there. timeout [s], 0: none."""
        return self._connection.call(self._name, EXEC, _message(text, floats, ints, any, words), timeout)

    def ctrl(self, *words, timeout=None):
        """CTRL: options and their values, actions."""
        return self._connection.call(self._name, CTRL, _message(words=words), timeout)

    def dbx(self, *words, timeout=None):
        """DBX: inspection."""
        return self._connection.call(self._name, DBX, _message(words=words), timeout)

    def exec_async(self, *words, text="", floats=(), ints=(), any=b"", timeout=None):
        """As exec(), and gives a future at once."""
        return self._connection.call_async(self._name, EXEC, _message(text, floats, ints, any, words), timeout)

    def ctrl_async(self, *words, timeout=None):
        return self._connection.call_async(self._name, CTRL, _message(words=words), timeout)

    def dbx_async(self, *words, timeout=None):
        return self._connection.call_async(self._name, DBX, _message(words=words), timeout)

    def events(self, pattern="*", keep=100, callback=None, timeout=None):
        """Subscribe to the events whose names match. callback(event) runs in a thread of the connection."""
        return Events(self._connection, self._name[0], pattern, keep, callback, timeout)

    def __getitem__(self, option):
        """The value of an option, as text."""
        return self.dbx("-get", option).get("text", "")

    def __setitem__(self, option, value):
        self.ctrl(option, value)

    def __repr__(self):
        return f"<sorma {self._name[0]}@{self._connection.address}>"


class Daemon:
    """What connect() gives: daemon["foo.a"] is an object there. Any thread may use it."""

    def __init__(self, connection):
        self._connection = connection

    def __getitem__(self, name):
        return Object(self._connection, name)

    def close(self):
        self._connection.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def __repr__(self):
        return f"<sorma daemon {self._connection.name} at {self._connection.where}>"


def connect(address, timeout=25.0, maxmessage=64 << 20):
    """Connect to a daemon: NAME, "@/PATH", "@unix:/PATH", "HOST:PORT". timeout [s]: for this and for each call, 0: none. maxmessage
    [bytes]: the longest record that is sent and taken."""
    connection = _Connection(address, timeout, maxmessage)
    deadline = time.monotonic() + (timeout or 1e6)
    with connection.leader:
        while True:
            try:
                connection.open(deadline)
                return Daemon(connection)
            except Error:
                if not connection.wait or time.monotonic() + LAST_PAUSE > deadline:
                    raise
            time.sleep(LAST_PAUSE)


def _user():
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())


_connections = weakref.WeakSet()
os.register_at_fork(after_in_child=lambda: [c.fresh() for c in list(_connections)])


def main(argv):
    """sorma.py DAEMON OBJECT EXEC|CTRL|DBX ?WORD ...?"""
    if len(argv) < 4 or argv[3] not in ("EXEC", "CTRL", "DBX"):
        print("usage: sorma.py DAEMON OBJECT EXEC|CTRL|DBX ?WORD ...?", file=sys.stderr)
        return 2
    try:
        with connect(argv[1]) as daemon:
            reply = getattr(daemon[argv[2]], argv[3].lower())(*argv[4:])
    except Error as e:
        print(f"{' '.join(e.code)}: {e.text} ({e.verdict})", file=sys.stderr)
        return 1
    print(reply["text"] if set(reply) == {"text", "code"} else reply)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
