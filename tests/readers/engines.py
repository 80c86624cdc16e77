"""The tasks of a fleet on a real engine, with attempts that are killed: every session once, with the bytes of a batch.

    python tests/readers/engines.py target/release/posegrid --folder target/engines [--sessions 12] [--engine dask --engine ray --engine slurm]

Sessions of three robots are simulated; one is damaged so that it has no result. A batch of `posegrid run` works off one lake, each engine
another one: three in ten first attempts are killed under way. A batch takes it from there, with nothing left to do but the damaged session,
and removes what the killed ones left. Then both lakes have the same files, byte for byte, and the engine told each session once.

`slurm` is the script of an array's jobs, run by a stand-in for Slurm that starts two at once and those again that ask for it.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parents[2]
ROBOTS = ("kr-1", "kr-2", "kr-3")

# Kills three in ten first attempts while they work; which ones follows from robot and session alone.
KILLER = """#!/usr/bin/env python3
import hashlib, json, os, pathlib, subprocess, sys, time
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
if first and hashlib.sha256(name.encode()).digest()[0] < 77:
    with (pathlib.Path(sys.argv[0] + ".killed")).open("a") as killed:
        killed.write(name + "\\n")
    child.stdin.write(line)
    child.stdin.close()
    time.sleep(hashlib.sha256(name.encode()).digest()[1] / 512)
    child.kill()
    child.wait()
    os.kill(os.getpid(), 9)
child.communicate(line)
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


def files(lake):
    """Every published file of a lake, by its path there."""
    paths = (path for path in lake.rglob("*") if path.is_file())
    named = ((path.relative_to(lake).as_posix(), path) for path in paths)
    return {name: path.read_bytes() for name, path in named if not name.startswith(".")}


def script(engine, folder, killer, lake):
    """Works off the fleet by an engine's script; returns its exit code and what it printed."""
    command = [sys.executable, HERE / f"pipelines/fleet/on_{engine}.py", folder / "fleet.toml", "--posegrid", killer, "--lake", lake]
    ended = subprocess.run(command, stdout=subprocess.PIPE, encoding="utf-8", check=False)
    return ended.returncode, ended.stdout


def array(folder, killer, lake):
    """Works off the fleet by the script of Slurm's jobs, with a stand-in for Slurm; returns as `script` does."""
    # The script names no lake: this one's program does.
    program = folder / "slurm-program"
    program.write_text(f'#!/bin/sh\nexec "{killer}" "$@" --lake "{lake}"\n')
    program.chmod(0o755)
    own = folder / "fleet.toml"
    found = subprocess.run([program, "tasks", own], stdout=subprocess.PIPE, encoding="utf-8", check=True)
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
            command = [HERE / "pipelines/fleet/slurm.sh", own, folder / "tasks.jsonl"]
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
    return max(code for code, _ in ended), "".join(told for _, told in ended)


def proved(engine, posegrid, folder, sessions, alone):
    """Works off the fleet on an engine, with a program that is killed now and then, and holds its lake against the batch's."""
    killer, lake = folder / f"{engine}-posegrid", folder / f"on-{engine}"
    shutil.copy(posegrid, f"{killer}.real")
    killer.write_text(KILLER)
    killer.chmod(0o755)
    begun = time.monotonic()
    code, told = array(folder, killer, lake) if engine == "slurm" else script(engine, folder, killer, lake)
    shared = time.monotonic() - begun
    assert code == 1, f"{engine}: one session is damaged: {code}"
    rows = [json.loads(line) for line in told.split("\n") if line]
    named = sorted((row["robot"], row["session"]) for row in rows)
    assert len(set(named)) == len(named) == sessions, named
    ways = [row["ended"] for row in rows]
    assert ways.count("failed") == 1 and ways.count("fault") == 0, ways
    killed = pathlib.Path(f"{killer}.killed").read_text().split()
    assert killed, "no attempt was killed"
    left = subprocess.run([posegrid, "tasks", folder / "fleet.toml", "--lake", lake], stdout=subprocess.PIPE, encoding="utf-8", check=True)
    assert left.stdout.count("\n") == 1, f"the damaged session alone is left: {left.stdout}"
    after = subprocess.run([posegrid, "run", folder / "fleet.toml", "--lake", lake], capture_output=True, encoding="utf-8", check=False)
    assert after.returncode == 1, after.stderr
    batch_files, engine_files = files(folder / "lake"), files(lake)
    assert batch_files.keys() == engine_files.keys(), batch_files.keys() ^ engine_files.keys()
    other = [name for name in batch_files if batch_files[name] != engine_files[name]]
    assert not other, other
    verify = [posegrid, "verify", lake, "--pipeline", folder / "fleet.toml"]
    verified = subprocess.run(verify, capture_output=True, encoding="utf-8", check=False)
    assert verified.returncode == 0, verified.stdout + verified.stderr
    os.remove(f"{killer}.real")
    print(
        f"{engine}, {sessions} sessions: {ways.count('done')} done and {ways.count('done-before')} found done, 1 without a result; "
        f"{len(killed)} first attempts killed; {len(engine_files)} files byte for byte those of a batch; "
        f"batch {alone:.0f} s, engine {shared:.0f} s",
        flush=True,
    )


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("posegrid", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path, required=True)
    arguments.add_argument("--sessions", type=int, default=12)
    arguments.add_argument("--engine", action="append", choices=["dask", "ray", "slurm"], help="dask and slurm where none is named")
    given = arguments.parse_args()
    posegrid, folder = given.posegrid.resolve(), given.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    made(posegrid, folder, given.sessions)
    begun = time.monotonic()
    batch = subprocess.run([posegrid, "run", folder / "fleet.toml", "--jobs", "2"], capture_output=True, encoding="utf-8", check=False)
    alone = time.monotonic() - begun
    assert batch.returncode == 1, batch.stderr
    for engine in given.engine or ["dask", "slurm"]:
        proved(engine, posegrid, folder, given.sessions, alone)


if __name__ == "__main__":
    main()
