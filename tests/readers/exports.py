"""Reads what `posegrid export` makes of a run's identified geometry with programs of others, and holds the forms against each other.

    python tests/readers/exports.py POSEGRID CALIBRATIONS --folder DIR [--urdf tests/robots/kr210.urdf --base base --tip tool0]
    python tests/readers/exports.py POSEGRID --ur --folder DIR

POSEGRID is the program, CALIBRATIONS a file of table `calibrations`. Needs `pin` from PyPI (Pinocchio).
1. `--format urdf` and the corrected URDF are loaded by Pinocchio, which knows nothing of posegrid.
2. The identified parameters in modified DH are put into Craig's formula here.
3. With --ur, a UR10e is simulated and run first, and the six frames of `--format ur-calibration` are put into the formula of
   ur_description's macro: an origin of x, y, z and roll, pitch, yaw, and a joint about z, six times.
The flange has to be the same within 1e-6 mm and 1e-9 rad at 500 poses, apart from what a form says that it cannot hold. The exit
code is 1 where it is not.
"""

import argparse
import csv
import pathlib
import re
import subprocess
import sys
import tomllib

import numpy as np
import pinocchio as pin

ROOT = pathlib.Path(__file__).resolve().parents[2]
POSES, MOST_MM, MOST_RAD = 500, 1e-6, 1e-9


def exported(program, table, form, *more):
    """What is written, and what is told beside it."""
    command = [program, "export", table, "--format", form, *more]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: {done.stderr}")
    return done.stdout, done.stderr


def pose(xyz, rpy):
    """Millimetres from metres, and a turn about fixed x, y and z."""
    made = np.eye(4)
    made[:3, :3] = pin.rpy.rpyToMatrix(*rpy)
    made[:3, 3] = 1000.0 * np.asarray(xyz)
    return made


def turned(axis, angle):
    return pose((0, 0, 0), [angle if axis == own else 0.0 for own in "xyz"])


def shifted(axis, length):
    return pose([length / 1000.0 if axis == own else 0.0 for own in "xyz"], (0, 0, 0))


def by_pinocchio(urdf, base, tip, poses):
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    frames = [model.getFrameId(link, pin.FrameType.BODY) for link in (base, tip)]
    ends = []
    for angles in poses:
        q = pin.neutral(model)
        for joint, angle in zip(list(model.joints)[1:], angles, strict=True):
            if joint.nq == 2:  # a continuous joint
                q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                q[joint.idx_q] = angle
        pin.framesForwardKinematics(model, data, q)
        end = data.oMf[frames[0]].actInv(data.oMf[frames[1]]).homogeneous.copy()
        end[:3, 3] *= 1000.0
        ends.append(end)
    return ends


def by_modified_dh(text, poses):
    """Craig's formula with the identified numbers; what no row has stands in the nominal robot file before them."""
    lines = text.splitlines()
    nominal = tomllib.loads("\n".join(line[4:] for line in lines if line.startswith("#   ")))
    rows = csv.DictReader(line for line in lines if not line.startswith("#"))
    found = {row["parameter"]: float(row["identified"]) * (np.pi / 180 if row["unit"] == "deg" else 1) for row in rows}

    def placed(place):
        if place not in nominal:
            return np.eye(4)
        stated = nominal[place]
        return pose(np.array(stated["xyz_mm"]) / 1000, np.radians(stated["euler_deg"]))

    def small(of):
        at = [found.get(f"{of}_{axis}", 0.0) / 1000 for axis in "xyz"]
        about = [found.get(f"{of}_r{axis}", 0.0) for axis in "xyz"]
        return pose(at, (0, 0, 0)) @ turned("x", about[0]) @ turned("y", about[1]) @ turned("z", about[2])

    ends = []
    for angles in poses:
        end = small("base") @ placed("base")
        for number, (joint, angle) in enumerate(zip(nominal["joint"], angles, strict=True), 1):
            end = end @ turned("x", found[f"alpha_{number}"]) @ shifted("x", found[f"a_{number}"])
            end = end @ turned("y", found.get(f"beta_{number}", 0.0))
            end = end @ turned("z", found[f"theta_{number}"] + joint["sign"] * angle)
            end = end @ shifted("z", found.get(f"d_{number}", joint["d_mm"]))
        ends.append(end @ placed("flange") @ small("target"))
    return ends


