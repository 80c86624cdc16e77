"""A stationary camera with a laser line sees the tool of the arm of `independent_arm.py`: points with covariances, as a log and as a table.

    python tests/readers/structured_light.py target/debug/posegrid --seed 1 --seed 2

What is measured is points in the camera's frame. Their noise is long along the line of sight, where it grows with the square of the
distance, and each message states it as `geometry_msgs/PoseWithCovarianceStamped`: `--wrong-by` times too small. One dwell in twenty-five is
missed. With `--poses` the orientation is measured too, and its 3 x 3 block and the block of position and orientation are stated.

For each seed `posegrid run` reads both logs, and the same stations as a table. This program shares no code with it. It checks that
- the size of what is stated is found: `--wrong-by` within `--errors` of the standard errors that table `sources` states;
- table `stations` has the mean of what the log's messages state between a station's first and last reading, all blocks, to nine digits
  (the log is decoded anew with `mcap_ros2`);
- the table of stations gives the size of the log, to a tenth.
"""

import argparse
import csv
import pathlib
import sys
import tempfile

import mcap_ros2.reader
import mcap_ros2.writer
import numpy as np
import pyarrow.parquet

from independent_arm import HOME, JOINT_STATE, JOINTS, POSE_STAMPED, REPEATABILITY, ROOT, START_NS, Arm, command, euler, turn

CAMERA_FROM_BASE = euler([-100.0, 10.0, 80.0])
CAMERA_MM = np.array([-300.0, 400.0, 3600.0])
POSE_WITH_COVARIANCE = POSE_STAMPED.replace(
    "geometry_msgs/Pose pose\n===", "geometry_msgs/PoseWithCovariance pose\n===", 1
).replace("MSG: geometry_msgs/Pose\n", "MSG: geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n" + "=" * 80 + "\nMSG: geometry_msgs/Pose\n", 1)
UPPER = [(i, j) for i in range(3) for j in range(i, 3)]


def stated(point):
    """What the camera states of a point, and of the orientation there: mm and rad."""
    ray, far = point / np.linalg.norm(point), np.linalg.norm(point) / 1000
    along = np.outer(ray, ray)
    position = along * (0.03 * far**2) ** 2 + (np.eye(3) - along) * (0.01 * far) ** 2
    skew = np.array([[0, -ray[2], ray[1]], [ray[2], 0, -ray[0]], [-ray[1], ray[0], 0]])
    # A turn across the ray goes with a shift across it: half of its variance.
    mixed = 0.7 * (0.01 * far) * 2e-4 * skew
    turns = np.diag([4e-8, 4e-8, 4e-8]) + 4e-8 * along
    return np.block([[position, mixed], [mixed.T, turns]])


