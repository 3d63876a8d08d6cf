"""Runs unittest's command line and prints the time of each test that takes a second or more.

`tests/test_times.awk` reads these lines.
"""

import os
import signal
import sys
import time
import unittest


class TimedResult(unittest.TextTestResult):
    """A result that prints the times of slow tests."""

    def startTest(self, test):
        self.started = time.monotonic()
        super().startTest(test)

    def stopTest(self, test):
        super().stopTest(test)
        seconds = time.monotonic() - self.started
        if seconds >= 1:
            print(f"\n{test.id()}: {seconds:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    # Background jobs of a shell ignore SIGINT, and so would the programs that tests start and interrupt.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    runner = unittest.TextTestRunner(resultclass=TimedResult)
    done = unittest.main(module=None, testRunner=runner, exit=False)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(not done.result.wasSuccessful())  # Blender as a module may crash while it shuts down
