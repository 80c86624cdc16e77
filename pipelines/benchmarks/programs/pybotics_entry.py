"""pybotics enters a benchmark: its calibration of all links, tool and world by its own fitness function, on exported splits.

    python pipelines/benchmarks/benchmark.py SUITE                             # writes benchmark/given
    python pipelines/benchmarks/programs/pybotics_entry.py benchmark/given answers
    python pipelines/benchmarks/benchmark.py SUITE --program pybotics=answers

Needs pybotics and scipy. pybotics takes modified DH: link i has the a and alpha of the standard link before it, and what follows the last
joint belongs to the tool. Prints the seconds of each calibration.
"""

import argparse
import time
from pathlib import Path

import common
import numpy as np
from pybotics.geometry import matrix_2_vector, vector_2_matrix
from pybotics.optimization import OptimizationHandler, optimize_accuracy
from pybotics.robot import Robot
from scipy.optimize import least_squares


# Step of the numerical derivatives, mm and rad.
STEP = 1e-5
# A parameter whose motions are those of others but for less than this share is one of them.
INDEPENDENT = 1e-3


def nominal(dh, world, target):
    """The nominal arm as pybotics takes it, with world and tool as found."""
    before = np.vstack([np.zeros(2), dh[:-1, :2]])
    table = np.column_stack([before[:, 1], before[:, 0], dh[:, 3], dh[:, 2]])  # alpha, a, theta, d
    robot = Robot.from_parameters(table.flatten())
    robot.world_frame = vector_2_matrix(matrix_2_vector(world))
    last = np.eye(4)
    last[0, 3] = dh[-1, 0]
    c, s = np.cos(dh[-1, 1]), np.sin(dh[-1, 1])
    last[1:3, 1:3] = [[c, -s], [s, c]]
    robot.tool.matrix = last @ np.block([[np.eye(3), target[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])
    return robot


def calibrated(dh, joints, measured):
    world, target = common.start(dh, joints, measured)
    robot = nominal(dh, world, target)
    here = np.array([robot.fk(own)[:3, 3] for own in joints[:5]])
    there = np.array([(world @ common.flange(dh, own / dh[:, 4]) @ [*target, 1])[:3] for own in joints[:5]])
    assert np.abs(here - there).max() < 1e-6, "pybotics has another nominal arm"
    handler = OptimizationHandler(robot, **independent(robot, joints))
    vector = handler.generate_optimization_vector()
    found = least_squares(optimize_accuracy, vector, args=(handler, joints, measured), x_scale="jac", max_nfev=60)
    handler.apply_optimization_vector(found.x)
    return handler.robot


def independent(robot, joints):
    """Masks of the parameters that the stations tell apart: world and tool first, then the links, each where it moves the positions otherwise
    than those before it. pybotics leaves that choice to its user; without it the redundant ones drift apart."""
    tool = [True] * 3 + [False] * 3
    handler = OptimizationHandler(robot, kinematic_chain_mask=True, tool_mask=tool, world_mask=True)
    start = handler.generate_optimization_vector()

    def positions(vector):
        handler.apply_optimization_vector(vector)
        return np.array([handler.robot.fk(own)[:3, 3] for own in joints]).ravel()

    here = positions(start)
    columns = np.array([(positions(start + step) - here) / STEP for step in np.eye(len(start)) * STEP])
    links = robot.kinematic_chain.num_parameters
    kept, basis = np.zeros(len(start), dtype=bool), []
    for place in [*range(links, len(start)), *range(links)]:
        length = np.linalg.norm(columns[place])
        left = columns[place] / length if length > 0 else columns[place]
        for _ in range(2):
            for own in basis:
                left = left - own * (own @ left)
        if np.linalg.norm(left) > INDEPENDENT:
            kept[place] = True
            basis.append(left / np.linalg.norm(left))
    tool = [*kept[links : links + 3], False, False, False]
    return {"kinematic_chain_mask": kept[:links], "tool_mask": tool, "world_mask": kept[links + 3 :]}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("given", type=Path)
    arguments.add_argument("answers", type=Path)
    own = arguments.parse_args()
    for folder in common.arms(own.given):
        dh = common.links(folder)
        for split in common.splits(folder):
            train = common.stations(split / "train.csv")
            began = time.process_time()
            robot = calibrated(dh, train.joints * dh[:, 4], train.measured)
            seconds = time.process_time() - began
            test = common.stations(split / "test.csv")
            positions = [robot.fk(q)[:3, 3] for q in test.joints * dh[:, 4]]
            common.answer(own.answers / folder.name / f"{split.name}.csv", test.names, positions)
            print(f"{folder.name}, {split.name}: {seconds:.1f} s of a core", flush=True)


if __name__ == "__main__":
    main()
