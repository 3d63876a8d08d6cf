"""What processes take."""

import os
import subprocess
import time

from .cache import Failed


def spent(command):
    """Runs a program to its end; seconds, core-seconds and peak memory in MiB, of it alone."""
    start = time.perf_counter()
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    # Popen is not to wait for what has been waited for.
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise Failed(" ".join(said.splitlines()[-3:]) or f"exit code {process.returncode}")
    return {
        "seconds": round(seconds, 2),
        "core_seconds": round(usage.ru_utime + usage.ru_stime, 2),
        "peak_mib": round(usage.ru_maxrss / 1024),
    }
