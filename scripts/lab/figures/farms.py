"""Farms whose shards are killed during the render: compares the channels of the picture with those of one render.

Slurm: two nodes on this machine; the render of one shard is killed, and the job of another one is requeued. Open Job
Description: the render of a shard is killed, and the command repeated. Ray: the worker of a shard is killed. Each killed
shard continues from its checkpoint.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import OpenEXR
from ..cache import BIN
from ..options import options
from ..record import ROOT, record

OUT = ROOT / "out" / "farms"
FARM = ROOT / "scripts" / "farm"
SCENE = ROOT / "scenes" / "torus.glb"
ARGUMENTS = {"engines": ["slurm", "openjd", "ray"], "shards": 4, "width": 48, "iterations": 2400}
PYTHON = ROOT / ".venv-farm" / "bin" / "python"
TIMEOUT = 400  # seconds


def render_options():
    """The options that all renders share."""
    size = ["--width", str(options.width), "--iterations", str(options.iterations)]
    return [*size, "--method", "vcm", "--checkpoint-every", "0.2"]


def channels(path):
    """The bytes of each channel of an EXR file, by name."""
    found = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: channel.pixels.tobytes() for name, channel in found.items()}


def wait_for(function, seconds=TIMEOUT):
    """Calls a function until its result is true; returns the result."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = function()
        if found:
            return found
        time.sleep(0.05)
    raise TimeoutError(f"{function.__name__}: nothing after {seconds:g} s")


def render_of(output, shard):
    """The process that renders a shard and has saved a checkpoint, or 0."""
    part = output.with_suffix(".shards") / f"part-{shard}.exr"
    if not Path(f"{part}.checkpoint").exists():
        return 0
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            words = (process / "cmdline").read_bytes().split(b"\0")
            if words[0].endswith(b"caustique") and str(part).encode() in words:
                return int(process.name)
    return 0


def parent(process):
    """The process id of a process's parent."""
    return int(re.search(r"PPid:\s*(\d+)", Path(f"/proc/{process}/status").read_text())[1])


def kill_render(output, shard):
    """Kills the render of a shard as soon as it has saved a checkpoint."""
    os.kill(wait_for(lambda: render_of(output, shard)), signal.SIGKILL)


def wait_for_resume(log, shard):
    """Waits until a log reports that a shard continues from its checkpoint."""
    message = f"shard {shard}/{options.shards} continues from"
    wait_for(lambda: log.exists() and message in log.read_text(encoding="utf-8"))


def slurm(output):
    """Renders by Slurm: the render of one shard is killed, and the running job of another one is requeued."""
    environment = {**os.environ, "SLURM_CONF": str(ROOT / "out" / "slurm" / "slurm.conf")}

    def query(*words):
        done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment)
        return done.stdout.split()

    subprocess.run([FARM / "slurm_here.sh", "start"], check=True, stdout=subprocess.DEVNULL)
    try:
        command = [FARM / "slurm.sh", SCENE, "-o", output, "--shards", str(options.shards), "--wait", *render_options()]
        run = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        array = re.search(r"shards (\d+)", run.stdout.readline())[1]
        kill_render(output, 0)
        wait_for(lambda: render_of(output, 1))
        query("scontrol", "requeue", f"{array}_1")

        for shard in (0, 1):
            job = f"{array}_{shard}"
            # Slurm would wait two minutes before it starts a requeued job.
            wait_for(lambda: job in query("squeue", "-h", "-r", "-t", "PD", "-o", "%i"))
            query("scontrol", "update", f"JobId={job}", "StartTime=now")
            wait_for_resume(output.with_suffix(".shards") / f"{shard}.log", shard)
        assert run.wait() == 0, "slurm.sh --wait failed"
    finally:
        subprocess.run([FARM / "slurm_here.sh", "stop"], check=True)
    return {"engine": "Slurm " + query("sinfo", "-V")[1], "killed": "a render, and a job queued again"}


def openjd(output):
    """Renders by Open Job Description: a kill ends the run, and the repeated command continues it."""
    program = PYTHON.with_name("openjd")
    parameters = [
        f"Scene={SCENE}",
        f"Output={output}",
        f"Shards={options.shards}",
        f"Options={' '.join(render_options())}",
    ]
    command = [program, "run", FARM / "template.yaml", *(word for one in parameters for word in ("-p", one))]
    with (OUT / "openjd.log").open("w", encoding="utf-8") as log:
        run = subprocess.Popen(command, stdout=log, stderr=log)
        kill_render(output, 1)
        assert run.wait() != 0, "a task was killed, but its job reports success"
        subprocess.run(command, check=True, stdout=log, stderr=log)
    wait_for_resume(OUT / "openjd.log", 1)
    return {"engine": f"Open Job Description, openjd-cli {version('openjd-cli')}", "killed": "a render"}


def ray(output):
    """Renders by Ray: a worker is killed, and its render with it."""
    command = [PYTHON, FARM / "ray_render.py", SCENE, "-o", output, "--shards", str(options.shards)]
    command += ["--partial", "0.5", *render_options()]
    with (OUT / "ray.log").open("w", encoding="utf-8") as log:
        run = subprocess.Popen(command, stdout=log, stderr=log)
        render = wait_for(lambda: render_of(output, 0))
        os.kill(parent(parent(render)), signal.SIGKILL)
        wait_for(lambda: not Path(f"/proc/{render}").exists(), 10)
        wait_for_resume(output.with_suffix(".shards") / "0.log", 0)
        wait_for(lambda: output.with_suffix(".partial.exr").exists() or run.poll() is not None)
        partial = output.with_suffix(".partial.exr").exists()
        assert run.wait() == 0, (OUT / "ray.log").read_text(encoding="utf-8")
    assert partial, "there was no preview before the final picture"
    return {"engine": f"Ray {version('ray')}", "killed": "a worker"}


def version(package):
    """The version of a package in .venv-farm."""
    words = [PYTHON, "-c", f"import importlib.metadata as m; print(m.version('{package}'))"]
    return subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def main():
    subprocess.run([ROOT / "scripts" / "setup.sh", "farm"], check=True)
    os.environ["CAUSTIQUE_BIN"] = str(Path(BIN).resolve())
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    single = OUT / "single.exr"
    subprocess.run(
        [BIN, "render", SCENE, "-o", single, *render_options(), "--progress", "none"],
        check=True,
        stderr=subprocess.DEVNULL,
    )
    rows = []
    for engine in options.engines:
        output, start = OUT / f"{engine}.exr", time.monotonic()
        found = {"slurm": slurm, "openjd": openjd, "ray": ray}[engine](output)
        one, other = channels(single), channels(output)
        assert one.keys() == other.keys(), sorted(one.keys() ^ other.keys())
        same = sum(one[name] == other[name] for name in one)
        rows.append(
            {
                **found,
                "shards": options.shards,
                "same": same,
                "channels": len(one),
                "seconds": round(time.monotonic() - start, 1),
            }
        )
        print(rows[-1], flush=True)
        assert same == len(one), f"{engine}: the bytes differ"
    record("farms", {"width": options.width, "iterations": options.iterations, "rows": rows})
