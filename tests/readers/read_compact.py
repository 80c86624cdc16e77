"""Reads the compact form of a lake with DuckDB, and with Spark where asked: it has the rows of the tables, once each.

    python tests/readers/read_compact.py POSEGRID LAKE [--spark] [--only-time]

The newest state names the files. Checked: each file's name is the digest of its bytes; runs, accuracy and asked have the rows of the tables, row by
row; the view sessions of `posegrid schema views --compact` gives what that of `posegrid schema views` gives; and its last
lines, which add runs newer than the state, give no row twice. Told: how many files, and how long the mean error before and after per robot and
month takes, over the view sessions and over accuracy. With --only-time the tables themselves are not read.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import time

import blake3
import duckdb

OF_SESSIONS = """SELECT robot, strftime(session_started, '%Y-%m') AS month, avg(before_mm), avg(after_mm), count(*)
FROM sessions GROUP BY ALL ORDER BY ALL"""
OF_ACCURACY = """SELECT a.robot, strftime(a.session_started, '%Y-%m') AS month, avg(value) FILTER (moment = 'before') AS before_mm,
       avg(value) FILTER (moment = 'after') AS after_mm, count(DISTINCT a.session)
FROM accuracy AS a SEMI JOIN current_runs AS r ON a.robot = r.robot AND a.run = r.run
WHERE name = 'mean' AND quantity = 'position_error' AND role = 'held_out' AND split = 'blocks' AND base_refit = 'none'
      AND model IN ('base_target', 'full', 'table')
GROUP BY ALL ORDER BY ALL"""
problems = []


def expect(what, found, expected):
    if found != expected:
        problems.append(f"{what}: found {found}, expected {expected}")


def connected(sql, lake):
    connection = duckdb.connect()
    for statement in sql.replace("'lake/", f"'{lake}/").split(";"):
        if statement.strip():
            connection.execute(statement)
    return connection


def views(posegrid, *flags):
    return subprocess.run([posegrid, "schema", "views", *flags], check=True, capture_output=True, text=True).stdout


def newest(lake):
    state = max((lake / "compact/states").glob("*.jsonl"))
    return state, [json.loads(line) for line in state.read_text().splitlines()]


def check_names(lake, files):
    for own in files:
        digest = blake3.blake3((lake / own["file"]).read_bytes()).hexdigest()
        expect(f"{own['file']}, digest of its bytes", digest[:32], pathlib.Path(own["file"]).name.split(".")[0])


def check_rows(lake, compact):
    for table in ("runs", "accuracy", "asked"):
        original = f"read_parquet('{lake}/{table}/*/*/*.parquet', union_by_name = true)"
        own = f"(SELECT {'*' if table == 'asked' else '* EXCLUDE (filename)'} FROM {table})"
        for one, other in ((own, original), (original, own)):
            more = compact.execute(f"SELECT count(*) FROM (FROM {one} EXCEPT ALL FROM {other})").fetchone()[0]
            expect(f"rows of {one} that {other} does not have", more, 0)


def check_views(posegrid, lake, compact):
    rows = "SELECT * FROM sessions ORDER BY robot, session, run"
    found = compact.execute(rows).fetchall()
    expect("rows of sessions", found, connected(views(posegrid), lake).execute(rows).fetchall())
    expect("rows of sessions with newer runs", connected(views(posegrid, "--compact").replace("--+ ", ""), lake).execute(rows).fetchall(), found)


def timed(what, work):
    begin = time.perf_counter()
    rows = work()
    print(f"{what}: {len(rows)} rows in {time.perf_counter() - begin:.2f} s, the first {rows[0]}")


def with_spark(lake, files):
    from pyspark.sql import SparkSession

    spark = SparkSession.builder.master("local[2]").config("spark.ui.enabled", "false").getOrCreate()
    spark.sparkContext.setLogLevel("ERROR")
    for table in ("runs", "asked"):
        rows = spark.read.parquet(*[str(lake / own["file"]) for own in files if own["table"] == table])
        rows.createOrReplaceTempView(table)
    query = """WITH last AS (SELECT robot, session, max_by(run, number) AS run FROM asked GROUP BY 1, 2)
    SELECT robot, date_format(session_started, 'yyyy-MM') AS month, avg(mean_before_mm), avg(mean_after_mm), count(*)
    FROM runs JOIN last USING (robot, session, run) GROUP BY 1, 2 ORDER BY 1, 2"""
    timed("Spark, the first time", lambda: spark.sql(query).collect())
    timed("Spark, again", lambda: spark.sql(query).collect())


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("posegrid")
    arguments.add_argument("lake", type=pathlib.Path)
    arguments.add_argument("--spark", action="store_true", help="ask Spark too, on two threads of this machine")
    arguments.add_argument("--only-time", action="store_true", help="do not read the tables themselves")
    given = arguments.parse_args()
    state, files = newest(given.lake)
    megabytes = sum(own["bytes"] for own in files) / 1e6
    print(f"{state.name}: {len(files)} files, {megabytes:.1f} MB; in compact {sum(1 for own in (given.lake / 'compact').rglob('*') if own.is_file())}")
    compact = connected(views(given.posegrid, "--compact"), given.lake)
    if not given.only_time:
        check_names(given.lake, files)
        check_rows(given.lake, compact)
        check_views(given.posegrid, given.lake, compact)
    timed("DuckDB over sessions", lambda: compact.execute(OF_SESSIONS).fetchall())
    timed("DuckDB over accuracy", lambda: compact.execute(OF_ACCURACY).fetchall())
    begin = time.perf_counter()
    with_newer = connected(views(given.posegrid, "--compact").replace("--+ ", ""), given.lake)
    print(f"runs newer than the state found in {time.perf_counter() - begin:.2f} s")
    timed("DuckDB over sessions with them", lambda: with_newer.execute(OF_SESSIONS).fetchall())
    if given.spark:
        with_spark(given.lake, files)
    for problem in problems:
        print(f"PROBLEM {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