def quaternion(matrix):
    """x y z w of a rotation matrix, by its largest eigenvector (Bar-Itzhack)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    k = np.array([[xx - yy - zz, 0, 0, 0], [yx + xy, yy - xx - zz, 0, 0], [zx + xz, zy + yz, zz - xx - yy, 0], [zy - yz, xz - zx, yx - xy, xx + yy + zz]])
    return np.linalg.eigh(k / 3)[1][:, -1]


def record(generator, folder, count, options):
    """Both logs and the table of a session."""
    arm = Arm(generator)
    rests = HOME + generator.uniform(-0.6, 0.6, (count, 6)) + generator.normal(0, REPEATABILITY, (count, 6))
    turned, place = arm.tool_pose(rests)
    points, turns = place @ CAMERA_FROM_BASE.T + CAMERA_MM, CAMERA_FROM_BASE @ turned
    covariances = np.array([stated(point) for point in points])
    noise = np.array([np.linalg.cholesky(own) @ generator.normal(0, options.wrong_by, 6) for own in covariances])
    points = points + noise[:, :3]
    turns = np.array([turn(v / np.linalg.norm(v), np.linalg.norm(v)) @ own for v, own in zip(noise[:, 3:], turns)])
    missed = generator.uniform(0, 1, count) < 0.04
    folder.mkdir(parents=True)
    starts = 3.0 * np.arange(count)
    with (folder / "controller.mcap").open("wb") as stream:
        writer = mcap_ros2.writer.Writer(stream)
        state = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for time in np.arange(0.0, 3.0 * count, 0.05):
            number = int(time // 3.0)
            share = np.clip((time - starts[number]) / 1.2, 0, 1)
            before = rests[number - 1] if number else HOME
            q = before + (rests[number] - before) * share * share * (3 - 2 * share)
            now = START_NS + round(time * 1e9)
            body = {"header": header(now), "name": JOINTS, "position": [float(x) for x in q], "velocity": [], "effort": []}
            writer.write_message("/joint_states", state, body, now, now)
        writer.finish()
    with (folder / "tracker.mcap").open("wb") as stream:
        writer = mcap_ros2.writer.Writer(stream)
        pose = writer.register_msgdef("geometry_msgs/msg/PoseWithCovarianceStamped", POSE_WITH_COVARIANCE)
        for time in np.arange(0.02, 3.0 * count, 0.1):
            number = int(time // 3.0)
            if missed[number] or time - starts[number] < 1.2:
                continue
            metres = np.diag([1e-3] * 3 + [1.0] * 3)
            # What is stated varies a little from message to message, and so does what is read.
            own = metres @ covariances[number] @ metres * generator.uniform(0.9, 1.1)
            at = (points[number] + generator.normal(0, 0.002, 3)) / 1000
            q = quaternion(turns[number]) if options.poses else [0, 0, 0, 1]
            now = START_NS + round((time + 2.5) * 1e9)
            body = {"pose": {"position": dict(zip("xyz", map(float, at))), "orientation": dict(zip("xyzw", map(float, q)))}, "covariance": [float(x) for x in own.ravel()]}
            writer.write_message("/scanner", pose, {"header": header(now), "pose": body}, now, now)
        writer.finish()
    with (folder / "scan.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow([*JOINTS, "x", "y", "z", "qx", "qy", "qz", "qw", *(f"c{n}" for n in range(36))])
        for number in np.flatnonzero(~missed):
            row = [*rests[number], *points[number], *quaternion(turns[number]), *covariances[number].ravel()]
            writer.writerow([f"{value:.12g}" for value in row])


def header(now):
    return {"stamp": {"sec": int(now // 10**9), "nanosec": int(now % 10**9)}, "frame_id": "scanner"}


def pipeline(folder, name, reads, options):
    lines = ["[robot]", f'file = "{ROOT}/pipelines/robots/kr210-r2700-extra.toml"', f'name = "{name}"', "[input]", 'folder = "sessions"', *reads]
    lines += ["uncertainty = { range_um = 900, range_um_per_m = 0, transverse_um = 200, transverse_um_per_m = 0, divisor = 1, orientation_rad = 1e-3 }"]
    lines += ["[fit]", f"orientations = {'true' if options.poses else 'false'}", "[fit.full]", "enabled = false", "[grid]", "steps_mm = [400]"]
    lines += ["[tolerance]", "mm = 3", "share = 0.95", "confidence = 0.95", "[output]", f'lake = "lake-{name}"']
    (folder / f"{name}.toml").write_text("\n".join(lines) + "\n")
    return folder / f"{name}.toml"


def only(folder):
    (path,) = folder.glob("*/*/*.parquet")
    return pyarrow.parquet.read_table(path, partitioning=None).to_pylist()


def blocks(log, first, last, poses):
    """Mean of the covariances stated between two times, mm and rad."""
    units = np.diag([1e3] * 3 + [1.0] * 3)
    own = [units @ c @ units for t, c in log if first <= t <= last]
    return np.mean(own, axis=0)


def check(binary, folder, seed, options):
    generator = np.random.default_rng(seed)
    record(generator, folder / "sessions/monday", options.stations, options)
    logs = ['sessions = ["monday"]', "[controller]", 'topic = "/joint_states"', 'time = "header"', 'unit = "rad"', "[tracker]", 'topic = "/scanner"', 'time = "header"', 'unit = "m"']
    logs += [] if options.poses else ["ignore_orientation = true"]
    table = ['sessions = ["monday"]', 'stations = "scan.csv"', "[stations]", f"joints = {JOINTS}", 'joint_unit = "rad"', "[stations.measured]", 'position = ["x", "y", "z"]', 'unit = "mm"']
    table += [f"covariance = {[f'c{n}' for n in range(36)]}"]
    table += ['orientation = { quaternion_xyzw = ["qx", "qy", "qz", "qw"] }'] if options.poses else []
    table += ["[tracker]"]
    wrong, sizes = [], {}
    for name, reads in (("log", logs), ("table", table)):
        said = command([binary, "run", "--verbose", pipeline(folder, name, reads, options)], {0, 3})
        if options.verbose:
            print(said)
        row = only(folder / f"lake-{name}/sources")[0]
        sizes[name] = row["stated_sizes"][0]
        error = row["stated_size_ses"][0]
        off = (sizes[name] - options.wrong_by) / error
        turned = row["stated_orientation_sizes"]
        print(f"| {seed} | {name} | {row['readings']} | {sizes[name]:.3f} +- {error:.3f} | {off:+.2f} | {turned} |", flush=True)
        if not abs(off) <= options.errors:
            wrong.append(f"{name}: a size of {sizes[name]} +- {error}, true {options.wrong_by}")
    if abs(sizes["table"] / sizes["log"] - 1) > 0.1:
        wrong.append(f"sizes of log and table: {sizes}")
    with (folder / "sessions/monday/tracker.mcap").open("rb") as stream:
        messages = mcap_ros2.reader.read_ros2_messages(stream, topics=["/scanner"])
        log = [(m.ros_msg.header.stamp.sec * 10**9 + m.ros_msg.header.stamp.nanosec, np.reshape(m.ros_msg.pose.covariance, (6, 6))) for m in messages]
    compared, worst = 0, 0.0
    for row in only(folder / "lake-log/stations"):
        if row["verdict"] != "paired":
            continue
        mean = blocks(log, row["first_reading_ns"], row["last_reading_ns"], options.poses)
        pairs = [(row[f"stated_cov_{'xyz'[i]}{'xyz'[j]}_mm2"], mean[i, j], mean[i, i] * mean[j, j]) for i, j in UPPER]
        if options.poses:
            for k in range(9):
                i, j = divmod(k, 3)
                pairs.append((row["stated_orientation_cov_rad2"][k], mean[3 + i, 3 + j], mean[3 + i, 3 + i] * mean[3 + j, 3 + j]))
                pairs.append((row["stated_position_orientation_cov_mm_rad"][k], mean[i, 3 + j], mean[i, i] * mean[3 + j, 3 + j]))
        elif row["stated_orientation_cov_rad2"] is not None:
            wrong.append("an orientation's covariance of points")
        worst = max(worst, max(abs(a - b) / size**0.5 for a, b, size in pairs))
        compared += row["readings_kept"] == row["readings"]
    print(f"  {compared} stations with all their readings, worst relative difference of a covariance {worst:.1e}")
    if not (compared > 0.8 * options.stations and worst < 1e-9):
        wrong.append(f"{compared} stations compared, covariances differ by {worst}")
    return [f"seed {seed}: {problem}" for problem in wrong]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--seed", type=int, action="append")
    parser.add_argument("--stations", type=int, default=120)
    parser.add_argument("--wrong-by", type=float, default=3.0)
    parser.add_argument("--errors", type=float, default=3.0)
    parser.add_argument("--poses", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    wrong = []
    for seed in options.seed or [1]:
        with tempfile.TemporaryDirectory() as folder:
            wrong += check(pathlib.Path(options.binary).resolve(), pathlib.Path(folder), seed, options)
    print("\n".join(wrong), file=sys.stderr)
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    main()
