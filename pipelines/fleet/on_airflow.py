"""The tasks of a pipeline file every night, as a DAG of Airflow 3. Put this file and `tasks.py` beside it into the folder of the DAGs.

Workers need `posegrid`, and pipeline file, sessions and lake by the same paths or addresses. Variables of their environment name them:
POSEGRID_PIPELINE is the pipeline file, POSEGRID the program and POSEGRID_LAKE the lake, where they are others than in the path and in the
pipeline file.

A task that a fault or a lost worker ended is done again. Sessions without a result are rows, and fail the last task alone.
"""

import os
from argparse import Namespace
from datetime import datetime, timedelta

import tasks
from airflow.sdk import dag, task
from airflow.sdk.exceptions import AirflowFailException

# Tasks that Airflow maps at most, by its own setting `max_map_length`, are 1024.
SHARES = 1000
RETRIES = {"retries": tasks.ATTEMPTS, "retry_delay": timedelta(seconds=tasks.PAUSE_S)}


def command(name):
    """The command line `posegrid NAME` of this environment."""
    own = os.environ
    given = Namespace(pipeline=own["POSEGRID_PIPELINE"], posegrid=own.get("POSEGRID", "posegrid"), lake=own.get("POSEGRID_LAKE"))
    return tasks.command(given, name)


@dag(schedule="0 2 * * *", start_date=datetime(2026, 1, 1), catchup=False, max_active_runs=1, tags=["posegrid"])
def posegrid_fleet():
    """Lists the tasks, does them and tells how they ended."""

    @task(**RETRIES)
    def listed():
        """The tasks that are to be done, in shares; a share is a task each where there are few."""
        try:
            lines = tasks.listing(command("tasks"))
        except tasks.Refused as refused:
            raise AirflowFailException(f"the tasks cannot be listed: {refused}") from None
        return [lines[first::SHARES] for first in range(min(SHARES, len(lines)))]

    @task(**RETRIES)
    def done(share):
        """Does a share of the tasks; a fault fails it, and what was done is known when it is done again."""
        return [tasks.work(command("task"), line) for line in share]

    @task(trigger_rule="all_done_min_one_success")
    def told(shares):
        """Tells how each task ended; fails where one has no result."""
        if tasks.tell(row for rows in shares for row in rows):
            raise AirflowFailException("some tasks have no result: see the rows in this log")

    told(done.expand(share=listed()))


posegrid_fleet()
