"""Work off the tasks of a pipeline file on a Ray cluster, and print how each ended: a line of JSON.

    python pipelines/fleet/on_ray.py fleet.toml                              # two worker processes on this machine
    python pipelines/fleet/on_ray.py fleet.toml --scheduler ray://head:10001

Needs `ray[default]` from PyPI, and `posegrid` on every worker; pipeline file, sessions and lake are reached by the same paths or
addresses there. A task that a fault or a lost worker ended is done again; sessions without a result are rows, and make exit code 1,
or 75 where it is worth starting again.
"""

import sys

import tasks


def main():
    given = tasks.arguments(__doc__.splitlines()[0], "address of the cluster; without it two worker processes are started here")

    import ray

    # Ray prints its own messages to what is standard output then: they are told on stderr, and rows alone on stdout.
    out, sys.stdout = sys.stdout, sys.stderr
    # Workers have the program, not this folder.
    ray.cloudpickle.register_pickle_by_value(tasks)
    lines = tasks.listed(given)
    own = {} if given.scheduler else {"num_cpus": 2, "include_dashboard": False}
    ray.init(address=given.scheduler or "local", log_to_driver=False, **own)
    work = ray.remote(max_retries=tasks.ATTEMPTS, retry_exceptions=[tasks.Fault])(tasks.work)
    command = tasks.command(given, "task")
    under_way = {work.remote(command, line): line for line in lines}

    def rows():
        while under_way:
            for future in ray.wait(list(under_way))[0]:
                line = under_way.pop(future)
                try:
                    yield ray.get(future)
                except ray.exceptions.RayError as error:
                    # Ray's text ends with what happened.
                    said = str(error).strip()
                    yield tasks.lost(line, said.split("\n")[-1] + "\n" + said)

    code = tasks.tell(rows(), out)
    ray.shutdown()
    sys.exit(code)


if __name__ == "__main__":
    main()
