"""Runs work in a child process with limits, which ends with the calling program."""

import os
import resource
import select
import shutil
import signal
import sys

from faults import Fault


def run_guarded(work, folder, seconds, memory):
    """Run `work` in a child process with at most `seconds` and `memory` bytes. Returns its exit code.

    The calling program keeps its end of standard input open. When it closes, the program has ended: kill the child and
    remove `folder`.
    """
    child = os.fork()
    if child == 0:
        if memory:
            resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
        code = work()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    done = os.pidfd_open(child)
    poll = select.poll()
    poll.register(done, select.POLLIN)
    poll.register(sys.stdin.fileno(), select.POLLIN)
    events = [descriptor for descriptor, _ in poll.poll(seconds * 1000)]
    if done not in events:
        os.kill(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if done in events:
        if code < 0:
            left = f" ({memory >> 20} MiB are left for it)" if memory else ""
            raise Fault("", f"the conversion was ended by {signal.Signals(-code).name}{left}",
                        "use a simpler stage, or a machine with more memory")
        return code
    if events:
        # Remove only a folder that the program made for this conversion.
        if os.path.basename(folder).startswith("caustique-usd-"):
            shutil.rmtree(folder, ignore_errors=True)
        return 1
    raise Fault("", f"the conversion takes longer than {seconds} s",
                "use a simpler stage, or set CAUSTIQUE_USD_SECONDS to more")
