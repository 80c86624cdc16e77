"""The tasks of a fleet on a real engine, with attempts that are killed: every session once, with the bytes of a batch.

    python tests/readers/engines.py target/release/posegrid --folder target/engines [--sessions 12] [--engine dask --engine slurm]
    python tests/readers/engines.py target/release/posegrid --folder target/engines --sessions 300 --hard --engine dask
    python tests/readers/engines.py target/release/posegrid --folder target/engines --sessions 60 --overhead --engine dask --engine spark

Sessions of three robots are simulated; one is damaged so that it has no result. A batch of `posegrid run` works off one lake, each engine
another one: three in ten first attempts are killed under way, and one in ten is held for three seconds. A batch takes it from there, with
nothing left to do but the damaged session, and removes what the killed ones left. Then both lakes have the same files, byte for byte, and
the engine told each session once.

`--hard` has sessions and lake on an S3 server, and a cluster of two worker processes on which two scripts do the same work at once; a worker
is killed, and later the scheduler, which is started anew. `--overhead` has no faults, and compares the engine's time with a batch's.
`slurm` is the script of an array's jobs, run by a stand-in for Slurm that starts two at once and those again that ask for it.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

import clusters
import lakes

HERE = pathlib.Path(__file__).resolve().parents[2]
ROBOTS = ("kr-1", "kr-2", "kr-3")

# Kills three in ten first attempts while they work, and holds one in ten; which ones follows from robot and session alone.
KILLER = """#!/usr/bin/env python3
import hashlib, json, os, pathlib, signal, subprocess, sys, time
posegrid, seen = sys.argv[0] + ".real", pathlib.Path(sys.argv[0] + ".seen")
if sys.argv[1] != "task":
    os.execv(posegrid, [posegrid, *sys.argv[1:]])
line = sys.stdin.read()
task = json.loads(line)
name = task["robot"] + "_" + task["session"]
seen.mkdir(exist_ok=True)
first = not (seen / name).exists()
(seen / name).touch()
child = subprocess.Popen([posegrid, *sys.argv[1:]], stdin=subprocess.PIPE, text=True)
child.stdin.write(line)
child.stdin.close()
lot, moment, *_ = hashlib.sha256(name.encode()).digest()
if first and lot < 102:
    time.sleep(moment / 512)
    how = "killed" if lot < 77 else "held"
    with (pathlib.Path(sys.argv[0] + "." + how)).open("a") as told:
        told.write(name + "\\n")
    if how == "killed":
        child.kill()
        child.wait()
        os.kill(os.getpid(), 9)
    os.kill(child.pid, signal.SIGSTOP)
    time.sleep(3)
    os.kill(child.pid, signal.SIGCONT)
