"""Forward kinematics of serial chains in URDFs: posegrid against Pinocchio.

    urdf_chains.py POSEGRID                 every URDF of the package example-robot-data: some 69 files
    urdf_chains.py POSEGRID --sample        the few of them that .ci/run takes
    urdf_chains.py POSEGRID a.urdf b.urdf   these

POSEGRID is the program. Needs `pin` and `example-robot-data` from PyPI: python -m pip install pin example-robot-data

Of each file every chain from the root to a leaf with four moving joints or more is taken, and one from a leaf over the tree to
another leaf, at random joint positions between the limits: `posegrid robot FILE --base … --tip … --at poses.csv`, and the same
of the robot file that `posegrid robot FILE` writes, in its own convention and with --conventions in each of the others, against
Pinocchio's frames. They have to agree within 1e-9 m and 1e-9 rad. A joint that mimics another is set by this script, from the
URDF. A chain that posegrid has to refuse, because a joint in it follows one outside or is planar or floating, has to be refused
with that reason. Which refusals there were is printed; so is the largest difference.
"""

import argparse
import csv
import importlib.metadata
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin

TOLERANCE_M = 1e-9
TOLERANCE_RAD = 1e-9
LEAST_JOINTS = 4
MOST_JOINTS = 16  # of a robot file
CONVENTIONS = ["standard-dh", "md-h", "modified-dh", "s-model", "cpc", "poe", "minimal-poe", "urdf"]
# An arm and its gripper, two makers of ordinary arms, a lift and a hand, a humanoid whose grippers mimic, wheels without limits,
# several arms on a lift, continuous joints, a file that is none.
SAMPLE = [
    "panda.urdf",
    "ur10_robot.urdf",
    "xarm7.urdf",
    "tiago.urdf",
    "talos_full_v2.urdf",
    "romeo.urdf",
    "centauro.urdf",
    "pr2.urdf",
    "kinova.urdf",
    "ur3.urdf",
]


class Joint:
    def __init__(self, node):
        self.name = node.get("name")
        self.kind = node.get("type")
        self.parent = node.find("parent").get("link")
        self.child = node.find("child").get("link")
        mimic = node.find("mimic") if self.kind != "fixed" else None
        self.follows = None if mimic is None else mimic.get("joint")
        self.multiplier = 1.0 if mimic is None else float(mimic.get("multiplier", 1))
        self.offset = 0.0 if mimic is None else float(mimic.get("offset", 0))
        limit = node.find("limit")
        lower, upper = (float(limit.get(key, 0)) for key in ("lower", "upper")) if limit is not None else (0.0, 0.0)
        if not lower < upper or self.kind == "continuous":
            lower, upper = -np.pi, np.pi
        self.lower, self.upper = lower, upper

    def moves(self):
        return self.kind != "fixed"


class Tree:
    def __init__(self, path):
        root = ElementTree.parse(path).getroot()
        self.links = [node.get("name") for node in root.findall("link")]
        self.joints = {node.get("name"): Joint(node) for node in root.findall("joint")}
        self.carrier = {joint.child: joint for joint in self.joints.values()}
        parents = {joint.parent for joint in self.joints.values()}
        self.leaves = [link for link in self.links if link not in parents]
        self.roots = [link for link in self.links if link not in self.carrier]

    def to_root(self, link):
        """The joints from a link up to the root."""
        joints = []
        while link in self.carrier:
            joints.append(self.carrier[link])
            link = joints[-1].parent
        return joints

    def chain(self, base, tip):
        """The joints from base to tip: up, and down."""
        up, down = self.to_root(base), self.to_root(tip)
        while up and down and up[-1] is down[-1]:
            up.pop()
            down.pop()
        return up + down[::-1]

    def driver(self, joint):
        """The joint that is followed in the end, None where the file has it not, with multiplier and offset."""
        multiplier, offset = 1.0, 0.0
        while joint is not None and joint.follows is not None:
            offset += multiplier * joint.offset
            multiplier *= joint.multiplier
            joint = self.joints.get(joint.follows)
        return joint, multiplier, offset


def reason_to_refuse(tree, chain):
    """The words that posegrid's refusal has to contain; None for a chain that it has to read."""
    for joint in chain:
        if joint.kind in ("planar", "floating"):
            return joint.kind
        if joint.follows is not None and tree.driver(joint)[0] not in chain:
            return f'joint "{joint.name}" follows'
    if sum(joint.moves() for joint in chain) > MOST_JOINTS:
        return "an arm has 1 to 16"
    return None


def run(*command):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)


def expected(model, tree, chain, reported, values, base, tip):
    """Poses of the tip in the base by Pinocchio, at rows of joint values in rad and m."""
    data = model.createData()
    frames = [model.getFrameId(link, pin.FrameType.BODY) for link in (base, tip)]
    poses = []
    for row in values:
        of_driver = dict(zip((joint.name for joint in reported), row))
        q = pin.neutral(model)
        for joint in chain:
            if not joint.moves():
                continue
            driver, multiplier, offset = tree.driver(joint)
            value = multiplier * of_driver[driver.name] + offset
            place = model.joints[model.getJointId(joint.name)]
            if place.nq == 2:
                q[place.idx_q : place.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                q[place.idx_q] = value
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[frames[0]].actInv(data.oMf[frames[1]]))
    return poses


def difference(rows, poses):
    """The largest difference in m and in rad."""
    apart_m = apart_rad = 0.0
    for row, pose in zip(rows, poses):
        numbers = [float(row[key]) for key in ("x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw")]
        apart_m = max(apart_m, float(np.linalg.norm(np.array(numbers[:3]) / 1000 - pose.translation)))
        turn = pin.Quaternion(np.array(numbers[3:])).inverse() * pin.Quaternion(pose.rotation)
        apart_rad = max(apart_rad, 2 * float(np.arcsin(min(1.0, np.linalg.norm(turn.vec())))))
    return apart_m, apart_rad


