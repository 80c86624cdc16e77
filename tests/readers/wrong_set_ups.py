"""Mistakes in the files of a cell, each made on several arms of our own: what `posegrid run` names first.

    python tests/readers/wrong_set_ups.py target/debug/posegrid --seed 1 --seed 2

The arms and their logs are those of `independent_arm.py`, which shares no code with posegrid. For each arm the session is recorded
once; then every mistake is made in a copy of the pipeline file or of the robot file, and the session is run. A line is printed for
each mistake that is not named first, and the count at the end. The exit code is 1 where fewer than 95 % are named, or where the
sound set-up of an arm is not run or is warned of.
"""

import argparse
import pathlib
import re
import subprocess
import sys

import numpy as np

from independent_arm import ROOT, Arm, pipeline, record

ROBOT = "kr210-r2700-extra.toml"


def replaced(text, old, new):
    if old not in text:
        raise SystemExit(f"{old!r} is not in the file to be changed")
    return text.replace(old, new, 1)


def in_section(text, name, old, new):
    begin = text.index(f"[{name}]")
    return text[:begin] + replaced(text[begin:], old, new)


def of_joint(text, number, change):
    parts = re.split(r"(?=\[\[joint\]\])", text)
    changed = change(parts[number])
    if changed == parts[number]:
        raise SystemExit(f"joint {number} is not changed")
    return "".join([*parts[:number], changed, *parts[number + 1 :]])


def swapped(text, first, second):
    first, second = f'"joint_a{first}"', f'"joint_a{second}"'
    return text.replace(first, "@").replace(second, first).replace("@", second)


def opposite(key):
    turn = lambda found: f"{key} = {-float(found.group(1)):g}" if key != "sign" else f"sign = {-int(found.group(1))}"
    return lambda text: re.sub(rf"{key} = (-?[\d.]+)", turn, text, count=1)


def other_arm(text):
    """The numbers of a small arm under the names of this one's joints."""
    names = iter(re.findall(r'^name = "(.*)"', text, re.M))
    other = (ROOT / "pipelines/robots/irb120.toml").read_text()
    return re.sub(r'^name = ".*"', lambda _: f'name = "{next(names)}"', other, flags=re.M)


TOOL, TARGET = "flange_from_tool = { xyz_mm = [25, -40, 100]", "target = { xyz_mm = [25, -40, 100]"
TURNED = "base_from_command = { xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }"
SURVEY = 'euler_deg = [0.2291831, -0.4010705, 148.9690267], euler_order = "fixed-xyz"'
# The mistake, what it does to the pipeline file, what it does to the robot file, and a pattern that the first naming matches.
MISTAKES = [
    ("frame of commands turned by 180°", lambda p: replaced(p, TURNED, TURNED.replace("0, 0, 0, 1]", "0, 0, 1, 0]")), None, r"base_from_command is turned by 180° about z"),
    ("frame of commands turned by 90°", lambda p: replaced(p, TURNED, TURNED.replace("quaternion_xyzw = [0, 0, 0, 1]", 'euler_deg = [0, 0, 90], euler_order = "fixed-xyz"')), None, r"base_from_command is turned by -90° about z"),
    ("surveyed base turned by 180°", lambda p: replaced(p, "148.9690267", "-31.0309733"), None, r"tracker_from_base is turned"),
    ("surveyed angles in another order", lambda p: replaced(p, SURVEY, SURVEY.replace("fixed-xyz", "moving-zyx")), None, r"tracker_from_base is written in another convention"),
    ("tool 80 mm from the target", lambda p: replaced(p, TOOL, TOOL.replace("100]", "180]")), None, r"flange_from_tool is off by \[0.0, 0.0, -80.0\]"),
    ("target 80 mm from the tool", lambda p: replaced(p, TARGET, TARGET.replace("100]", "180]")), None, r"\[fit\] target is off by \[0.0, 0.0, -80.0\]"),
    ("tool left out", lambda p: replaced(p, TOOL, TOOL.replace("[25, -40, 100]", "[0, 0, 0]")), None, r"flange_from_tool is off by \[25.0, -40.0, 100.0\]"),
    ("tool mirrored", lambda p: replaced(p, TOOL, TOOL.replace("-40", "40")), None, r"flange_from_tool has the wrong sign in y"),
    ("tool in metres", lambda p: replaced(p, TOOL, TOOL.replace("[25, -40, 100]", "[0.025, -0.040, 0.100]")), None, r"flange_from_tool has its position in m"),
    ("commands in m read as mm", lambda p: in_section(p, "commanded", 'unit = "m"', 'unit = "mm"'), None, r"commanded positions are in m"),
    ("angles in rad read as deg", lambda p: replaced(p, 'unit = "rad"', 'unit = "deg"'), None, r"joint angles are in rad"),
    ("readings in m read as mm", lambda p: in_section(p, "tracker", 'unit = "m"', 'unit = "mm"'), None, r"tracker's positions are in m"),
    ("nominal a_2 wrong by 100 mm", None, lambda r: replaced(r, "a_mm = 1150", "a_mm = 1050"), r"other numbers than the ready one, kr210-r2700-extra"),
    ("nominal d_4 wrong by 100 mm", None, lambda r: replaced(r, "d_mm = 1200", "d_mm = 1300"), r"other numbers than the ready one, kr210-r2700-extra"),
    ("another arm's file", None, other_arm, r"of another arm"),
    ("joints 5 and 6 swapped", None, lambda r: swapped(r, 5, 6), r"joint 5\) and .*joint 6\) are swapped"),
    ("joints 1 and 2 swapped", None, lambda r: swapped(r, 1, 2), r"joint 1\) and .*joint 2\) are swapped"),
    ("joint 3 counted the other way", None, lambda r: of_joint(r, 3, opposite("sign")), r"counts .*joint 3\) the other way"),
    ("sign of a twist", None, lambda r: of_joint(r, 1, opposite("alpha_deg")), r"alpha_deg of link 1"),
    ("sign of a length", None, lambda r: of_joint(r, 2, opposite("a_mm")), r"a_mm of link 2"),
    ("a joint's zero left out", None, lambda r: of_joint(r, 3, lambda text: text.replace("offset_deg = 90", "offset_deg = 0")), r"the zero of .*joint 3\) is \+90° away"),
]


