"""The standard input of a process.

It is a socket and not a pipe where writing to the pipe of a process that has ended raises SIGPIPE, which ends Blender.
"""

import os
import socket
import subprocess
import sys

from . import processes

#: No SIGPIPE: a flag of each call on Linux, and an option of the socket on macOS (SO_NOSIGPIPE), which Python does not name.
_FLAGS = getattr(socket, "MSG_NOSIGNAL", 0)
_NO_SIGNAL = 0x1022


class ProcessInput:
    """Sends data to a process, which `start` starts."""

    def __init__(self):
        self._pipe = None  # on Windows, which has no SIGPIPE, and no sockets as files
        if os.name != "nt":
            self._here, self._there = socket.socketpair()
            if sys.platform == "darwin":
                self._here.setsockopt(socket.SOL_SOCKET, _NO_SIGNAL, 1)

    def start(self, command, **options):
        """Start a process that reads this input. Returns the `subprocess.Popen`."""
        if os.name == "nt":
            process = subprocess.Popen(command, stdin=subprocess.PIPE, bufsize=0, **processes.OWN_GROUP, **options)
            self._pipe = process.stdin
            return process
        with self._there:
            return subprocess.Popen(command, stdin=self._there, **processes.OWN_GROUP, **options)

    def send(self, data):
        """Send bytes. Raises OSError if the process has ended or the input is closed."""
        if os.name == "nt":
            self._pipe.write(data)
        else:
            self._here.sendall(data, _FLAGS)

    def close(self):
        """End the input."""
        (self._pipe if os.name == "nt" else self._here).close()
