"""What every engine does with the tasks of a pipeline file: list them, do one, tell how it ended."""

import argparse
import json
import os
import subprocess
import sys
import time

# Dask has its workers give memory back to the system at every opportunity: a program that asks for it again at once takes a third longer.
NOT_FOR_TASKS = ("MALLOC_TRIM_THRESHOLD_",)
# Exit code of a task that the machine or the storage ended, which is worth another attempt.
FAULT = 75
# Attempts after the first, and the pause before each where the machine or the storage failed: storage may be away for a minute.
ATTEMPTS = 6
PAUSE_S = 15


class Fault(Exception):
    """The machine or the storage failed, so that the task is worth another attempt."""


def arguments(description, cluster):
    """The command line of an engine's script; `cluster` says what `--scheduler` names."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("pipeline", help="the pipeline file")
    parser.add_argument("--scheduler", help=cluster)
    parser.add_argument("--posegrid", default="posegrid", help="the program, as workers find it")
    parser.add_argument("--lake", help="the place of the published tables, instead of the pipeline file's")
    return parser.parse_args()


def command(given, name):
    """The command line `posegrid NAME` of these arguments."""
    lake = ["--lake", given.lake] if given.lake else []
    return [given.posegrid, name, given.pipeline, *lake]


def listed(given):
    """The tasks that are to be done, a line of JSON each, the longest first; what waits is told on stderr."""
    found = subprocess.run(command(given, "tasks"), stdout=subprocess.PIPE, encoding="utf-8", check=False)
    if found.returncode:
        sys.exit(found.returncode)
    # By line feeds alone: names may hold characters that end a line elsewhere.
    lines = [line for line in found.stdout.split("\n") if line]
    return sorted(lines, key=lambda line: (-json.loads(line)["expected_s"], line))


def work(command_line, line):
    """Does one task; returns how it ended, or raises a fault."""
    own = {name: value for name, value in os.environ.items() if name not in NOT_FOR_TASKS}
    ended = subprocess.run(command_line, input=line + "\n", capture_output=True, encoding="utf-8", env=own, check=False)
    if ended.returncode in (0, 1):
        return json.loads(ended.stdout)
    message = ended.stderr.strip().split("\n")[-1] or f"ended with {ended.returncode}"
    if ended.returncode == FAULT:
        time.sleep(PAUSE_S)
    if ended.returncode == FAULT or ended.returncode < 0:
        raise Fault(message)
    return unfinished(line, "failed", message)


def insisted(command_line, line):
    """Does one task, again after a fault; for engines that end all work where one task fails too often."""
    for _ in range(ATTEMPTS):
        try:
            return work(command_line, line)
        except Fault as fault:
            last = str(fault)
    return unfinished(line, "fault", last)


def unfinished(line, ended, reason):
    """The row of a task that told none itself."""
    task = json.loads(line)
    own = {key: task.get(key) for key in ("id", "robot", "session")}
    return own | {"ended": ended, "run": None, "met": None, "reason": reason}


def tell(rows, out=sys.stdout):
    """Prints rows to `out` as they come; returns the exit code: 75 where a fault ended a task for good, 1 where one has no result."""
    ways = set()
    for row in rows:
        ways.add(row["ended"])
        print(json.dumps(row, sort_keys=True), file=out, flush=True)
    return FAULT if "fault" in ways else int("failed" in ways)
