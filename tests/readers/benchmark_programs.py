"""FIGAROH and pybotics on the splits of a benchmark, their figures and times beside posegrid's: same data, same machine, one judge.

    python tests/readers/benchmark_programs.py POSEGRID --figaroh PYTHON --pybotics PYTHON [--suite SUITE] [--arm wam]… [--folder FOLDER]

The programs need environments of their own (`pip install figaroh pyyaml`; `pip install pybotics`, which wants numpy before 2). Checks that
every answer is accepted by the judge, and that on the WAM, whose positions all three fit with equal weights, the geometry of FIGAROH is as
good as ours within 5 %.
"""

import argparse
import os
import pathlib
import resource
import subprocess
import sys
import time

import polars

PROGRAMS = pathlib.Path("pipelines/benchmarks/programs")


def timed(command):
    """Standard output of a command, its wall time and the time of all cores, s."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    ended = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ended.stdout, time.perf_counter() - began, after.ru_utime - before.ru_utime


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("posegrid", type=pathlib.Path)
    arguments.add_argument("--figaroh", type=pathlib.Path)
    arguments.add_argument("--pybotics", type=pathlib.Path)
    arguments.add_argument("--suite", type=pathlib.Path, default="pipelines/benchmarks/stations.toml")
    arguments.add_argument("--arm", action="append", default=[])
    arguments.add_argument("--folder", type=pathlib.Path, default="target/benchmark-programs")
    own = arguments.parse_args()
    arms = [part for arm in own.arm for part in ("--arm", arm)]
    given = own.folder / "given"
    timed([own.posegrid, "benchmark", own.suite, *arms, "--export", given])
    predictions = []
    for name, python in (("figaroh", own.figaroh), ("pybotics", own.pybotics)):
        if python:
            answers = own.folder / name
            text, wall, cores = timed([python, "-W", "ignore", PROGRAMS / f"{name}_entry.py", given, answers])
            print(text, end="")
            print(f"{name}: {wall:.1f} s, {cores:.1f} s of a core in all")
            predictions += ["--predictions", f"{name}={answers}"]
    out = own.folder / "out"
    text, wall, cores = timed([own.posegrid, "benchmark", own.suite, *arms, *predictions, "--out", out])
    print(text, end="")
    print(f"posegrid, all its models and the intervals of all: {wall:.1f} s, {cores:.1f} s of a core")
    rms = polars.read_parquet(out / "benchmark.parquet").filter(polars.col("figure") == "rms", polars.col("robot") == "wam")
    for split in rms["split"].unique().sort():
        models = dict(rms.filter(polars.col("split") == split).select("model", "value").iter_rows())
        if "figaroh" in models and abs(models["figaroh"] / models["geometric"] - 1) > 0.05:
            print(f"PROBLEM wam, {split}: FIGAROH {models['figaroh']:.3f} mm, ours {models['geometric']:.3f} mm", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    os.environ["PYTHONPATH"] = str(PROGRAMS)
    sys.exit(main())
