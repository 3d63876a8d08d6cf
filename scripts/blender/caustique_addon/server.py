"""Talks to `caustique serve`, which keeps a scene and sends pictures while they render (docs/server.md).

A thread reads the answers, so that no call waits for the program.
"""

import collections
import json
import subprocess
import threading

import numpy

from .fault import Fault
from .process_input import ProcessInput

#: The version of the protocol that this module speaks.
PROTOCOL = 1
#: A picture: pixels (height, width, 4), top row first, and what the program says of it.
Picture = collections.namedtuple("Picture", "pixels about")

_MAX_LOG_LINES = 20  # of the program's messages, for the fault if it ends by itself


class Server:
    """A running `caustique serve`. `answered(answer)` and `shown(picture)` are called in the thread that reads."""

    def __init__(self, program, threads, answered, shown):
        self._answered, self._shown, self._next, self._log = answered, shown, 0, collections.deque(maxlen=_MAX_LOG_LINES)
        try:
            self._input = ProcessInput()
            self._process = self._input.start([program, "serve", *threads], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        except OSError as error:
            raise Fault(f"{program} does not run: {error.strerror}", "choose the program in the add-on's preferences") from error
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._read, self._read_log)]
        for thread in self._threads:
            thread.start()

    def send(self, command, **fields):
        """Send a command. Returns its number, which answers repeat as `id`, or None if the program has ended."""
        self._next += 1
        line = json.dumps({"command": command, "id": self._next, **fields})
        try:
            self._input.send(line.encode() + b"\n")
        except OSError:  # it has ended, or was closed
            return None
        return self._next

    def is_running(self):
        """Whether the program is running."""
        return self._process.poll() is None

    def close(self):
        """End the program. It ends by itself when its input is closed, so nothing waits here."""
        self._input.close()
        threading.Thread(target=self._end, daemon=True).start()

    def _end(self):
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _read(self):
        out = self._process.stdout
        with out:
            for line in out:
                answer = json.loads(line)
                if answer["event"] == "ready" and answer["protocol"] != PROTOCOL:
                    answer = {"event": "error", "message": f"the program speaks version {answer['protocol']} of the protocol",
                              "hint": "update the program and the add-on together"}
                if answer["event"] != "picture":
                    self._answered(answer)
                    continue
                data = out.read(answer["bytes"])
                if len(data) == answer["bytes"]:
                    size = answer["height"], answer["width"], 4
                    self._shown(Picture(numpy.frombuffer(data, "<f4").reshape(size), answer))
        self._answered({"event": "ended", "message": (self._log or ["the program has ended"])[-1]})

    def _read_log(self):
        with self._process.stderr as messages:
            for line in messages:
                self._log.append(line.decode(errors="replace").rstrip())
