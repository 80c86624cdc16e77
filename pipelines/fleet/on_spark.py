"""Work off the tasks of a pipeline file on a Spark cluster, and print how each ended, as it ends: a line of JSON.

    python pipelines/fleet/on_spark.py fleet.toml                                # two worker processes on this machine
    python pipelines/fleet/on_spark.py fleet.toml --scheduler spark://head:7077
    python pipelines/fleet/on_spark.py fleet.toml --scheduler sc://head:50051    # by Spark Connect: Spark's own server, or Sail's

Needs `pyspark` from PyPI and Java 17, and `posegrid` on every worker; pipeline file, sessions and lake are reached by the same paths or
addresses there. Spark Connect needs `pyspark-client` alone here, and `pandas` and `pyarrow` here and on its workers. Workers run `python3`:
where that is no Python of the same minor version as this one, PYSPARK_PYTHON names theirs, set for this script (for Spark Connect, for its
server).

A task that a fault or a lost worker ended is done again; sessions without a result are rows, and make exit code 1, or 75 where it is
worth starting again. A master that is started again knows this script's work only with `spark.deploy.recoveryMode` (FILESYSTEM, and
`spark.deploy.recoveryDirectory`): otherwise it gives it no worker any more. So this script ends with 75 when none of its tasks has run for
--idle seconds, as it does where other work has the whole cluster.
"""

import json
import os
import sys
import threading
import time

import tasks

# Pause between two looks at what ended, s.
LOOK_S = 0.3


class Idle(Exception):
    """No task has run for too long."""


class Activity:
    """When a task ran last, of work that the cluster has."""

    def __init__(self, idle_s):
        self.idle_s, self.last = idle_s, time.monotonic()

    def seen(self, is_active):
        """Takes note of whether a task runs; raises where none has for too long."""
        now = time.monotonic()
        if is_active:
            self.last = now
        elif now - self.last > self.idle_s:
            raise Idle(
                f"no task has run for {self.idle_s:.0f} s: the cluster has no worker for them, or its master was started again without "
                "spark.deploy.recoveryMode; start this script again when there are workers"
            )


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


def by_context(spark, do, count, activity):
    """The rows of all tasks as they end, by a job with a partition for each: it is what Spark starts again, and copies where it takes long."""
    from pyspark import AccumulatorParam

    class Rows(AccumulatorParam):
        """Rows that tasks add; of two copies of a task those of one."""

        def zero(self, value):
            return []

        def addInPlace(self, rows, more):
            return rows + more

    context, failed, told = spark.sparkContext, [], 0
    ended = context.accumulator([], Rows())

    def work():
        try:
            context.parallelize(range(count), count).foreach(lambda number: ended.add([do(number)]))
        except Exception as error:
            failed.append(error)

    job, tracker = threading.Thread(target=work, daemon=True), context.statusTracker()
    job.start()
    while job.is_alive() or told < len(ended.value):
        job.join(LOOK_S)
        stages = [tracker.getStageInfo(stage) for stage in tracker.getActiveStageIds()]
        rows = ended.value[told:]
        yield from rows
        told += len(rows)
        activity.seen(rows or any(stage and stage.numActiveTasks for stage in stages))
    if failed:
        raise failed[0]


def by_connect(spark, do, count):
    """The rows of all tasks in their order, each when those before it have ended too: Spark Connect has neither jobs nor accumulators."""

    def ended(batches):
        import pyarrow

        for batch in batches:
            yield pyarrow.RecordBatch.from_pydict({"row": [json.dumps(do(number)) for number in batch["id"].to_pylist()]})

    for (row,) in spark.range(0, count, 1, count).mapInArrow(ended, "row string").toLocalIterator():
        yield json.loads(row)


def main():
    def own(parser):
        parser.add_argument("--idle", type=float, default=600, help="end with 75 when none of its tasks has run for these seconds: 600")

    given = tasks.arguments(__doc__.splitlines()[0], "master or Connect server of the cluster; without it two worker processes are started here", own)

    from pyspark import cloudpickle

    # Workers have the program, not this folder.
    cloudpickle.register_pickle_by_value(tasks)
    lines = tasks.listed(given)
    command = tasks.command(given, "task")

    def do(number):
        return tasks.insisted(command, lines[number])

    # Spark's processes print messages to what is standard output then: those are told on stderr, and rows alone on stdout.
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    left = {json.loads(line)["id"]: line for line in lines}

    def rows():
        doing = f"no session on {given.scheduler}: "
        try:
            spark, doing = session(given.scheduler), ""
            if given.scheduler and given.scheduler.startswith("sc://"):
                ended = by_connect(spark, do, len(lines))
            else:
                ended = by_context(spark, do, len(lines), Activity(given.idle))
            for row in ended:
                left.pop(row["id"], None)
                yield row
        except Exception as error:
            # Spark ended the job, whatever the kind of error: what was done is in the lake, and known when the tasks are listed again.
            yield from (tasks.lost(line, error, doing) for line in left.values())

    code = tasks.tell(rows() if lines else [], out)
    # Spark may wait for a master that is gone; what it started ends with this process.
    os._exit(code)


if __name__ == "__main__":
    main()
