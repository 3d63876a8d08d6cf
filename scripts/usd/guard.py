"""Runs a command in a child process with limits, which ends with the calling program."""

import os
import queue
import shutil
import signal
import subprocess
import sys
import threading

from faults import Fault

try:
    import resource
except ModuleNotFoundError:  # Windows
    resource = None

_CALLER_ENDED = "the calling program has ended"


def limit_memory(memory):
    """Limit this process to `memory` bytes of data, where the system can; 0 is no limit."""
    if memory and resource is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))


def run_guarded(command, folder, seconds, memory):
    """Run `command`, which limits itself to `memory` bytes, for at most `seconds`. Returns its exit code.

    The calling program keeps its end of standard input open. When it closes, the program has ended: kill the child and
    remove `folder`.
    """
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    events = queue.SimpleQueue()

    def watch_caller():
        os.read(sys.stdin.fileno(), 1)  # `sys.stdin` has a lock that Python wants when it exits
        events.put(_CALLER_ENDED)

    for watch in (watch_caller, lambda: events.put(child.wait())):
        threading.Thread(target=watch, daemon=True).start()
    try:
        event = events.get(timeout=seconds)
    except queue.Empty:
        child.kill()
        raise Fault("", f"the conversion takes longer than {seconds} s",
                    "use a simpler stage, or set CAUSTIQUE_USD_SECONDS to more") from None
    if event == _CALLER_ENDED:
        child.kill()
        # Remove only a folder that the program made for this conversion.
        if os.path.basename(folder).startswith("caustique-usd-"):
            shutil.rmtree(folder, ignore_errors=True)
        return 1
    if event < 0:
        left = f" ({memory >> 20} MiB are left for it)" if memory else ""
        raise Fault("", f"the conversion was ended by {signal.Signals(-event).name}{left}",
                    "use a simpler stage, or a machine with more memory")
    return event
