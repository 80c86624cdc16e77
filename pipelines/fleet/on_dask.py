"""Work off the tasks of a pipeline file on a Dask cluster, and print how each ended: a line of JSON.

    python pipelines/fleet/on_dask.py fleet.toml                             # two worker processes on this machine
    python pipelines/fleet/on_dask.py fleet.toml --scheduler tcp://head:8786

Needs `distributed` from PyPI, and `posegrid` on every worker; pipeline file, sessions and lake are reached by the same paths or
addresses there. A task that a fault or a lost worker ended is done again; sessions without a result are rows, and make exit code 1,
or 75 where it is worth starting again.
"""

import sys

import tasks


def main():
    given = tasks.arguments(__doc__.splitlines()[0], "address of the cluster; without it two worker processes are started here")

    import cloudpickle
    import dask
    from distributed import Client, LocalCluster, as_completed

    def work(command, line):
        """As `tasks.work`; a function of this script travels to scheduler and workers with what it uses, for they have not this folder."""
        return tasks.work(command, line)

    cloudpickle.register_pickle_by_value(tasks)
    lines = tasks.listed(given)
    dask.config.set({"distributed.scheduler.allowed-failures": tasks.ATTEMPTS})
    cluster = given.scheduler or LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with Client(cluster) as client:
        command = tasks.command(given, "task")
        # Not pure: a task that was done in an earlier batch is another call of the same words.
        futures = {client.submit(work, command, line, retries=tasks.ATTEMPTS, pure=False): line for line in lines}

        def row(future):
            if future.status == "finished":
                return future.result()
            # Cancelled with its scheduler, or failed for good.
            return tasks.lost(futures[future], "the scheduler was lost" if future.cancelled() else future.exception())

        code = tasks.tell(row(future) for future in as_completed(futures))
    if not given.scheduler:
        cluster.close()
    sys.exit(code)


if __name__ == "__main__":
    main()
