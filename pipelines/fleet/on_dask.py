"""Work off the tasks of a pipeline file on a Dask cluster, and print how each ended: a line of JSON.

    python pipelines/fleet/on_dask.py fleet.toml                             # two worker processes on this machine
    python pipelines/fleet/on_dask.py fleet.toml --scheduler tcp://head:8786

Needs `distributed` from PyPI, and `posegrid` on every worker; pipeline file, sessions and lake are reached by the same paths or
addresses there. A task that a fault or a lost worker ended is done again; sessions without a result are rows, and make exit code 1.
"""

import argparse
import json
import subprocess
import sys

FAULT = 75
ATTEMPTS = 6


class Fault(Exception):
    """The machine or the storage failed, so that the task is worth another attempt."""


def work(command, line):
    """Does one task; returns how it ended."""
    ended = subprocess.run(command, input=line, capture_output=True, text=True, check=False)
    if ended.returncode in (0, 1):
        return json.loads(ended.stdout)
    message = ended.stderr.strip().splitlines()[-1:] or [f"ended with {ended.returncode}"]
    if ended.returncode == FAULT or ended.returncode < 0:
        raise Fault(message[0])
    task = json.loads(line)
    own = {key: task.get(key) for key in ("id", "robot", "session")}
    return own | {"ended": "failed", "run": None, "met": None, "reason": message[0]}


def listed(posegrid, pipeline, options):
    """The tasks that are to be done, as lines; what waits is told on stderr."""
    found = subprocess.run([posegrid, "tasks", pipeline, *options], stdout=subprocess.PIPE, text=True, check=False)
    if found.returncode:
        sys.exit(found.returncode)
    return found.stdout.splitlines(keepends=True)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("pipeline", help="the pipeline file")
    arguments.add_argument("--scheduler", help="address of the cluster; without it two worker processes are started here")
    arguments.add_argument("--posegrid", default="posegrid", help="the program, as workers find it")
    arguments.add_argument("--lake", help="the place of the published tables, instead of the pipeline file's")
    given = arguments.parse_args()

    import dask
    from distributed import Client, LocalCluster, as_completed

    options = ["--lake", given.lake] if given.lake else []
    lines = listed(given.posegrid, given.pipeline, options)
    # The longest first, so that none is left to wait for at the end.
    lines.sort(key=lambda line: (-json.loads(line)["expected_s"], line))
    dask.config.set({"distributed.scheduler.allowed-failures": ATTEMPTS})
    cluster = given.scheduler or LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    failed = 0
    with Client(cluster) as client:
        command = [given.posegrid, "task", given.pipeline, *options]
        # Not pure: a task that was done in an earlier batch is another call of the same words.
        futures = [client.submit(work, command, line, retries=ATTEMPTS, pure=False) for line in lines]
        for future in as_completed(futures):
            row = future.result() if future.status == "finished" else {"ended": "fault", "reason": repr(future.exception())}
            failed += row["ended"] in ("failed", "fault")
            print(json.dumps(row, sort_keys=True), flush=True)
    if not given.scheduler:
        cluster.close()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
