"""A server of static files that knows ranges, as any does, and that fails as real ones do when it is told to."""

import threading
import time
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path


class RangeHandler(SimpleHTTPRequestHandler):
    """`http.server`'s own, and single ranges; `server.fault(name, span)` says what goes wrong with a request."""

    protocol_version = "HTTP/1.1"

    def do_GET(self):
        path, span = Path(self.translate_path(self.path)), self.headers.get("Range")
        if not path.is_file():
            self.send_error(404)
            return
        data, total = path.read_bytes(), path.stat().st_size
        fault = self.server.fault(path.name, span)
        self.server.asked.append((path.name, span))
        if fault == "silent":
            self.server.released.wait(30)
            self.close_connection = True
            return
        if fault == "closed":
            self.close_connection = True
            return
        if fault == "error":
            self.send_error(503)
            return
        status = 200
        if span and fault != "no ranges":
            first, last = (int(number) for number in span.removeprefix("bytes=").split("-"))
            data, status = data[first : last + 1], 206
        self.send_response(status)
        self.send_header("Content-Type", "application/octet-stream")
        if status == 206:
            shift = 16 if fault == "other range" else 0
            self.send_header("Content-Range", f"bytes {first + shift}-{last + shift}/{total}")
        if fault == "short":
            data = data[: len(data) // 2]
        if fault == "altered":
            data = bytes(byte ^ 255 for byte in data)
        self.send_header("Content-Length", str(len(data)))
        if fault == "short":
            # It promises no more than comes: the client has to count for itself.
            self.send_header("Connection", "close")
        self.end_headers()
        if fault == "slow":
            self._trickle(data)
        else:
            self.wfile.write(data)

    def _trickle(self, data):
        """A byte now and then, each in time."""
        for byte in data:
            try:
                self.wfile.write(bytes([byte]))
                self.wfile.flush()
            except OSError:
                return
            if self.server.released.wait(0.05):
                return

    def log_message(self, *_):
        pass


@contextmanager
def serving(folder, fault=lambda name, span: ""):
    """A server of a folder's contents: yields its address, and what was asked of it."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(RangeHandler, directory=str(folder)))
    server.daemon_threads = True
    server.fault, server.asked, server.released = fault, [], threading.Event()
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}", server.asked
    finally:
        server.released.set()
        server.shutdown()
        server.server_close()
        thread.join()


def took(begin):
    """Seconds since."""
    return time.monotonic() - begin
