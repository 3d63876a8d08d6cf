"""Time and memory of a process."""

import os
import subprocess
import time

from .cache import Failed


def measure_process(command):
    """Runs a program to its end; returns its seconds, core-seconds and peak memory in MiB, without child processes."""
    start = time.perf_counter()
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    messages = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    # wait4 has reaped the process, so Popen must not wait for it.
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise Failed(" ".join(messages.splitlines()[-3:]) or f"exit code {process.returncode}")
    return {
        "seconds": round(seconds, 2),
        "core_seconds": round(usage.ru_utime + usage.ru_stime, 2),
        "peak_mib": round(usage.ru_maxrss / 1024),
    }
