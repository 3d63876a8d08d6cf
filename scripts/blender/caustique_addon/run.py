"""The program at work: what it has said so far, how to stop it, and how it ended."""

import json
import signal
import subprocess
import threading
import time

from . import fault, handoff

_INTERRUPTED = 130  # exit code of a program that was asked to stop and has written what was done
_LEAST_GRACE = 20  # seconds: finishing a large picture takes some


class Run:
    """`command` (a list) as a process in a folder. `progress` is its last line of progress, or None."""

    def __init__(self, command, folder):
        self.progress, self.warnings = None, []
        self._rest = []
        self._asked = None  # when it was asked to stop
        self._longest = 0.0  # seconds, of all iterations so far
        # In a group of its own, or a Ctrl-C at the terminal would reach it twice: from there and from us.
        self._process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.PIPE, text=True, errors="replace", start_new_session=True)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self):
        with self._process.stderr as told:
            for line in map(str.rstrip, told):
                if line.startswith("{"):
                    self._heard(json.loads(line))
                elif line.startswith("warning: "):
                    self.warnings.append(handoff.without_file(line[len("warning: "):]))
                elif line:
                    self._rest.append(handoff.without_file(line))

    def _heard(self, progress):
        before = self.progress["seconds"] if self.progress else 0.0
        self._longest = max(self._longest, progress["seconds"] - before)
        self.progress = progress

    def working(self):
        """Whether it still runs."""
        return self._process.poll() is None

    def stop(self):
        """Ask it to finish the iteration and write what there is; insist where that takes long. Call it repeatedly."""
        now = time.monotonic()
        if self._asked is None:
            self._asked = now
            self._process.send_signal(signal.SIGINT)
        elif now - self._asked > _LEAST_GRACE + 2 * self._longest:
            self._process.send_signal(signal.SIGINT)
            self._asked = now

    def kill(self):
        """End it at once, if it still runs."""
        self._process.kill()
        self._process.wait()
        self._listener.join()

    def finish(self):
        """Raise a Fault if it has failed."""
        code = self._process.wait()
        self._listener.join()  # it may not have heard the last words yet
        if code not in (0, _INTERRUPTED):
            raise fault.fault_from_program(self._rest, code)


def fraction(progress):
    """How much of a render is done, 0 to 1, by its line of progress."""
    if progress["iterations"]:
        by_count = progress["iteration"] / progress["iterations"]
    else:
        by_count = 0.0
    whole = progress["seconds"] + (progress["remaining"] or 0.0)
    by_time = progress["seconds"] / whole if progress["remaining"] is not None and whole > 0 else 0.0
    return min(max(by_count, by_time), 1.0)


def sentence(progress):
    """A line of progress in words."""
    if progress["iteration"] == progress["iterations"]:
        return "Finishing"
    text = f"Iteration {progress['iteration']}"
    if progress["iterations"]:
        text += f" of {progress['iterations']}"
    if progress["error"] is not None:
        text += f", error {100 * progress['error']:.2g} %"
    if progress["remaining"] is not None:
        text += f", {duration(progress['remaining'])} left"
    return text


def duration(seconds):
    """Seconds as people say them."""
    minutes, hours = seconds / 60, seconds / 3600
    if hours >= 2:
        return f"{hours:.0f} h"
    return f"{minutes:.0f} min" if minutes >= 2 else f"{seconds:.0f} s"
