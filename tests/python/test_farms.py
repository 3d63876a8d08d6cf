"""Tests the farm scripts, the submitted jobs and the job template. Slurm and Ray do not run."""

import contextlib
import os
import signal
import subprocess
import time
import unittest

import OpenEXR
import support

FARM = support.ROOT / "scripts" / "farm"
OPTIONS = ["--width", "24", "--method", "path"]


def script(name, *words, check=0, env=None):
    """Run a farm script. An AssertionError shows its output if the exit code is not `check`."""
    variables = {**os.environ, "CAUSTIQUE_BIN": str(support.binary()), **(env or {})}
    done = subprocess.run([FARM / name, *map(str, words)], capture_output=True, text=True, env=variables, check=False)
    if check is not None and done.returncode != check:
        raise AssertionError(f"{name}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done


def channels(path):
    """The channels of an EXR, {name: bytes}."""
    found = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: channel.pixels.tobytes() for name, channel in found.items()}


class Tasks(support.Scratch):
    def whole(self, *options):
        """The channels of an undivided render."""
        file = self.dir / "whole.exr"
        support.run(["render", support.scene("blocks"), "-o", file, *OPTIONS, *options], check=0)
        return channels(file)

    def test_shards_merge_to_the_render_and_are_removed(self):
        out = self.dir / "a.exr"
        for index in (2, 0, 1):
            script("shard.sh", support.scene("blocks"), out, f"{index}/3", "--iterations", 6, *OPTIONS)
            if index == 0:
                self.assertIn("2 of 3 shards are merged", script("merge.sh", out, "--partial").stderr)
                self.assertEqual(len(list((self.dir / "a.shards").glob("shard-?.exr"))), 2)
        for words in (["--help"], ["-o", self.dir / "other.exr"]):
            self.assertIn("is not written", script("merge.sh", out, *words).stderr)
            self.assertEqual(len(list((self.dir / "a.shards").glob("shard-?.exr"))), 3)
        script("merge.sh", out, "--png", self.dir / "a.png")
        self.assertEqual(channels(out), self.whole("--iterations", 6))
        self.assertTrue((self.dir / "a.png").exists())
        self.assertFalse((self.dir / "a.shards").exists())

    def test_a_shard_alone_is_the_picture(self):
        out = self.dir / "a.exr"
        script("shard.sh", support.scene("blocks"), out, "0/1", "--iterations", 6, *OPTIONS, "--png", self.dir / "a.png")
        script("merge.sh", out)
        self.assertEqual(channels(out), self.whole("--iterations", 6))
        self.assertEqual(sorted(file.name for file in self.dir.iterdir()), ["a.exr", "a.png", "whole.exr"])

    def test_killing_a_task_kills_its_render_and_the_next_task_continues(self):
        out, iterations = self.dir / "a.exr", 3000
        words = [support.scene("blocks"), out, "0/2", "--iterations", iterations, *OPTIONS, "--checkpoint-every", "0.01"]
        variables = {**os.environ, "CAUSTIQUE_BIN": str(support.binary())}
        task = subprocess.Popen([FARM / "shard.sh", *map(str, words)], env=variables, stderr=subprocess.DEVNULL)
        state = self.dir / "a.shards" / "part-0.exr.checkpoint"
        self.wait(state.exists)
        children = subprocess.run(["pgrep", "-P", str(task.pid)], capture_output=True, text=True, check=True).stdout.split()
        task.send_signal(signal.SIGKILL)
        task.wait()
        for child in children:
            self.wait(lambda child=child: not self.alive(child))
        said = script("shard.sh", *words).stderr
        self.assertIn("shard 0/2 continues from", said)
        script("shard.sh", *words[:2], "1/2", *words[3:])
        script("merge.sh", out)
        self.assertEqual(channels(out), self.whole("--iterations", iterations))

    def test_a_terminated_task_saves_its_checkpoint(self):
        words = [support.scene("blocks"), self.dir / "a.exr", "0/1", "--iterations", 10**6, *OPTIONS]
        variables = {**os.environ, "CAUSTIQUE_BIN": str(support.binary())}
        task = subprocess.Popen(
            [FARM / "shard.sh", *map(str, words), "--progress", "json"], env=variables, stderr=subprocess.PIPE, text=True
        )
        next(line for line in task.stderr if '"iteration":' in line)
        task.terminate()
        task.stderr.read()
        task.stderr.close()
        self.assertEqual(task.wait(), 130)
        self.assertTrue((self.dir / "a.shards" / "part-0.exr.checkpoint").exists())
        self.assertFalse((self.dir / "a.shards" / "shard-0.exr").exists())

    def test_shards_of_another_render_are_refused(self):
        words = [support.scene("blocks"), self.dir / "a.exr", "0/2", "--iterations", 2, *OPTIONS]
        script("shard.sh", *words)
        for other in ([*words, "--seed", 1], [*words[:2], "0/3", *words[3:]], [support.scene("torus"), *words[1:]]):
            self.assertIn("another scene", script("shard.sh", *other, check=2).stderr)
        self.assertIn("shard 1 of 2 is missing", script("merge.sh", self.dir / "a.exr", check=2).stderr)
        self.assertTrue((self.dir / "a.shards" / "shard-0.exr").exists())

    def wait(self, what):
        """Wait until a condition holds."""
        end = time.monotonic() + 60
        while not what():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)

    @staticmethod
    def alive(process):
        """Whether a process is running."""
        with contextlib.suppress(OSError), open(f"/proc/{process}/stat", encoding="utf-8") as stat:
            return stat.read().rsplit(")", 1)[1].split()[0] != "Z"
        return False


