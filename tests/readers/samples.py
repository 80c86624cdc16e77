"""Holds the joint samples and readings of table `logs` against the logs themselves, decoded by mcap-ros2-support.

    python tests/readers/samples.py LAKE SESSIONS

SESSIONS has a folder for each session with controller.mcap and tracker.mcap. Checked, bit for bit: stamps, joint angles
in the order of the messages' names, positions in mm.
"""

import pathlib
import sys

import mcap_ros2.reader
import pyarrow.parquet


def samples(log, topic):
    for found in mcap_ros2.reader.read_ros2_messages(str(log), topics=[topic]):
        stamp = found.ros_msg.header.stamp
        yield stamp.sec * 1_000_000_000 + stamp.nanosec, found.ros_msg


def mm(point):
    return [1000.0 * point.x, 1000.0 * point.y, 1000.0 * point.z]


def main(lake, sessions):
    wrong = rows = 0
    for file in sorted(pathlib.Path(lake).glob("logs/*/*/*.parquet")):
        folder = pathlib.Path(sessions) / file.parent.name
        columns = ["source", "stamp_ns", "joints_rad", "x_mm", "y_mm", "z_mm"]
        found = pyarrow.parquet.read_table(file, columns=columns).to_pylist()
        joints = samples(folder / "controller.mcap", "/joint_states")
        poses = samples(folder / "tracker.mcap", "/tracker/pose")
        expected = {
            "joints": [(stamp, list(message.position)) for stamp, message in joints],
            "target": [(stamp, mm(message.pose.position)) for stamp, message in poses],
        }
        for source, expected in expected.items():
            place = lambda row: row["joints_rad"] if source == "joints" else [row[axis] for axis in columns[3:]]
            table = [(row["stamp_ns"], place(row)) for row in found if row["source"] == source]
            rows += len(table)
            if table != expected or not table:
                wrong += 1
                print(f"{file}: {source}: {len(table)} rows, not what {folder} has ({len(expected)} messages)")
    print(f"{rows} samples of the logs read by another program, {wrong} sources that differ")
    return 1 if wrong or rows == 0 else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