child.wait()
sys.exit(child.returncode if child.returncode >= 0 else 75)
"""


def made(posegrid, folder, sessions):
    """A pipeline file of three robots, and their sessions."""
    for number in range(sessions):
        robot = ROBOTS[number % len(ROBOTS)]
        out = folder / "sessions" / robot / f"day-{number:02}"
        subprocess.run(
            [posegrid, "simulate", HERE / "pipelines/robots/kr210-r2700-extra.toml", "--out", out, "--arm", str(number % 3)]
            + ["--seed", str(number), "--session", out.name, "--home", "0,-75,100,25,55,-15", "--random", "60"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
    damaged = sorted((folder / "sessions").glob("*/*/tracker.mcap"))[-1]
    shutil.copy(damaged.with_name("controller.mcap"), damaged)
    text = (HERE / "pipelines/quickstart.toml").read_text()
    for old, new in (
        ('"../tests/recordings"', '"sessions"'),
        ('sessions = ["quickstart"]', 'robots = "robots.csv"'),
        ('name = "kr210-demo"\n', ""),
        ('"robots/kr210', f'"{HERE}/pipelines/robots/kr210'),
        ("steps_mm = [60, 90, 120, 180, 240, 360, 720]", "steps_mm = [180, 240, 360]"),
        ("[grid]", "[fit.full]\nharmonics = 12\n\n[grid]"),
        ('"../lake"', '"lake"'),
    ):
        assert old in text, old
        text = text.replace(old, new, 1)
    (folder / "robots.csv").write_text("name,tolerance.mm\n" + "".join(f"{robot},0.5\n" for robot in ROBOTS))
    (folder / "fleet.toml").write_text(text)
    # Files that changed in the last moments have no state yet.
    time.sleep(2.2)


class Script:
    """An engine's script at work on a fleet: started again, as an operator would, until its exit code says that this changes nothing."""

    def __init__(self, engine, pipeline, program, lake, scheduler=None):
        cluster = ["--scheduler", scheduler] if scheduler else []
        script = HERE / f"pipelines/fleet/on_{engine}.py"
        self.command = [sys.executable, script, pipeline, "--posegrid", program, "--lake", lake.place, *cluster]
        self.process, self.rows, self.starts = None, [], 0

    def ended(self):
        """Works off the fleet; returns the rows of the last start, which told of each task that was left."""
        while True:
            self.starts += 1
            assert self.starts < 6, "it comes to no end"
            self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, encoding="utf-8")
            told = []
            for line in self.process.stdout:
                told.append(json.loads(line))
                self.rows.append(told[-1])
            code = self.process.wait()
            names = [(row["robot"], row["session"]) for row in told]
            assert len(set(names)) == len(names), f"told twice: {names}"
            if code in (0, 1) and told:
                return code, told
            ways = collections.Counter(row["ended"] for row in told)
            print(f"the script ended with {code}, having told {dict(ways)}; {told[-1:]}", file=sys.stderr, flush=True)


def disturbed(cluster, lake, scripts, sessions):
    """Kills a worker when a quarter of the sessions is done, and the scheduler when half of them is."""
    for share, disturb in ((0.25, cluster.loses_a_worker), (0.5, cluster.restarts)):
        while lake.count() < share * sessions:
            if all(script.process and script.process.poll() is not None for script in scripts):
                return
            time.sleep(0.3)
        disturb()
        print(f"{disturb.__name__} when {lake.count()} sessions were done", file=sys.stderr, flush=True)
        if disturb == cluster.restarts and cluster.ends_script:
            for script in scripts:
                clusters.killed(script.process)


def on_a_cluster(engine, folder, pipeline, killer, lake, sessions):
    """Works off the fleet by two scripts at once on a cluster that loses a worker and its scheduler; returns each one's rows."""
    with clusters.CLUSTERS[engine](folder) as cluster, concurrent.futures.ThreadPoolExecutor(3) as pool:
        scripts = [Script(engine, pipeline, killer, lake, cluster.address) for _ in range(2)]
        ended = [pool.submit(script.ended) for script in scripts]
        pool.submit(disturbed, cluster, lake, scripts, sessions).result()
        last = [own.result() for own in ended]
    assert all(code == 1 for code, _ in last), "one session is damaged"
    return [row for script in scripts for row in script.rows], sum(script.starts for script in scripts)


def array(folder, pipeline, killer, lake):
    """Works off the fleet by the script of Slurm's jobs, with a stand-in for Slurm; returns the rows."""
    # The script names no lake: this one's program does.
    program = folder / "slurm-program"
    program.write_text(f'#!/bin/sh\nexec "{killer}" "$@" --lake "{lake.place}"\n')
    program.chmod(0o755)
    found = subprocess.run([program, "tasks", pipeline], stdout=subprocess.PIPE, encoding="utf-8", check=True)
    (folder / "tasks.jsonl").write_text(found.stdout)
    requeue = folder / "bin" / "scontrol"
    requeue.parent.mkdir(exist_ok=True)
    requeue.write_text(f'#!/bin/sh\n[ "$1" = requeue ] && touch "{folder}/requeued-$2"\n')
    requeue.chmod(0o755)

    def job(number):
        for restart in range(7):
            about = {"SLURM_ARRAY_TASK_ID": str(number), "SLURM_JOB_ID": str(number), "SLURM_RESTART_COUNT": str(restart)}
            path = f"{requeue.parent}:{os.environ['PATH']}"
            environment = os.environ | about | {"POSEGRID": str(program), "PATH": path}
            command = [HERE / "pipelines/fleet/slurm.sh", pipeline, folder / "tasks.jsonl"]
            ended = subprocess.run(command, env=environment, stdout=subprocess.PIPE, encoding="utf-8", check=False)
            asked = folder / f"requeued-{number}"
            # A job that was killed is lost with its node; Slurm puts those back by itself.
            if not asked.exists() and ended.returncode < 128:
                break
            asked.unlink(missing_ok=True)
        # A job that begins again writes its output anew.
        return ended.returncode, ended.stdout

    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        ended = list(pool.map(job, range(1, 1 + found.stdout.count("\n"))))
    assert max(code for code, _ in ended) == 1, "one session is damaged"
    return [json.loads(line) for _, told in ended for line in told.split("\n") if line]