class Slurm(support.Scratch):
    def submit(self, *words, check=0):
        return script("slurm.sh", support.scene("blocks"), "-o", self.dir / "a.##.exr", "--dry-run", *words, check=check)

    def test_every_frame_has_an_array_and_a_merge_that_waits_for_it(self):
        done = self.submit("--shards", 4, "--frames", "8-10,2", "--iterations", 8, "--", "--png", "look ##.png")
        self.assertEqual(done.stdout, "frame 8: shards 0, merge 0\nframe 10: shards 0, merge 0\n")
        jobs = done.stderr.split("# sbatch ")[1:]
        self.assertEqual(len(jobs), 4)
        self.assertIn("--array=0-3", jobs[0])
        self.assertIn("a.10.shards/%a.log", jobs[2])
        self.assertIn("--frame 10 --threads 1 --iterations 8", jobs[2])
        self.assertIn("--dependency=afterany:0", jobs[3])
        self.assertIn("--frame 10 --threads 1 --png look\\ ##.png", jobs[3])
        for job in jobs:
            subprocess.run(["bash", "-n"], input=job.split("\n", 1)[1], text=True, check=True)

    def test_meaningless_options_are_refused(self):
        for words, fault in (
            (["--shards", "0"], "'0' is no count"),
            (["--shards", "2", "--frames", "3"], None),
            (["--shards", "2", "--frames", "b"], "--frames: 'b'"),
            (["--shards", "2", "--frames", "10-5"], "ends before it begins"),
            (["--shards", "2", "--png", "a.png"], "no shard is a picture"),
            (["--shards", "2", "--layers=all"], "no shard is a picture"),
            (["--shards", "2", "--resume", "a"], "given by the farm"),
        ):
            with self.subTest(words):
                done = self.submit(*words, check=2 if fault else 0)
                self.assertIn(fault or "", done.stderr)


class OpenJobDescription(support.Scratch):
    def start(self, **given):
        """The job of a small picture with these parameters, and a session that records its progress in `seen`."""
        from openjd.model import create_job, decode_job_template, document_string_to_object, DocumentType
        from openjd.model import preprocess_job_parameters
        from openjd.sessions import Session

        text = (FARM / "template.yaml").read_text(encoding="utf-8")
        document = document_string_to_object(document=text, document_type=DocumentType.YAML)
        template = decode_job_template(template=document)
        self.out, self.seen = self.dir / "it's a.exr", []
        given = {"Scene": str(support.scene("blocks")), "Output": str(self.out), "Caustique": str(support.binary()), **given}
        values = preprocess_job_parameters(
            job_template=template, job_parameter_values=given, job_template_dir=FARM, current_working_dir=self.dir
        )
        session = self.enterContext(Session(
            session_id="test", job_parameter_values=values,
            callback=lambda _, status: self.seen.append((status.progress, status.status_message))
        ))
        return create_job(job_template=template, job_parameter_values=values), session

    def test_the_template_runs_and_its_progress_is_understood(self):
        job, session = self.start(Shards="2", Options="--iterations 8 --width 24")
        for step, tasks in zip(job.steps, ((1, 2), (None,))):
            for shard in tasks:
                self.run_task(session, step, shard)
        self.assertTrue(self.out.exists())
        self.assertEqual(sorted({progress for progress, _ in self.seen if progress is not None}), [25, 50, 75, 100])
        self.assertTrue(any("iteration 2 of 4" in (message or "") for _, message in self.seen))

    def test_options_are_words_and_nothing_is_evaluated(self):
        png = self.dir / "a \"b\" $HOME `id` *.png"
        text = f"--iterations 2 --width 8 --png '{png}' --method path"
        job, session = self.start(Options=text)
        self.run_task(session, job.steps[0], 1)
        self.assertTrue(png.exists())
        trap = self.dir / "trap"
        for wrong in (f"$(touch {trap})", f"`touch {trap}`", f"; touch {trap}", f"&& touch {trap}", f"a); touch {trap}; (b",
                      "'never closed"):
            job, session = self.start(Options=f"--iterations 2 --width 8 {wrong}", Output=str(self.dir / "other.exr"))
            self.run_task(session, job.steps[0], 1, "FAILED")
            self.assertFalse(trap.exists(), wrong)

    def test_relative_paths_start_in_a_known_folder(self):
        """In the parameter Folder, which the submission resolves, or in the output's folder."""
        (self.dir / "elsewhere").mkdir()
        for number, (given, folder) in enumerate([({}, self.dir), ({"Folder": "elsewhere"}, self.dir / "elsewhere")]):
            job, session = self.start(
                Output=f"{number}.exr", MergeOptions="--png look.png", Options="--iterations 2 --width 8 --method path",
                **given,
            )
            self.run_task(session, job.steps[0], 1)
            self.assertTrue((folder / "look.png").exists())
            self.assertTrue((self.dir / f"{number}.exr").exists())

    def run_task(self, session, step, shard, end="SUCCESS"):
        """Run a task, and assert that it ends with `end`."""
        from openjd.model import ParameterValue, ParameterValueType
        from openjd.sessions import ActionState, SessionState

        of = {"Frame": ParameterValue(type=ParameterValueType.INT, value="0")}
        of |= {"Shard": ParameterValue(type=ParameterValueType.INT, value=str(shard))} if shard else {}
        session.run_task(step_script=step.script, task_parameter_values=of)
        while session.state == SessionState.RUNNING:
            time.sleep(0.01)
        self.assertEqual(session.action_status.state, ActionState[end])


if __name__ == "__main__":
    unittest.main()
