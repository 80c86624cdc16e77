"""Every numeric key of a pipeline file at the ends of its range, on a small session: what `check` accepts has a result or a reason, and no panic.

    python tests/readers/extremes.py POSEGRID [--folder target/extremes] [--only WORD]

Keys and ranges are those of src/app/pipeline/keys/pipeline.toml, for the sections that a session of two logs has. The end of a range that has
none is 1e300. A run has 120 seconds; its exit code is 0, 1 or 3, or 2 where `check` had refused the value.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
ARM = ROOT / "pipelines/robots/kr210-r2700-extra.toml"
KEYS = ROOT / "src/app/pipeline/keys/pipeline.toml"
BASE = {
    "robot": {"file": f'"{ARM}"', "name": '"tiny"', "up": "[0, 0, 1]"},
    "input": {"folder": '"made"', "sessions": '["one"]'},
    "controller": {"topic": '"/joint_states"', "time": '"header"', "unit": '"rad"'},
    "commanded": {
        "topic": '"/commanded_pose"', "time": '"header"', "unit": '"m"', "target_is_tool": "true",
        "base_from_command": "{ xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }",
        "flange_from_tool": "{ xyz_mm = [25, -40, 100], quaternion_xyzw = [0, 0, 0, 1] }",
    },
    "tracker": {"topic": '"/tracker/point"', "time": '"header"', "unit": '"m"'},
    "tracker.uncertainty": {"range_um": "10", "range_um_per_m": "0.3", "transverse_um": "15", "transverse_um_per_m": "6", "divisor": "2"},
    "grid": {"steps_mm": "[100, 500]"},
    "tolerance": {"mm": "0.5", "share": "0.95", "confidence": "0.95"},
    "output": {"lake": '"lake"'},
}
NEEDED = {
    "fit.target": {"xyz_mm": "[25, -40, 100]", "sd_mm": "1.0"},
    "fit.loss": {"kind": '"huber"', "tuning": "1.5"},
}
SECTIONS = ("join", "fit", "similarity", "grid", "tolerance", "report", "limits", "input", "tracker.uncertainty", "robot.valid_for")


def ends(entry):
    """The ends of a key's range, and numbers next to them."""
    whole, stated = "whole number" in entry["type"], entry.get("range", "")
    numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", stated)]
    if " to " in stated and len(numbers) == 2:
        found = numbers
    else:
        found = [*numbers, 10**18 if whole else 1e300]
    if "above" in stated:
        found = [1 if whole else 1e-300, *found[1:]]
    if not stated:
        found = [0, 1, 10**18] if whole else [0.0, -1e300, 1e300, 1e-300]
    if "more" in stated and not whole:
        found.append(1e-300)
    if "below" in stated or "and 1" in stated:
        found.append(0.9999999999999999)
    return [int(number) if whole else number for number in found]


def cases():
    for section in tomllib.loads(KEYS.read_text())["section"]:
        name = section["name"]
        if not name.startswith(SECTIONS) or section.get("repeated"):
            continue
        for entry in section["keys"]:
            kind = entry["type"]
            if "number" not in kind or "text" in kind:
                continue
            count = re.match(r"(\d+) ", kind)
            for value in ends(entry):
                written = repr(value)
                if count:
                    written = f"[{', '.join([written] * int(count[1]))}]"
                elif kind.startswith("list"):
                    written = f"[{written}]" if "slide" not in entry["key"] else f"[{written}, {written}]"
                yield name, entry["key"], written


def pipeline(section, key, value):
    wanted = {name: dict(keys) for name, keys in BASE.items()}
    if section in NEEDED:
        wanted[section] = dict(NEEDED[section])
    wanted.setdefault(section, {})[key] = value
    return "".join(f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) for name, keys in wanted.items())


def call(program, *arguments):
    try:
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, errors="replace", timeout=120)
    except subprocess.TimeoutExpired:
        return "120 s", ""
    return done.returncode, done.stdout + done.stderr


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program", type=pathlib.Path)
    arguments.add_argument("--folder", type=pathlib.Path, default=ROOT / "target/extremes")
    arguments.add_argument("--only", default="")
    given = arguments.parse_args()
    program = given.program.resolve() if given.program.exists() else given.program
    shutil.rmtree(given.folder, ignore_errors=True)
    made = given.folder / "made/one"
    code, said = call(program, "simulate", ARM, "--home=0,-75,100,25,55,-15", "--seed", 5, "--random-joints", 30, "--session", "one", "--out", made)
    if code:
        sys.exit(said)
    file, counts, problems = given.folder / "p.toml", {}, 0
    for section, key, value in cases():
        if given.only not in f"{section}.{key}":
            continue
        shutil.rmtree(given.folder / "lake", ignore_errors=True)
        file.write_text(pipeline(section, key, value))
        checked, refused = call(program, "check", file)
        code, said = (checked, refused) if checked else call(program, "run", file)
        counts[code] = counts.get(code, 0) + 1
        if code not in (0, 1, 2, 3) or "panicked" in said or (checked == 0 and code == 2):
            problems += 1
            print(f"PROBLEM [{section}] {key} = {value}: exit code {code}: {said[-600:]}", file=sys.stderr, flush=True)
    print(f"values by exit code: {counts}; {problems} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
