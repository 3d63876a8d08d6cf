"""Runs the program that the package of `scripts/package.sh` contains: `caustique ...` or `python -m caustique ...`."""

import importlib.util
import os
import signal
import subprocess
import sys
from pathlib import Path

PROGRAM = Path(__file__).resolve().parent / "bin" / ("caustique.exe" if os.name == "nt" else "caustique")


def main():
    """Run the program with the same arguments, in place of this process where the system can replace one."""
    if not PROGRAM.is_file():
        sys.exit(f"caustique: error: {PROGRAM}: this package does not contain the program\n"
                 "hint: install a wheel that 'scripts/package.sh' has made, or build the program with 'cargo build --release'")
    if not os.access(PROGRAM, os.X_OK):  # Some installers drop the permission.
        PROGRAM.chmod(0o755)
    if importlib.util.find_spec("pxr") is not None:  # This Python reads USD stages.
        os.environ.setdefault("CAUSTIQUE_USD_PYTHON", sys.executable)
    if os.name == "nt":
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # The program answers Ctrl-C.
        sys.exit(subprocess.call([PROGRAM, *sys.argv[1:]]))
    os.execv(PROGRAM, ["caustique", *sys.argv[1:]])


if __name__ == "__main__":
    main()