def run(binary, folder, session, number, on_pipeline, on_robot):
    """Runs the session with changed files; the exit code and everything that was said."""
    files = folder / f"{session}-{number}"
    files.mkdir()
    robot = (ROOT / "pipelines/robots" / ROBOT).read_text()
    text = pipeline(folder, session, []).read_text().replace(f"{ROOT}/pipelines/robots/{ROBOT}", ROBOT)
    text = re.sub(r'lake = ".*"', 'lake = "lake"', text)
    (files / ROBOT).write_text(on_robot(robot) if on_robot else robot)
    (files / "cell.toml").write_text(on_pipeline(text) if on_pipeline else text)
    done = subprocess.run([binary, "run", files / "cell.toml"], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", type=pathlib.Path, help="posegrid")
    parser.add_argument("--seed", type=int, action="append", help="an arm; may be given several times")
    parser.add_argument("--folder", type=pathlib.Path, default=ROOT / "target/wrong-set-ups", help="a new folder to work in")
    parser.add_argument("--pitch", type=float, default=240.0, help="pitch of the measured stations, mm")
    options = parser.parse_args()
    folder, binary = options.folder.resolve(), options.binary.resolve()
    folder.mkdir(parents=True)
    named, made, alarms = 0, 0, 0
    for seed in options.seed or [1]:
        generator = np.random.default_rng(seed)
        session = f"arm-{seed}"
        record(Arm(generator), generator, folder / "recordings" / session, options.pitch)
        code, said = run(binary, folder, session, 0, None, None)
        if code not in (0, 3) or "check the set-up" in said or "contradict" in said:
            alarms += 1
            print(f"seed {seed}, sound: exit code {code}\n{said}")
        for number, (name, on_pipeline, on_robot, pattern) in enumerate(MISTAKES, 1):
            code, said = run(binary, folder, session, number, on_pipeline, on_robot)
            first = said.split("with one change by", 1)[-1].split("the logs cannot separate", 1)[0]
            is_named = code == 1 and re.search(pattern, first) is not None
            named, made = named + is_named, made + 1
            if not is_named:
                print(f"seed {seed}, {name}: exit code {code}: {said.strip().splitlines()[0][:600] if said.strip() else ''}", flush=True)
    print(f"{named} of {made} mistakes named first, {alarms} false alarms")
    return 1 if alarms or named < 0.95 * made else 0


if __name__ == "__main__":
    sys.exit(main())
