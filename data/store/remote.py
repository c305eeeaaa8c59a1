"""A display database behind HTTP: its index is fetched whole, its geometry by range requests as it is wanted.

Any server of static files will do that answers `Range: bytes=a-b` with 206 (RFC 9110, section 14). Nothing waits longer
than its time-out, however slowly bytes come.
"""

import http.client
import json
import time
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote, urlsplit

from ..errors import InputError
from .ranges import Range, ReadFailed
from .walk_folder import GEOMETRY, INDEX_FILES, WalkFolder, read_walk

TIMEOUT_S = 10.0
# Bytes taken at a time, between looks at the clock.
PIECE = 2**16
# A manifest is never larger; what is in it bounds the other files.
MANIFEST_MOST = 2**20
# An index that a walk would wait for and hold in memory.
INDEX_MOST = 2**30


def is_remote(place: str | Path) -> bool:
    """Whether a place is an address and not a folder."""
    return isinstance(place, str) and place.lower().startswith(("http://", "https://"))


class _Server:
    """Requests to one server over a connection that is kept."""

    def __init__(self, url: str, timeout_s: float) -> None:
        parts = urlsplit(url)
        try:
            port = parts.port
        except ValueError:
            port = 0
        if not parts.hostname or port == 0 or parts.query or parts.fragment:
            raise InputError(f"{url}: expected an address such as http://host:8000/house.walk")
        kind = http.client.HTTPSConnection if parts.scheme.lower() == "https" else http.client.HTTPConnection
        self._connection = kind(parts.hostname, port, timeout=timeout_s)
        self._base, self._timeout_s = quote(parts.path.rstrip("/"), safe="/%"), timeout_s

    def get(self, name: str, most: int, span: tuple[int, int] | None = None) -> bytes:
        """A file, or bytes span[0] to span[1] - 1 of it; at most so many.

        Raises:
            ReadFailed: anything else comes, or not in time.
        """
        until = time.monotonic() + self._timeout_s
        for again in (True, False):
            try:
                return self._asked(name, most, span, until)
            except (http.client.RemoteDisconnected, ConnectionError) as error:
                # A kept connection may have been closed since.
                self.close()
                if not again or time.monotonic() >= until:
                    raise ReadFailed(f"{name}: expected an answer, found {_words(error)}") from None
            except (TimeoutError, OSError, http.client.HTTPException, ValueError) as error:
                self.close()
                found = f"none in {self._timeout_s:g} s" if isinstance(error, TimeoutError) else _words(error)
                raise ReadFailed(f"{name}: expected an answer, found {found}") from None
            except ReadFailed:
                # What is left of the answer must not be taken for the next one.
                self.close()
                raise
        raise AssertionError("unreachable")

    def _asked(self, name: str, most: int, span: tuple[int, int] | None, until: float) -> bytes:
        headers = {} if span is None else {"Range": f"bytes={span[0]}-{span[1] - 1}"}
        # A kept connection still has what was left of the time of the request before.
        self._hurry(until)
        # Servers that compress would count other bytes.
        self._connection.request("GET", f"{self._base}/{name}", headers=headers | {"Accept-Encoding": "identity"})
        self._hurry(until)
        answer = self._connection.getresponse()
        try:
            return self._told(answer, name, most, span, until)
        except BaseException:
            # An answer holds on to the socket of a connection that is closed.
            answer.close()
            raise

    def _told(
        self, answer: http.client.HTTPResponse, name: str, most: int, span: tuple[int, int] | None, until: float
    ) -> bytes:
        """The bytes of an answer."""
        wanted = 200 if span is None else 206
        if answer.status != wanted:
            why = "; the server knows no ranges" if span is not None and answer.status == 200 else ""
            raise ReadFailed(f"{name}: expected status {wanted}, found {answer.status} {answer.reason}{why}")
        if span is not None:
            told = (answer.headers.get("Content-Range") or "").split("/")[0].strip()
            if told != f"bytes {span[0]}-{span[1] - 1}":
                raise ReadFailed(f"{name}: expected bytes {span[0]}-{span[1] - 1}, found {told or 'no range'}")
            most = span[1] - span[0]
        data = bytearray()
        while len(data) <= most:
            self._hurry(until)
            part = answer.read1(min(PIECE, most + 1 - len(data)))
            if not part:
                break
            data += part
        if answer.length == 0:
            # Only a read of nothing lets the connection go.
            answer.read()
        if len(data) > most or (span is not None and len(data) < most):
            raise ReadFailed(f"{name}: expected {most} bytes, found {'more' if len(data) > most else len(data)}")
        return bytes(data)

    def _hurry(self, until: float) -> None:
        """Let the next bytes take no longer than what is left of the time."""
        left = until - time.monotonic()
        if left <= 0:
            raise TimeoutError
        if self._connection.sock is not None:
            self._connection.sock.settimeout(left)

    def close(self) -> None:
        """Close the connection; the next request opens another one."""
        self._connection.close()


def fetch_index(url: str, folder: Path, timeout_s: float = TIMEOUT_S) -> tuple[WalkFolder, int]:
    """Fetch all of a display database but its geometry into a folder.

    Args:
        url: of the database, http or https.
        folder: empty, to write into.
        timeout_s: that no file may take longer than [s].

    Returns:
        The database, which has no geometry.bin, and how many bytes were fetched.

    Raises:
        InputError: no answer in time, or what came is no display database, cut short, or altered.
    """
    server = _Server(url, timeout_s)
    try:
        found = {"manifest.json": server.get("manifest.json", MANIFEST_MOST)}
        try:
            files = json.loads(found["manifest.json"])["files"]
            sizes = {name: int(files[name]["bytes"]) for name in INDEX_FILES}
        except (ValueError, TypeError, KeyError):
            raise InputError(f"{url}/manifest.json: expected that of a display database, found another") from None
        if not (min(sizes.values()) >= 0 and sum(sizes.values()) <= INDEX_MOST):
            raise InputError(f"{url}: expected an index of at most {INDEX_MOST:,} bytes, found {sum(sizes.values()):,}")
        for name, size in sizes.items():
            found[name] = server.get(name, size)
    except ReadFailed as error:
        raise InputError(f"{url}/{error}") from None
    finally:
        server.close()
    for name, data in found.items():
        (folder / name).write_bytes(data)
    try:
        return read_walk(folder, geometry=False), sum(map(len, found.values()))
    except InputError as error:
        raise InputError(str(error).replace(str(folder), url)) from None


class HttpSource:
    """Ranges of the geometry of a display database behind HTTP."""

    def __init__(self, url: str, timeout_s: float = TIMEOUT_S) -> None:
        """Nothing is asked yet.

        Raises:
            InputError: an address that is none.
        """
        self._server = _Server(url, timeout_s)

    def expect(self, ranges: Sequence[Range]) -> None:
        """Nothing: each is asked for when its turn comes."""

    def read(self, wanted: Range) -> bytes:
        """All bytes of a range.

        Raises:
            ReadFailed: they did not come in time, or others came.
        """
        return self._server.get(GEOMETRY, wanted.size, (wanted.first, wanted.first + wanted.size))

    def close(self) -> None:
        """Close the connection."""
        self._server.close()


def _words(error: Exception) -> str:
    """What an error says, on a line."""
    text = " ".join(str(error).split())
    return text or type(error).__name__
