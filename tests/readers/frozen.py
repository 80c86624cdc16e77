"""Ten lakes of a commit, kept outside the checkout, held against those of this checkout by column.

    python tests/readers/frozen.py BASE [--folder ../frozen] [--before PROGRAM] [--after PROGRAM] [--only NAME]

BASE is a commit. Its program is built in a clone at FOLDER/<commit>/checkout (or given by `--before`) and makes, once, the sessions that
are simulated and its ten lakes, FOLDER/<commit>/lakes. This checkout is then built (or `--after` given), makes the same lakes from the same
inputs in FOLDER/now, and `compare_lakes.py` holds each against the one of BASE. Exit code 0: nothing differs; 1 otherwise.

    quickstart   the first command of README
    grid         the UR10 on its grid
    judged       random-a of the UR10, judged by random-b
    pool         the four recordings of the UR10, each left out
    tables       WAM and positioner, as tables
    reflectors   three reflectors with references on base and floor, a tracker that is bumped
    lengths      two instruments of lengths beside a tracker
    camera       a camera that watches a flat target
    driven       a session driven by corrected commands
    plan         a plan, and the history of two nights
"""

import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
ARM = ROOT / "pipelines/robots/kr210-r2700-extra.toml"
HOME = ["--home", "0,-75,100,25,55,-15"]
SIMULATED = {
    "reflectors": ["--seed", "3", "--random-joints", "120", "--table", "--beside", "120,0,0", "--beside", "0,120,0", "--reference",
                   "900,0,300", "--reference", "0,900,300", "--floor-reference", "1500,1500,0", "--tracker-bump-mm", "0.2"],
    "lengths": ["--seed", "3", "--random-joints", "120", "--table", "--distance-from", "2000,0,100,3,0.01",
                "--height-above", "0,0,1,-300,0.05"],
    "camera": ["--seed", "3", "--random-joints", "120", "--table", "--camera", "1500,0.2,240,2"],
    "monday": ["--seed", "3", "--random", "120", "--cone-deg", "10"],
}


