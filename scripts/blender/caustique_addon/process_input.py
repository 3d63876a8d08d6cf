"""The standard input of a process.

It is a socket and not a pipe: a write to the pipe of a process that has ended raises SIGPIPE, which ends Blender.
"""

import socket
import subprocess


class ProcessInput:
    """Sends data to a process, which `start` starts."""

    def __init__(self):
        self._here, self._there = socket.socketpair()

    def start(self, command, **options):
        """Start a process that reads this input. Returns the `subprocess.Popen`."""
        # In a process group of its own, else a Ctrl-C in Blender's terminal would end it.
        with self._there:
            return subprocess.Popen(command, stdin=self._there, start_new_session=True, **options)

    def send(self, data):
        """Send bytes. Raises OSError if the process has ended or the input is closed."""
        self._here.sendall(data, socket.MSG_NOSIGNAL)

    def close(self):
        """End the input."""
        self._here.close()
