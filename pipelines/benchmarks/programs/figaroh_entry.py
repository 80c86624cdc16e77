"""FIGAROH enters a benchmark: its calibration of all geometric parameters, base and target, on exported splits.

    python pipelines/benchmarks/benchmark.py SUITE                             # writes benchmark/given
    python pipelines/benchmarks/programs/figaroh_entry.py benchmark/given answers
    python pipelines/benchmarks/benchmark.py SUITE --program figaroh=answers

Needs figaroh (which brings Pinocchio) and PyYAML. The nominal arm is written as a URDF, in m. Prints the seconds of each calibration.
"""

import argparse
import contextlib
import io
import tempfile
import time
from pathlib import Path

import common
import numpy as np
import yaml
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm
from figaroh.tools.robot import Robot
from scipy.spatial.transform import Rotation


class Calibration(BaseCalibration):
    """Distances in the world frame, all alike."""

    def cost_function(self, var):
        found = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        return self.PEE_measured - found


def origin(matrix):
    rpy = Rotation.from_matrix(matrix[:3, :3]).as_euler("xyz")
    numbers = [" ".join(f"{value:.15g}" for value in part) for part in (matrix[:3, 3], rpy)]
    return f'<origin xyz="{numbers[0]}" rpy="{numbers[1]}"/>'


def turned(axis, angle):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(np.eye(3)[axis] * angle).as_matrix()
    return matrix


def urdf(dh):
    """The nominal arm; angles of its joints are those of the exported columns."""
    links, joints, before = ['<link name="base"/>'], [], np.eye(4)
    for place, (a, alpha, d, offset, sign) in enumerate(dh, 1):
        parent = "base" if place == 1 else f"link{place - 1}"
        links.append(f'<link name="link{place}"/>')
        joints.append(
            f'<joint name="q{place}" type="revolute"><parent link="{parent}"/><child link="link{place}"/>{origin(before @ turned(2, offset))}'
            f'<axis xyz="0 0 {sign:.0f}"/><limit lower="-7" upper="7" effort="1" velocity="1"/></joint>'
        )
        before = np.eye(4)
        before[:3, 3] = [a / 1000, 0, d / 1000]
        before = before @ turned(0, alpha)
    links.append('<link name="flange"/>')
    joints.append(
        f'<joint name="to_flange" type="fixed"><parent link="link{len(dh)}"/><child link="flange"/>{origin(before)}</joint>'
    )
    return f'<?xml version="1.0"?><robot name="arm">{"".join(links + joints)}</robot>'


def configuration(joints, data):
    return {
        "robot": {"name": "arm"},
        "tasks": {
            "calibration": {
                "enabled": True,
                "kinematics": {"base_frame": "universe", "tool_frame": "flange"},
                "joints": {"active_joints": [f"q{place}" for place in range(1, joints + 1)]},
                "parameters": {"calibration_level": "full_params", "include_non_geometric": False, "outlier_threshold": 1.0},
                "measurements": {"markers": [{"measurable_dof": [True] * 3 + [False] * 3}]},
                "data": {"source_file": str(data)},
            }
        },
    }


def calibrated(folder, dh, joints, measured):
    """The calibration of the stations that train, by FIGAROH's own files."""
    (folder / "arm.urdf").write_text(urdf(dh))
    columns = ["x1", "y1", "z1", *(f"q{place}" for place in range(1, len(dh) + 1))]
    table = np.column_stack([measured / 1000, joints])
    np.savetxt(folder / "train.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    (folder / "calibration.yaml").write_text(yaml.safe_dump(configuration(len(dh), folder / "train.csv")))
    robot = Robot(str(folder / "arm.urdf"), package_dirs=str(folder))
    here = calc_nominal(robot, joints[0])
    assert np.abs(here - common.flange(dh, joints[0])[:3, 3] / 1000).max() < 1e-9, "FIGAROH has another nominal arm"
    own = Calibration(robot, str(folder / "calibration.yaml"))
    own.calib_config["known_baseframe"] = own.calib_config["known_tipframe"] = False
    own.initialize()
    own.solve(enable_logging=False)
    return own


def calc_nominal(robot, joints):
    robot.framesForwardKinematics(joints)
    return robot.data.oMf[robot.model.getFrameId("flange")].translation.copy()


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("given", type=Path)
    arguments.add_argument("answers", type=Path)
    given = arguments.parse_args()
    for folder in common.arms(given.given):
        dh = common.links(folder)
        for split in common.splits(folder):
            train = common.stations(split / "train.csv")
            began = time.process_time()
            with tempfile.TemporaryDirectory() as work, contextlib.redirect_stdout(io.StringIO()):
                own = calibrated(Path(work), dh, train.joints, train.measured)
            seconds = time.process_time() - began
            test = common.stations(split / "test.csv")
            config = dict(own.calib_config, NbSample=len(test.joints))
            positions = calc_updated_fkm(own.model, own.data, own.LM_result.x, test.joints, config)
            positions = positions.reshape(3, -1).T * 1000
            common.answer(given.answers / folder.name / f"{split.name}.csv", test.names, positions)
            print(f"{folder.name}, {split.name}: {seconds:.1f} s of a core", flush=True)


if __name__ == "__main__":
    main()