def call(program, *arguments, allowed=(0,)):
    """Runs a command in the root of the checkout; anything but an allowed exit code ends the comparison."""
    done = subprocess.run([program, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True)
    if done.returncode not in allowed:
        sys.exit(f"{program} {' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def pipeline(text, file, lake, changes):
    """A pipeline file with another lake and other lines: pairs of a pattern and what takes its place."""
    for pattern, new in [(r'^lake = .*', f'lake = "{lake}"'), *changes]:
        text, count = re.subn(pattern, lambda _: new, text, flags=re.M)
        if not count:
            sys.exit(f"{file.name}: nothing to replace for {pattern}")
    file.write_text(text)
    return file


def given(name):
    """A pipeline file of the checkout whose paths hold anywhere."""
    text = (ROOT / "pipelines" / f"{name}.toml").read_text()
    return re.sub(r'"((\.\./|robots/)[^"]*)"', lambda found: f'"{os.path.normpath(ROOT / "pipelines" / found[1])}"', text)


def of_table(inputs, name):
    """The quickstart's file with the table of a simulated session in place of its logs, as the table's own head says."""
    lines = (inputs / name / "mon/stations.csv").read_text().splitlines()
    section = "\n".join(line[2:] for line in lines[1:] if line.startswith("# "))
    before, after = given("quickstart").split("[controller]")
    after = re.sub(r"(?m)^(topic|time|unit|temperature) = .*\n", "", after[after.index("[commanded]"):])
    return f"{before}{section}\n\n{after}"


def made(program, inputs):
    """The sessions that are simulated, once."""
    for name, flags in SIMULATED.items():
        folder = inputs / name / "mon"
        if not (folder / "controller.mcap").exists():
            call(program, "simulate", ARM, "--out", folder, "--arm", "3", "--session", "mon", *HOME, *flags)


def corrected_session(program, inputs, out):
    """Targets corrected with monday's table, and, once, tuesday of the simulated arm, which they drive."""
    (table,) = out.glob("lake/calibrations/*/mon/*.parquet")
    truth = [line.split(",") for line in (inputs / "monday/mon/truth_stations.csv").read_text().splitlines()]
    columns = [k for k, name in enumerate(truth[0]) if name.startswith("commanded_joint_")]
    lines = ["target," + ",".join(f"q{k}_rad" for k in range(1, 7))]
    lines += [",".join([f"hole {n}", *(row[k] for k in columns)]) for n, row in enumerate(truth[1:])]
    (out / "targets.csv").write_text("\n".join(lines) + "\n")
    allowed = ["--allow", "not-met", "--allow", "not-shown"]
    call(program, "compensate", table, out / "targets.csv", *allowed, "--out", out / "corrected.json", allowed=(0, 3))
    folder = inputs / "monday/tue"
    if not folder.exists():
        flags = ["--arm", "3", "--seed", "4", "--session", "tue", *HOME, "--poses", out / "corrected.json"]
        call(program, "simulate", ARM, *flags, "--out", folder)


def lakes(program, inputs, out, only):
    """The ten lakes of a program, of which those that are there already are kept."""
    for name, make in LAKES.items():
        if only and name not in only or (out / name / "whole").exists():
            continue
        shutil.rmtree(out / name, ignore_errors=True)
        (out / name).mkdir(parents=True)

        def job(text, changes=(), file=name):
            changed = pipeline(text, out / name / f"{file}.toml", out / name / "lake", changes)
            call(program, "run", changed, "--jobs", "2", allowed=(0, 3))

        make(job, program, inputs, out / name)
        (out / name / "whole").touch()


def sessions(inputs, name, listed='["mon"]'):
    return [(r"^folder = .*", f'folder = "{inputs / name}"'), (r"^sessions = .*", f"sessions = {listed}")]


def of_stations(job, inputs, name, changes=()):
    listed = '["mon"]\nstations = "stations.csv"'
    job(of_table(inputs, name), [*sessions(inputs, name, listed), *changes])


def pool(job, *_):
    every = 'sessions = ["ur10-grid", "ur10-joint", "ur10-random-a", "ur10-random-b"]\npool = "all"'
    job(given("ur10-random"), [(r"^sessions = .*", every), (r"^test = .*\n", "")])


def tables(job, *_):
    for name in ("wam", "positioner"):
        job(given(f"stations-{name}"), file=name)


def driven(job, program, inputs, out):
    job(given("quickstart"), sessions(inputs, "monday"))
    corrected_session(program, inputs, out)
    job(given("quickstart"), sessions(inputs, "monday", '["tue"]'), file="tuesday")


def plan(job, program, inputs, out):
    job(given("quickstart"), sessions(inputs, "monday", '["mon", "tue"]'))
    call(program, "history", out / "lake", "--output", out / "lake/history", allowed=(0, 3))
    small = "poses = [12]\nrobots = 8\nwhole_model_robots = 4\ntest_poses = 100\ncandidates = 100\nverify_poses = 6"
    changes = [(r"^steps_mm = .*", "steps_mm = [250, 500]"), (r"^poses = .*", small)]
    call(program, "plan", pipeline(given("plan-kr210"), out / "small.toml", out / "lake", changes), allowed=(0, 3))


TARGET = (r"^target = .*", "targets.T1 = { xyz_mm = [25, -40, 100], sd_mm = 0.2 }")
CAMERA = (r"^uncertainty = .*", "camera = { focal_px = 1500, noise_px = 0.2, target_mm = 240, corners = 2 }")
LAKES = {
    "quickstart": lambda job, *_: job(given("quickstart")),
    "grid": lambda job, *_: job(given("ur10-grid")),
    "judged": lambda job, *_: job(given("ur10-random")),
    "pool": pool,
    "tables": tables,
    "reflectors": lambda job, _, inputs, *__: of_stations(job, inputs, "reflectors", [TARGET]),
    "lengths": lambda job, _, inputs, *__: of_stations(job, inputs, "lengths"),
    "camera": lambda job, _, inputs, *__: of_stations(job, inputs, "camera", [CAMERA, (r"^tracker_from_base = .*\n", "")]),
    "driven": driven,
    "plan": plan,
}


def built(checkout, target):
    environment = os.environ | {"CARGO_TARGET_DIR": str(target)}
    subprocess.run(["cargo", "build", "--release"], cwd=checkout, env=environment, check=True)
    return target / "release/posegrid"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("base", help="the commit whose tables have to stay")
    parser.add_argument("--folder", type=pathlib.Path, default=ROOT.parent / "frozen", help="where lakes are kept, outside the checkout")
    parser.add_argument("--before", type=pathlib.Path, help="a program of BASE that is there already")
    parser.add_argument("--after", type=pathlib.Path, help="a program of this checkout that is there already")
    parser.add_argument("--only", action="append", choices=LAKES, help="one of the ten; may be given several times")
    arguments = parser.parse_args()
    commit = subprocess.run(["git", "rev-parse", arguments.base], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    folder = arguments.folder.resolve() / commit[:12]
    program = arguments.before
    if program is None:
        checkout = folder / "checkout"
        if not checkout.exists():
            subprocess.run(["git", "clone", "-q", ROOT, checkout], check=True)
        subprocess.run(["git", "checkout", "-q", commit], cwd=checkout, check=True)
        program = built(checkout, folder / "target")
    inputs = folder / "inputs"
    made(program.resolve(), inputs)
    lakes(program.resolve(), inputs, folder / "lakes", arguments.only)
    now = arguments.folder.resolve() / "now"
    for old in [now / name for name in arguments.only or LAKES]:
        shutil.rmtree(old, ignore_errors=True)
    after = (arguments.after or built(ROOT, ROOT / "target")).resolve()
    lakes(after, inputs, now, arguments.only)
    code = 0
    for name in arguments.only or LAKES:
        print(f"== {name}", flush=True)
        pair = folder / "lakes" / name / "lake", now / name / "lake"
        compared = [sys.executable, str(ROOT / "tests/readers/compare_lakes.py"), *pair]
        code |= subprocess.run(compared).returncode
    sys.exit(code)


if __name__ == "__main__":
    main()