class Check:
    def __init__(self, arguments, folder):
        self.posegrid = arguments.posegrid
        self.poses = arguments.poses
        self.conventions = CONVENTIONS if arguments.conventions else []
        self.folder = folder
        self.random = np.random.default_rng(arguments.seed)
        self.following = 0
        self.files = self.chains = self.across = self.compared = self.refused = self.not_stated = 0
        self.worst = (0.0, 0.0)
        self.faults = []

    def fault(self, words):
        self.faults.append(words)
        print(f"  WRONG: {words}")

    def file(self, path):
        tree = Tree(path)
        if not tree.links:
            answer = run(self.posegrid, "robot", path)
            print(f"{path.name}: no links; posegrid: {answer.stderr.strip()[-60:]}")
            if answer.returncode != 2:
                self.fault(f"{path.name}: read, but it has no links")
            return
        model = pin.buildModelFromUrdf(str(path))
        self.files += 1
        root = tree.roots[0]
        before = self.chains + self.across, self.refused
        for leaf in tree.leaves:
            chain = tree.chain(root, leaf)
            if sum(joint.moves() for joint in chain) >= LEAST_JOINTS:
                self.chains += self.chain(path, model, tree, root, leaf)
        if len(tree.leaves) > 1:
            ends = tree.leaves[0], tree.leaves[-1]
            if sum(joint.moves() for joint in tree.chain(*ends)) >= LEAST_JOINTS:
                self.across += self.chain(path, model, tree, *ends)
        print(
            f"{path.name}: {self.chains + self.across - before[0]} chains agree, {self.refused - before[1]} refused as they have to be"
        )

    def chain(self, path, model, tree, base, tip):
        """Compares a chain; whether it agrees."""
        name = f"{path.name} {base} to {tip}"
        chain = tree.chain(base, tip)
        ends = ["--base", base, "--tip", tip]
        made = run(self.posegrid, "robot", path, *ends)
        reason = reason_to_refuse(tree, chain)
        if reason is not None:
            self.refused += 1
            if made.returncode != 2 or reason not in made.stderr:
                self.fault(f"{name}: not refused for {reason!r}: {made.returncode} {made.stderr.strip()}")
            return False
        if made.returncode != 0:
            self.fault(f"{name}: refused: {made.stderr.strip()}")
            return False
        robot = self.folder / "robot.toml"
        robot.write_text(made.stdout)
        self.following += any(joint.follows is not None for joint in chain)
        reported = [joint for joint in chain if joint.moves() and joint.follows is None]
        values = np.array([[self.random.uniform(j.lower, j.upper) for j in reported] for _ in range(self.poses)])
        slides = np.array([joint.kind == "prismatic" for joint in reported])
        stated = np.where(slides, values * 1000, np.degrees(values))
        values = np.where(slides, stated / 1000, np.radians(stated))
        table = self.folder / "poses.csv"
        with table.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow([joint.name for joint in reported])
            writer.writerows([[repr(float(x)) for x in row] for row in stated])
        wanted = expected(model, tree, chain, reported, values, base, tip)
        roads = [[path, *ends], [robot], *([robot, "--convention", word] for word in self.conventions)]
        agree = True
        for road in roads:
            answer = run(self.posegrid, "robot", *road, "--at", table)
            if "from parallel" in answer.stderr:
                self.not_stated += 1
                continue
            rows = list(csv.DictReader(answer.stdout.splitlines()))
            if answer.returncode != 0 or len(rows) != len(wanted):
                self.fault(f"{name} {road[1:]}: {answer.returncode} {answer.stderr.strip()}")
                agree = False
                continue
            apart = difference(rows, wanted)
            self.compared += len(rows)
            self.worst = max(self.worst[0], apart[0]), max(self.worst[1], apart[1])
            if apart[0] > TOLERANCE_M or apart[1] > TOLERANCE_RAD:
                self.fault(f"{name} {road[1:]}: {apart[0]:.2e} m and {apart[1]:.2e} rad apart")
                agree = False
        return agree


def files_of_package(only):
    package = importlib.metadata.files("example-robot-data") or []
    paths = sorted(Path(file.locate()).resolve() for file in package if file.name.endswith(".urdf"))
    return [path for path in paths if only is None or path.name in only]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("posegrid", type=Path)
    parser.add_argument("files", type=Path, nargs="*")
    parser.add_argument("--sample", action="store_true", help="a few files of the package only")
    parser.add_argument("--conventions", action="store_true", help="each robot file in the other conventions too")
    parser.add_argument("--poses", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    files = arguments.files or files_of_package(SAMPLE if arguments.sample else None)
    with tempfile.TemporaryDirectory() as folder:
        check = Check(arguments, Path(folder))
        for path in files:
            check.file(path)
    print(
        f"Pinocchio {pin.__version__}: {check.files} files, {check.chains} chains from root to leaf and {check.across} from leaf to leaf "
        f"agree ({check.following} with a joint that follows another), {check.refused} refused as they have to be, {check.compared} poses; largest difference {check.worst[0]:.1e} m, "
        f"{check.worst[1]:.1e} rad"
        + (f"; {check.not_stated} tables of nearly parallel axes not stated" if check.not_stated else "")
    )
    if check.faults or check.chains == 0:
        sys.exit(f"{len(check.faults)} differences" if check.faults else "no chain was compared")


if __name__ == "__main__":
    main()