def told_once(rows, sessions, is_hard, is_script_lost):
    """Asserts that the rows tell of every session, and that no session was committed twice; returns how often each way came.

    Rows that a script had yet to print are lost with it: what it did is in the lake then, and no script tells of it again.
    """
    ways = collections.defaultdict(list)
    for row in rows:
        ways[row["robot"], row["session"]].append(row["ended"])
    assert len(ways) == sessions or is_script_lost, f"{len(ways)} of {sessions} sessions were told"
    assert is_hard or all(len(own) == 1 for own in ways.values()), ways
    twice = {name: own for name, own in ways.items() if own.count("done") > 1}
    assert not twice, f"committed twice: {twice}"
    failed = [name for name, own in ways.items() if "failed" in own]
    assert len(failed) == 1, f"the damaged session alone has no result: {failed}"
    # A task that ended with its scheduler may have had its result: then the lake knew it when the script was started again.
    assert is_hard or not any("fault" in own for own in ways.values()), ways
    return collections.Counter(way for own in ways.values() for way in own)


def is_the_batchs(posegrid, pipeline, lake, batch_files):
    """Lets a batch take a lake from there, and holds every file against those of the batch; returns their number."""
    left = subprocess.run([posegrid, "tasks", pipeline, "--lake", lake.place], stdout=subprocess.PIPE, encoding="utf-8", check=True)
    assert left.stdout.count("\n") == 1, f"the damaged session alone is left: {left.stdout}"
    after = subprocess.run([posegrid, "run", pipeline, "--lake", lake.place], capture_output=True, encoding="utf-8", check=False)
    assert after.returncode == 1, after.stderr
    engine_files = lake.files()
    assert batch_files.keys() == engine_files.keys(), batch_files.keys() ^ engine_files.keys()
    other = [name for name in batch_files if batch_files[name] != engine_files[name]]
    assert not other, other
    # Of many sessions some are recomputed, by their names.
    names = sorted({name.split("/")[2] for name in batch_files if name.startswith("runs/")})
    verify = [posegrid, "verify", lake.place, *names[:12], "--pipeline", pipeline]
    verified = subprocess.run(verify, capture_output=True, encoding="utf-8", check=False)
    assert verified.returncode == 0, verified.stdout + verified.stderr
    return len(engine_files)


def proved(engine, posegrid, fleet, sessions, batch_files):
    """Works off a fleet on an engine, with a program that is killed now and then, and holds its lake against the batch's."""
    folder, pipeline, lake, is_hard = fleet
    killer = folder / f"{engine}-posegrid"
    shutil.copy(posegrid, f"{killer}.real")
    killer.write_text(KILLER)
    killer.chmod(0o755)
    begun, starts = time.monotonic(), 1
    if engine == "slurm":
        rows = array(folder, pipeline, killer, lake)
    elif is_hard:
        rows, starts = on_a_cluster(engine, folder, pipeline, killer, lake, sessions)
    else:
        code, rows = Script(engine, pipeline, killer, lake).ended()
        assert code == 1, f"one session is damaged: {code}"
    shared = time.monotonic() - begun
    is_hard = is_hard and engine != "slurm"
    ways = told_once(rows, sessions, is_hard, is_hard and clusters.CLUSTERS[engine].ends_script)
    touched = [pathlib.Path(f"{killer}.{how}") for how in ("killed", "held")]
    killed, held = (path.read_text().split() if path.exists() else [] for path in touched)
    assert killed, "no attempt was killed"
    count = is_the_batchs(posegrid, pipeline, lake, batch_files)
    os.remove(f"{killer}.real")
    print(
        f"{engine}, {sessions} sessions in {shared:.0f} s: {len(killed)} first attempts killed and {len(held)} held; "
        f"rows {json.dumps(ways)}; the script was started {starts} times; "
        f"{count} files byte for byte those of a batch",
        flush=True,
    )


