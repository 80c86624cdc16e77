"""The tasks of a fleet on a real engine, with attempts that are killed: every session once, with the bytes of a batch.

    python tests/readers/engines.py target/release/posegrid --folder target/engines [--sessions 12]

Sessions of three robots are simulated; one is damaged so that it has no result. A batch of `posegrid run` works off one lake, the engine
another one: three in ten first attempts are killed under way. Then both lakes have the same files, byte for
byte, and the engine told each session once.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parents[2]
ROBOTS = ("kr-1", "kr-2", "kr-3")

# Kills three in ten first attempts while they work; which ones follows from the task alone.
KILLER = """#!/usr/bin/env python3
import hashlib, json, os, pathlib, subprocess, sys, time
posegrid, seen = sys.argv[0] + ".real", pathlib.Path(sys.argv[0] + ".seen")
if sys.argv[1] != "task":
    os.execv(posegrid, [posegrid, *sys.argv[1:]])
line = sys.stdin.read()
name = json.loads(line)["id"]
seen.mkdir(exist_ok=True)
first = not (seen / name).exists()
(seen / name).touch()
child = subprocess.Popen([posegrid, *sys.argv[1:]], stdin=subprocess.PIPE, text=True)
if first and hashlib.sha256(name.encode()).digest()[0] < 77:
    with (pathlib.Path(sys.argv[0] + ".killed")).open("a") as killed:
        killed.write(name + "\\n")
    child.stdin.write(line)
    child.stdin.close()
    time.sleep(0.2 + hashlib.sha256(name.encode()).digest()[1] / 128)
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


def engine(posegrid, folder):
    """Works off the fleet on Dask, with a program that is killed now and then; returns its rows and how long it took."""
    killer = folder / "posegrid"
    shutil.copy(posegrid, folder / "posegrid.real")
    killer.write_text(KILLER)
    killer.chmod(0o755)
    begun = time.monotonic()
    script = [sys.executable, HERE / "pipelines/fleet/on_dask.py", folder / "fleet.toml"]
    ended = subprocess.run(
        [*script, "--posegrid", killer, "--lake", folder / "on-engine"], stdout=subprocess.PIPE, text=True, check=False
    )
    rows = [json.loads(line) for line in ended.stdout.splitlines()]
    assert ended.returncode == 1, f"one session is damaged: {ended.returncode}"
    return rows, time.monotonic() - begun


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("posegrid", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path, required=True)
    arguments.add_argument("--sessions", type=int, default=12)
    given = arguments.parse_args()
    posegrid, folder = given.posegrid.resolve(), given.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    made(posegrid, folder, given.sessions)
    begun = time.monotonic()
    batch = subprocess.run([posegrid, "run", folder / "fleet.toml", "--jobs", "2"], capture_output=True, text=True, check=False)
    alone = time.monotonic() - begun
    assert batch.returncode == 1, batch.stderr
    rows, shared = engine(posegrid, folder)
    told = sorted((row["robot"], row["session"]) for row in rows)
    assert len(set(told)) == len(told) == given.sessions, told
    ways = [row["ended"] for row in rows]
    assert ways.count("failed") == 1 and ways.count("fault") == 0, ways
    killed = (folder / "posegrid.killed").read_text().split()
    assert killed, "no attempt was killed"
    batch_files, engine_files = files(folder / "lake"), files(folder / "on-engine")
    assert batch_files.keys() == engine_files.keys(), batch_files.keys() ^ engine_files.keys()
    other = [name for name in batch_files if batch_files[name] != engine_files[name]]
    assert not other, other
    again = subprocess.run(
        [posegrid, "tasks", folder / "fleet.toml", "--lake", folder / "on-engine"], stdout=subprocess.PIPE, text=True, check=True
    )
    left = again.stdout.splitlines()
    assert len(left) == 1, "the damaged session alone is left"
    verify = [posegrid, "verify", folder / "on-engine", "--pipeline", folder / "fleet.toml"]
    verified = subprocess.run(verify, capture_output=True, text=True, check=False)
    print(
        f"{given.sessions} sessions: {ways.count('done')} done and {ways.count('done-before')} found done by the engine, 1 without a result; "
        f"{len(killed)} first attempts killed; {len(engine_files)} files byte for byte those of a batch; batch {alone:.0f} s, engine {shared:.0f} s"
    )
    assert verified.returncode == 0, verified.stdout + verified.stderr
    os.remove(folder / "posegrid.real")


if __name__ == "__main__":
    main()