def by_ur_description(text, poses):
    """The six origins of urdf/ur_macro.xacro, and the flange in the last as the comment has it."""
    numbers = re.findall(r"^    (?:x|y|z|roll|pitch|yaw): (\S+)$", text, re.MULTILINE)
    assert len(numbers) == 36, text
    frames = np.array(numbers, dtype=float).reshape(6, 6)
    xyz, rpy = re.search(r'tool0 to flange xyz="([^"]*)" rpy="([^"]*)"', text).groups()
    rest = pose(*(np.array(part.split(), dtype=float) for part in (xyz, rpy)))
    ends = []
    for angles in poses:
        end = np.eye(4)
        for frame, angle in zip(frames, angles, strict=True):
            end = end @ pose(frame[:3], frame[3:]) @ turned("z", angle)
        ends.append(end @ rest)
    return ends


def compare(name, ends, wanted):
    off = np.array(ends) - np.array(wanted)
    mm, rad = np.linalg.norm(off[:, :3, 3], axis=1).max(), np.abs(off[:, :3, :3]).max()
    good = mm < MOST_MM and rad < MOST_RAD
    print(f"{name}: the flange within {mm:.1e} mm and {rad:.1e} rad at {POSES} poses{'' if good else ': TOO MUCH'}")
    return good


def spread(urdf):
    """Poses within the limits of an exported URDF, the same ones each time."""
    model = pin.buildModelFromXML(urdf)
    return np.random.default_rng(1).uniform(model.lowerPositionLimit, model.upperPositionLimit, (POSES, model.nq))


def ur_run(program, folder):
    """The file of table calibrations of a simulated UR10e."""
    robot = ROOT / "pipelines/robots/ur10e.toml"
    if not (folder / "lake").exists():
        session = [program, "simulate", robot, "--out", folder / "sessions/ur", "--seed", 3, "--session", "ur", "--random", 80]
        session += ["--robot-name", "kr210-demo", "--home", "0,-70,100,-120,-90,0", "--size", "400,400,400"]
        subprocess.run([str(part) for part in session], check=True, capture_output=True)
        pipeline = (ROOT / "pipelines/quickstart.toml").read_text()
        for old, new in (
            ("robots/kr210-r2700-extra.toml", str(robot)),
            ('"../tests/recordings"', '"sessions"'),
            ('sessions = ["quickstart"]', 'sessions = ["ur"]'),
            ('"../lake"', '"lake"'),
        ):
            pipeline = pipeline.replace(old, new)
        (folder / "pipeline.toml").write_text(pipeline)
        ended = subprocess.run([str(program), "run", str(folder / "pipeline.toml")], capture_output=True, text=True)
        if ended.returncode not in (0, 3):
            sys.exit(ended.stderr)
    return next((folder / "lake/calibrations").rglob("*.parquet"))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("posegrid", type=pathlib.Path)
    parser.add_argument("calibrations", type=pathlib.Path, nargs="?")
    parser.add_argument("--folder", type=pathlib.Path, required=True)
    parser.add_argument("--ur", action="store_true")
    parser.add_argument("--urdf", type=pathlib.Path)
    parser.add_argument("--base")
    parser.add_argument("--tip")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    program = given.posegrid.resolve()
    table = ur_run(program, given.folder) if given.ur else given.calibrations
    urdf, _ = exported(program, table, "urdf")
    poses = spread(urdf)
    wanted = by_pinocchio(urdf, "base_link", "flange", poses)
    text, _ = exported(program, table, "parameters", "--convention", "modified-dh")
    good = compare("parameters in modified DH", by_modified_dh(text, poses), wanted)
    if given.urdf:
        corrected, _ = exported(program, table, "urdf", "--urdf", given.urdf, "--base", given.base, "--tip", given.tip)
        good &= compare(f"{given.urdf.name}, corrected", by_pinocchio(corrected, given.base, given.tip, poses), wanted)
    if given.ur:
        yaml, _ = exported(program, table, "ur-calibration")
        good &= compare("ur_description", by_ur_description(yaml, poses), wanted)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
