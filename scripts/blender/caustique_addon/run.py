"""A running program: its progress, how to stop it, and its result."""

import json
import subprocess
import threading
import time

from . import fault, processes, wording

_POLL_SECONDS = 0.05  # between two looks for the saved state
_INTERRUPTED = 130  # exit code of a program that was interrupted and has written its picture
_SAVE_SECONDS = 20.0  # from the interrupt to killing the program, which saves its state meanwhile
_GRACE_SECONDS = 1.0  # from the interrupt to ending the program, whose last picture is on the screen


class Run:
    """A process of the program: `command` (a list) in `folder`. `progress`: the last progress object, or None."""

    def __init__(self, command, folder):
        self.progress, self.warnings = None, []
        self._rest = []
        self._interrupted_at = None  # time of the interrupt
        self._ended = False  # by `stop`, after the grace period
        self._process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.PIPE, text=True, errors="replace", **processes.OWN_GROUP)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self):
        with self._process.stderr as messages:
            for line in map(str.rstrip, messages):
                if line.startswith("{"):
                    self._take(json.loads(line))
                elif line:
                    self._rest.append(wording.of_interface(line))

    def _take(self, event):
        """Keep what an event of `--progress json` says."""
        kind = event.get("event", "progress")
        if kind == "progress":
            self.progress = event
        elif kind == "warning":
            self.warnings.append(wording.of_interface(event["message"]))
        elif kind in ("error", "note"):
            self._rest.append(wording.of_interface(event["message"]))
            if event.get("hint"):
                self._rest.append(wording.of_interface(f"hint: {event['hint']}"))

    @property
    def process_id(self):
        """The number of the process."""
        return self._process.pid

    def is_running(self):
        """Whether the program is running."""
        return not self._ended and self._process.poll() is None

    def stop(self, is_saved=lambda: True):
        """Interrupt the program, which then saves its state and writes its picture; leave it after a grace period, and kill it
        when `is_saved()` holds. Call this repeatedly."""
        now = time.monotonic()
        if self._interrupted_at is None:
            self._interrupted_at = now
            self._process.send_signal(processes.INTERRUPT)
        elif now - self._interrupted_at > _GRACE_SECONDS:
            self._ended = True
            threading.Thread(target=self._end, args=(is_saved,), daemon=True).start()

    def _end(self, is_saved):
        """Kill the program when it has saved its state, while the user goes on."""
        end = self._interrupted_at + _SAVE_SECONDS
        while self._process.poll() is None and not is_saved() and time.monotonic() < end:
            time.sleep(_POLL_SECONDS)
        self._process.kill()
        self._process.wait()

    def kill(self):
        """Kill the program if it is running and has not been left to save its state."""
        if not self._ended:
            self._process.kill()
            self._process.wait()
            self._listener.join()

    def finish(self):
        """Wait for the end of the program. Raises a Fault if it failed by itself."""
        if self._ended:
            return
        code = self._process.wait()
        self._listener.join()  # it may not have read the last lines yet
        if code not in (0, _INTERRUPTED):
            raise fault.fault_from_program(self._rest, code)


def fraction(progress):
    """The completed share of a render, 0 to 1, from its progress."""
    if progress["iterations"]:
        by_count = progress["iteration"] / progress["iterations"]
    else:
        by_count = 0.0
    whole = progress["seconds"] + (progress["remaining"] or 0.0)
    by_time = progress["seconds"] / whole if progress["remaining"] is not None and whole > 0 else 0.0
    return min(max(by_count, by_time), 1.0)


def sentence(progress):
    """The render's progress as a sentence: its iteration, error in per cent if known, and time left if known."""
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
    """Text for a duration given in seconds, rounded to seconds, minutes or hours."""
    minutes, hours = seconds / 60, seconds / 3600
    if hours >= 2:
        return f"{hours:.0f} h"
    return f"{minutes:.0f} min" if minutes >= 2 else f"{seconds:.0f} s"
