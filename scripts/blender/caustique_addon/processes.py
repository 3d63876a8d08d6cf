"""Processes of the program, which differ between Windows and other systems."""

import os
import signal
import subprocess

if os.name == "nt":
    #: Options of `subprocess.Popen` for a process group of its own, else a Ctrl-C in Blender's terminal would end it.
    OWN_GROUP = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    #: The signal that asks the program to save its state and write its picture. Groups of their own ignore Ctrl-C.
    INTERRUPT = signal.CTRL_BREAK_EVENT
else:
    OWN_GROUP = {"start_new_session": True}
    INTERRUPT = signal.SIGINT
