"""A server of files that answers requests for ranges as slowly and as badly as it is told.

    server.py DIRECTORY [--latency MS] [--rate MB/S] [--faults SHARE]

Prints its port, and then, for each line on its standard input, what it has sent since the last one: requests,
bytes of files. Latency is that of each request; the rate is shared by all. A share of the requests is answered by
503, by a reset connection or by half of the bytes, in turn.
"""

import argparse
import hashlib
import os
import socket
import socketserver
import struct
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler

PIECE = 64 * 1024


class Line:
    """The line that all answers share."""

    def __init__(self, rate):
        self.rate, self.free, self.lock = rate, 0.0, threading.Lock()

    def send(self, out, data):
        """Sends `data` when those before are through."""
        if self.rate:
            with self.lock:
                self.free = max(self.free, time.monotonic()) + len(data) / self.rate
                free = self.free
            time.sleep(max(0.0, free - time.monotonic()))
        out.write(data)


class Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self):
        server = self.server
        path = os.path.join(server.directory, self.path.split("?")[0].lstrip("/"))
        with server.lock:
            server.requests += 1
            fault = server.fault()
        time.sleep(server.latency)
        if not os.path.isfile(path):
            return self.send_error(404)
        if fault == "busy":
            return self.send_error(503)
        if fault == "reset":
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.close_connection = True
            return self.connection.close()
        length = os.path.getsize(path)
        first, last = 0, length - 1
        wanted = self.headers.get("Range")
        if wanted:
            first, end = wanted.removeprefix("bytes=").split("-")
            first, last = int(first), min(int(end or length - 1), length - 1)
        with open(path, "rb") as file:
            file.seek(first)
            data = file.read(last - first + 1)
        self.send_response(206 if wanted else 200)
        if wanted:
            self.send_header("Content-Range", f"bytes {first}-{last}/{length}")
        self.send_header("Content-Length", str(len(data)))
        self.send_header("ETag", '"' + hashlib.md5(f"{path} {length}".encode()).hexdigest() + '"')
        self.end_headers()
        if fault == "truncated":
            data = data[: len(data) // 2]
            self.close_connection = True
        for start in range(0, len(data), PIECE):
            server.line.send(self.wfile, data[start : start + PIECE])
        with server.lock:
            server.bytes += len(data)

    def log_message(self, *_):
        pass


class Server(socketserver.ThreadingTCPServer):
    daemon_threads, allow_reuse_address, request_queue_size = True, True, 64

    def __init__(self, options):
        super().__init__(("127.0.0.1", 0), Handler)
        self.directory, self.latency = options.directory, options.latency / 1000
        self.line, self.share = Line(options.rate * 1e6), options.faults
        self.lock, self.requests, self.bytes, self.owed, self.turn = threading.Lock(), 0, 0, 0.0, 0

    def fault(self):
        self.owed += self.share
        if self.owed < 1.0:
            return None
        self.owed -= 1.0
        self.turn += 1
        return ("busy", "reset", "truncated")[self.turn % 3]

    def handle_error(self, *_):
        pass


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory")
    parser.add_argument("--latency", type=float, default=0.0)
    parser.add_argument("--rate", type=float, default=0.0)
    parser.add_argument("--faults", type=float, default=0.0)
    server = Server(parser.parse_args())
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(server.server_address[1], flush=True)
    for _ in sys.stdin:
        with server.lock:
            print(server.requests, server.bytes, flush=True)
            server.requests = server.bytes = 0


if __name__ == "__main__":
    main()
