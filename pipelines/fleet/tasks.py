"""What every engine does with the tasks of a pipeline file: list them, do one, tell how it ended."""

import argparse
import json
import os
import platform
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


# What an engine's error says where no other attempt helps: a package or the program that workers lack, or another Python than theirs.
NEVER = ("ModuleNotFoundError", "ImportError", "PACKAGE_NOT_INSTALLED", "UNSUPPORTED_PACKAGE_VERSION", "PYTHON_VERSION_MISMATCH", "Cannot run program")


class Fault(Exception):
    """The machine or the storage failed, so that the task is worth another attempt."""


class Refused(Exception):
    """The tasks cannot be listed, and asking again gives the same."""


def arguments(description, cluster, add=lambda parser: None):
    """The command line of an engine's script; `cluster` says what `--scheduler` names, and `add` adds arguments of its own."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("pipeline", help="the pipeline file")
    parser.add_argument("--scheduler", help=cluster)
    parser.add_argument("--posegrid", default="posegrid", help="the program, as workers find it")
    parser.add_argument("--lake", help="the place of the published tables, instead of the pipeline file's")
    add(parser)
    return parser.parse_args()


def command(given, name):
    """The command line `posegrid NAME` of these arguments."""
    lake = ["--lake", given.lake] if given.lake else []
    return [given.posegrid, name, given.pipeline, *lake]


def listed(given):
    """The tasks that are to be done, a line of JSON each, the longest first; ends the script where they cannot be listed."""
    for attempt in range(1 + ATTEMPTS):
        try:
            return sorted(listing(command(given, "tasks")), key=lambda line: (-json.loads(line)["expected_s"], line))
        except Refused as refused:
            ended_with(2, f"the tasks cannot be listed: {refused}")
        except Fault as fault:
            last = f"the tasks cannot be listed: {fault}"
            print(last, file=sys.stderr, flush=True)
            if attempt < ATTEMPTS:
                time.sleep(PAUSE_S)
    ended_with(FAULT, f"{last}; after {1 + ATTEMPTS} attempts the script ends, start it again")


def ended_with(code, message):
    """Ends the script with an exit code and a message on stderr."""
    print(message, file=sys.stderr, flush=True)
    sys.exit(code)


def listing(command_line):
    """The lines of `posegrid tasks`, which tells on stderr what waits; raises a fault, or that it is refused."""
    try:
        found = subprocess.run(command_line, stdout=subprocess.PIPE, encoding="utf-8", check=False)
    except OSError as error:
        raise Refused(f"{command_line[0]} cannot be started: {error.strerror}; name the program by --posegrid") from None
    if is_fault(found.returncode):
        raise Fault(f"posegrid ended with {found.returncode}")
    if found.returncode:
        raise Refused(f"posegrid ended with {found.returncode}, as said above")
    # By line feeds alone: names may hold characters that end a line elsewhere.
    return [line for line in found.stdout.split("\n") if line]


def is_fault(code):
    """Whether an exit code is one of the machine or the storage: also of a signal, by itself or as a shell tells it."""
    return code == FAULT or code < 0 or code > 128


def work(command_line, line):
    """Does one task; returns how it ended, or raises a fault."""
    own = {name: value for name, value in os.environ.items() if name not in NOT_FOR_TASKS}
    try:
        ended = subprocess.run(command_line, input=line + "\n", capture_output=True, encoding="utf-8", env=own, check=False)
    except OSError as error:
        return unfinished(line, "failed", f"{command_line[0]} cannot be started on {platform.node()}: {error.strerror}")
    message = ended.stderr.strip().split("\n")[-1] or f"ended with {ended.returncode}"
    if ended.returncode == FAULT:
        time.sleep(PAUSE_S)
    if is_fault(ended.returncode):
        raise Fault(message)
    # A task that cannot be read, or a pipeline file that is wrong, has no row.
    return json.loads(ended.stdout) if ended.stdout else unfinished(line, "failed", message)


def insisted(command_line, line):
    """Does one task, again after a fault; for engines that end all work where one task fails too often."""
    for _ in range(ATTEMPTS):
        try:
            return work(command_line, line)
        except Fault as fault:
            last = str(fault)
    return unfinished(line, "fault", last)


def lost(line, error, doing=""):
    """The row of a task that an engine's error ended, `doing` this: a fault, unless no other attempt helps; with the error's first useful line."""
    said = [own.strip(" :\t\r") for own in str(error).split("\n")]
    # Those of Java and of gRPC follow an announcement.
    said = [own for own in said if own and not own.startswith(("An error occurred while calling", "<_"))] or [type(error).__name__]
    for own, word in ((own, word) for own in said for word in NEVER if word in own):
        reason = own[1 + own.rfind(":", 0, own.index(word)) :].strip()
        return unfinished(line, "failed", f"{reason}; another attempt ends likewise, until the workers, or this machine, have it")
    return unfinished(line, "fault", doing + said[0])


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
