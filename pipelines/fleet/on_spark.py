"""Work off the tasks of a pipeline file on a Spark cluster, and print how each ended: a line of JSON.

    python pipelines/fleet/on_spark.py fleet.toml                                # two worker processes on this machine
    python pipelines/fleet/on_spark.py fleet.toml --scheduler spark://head:7077
    python pipelines/fleet/on_spark.py fleet.toml --scheduler sc://head:50051    # by Spark Connect: Spark's own server, or Sail's

Needs `pyspark`, `pandas` and `pyarrow` from PyPI, and `posegrid` on every worker; pipeline file, sessions and lake are reached by the same
paths or addresses there. Java 17 is needed for all but Spark Connect, for which `pyspark-client` is enough. A task that a fault or a lost
worker ended is done again; sessions without a result are rows, and make exit code 1, or 75 where it is
worth starting again. Rows are printed when all tasks have ended.
"""

import json
import os
import sys

import tasks


def session(scheduler):
    """A Spark session on a cluster; on this machine where none is named."""
    from pyspark.sql import SparkSession

    if scheduler and scheduler.startswith("sc://"):
        return SparkSession.builder.remote(scheduler).getOrCreate()
    if not scheduler:
        # Workers on this machine are by this Python, whatever `python3` is.
        os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
    # A lost worker's tasks are started again as often as a fault's are.
    master = scheduler or f"local[2, {tasks.ATTEMPTS}]"
    builder = SparkSession.builder.master(master).config("spark.task.maxFailures", tasks.ATTEMPTS)
    if not scheduler:
        # Spark hands out tasks here and nothing else: its own threads are to leave the cores to them.
        builder = builder.config("spark.driver.extraJavaOptions", "-XX:+UseSerialGC -XX:TieredStopAtLevel=1")
    return builder.config("spark.ui.enabled", False).config("spark.ui.showConsoleProgress", False).getOrCreate()


def main():
    given = tasks.arguments(__doc__.splitlines()[0], "master or Connect server of the cluster; without it two worker processes are started here")

    from pyspark import cloudpickle

    # Workers have the program, not this folder.
    cloudpickle.register_pickle_by_value(tasks)
    lines = tasks.listed(given)
    command = tasks.command(given, "task")

    def ended(batches):
        """The rows, as texts, of the tasks with the numbers of a partition."""
        import pyarrow

        for batch in batches:
            rows = [json.dumps(tasks.insisted(command, lines[number])) for number in batch["id"].to_pylist()]
            yield pyarrow.RecordBatch.from_pydict({"row": rows})

    # Spark's processes print messages to what is standard output then: those are told on stderr, and rows alone on stdout.
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    spark = session(given.scheduler)
    # A partition for each task: it is what Spark starts again, and copies where it takes long.
    numbers = spark.range(0, len(lines), 1, max(len(lines), 1))
    try:
        rows = [json.loads(row) for (row,) in numbers.mapInArrow(ended, "row string").collect()]
    except Exception as error:
        # Spark ended the job, whatever the kind of error: what was done is in the lake, and known when the tasks are listed again.
        rows = [tasks.unfinished(line, "fault", str(error).strip().split("\n")[0]) for line in lines]
    code = tasks.tell(rows, out)
    spark.stop()
    sys.exit(code)


if __name__ == "__main__":
    main()