def seconds(command):
    begun = time.monotonic()
    ended = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8", check=False)
    assert ended.returncode == 1, f"one session is damaged: {ended.returncode}"
    return time.monotonic() - begun, ended.stdout


def overhead(engine, posegrid, folder):
    """Compares an engine of two worker processes with a batch of two threads: from the first task's start to the end, and the listing."""
    ratios = []
    for turn in range(3):
        lakes_of = [folder / f"{kind}-{turn}-{engine}" for kind in ("alone", "shared")]
        alone, _ = seconds([posegrid, "run", folder / "fleet.toml", "--jobs", "2", "--lake", lakes_of[0]])
        times = folder / f"times-{turn}-{engine}"
        program = folder / f"timed-{engine}"
        program.write_text(f'#!/bin/sh\necho "$1 $(date +%s.%N)" >> {times}\n{posegrid} "$@"\ncode=$?\necho "$1 $(date +%s.%N)" >> {times}\nexit $code\n')
        program.chmod(0o755)
        script = [sys.executable, HERE / f"pipelines/fleet/on_{engine}.py", folder / "fleet.toml", "--posegrid", program]
        whole, _ = seconds([*script, "--lake", lakes_of[1]])
        marks = [line.split() for line in times.read_text().splitlines()]
        spans = {word: [float(time) for name, time in marks if name == word] for word in ("tasks", "task")}
        shared = sum(max(span) - min(span) for span in spans.values())
        ratios.append(shared / alone)
        print(f"{engine}: batch {alone:.1f} s, engine {shared:.1f} s beside its start of {whole - shared:.1f} s: {shared / alone:.3f}", flush=True)
    return sorted(ratios)[1]


def on_a_server(folder):
    """Puts the sessions on a server; returns it with the pipeline file that names them there."""
    server = lakes.Server()
    text = (folder / "fleet.toml").read_text()
    sessions = server.upload(folder / "sessions", "sessions")
    # A run's name follows from that of its pipeline file too.
    own = folder / "on-server"
    own.mkdir()
    (own / "fleet.toml").write_text(text.replace('"sessions"', f'"{sessions}"', 1))
    shutil.copy(folder / "robots.csv", own)
    return server, own / "fleet.toml"


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("posegrid", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path, required=True)
    arguments.add_argument("--sessions", type=int, default=12)
    engines = ["dask", "ray", "spark", "slurm"]
    arguments.add_argument("--engine", action="append", choices=engines, help="dask and slurm where none is named")
    arguments.add_argument("--hard", action="store_true", help="on an S3 server, and workers and scheduler are killed too")
    arguments.add_argument("--overhead", action="store_true", help="without faults, and compare the time")
    given = arguments.parse_args()
    posegrid, folder = given.posegrid.resolve(), given.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    made(posegrid, folder, given.sessions)
    if given.overhead:
        for engine in given.engine or ["dask"]:
            print(f"{engine}: {overhead(engine, posegrid, folder):.3f} of the time of a batch", flush=True)
        return
    alone, _ = seconds([posegrid, "run", folder / "fleet.toml", "--jobs", "2"])
    print(f"a batch of two threads: {alone:.0f} s", flush=True)
    batch_files = lakes.InFolder(folder / "lake").files()
    server, pipeline = on_a_server(folder) if given.hard else (None, folder / "fleet.toml")
    for engine in given.engine or ["dask", "slurm"]:
        lake = lakes.OnServer(server, f"on-{engine}") if server else lakes.InFolder(folder / f"on-{engine}")
        proved(engine, posegrid, (folder, pipeline, lake, given.hard), given.sessions, batch_files)


if __name__ == "__main__":
    main()
