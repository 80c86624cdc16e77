"""What programs that enter a benchmark share: the files that `benchmark.py` writes for them, and the answers to them."""

import csv
import math
import tomllib
from types import SimpleNamespace

import numpy as np


def arms(given):
    """The folders of arms that were exported."""
    return sorted(path for path in given.iterdir() if path.is_dir())


def links(folder):
    """The rows of an arm's standard DH table: a (mm), alpha, d (mm), offset, sign."""
    robot = tomllib.loads((folder / "robot.toml").read_text())
    if robot["convention"] != "standard-dh" or any(key in robot for key in ("joint_map", "coupling")):
        raise SystemExit(f"{folder.name}: the script reads standard DH without coupled joints")
    rows = [
        (j["a_mm"], math.radians(j["alpha_deg"]), j["d_mm"], math.radians(j["offset_deg"]), j["sign"])
        for j in robot["joint"]
    ]
    return np.array(rows, dtype=float)


def splits(folder):
    return sorted(path for path in folder.iterdir() if path.is_dir())


def stations(path):
    """The stations of a file: number, joints (rad), measured position (mm, NaN where none is given), place by posegrid's identified geometry, and
    the error that it leaves (mm)."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    columns = [name for name in rows[0] if name.startswith("q")]
    numbers = lambda names: np.array([[float(row[name] or "nan") for name in names] for row in rows])
    measured, geometry = numbers("xyz"), numbers(["gx", "gy", "gz"])
    names = [int(row["station"]) for row in rows]
    return SimpleNamespace(names=names, joints=numbers(columns), measured=measured, geometry=geometry, error=measured - geometry)


def answer(path, names, positions, variances=None):
    """Writes predicted positions, mm in the frame of the training, with the variances of measured minus predicted along its axes, mm²."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["station", *"xyz", *([] if variances is None else ["cxx", "cxy", "cxz", "cyy", "cyz", "czz"])])
        for place, (station, position) in enumerate(zip(names, positions)):
            x, y, z = (0, 0, 0) if variances is None else map(float, variances[place])
            stated = [] if variances is None else [x, 0.0, 0.0, y, 0.0, z]
            writer.writerow([station, *map(float, position), *stated])


def flange(dh, joints):
    """The nominal flange in the base frame: 4 × 4, mm."""
    pose = np.eye(4)
    for (a, alpha, d, offset, sign), joint in zip(dh, joints):
        c, s, ca, sa = *(f(sign * joint + offset) for f in (math.cos, math.sin)), math.cos(alpha), math.sin(alpha)
        pose = pose @ np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
    return pose


def kabsch(to, source):
    """The rigid transform, 4 × 4, that moves `source` onto `to` with the least sum of squares."""
    middle, other = to.mean(0), source.mean(0)
    u, _, vt = np.linalg.svd((to - middle).T @ (source - other))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = turn, middle - turn @ other
    return moved


def start(dh, joints, measured, passes=10_000):
    """World from base (4 × 4) and the target at the flange (mm) by turns until it stays, the arm nominal."""
    poses = np.array([flange(dh, own) for own in joints])
    target = np.zeros(3)
    for _ in range(passes):
        world = kabsch(measured, poses[:, :3, 3] + poses[:, :3, :3] @ target)
        turns = world[:3, :3] @ poses[:, :3, :3]
        left = measured - (poses[:, :3, 3] @ world[:3, :3].T + world[:3, 3])
        before, target = target, np.linalg.lstsq(turns.reshape(-1, 3), left.reshape(-1), rcond=None)[0]
        if np.abs(target - before).max() < 1e-6:
            break
    return world, target
