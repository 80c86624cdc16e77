"""Holds every robot file of pipelines/robots against a public description of that arm, by kinematics that share no code with posegrid.

    python tests/readers/ready_robots.py [--robots pipelines/robots] [--only kr210-r3100-2] [--self-test] [--table]

For each file, at zero, at its home pose and at 200 random poses within its limits,
1. the flange by the file's rows (standard or modified DH, joint_map, base and flange);
2. the flange by the joint origins and axes of a description (URDF: origin, roll-pitch-yaw, axis), the numbers below;
3. where there is one, the flange by a second source: a table in modified DH of another hand.
The largest differences in position and orientation are printed, and the limits are compared; so are the flanges of
tests/library/kinematics/urdf_flanges.csv, which posegrid's own kinematics is tested with. The exit code is 1 where a position is off by more
than 1e-5 mm or an orientation by more than 2e-6 rad, or by more than what is stated below of that source; where a limit is
another; where a file has no entry below; or where README.md beside the files does not list it.
--self-test also changes each number of each file by little, one at a time, and asks that every change is noticed.
--table prints the table of README.md.
"""

import argparse
import csv
import dataclasses
import pathlib
import sys
import tomllib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
POSES = 200
MOST_MM, MOST_RAD = 1e-5, 2e-6  # descriptions round right angles to as little as six digits, of the last turn only
MOST_LIMIT_DEG = 0.1  # descriptions round limits to three digits of a radian

H, PI = np.pi / 2, np.pi
NAMES_OF_ANGLES = {"h": H, "-h": -H, "pi": PI, "-pi": -PI}


@dataclasses.dataclass
class Described:
    """An arm as a description has it: repository, path and commit, then what was read from it.

    joints: a line for each, `name | xyz (m) | roll pitch yaw (rad; h is a right angle) | axis | lower upper (degrees; r: radians)`.
    base, tip: the controller's base frame in the root link, and the flange in the last link: `xyz | roll pitch yaw`.
    limits: limits that are others on purpose, with the reason; read: what of the description does not hold for the controller.
    second: rows `alpha a d theta` (degrees, mm) of a table in modified DH, `senses` of the joints in it, and how far it may be off, mm.
    """

    where: str
    joints: str
    base: str = "0 0 0 | 0 0 0"
    tip: str = "0 0 0 | 0 0 0"
    limits: dict = dataclasses.field(default_factory=dict)
    coupled: bool = False
    read: str = ""
    second: str = ""
    senses: tuple = (1,) * 7
    second_where: str = "robotkinematicscatalogue@1.1.2 of PyPI: the tables of RoboDK's library"
    second_mm: float = MOST_MM


KUKA_SENSES = (-1, 1, 1, -1, 1, -1)
FANUC_SENSES = (1, 1, -1, -1, -1, -1)
FLANGE_DOWN_X = "0 0 0 | 0 h 0"  # KUKA's and ABB's flange in the last link of ROS-Industrial
FLANGE_UP_X = "0 0 0 | pi -h 0"  # Fanuc's


def kuka_table(d1, a1, a2, a3, d4, d6):
    return f"0 0 {d1} 0; -90 {a1} 0 0; 0 {a2} 0 -90; -90 {a3} {d4} 0; 90 0 0 0; -90 0 {d6} 180"


def abb_table(d1, a1, a2, a3, d4, d6, turn=180):
    return f"0 0 {d1} 0; -90 {a1} 0 -90; 0 {a2} 0 0; -90 {a3} {d4} 0; 90 0 0 0; -90 0 {d6} {turn}"


def fanuc_table(a1, a2, a3, d4, d6):
    return abb_table(0, a1, a2, a3, d4, d6, turn=0)


def ur_joints(shoulder, forearm, wrist_1, wrist_1_z, wrist_2, wrist_2_z, wrist_3, wrist_3_z):
    """The joints of a UR from the figures of its default_kinematics.yaml (m)."""
    return f"""
        shoulder_pan_joint  | 0 0 {shoulder}                | 0 0 0                                     | 0 0 1 | -360 360
        shoulder_lift_joint | 0 0 0                         | 1.570796327 0 0                           | 0 0 1 | -360 360
        elbow_joint         | {forearm} 0 0                 | 0 0 0                                     | 0 0 1 | -180 180
        wrist_1_joint       | {wrist_1} 0 {wrist_1_z}       | 0 0 0                                     | 0 0 1 | -360 360
        wrist_2_joint       | 0 {wrist_2} {wrist_2_z}       | 1.570796327 0 0                           | 0 0 1 | -360 360
        wrist_3_joint       | 0 {wrist_3} {wrist_3_z}       | 1.570796326589793 3.141592653589793 3.141592653589793 | 0 0 1 | -360 360"""


def old_ur_joints(shoulder, lift, elbow_y, elbow, wrist_1, wrist_2, wrist_3):
    """The joints of a UR of the CB series as its first description has them (m), which knows no DH."""
    return f"""
        shoulder_pan_joint  | 0 0 {shoulder}       | 0 0 0              | 0 0 1 | -360 360
        shoulder_lift_joint | 0 {lift} 0           | 0 1.57079632679 0  | 0 1 0 | -360 360
        elbow_joint         | 0 {elbow_y} {elbow}  | 0 0 0              | 0 1 0 | -180 180
        wrist_1_joint       | 0 0 {wrist_1}        | 0 1.57079632679 0  | 0 1 0 | -360 360
        wrist_2_joint       | 0 {wrist_2} 0        | 0 0 0              | 0 0 1 | -360 360
        wrist_3_joint       | 0 0 {wrist_3}        | 0 0 0              | 0 1 0 | -360 360"""


def ur_table(d1, a2, a3, d4, d5, d6):
    return f"0 0 {d1} 0; 90 0 0 0; 0 {a2} 0 0; 0 {a3} {d4} 0; 90 0 {d5} 0; -90 0 {d6} 0"


# Franka's own table, the flange's 107 mm in its last row.
FRANKA_TABLE = "0 0 333 0; -90 0 0 0; 90 0 316 0; 90 82.5 0 0; -90 -82.5 384 0; 90 0 0 0; 90 88 107 0"

UR_ARTICLE = "Universal Robots' article \"DH Parameters for calculations of kinematics and dynamics\""
UR_ELBOW = {3: "the description halves the elbow's range for planners; the user manual has 360° for every joint"}
UR1 = "ros-industrial/universal_robot: ur_description/config/{}/default_kinematics.yaml"
ERD = "PyPI example-robot-data 6.0.0: ur_description/urdf/{}_robot.urdf"
# The first descriptions of the CB series begin in base_link, which stands half a turn from base.
OLD_UR_BASE = "0 0 0 | 0 0 -3.14159265359"


def r2000(path, velocity_class):
    """The R-2000iC/165F and /210F: the same lengths and limits."""
    return Described(
        f"ros-industrial/fanuc: fanuc_r2000ic_support/urdf/{path}",
        """
        joint_1 | 0 0 .670   | 0 0 0 | 0 0 1  | -185 185
        joint_2 | .312 0 0   | 0 0 0 | 0 1 0  | -60 76
        joint_3 | 0 0 1.075  | 0 0 0 | 0 -1 0 | -132 180
        joint_4 | 0 0 .225   | 0 0 0 | -1 0 0 | -360 360
        joint_5 | 1.280 0 0  | 0 0 0 | 0 -1 0 | -125 125
        joint_6 | .215 0 0   | 0 0 0 | -1 0 0 | -360 360""",
        base="0 0 .670 | 0 0 0",
        tip=FLANGE_UP_X,
        coupled=True,
        read=f"its {velocity_class} launch file has J23_factor 1: the driver adds J2 to the J3 of the controller",
        second=fanuc_table(312, 1075, 225, 1280, 215),
        senses=FANUC_SENSES,
    )


ARMS = {
    # ---------------------------------------------------------------- KUKA
    "kr210-r2700-extra": Described(
        "ros-industrial/kuka_experimental@01ae9a4c: kuka_kr210_support/urdf/kr210r2700extra_macro.xacro",
        """
        joint_a1 | 0 0 .675  | 0 0 0 | 0 0 -1 | -185 185
        joint_a2 | .350 0 0  | 0 0 0 | 0 1 0  | -140 -5
        joint_a3 | 1.150 0 0 | 0 0 0 | 0 1 0  | -120 155
        joint_a4 | 0 0 -.041 | 0 0 0 | -1 0 0 | -350 350
        joint_a5 | 1.200 0 0 | 0 0 0 | 0 1 0  | -125 125
        joint_a6 | .215 0 0  | 0 0 0 | -1 0 0 | -350 350""",
        tip=FLANGE_DOWN_X,
        second=kuka_table(675, 350, 1150, -41, 1200, 215),
        senses=KUKA_SENSES,
    ),
    "kr210-r3100-2": Described(
        "ros-industrial/kuka_experimental@e2e224e4: kuka_kr210_support/urdf/kr210_r3100-2_macro.xacro",
        """
        joint_a1 | 0 0 .645    | 0 0 0 | 0 0 -1 | -185 185
        joint_a2 | .33 0 0     | 0 0 0 | 0 1 0  | -140 -5
        joint_a3 | 1.350 0 0   | 0 0 0 | 0 1 0  | -120 168
        joint_a4 | 1.420 0 .115 | 0 0 0 | -1 0 0 | -350 350
        joint_a5 | 0 0 0       | 0 0 0 | 0 1 0  | -122.5 122.5
        joint_a6 | .240 0 0    | 0 0 0 | -1 0 0 | -350 350""",
        tip=FLANGE_DOWN_X,
    ),
    "kr210-r3100-2 (KUKA)": Described(
        "kroshu/kuka_robot_descriptions@04e1135b: kuka_quantec_support/urdf/kr210_r3100_2_macro.xacro",
        """
        - | 0 0 0       | -3.141592653589793 0 0 | 0 0 1 | -3.2288591161895095r 3.2288591161895095r
        - | .33 0 -.645 | h 0 0                  | 0 0 1 | -2.443460952792061r -.08726646259971647r
        - | 1.35 0 0    | 0 0 -h                 | 0 0 1 | -2.0943951023931953r 2.9321531433504737r
        - | .115 0 0    | h 0 0                  | 0 0 1 | -6.1086523819801535r 6.1086523819801535r
        - | 0 0 -1.42   | -h 0 0                 | 0 0 1 | -2.138028333693054r 2.138028333693054r
        - | 0 0 0       | h 0 0                  | 0 0 1 | -6.1086523819801535r 6.1086523819801535r""",
        tip="0 0 -.240 | 0 pi 0",
    ),
    "kr210-r3100-ultra": Described(
        "kroshu/kuka_robot_descriptions@26e7811e: kuka_quantec_support/urdf/kr210_r3100_ultra_macro.xacro",
        """
        - | 0 0 .675      | 0 0 0  | 0 0 -1 | -3.2288591125r 3.2288591125r
        - | .35 0 0       | -h 0 0 | 0 0 1  | -2.44346095r -.0872664625r
        - | 1.35 0 0      | 0 0 -h | 0 0 1  | -2.0943951r 2.7052603375r
        - | -.041 1.4 0   | h 0 0  | 0 0 1  | -6.108652375r 6.108652375r
        - | 0 0 0         | -h 0 0 | 0 0 1  | -2.13802833125r 2.13802833125r
        - | 0 0 0         | h 0 0  | 0 0 1  | -6.108652375r 6.108652375r""",
        tip="0 0 -.24 | 0 pi 0",
        read="axis of joint 1 reversed: it is 0 0 1 there, while KUKA's descriptions of the R2700 extra and R3100-2 have z down, as the controller does",
        second=kuka_table(675, 350, 1350, -41, 1400, 240),
        senses=KUKA_SENSES,
    ),
    "kr10-r1100-sixx": Described(
        "ros-industrial/kuka_experimental@194edaa6: kuka_kr10_support/urdf/kr10r1100sixx_macro.xacro",
        """
        joint_a1 | 0 0 .400 | 0 0 0 | 0 0 -1 | -170 170
        joint_a2 | .025 0 0 | 0 0 0 | 0 1 0  | -190 45
        joint_a3 | .560 0 0 | 0 0 0 | 0 1 0  | -120 156
        joint_a4 | 0 0 .035 | 0 0 0 | -1 0 0 | -120 120
        joint_a5 | .515 0 0 | 0 0 0 | 0 1 0  | -120 120
        joint_a6 | .080 0 0 | 0 0 0 | -1 0 0 | -350 350""",
        tip=FLANGE_DOWN_X,
        limits={4: "narrowed in this description for a drilling tool; 185° in a comment in it and in RoboDK's library"},
        second=kuka_table(400, 25, 560, 35, 515, 80),
        senses=KUKA_SENSES,
    ),
    "kr6-r700-sixx": Described(
        "ros-industrial/kuka_experimental@38cf32e9: kuka_kr6_support/urdf/kr6r700sixx_macro.xacro",
        """
        joint_a1 | 0 0 .4   | 0 0 0 | 0 0 -1 | -170 170
        joint_a2 | .025 0 0 | 0 0 0 | 0 1 0  | -190 45
        joint_a3 | .315 0 0 | 0 0 0 | 0 1 0  | -120 156
        joint_a4 | 0 0 .035 | 0 0 0 | -1 0 0 | -185 185
        joint_a5 | .365 0 0 | 0 0 0 | 0 1 0  | -120 120
        joint_a6 | .080 0 0 | 0 0 0 | -1 0 0 | -350 350""",
        tip=FLANGE_DOWN_X,
        second=kuka_table(400, 25, 315, 35, 365, 80),
        senses=KUKA_SENSES,
    ),
    "kr6-r900-sixx": Described(
        "ros-industrial/kuka_experimental@2510a098: kuka_kr6_support/urdf/kr6r900sixx_macro.xacro",
        """
        joint_a1 | 0 0 .400 | 0 0 0 | 0 0 -1 | -170 170
        joint_a2 | .025 0 0 | 0 0 0 | 0 1 0  | -190 45
        joint_a3 | .455 0 0 | 0 0 0 | 0 1 0  | -120 156
        joint_a4 | 0 0 .035 | 0 0 0 | -1 0 0 | -185 185
        joint_a5 | .420 0 0 | 0 0 0 | 0 1 0  | -120 120
        joint_a6 | .080 0 0 | 0 0 0 | -1 0 0 | -350 350""",
        tip=FLANGE_DOWN_X,
        second=kuka_table(400, 25, 455, 35, 420, 80),
        senses=KUKA_SENSES,
    ),
    "lbr-iiwa14-r820": Described(
        "IFL-CAMP/iiwa_stack@052aa68d: iiwa_description/urdf/iiwa14.xacro",
        """
        iiwa_joint_1 | 0 0 .1575 | 0 0 0   | 0 0 1 | -170 170
        iiwa_joint_2 | 0 0 .2025 | h 0 pi  | 0 0 1 | -120 120
        iiwa_joint_3 | 0 .2045 0 | h 0 pi  | 0 0 1 | -170 170
        iiwa_joint_4 | 0 0 .2155 | h 0 0   | 0 0 1 | -120 120
        iiwa_joint_5 | 0 .1845 0 | -h pi 0 | 0 0 1 | -170 170
        iiwa_joint_6 | 0 0 .2155 | h 0 0   | 0 0 1 | -120 120
        iiwa_joint_7 | 0 .081 0  | -h pi 0 | 0 0 1 | -175 175""",
        tip="0 0 .045 | pi pi pi",
        second="0 0 360 0; -90 0 0 0; 90 0 420 0; -90 0 0 0; 90 0 400 0; -90 0 0 0; 90 0 126 0",
        senses=(1, 1, 1, -1, 1, 1, 1),
    ),
    "lbr-iiwa14-r820 (KUKA)": Described(
        "kroshu/kuka_robot_descriptions@062e13cb: kuka_lbr_iiwa_support/urdf/lbr_iiwa14_r820_macro.xacro",
        """
        - | 0 0 .1575 | 0 0 0 | 0 0 1  | -170 170
        - | 0 0 .2025 | 0 0 0 | 0 1 0  | -120 120
        - | 0 0 .2045 | 0 0 0 | 0 0 1  | -170 170
        - | 0 0 .2155 | 0 0 0 | 0 -1 0 | -120 120
        - | 0 0 .1845 | 0 0 0 | 0 0 1  | -170 170
        - | 0 0 .2155 | 0 0 0 | 0 1 0  | -120 120
        - | 0 0 .081  | 0 0 0 | 0 0 1  | -175 175""",
        tip="0 0 .045 | 0 0 0",
        read="flange at 45 mm beyond link 7, the bare one: it has the media flange there, at 71 mm",
    ),
    # ---------------------------------------------------------------- ABB
    "irb120": Described(
        "ros-industrial/abb@59e17fb6: abb_irb120_support/urdf/irb120_3_58_macro.xacro",
        """
        joint_1 | 0 0 0    | 0 0 0 | 0 0 1 | -2.87979r 2.87979r
        joint_2 | 0 0 .29  | 0 0 0 | 0 1 0 | -1.91986r 1.91986r
        joint_3 | 0 0 .27  | 0 0 0 | 0 1 0 | -1.91986r 1.22173r
        joint_4 | 0 0 .07  | 0 0 0 | 1 0 0 | -2.79253r 2.79253r
        joint_5 | .302 0 0 | 0 0 0 | 0 1 0 | -2.094395r 2.094395r
        joint_6 | .072 0 0 | 0 0 0 | 1 0 0 | -6.98132r 6.98132r""",
        tip=FLANGE_DOWN_X,
        second=abb_table(290, 0, 270, 70, 302, 72),
    ),
    "irb4600-60-205": Described(
        "ros-industrial/abb@1acdf691: abb_irb4600_support/urdf/irb4600_60_205_macro.xacro",
        """
        joint_1 | 0 0 .495 | 0 0 0 | 0 0 1 | -3.141r 3.141r
        joint_2 | .175 0 0 | 0 0 0 | 0 1 0 | -1.570r 2.617r
        joint_3 | 0 0 .9   | 0 0 0 | 0 1 0 | -3.141r 1.308r
        joint_4 | 0 0 .175 | 0 0 0 | 1 0 0 | -6.981r 6.981r
        joint_5 | .960 0 0 | 0 0 0 | 0 1 0 | -2.181r 2.094r
        joint_6 | .135 0 0 | 0 0 0 | 1 0 0 | -6.981r 6.981r""",
        tip="0 0 0 | 0 1.57079632679 0",
        second=abb_table(495, 175, 900, 175, 960, 135),
    ),
    "irb4600-40-255": Described(
        "ros-industrial/abb@0707207a: abb_irb4600_support/urdf/irb4600_40_255_macro.xacro",
        """
        joint_1 | 0 0 .495  | 0 0 0 | 0 0 1 | -180 180
        joint_2 | .175 0 0  | 0 0 0 | 0 1 0 | -90 150
        joint_3 | 0 0 1.095 | 0 0 0 | 0 1 0 | -180 75
        joint_4 | 0 0 .175  | 0 0 0 | 1 0 0 | -400 400
        joint_5 | 1.270 0 0 | 0 0 0 | 0 1 0 | -125 120
        joint_6 | .135 0 0  | 0 0 0 | 1 0 0 | -400 400""",
        tip=FLANGE_DOWN_X,
        second=abb_table(495, 175, 1095, 175, 1270, 135),
    ),
    "irb1200-5-90": Described(
        "ros-industrial/abb@30e6c442: abb_irb1200_support/urdf/irb1200_5_90_macro.xacro",
        """
        joint_1 | 0 0 .3991 | 0 0 0 | 0 0 1 | -2.967r 2.967r
        joint_2 | 0 0 0     | 0 0 0 | 0 1 0 | -1.745r 2.269r
        joint_3 | 0 0 .448  | 0 0 0 | 0 1 0 | -3.491r 1.222r
        joint_4 | 0 0 .042  | 0 0 0 | 1 0 0 | -4.712r 4.712r
        joint_5 | .451 0 0  | 0 0 0 | 0 1 0 | -2.269r 2.269r
        joint_6 | .082 0 0  | 0 0 0 | 1 0 0 | -6.283r 6.283r""",
        tip=FLANGE_DOWN_X,
        second=abb_table(399, 0, 448, 42, 451, 82),
        second_mm=0.1 + MOST_MM,  # 399 and 399.1 mm from the mounting face to axis 2
    ),
    "irb6700-200-260": Described(
        "ros-industrial/abb@655ec59e: abb_irb6700_support/urdf/irb6700_200_260_macro.xacro",
        """
        joint_1 | 0 0 .78    | 0 0 0 | 0 0 1 | -170 170
        joint_2 | .32 0 0    | 0 0 0 | 0 1 0 | -65 85
        joint_3 | 0 0 1.125  | 0 0 0 | 0 1 0 | -180 70
        joint_4 | 0 0 .2     | 0 0 0 | 1 0 0 | -300 300
        joint_5 | 1.1425 0 0 | 0 0 0 | 0 1 0 | -130 130
        joint_6 | .2 0 0     | 0 0 0 | 1 0 0 | -360 360""",
        tip=FLANGE_DOWN_X,
        second=abb_table(780, 320, 1125, 200, 1142.5, 200),
    ),
    # ---------------------------------------------------------------- Mecademic
    "meca500": Described(
        "Vanderbilt-Applied-Robotics-Lab/meca500_ros2@0094d241: src/meca500_description/urdf/meca500.xacro",
        """
        joint1 | .012498 0 .091 | 0 0 0 | 0 0 1 | -3.05433r 3.05433r
        joint2 | 0 0 .044       | 0 0 0 | 0 1 0 | -1.22173048r 1.5708r
        joint3 | 0 0 .135       | 0 0 0 | 0 1 0 | -2.35619r 1.22173048r
        joint4 | 0 0 .038       | 0 0 0 | 1 0 0 | -2.96706r 2.96706r
        joint5 | .12 0 0        | 0 0 0 | 0 1 0 | -2.00713r 2.00713r
        joint6 | .07 0 0        | 0 0 0 | 1 0 0 | -3.14159r 3.14159r""",
        base="0.012498 0 0 | 0 0 0",  # BRF stands on the axis of joint 1
        tip=FLANGE_DOWN_X,  # FRF: z out of the flange, y as that of BRF at zero
        limits={6: "joint 6 turns many times: RoboDK's library has two turns either way, the description half a turn"},
        second=abb_table(135, 0, 135, 38, 120, 70),
    ),
    # ---------------------------------------------------------------- Stäubli
    "tx2-90": Described(
        "ros-industrial/staubli_experimental@0b0f4553: staubli_tx2_90_support/urdf/tx2_90_macro.xacro",
        """
        joint_1 | 0 0 .478   | 0 0 0 | 0 0 1 | -180 180
        joint_2 | .050 0 0   | 0 0 0 | 0 1 0 | -130 147.5
        joint_3 | 0 .05 .425 | 0 0 0 | 0 1 0 | -145 145
        joint_4 | 0 0 0      | 0 0 0 | 0 0 1 | -270 270
        joint_5 | 0 0 .425   | 0 0 0 | 0 1 0 | -115 140
        joint_6 | 0 0 .100   | 0 0 0 | 0 0 1 | -270 270""",
        base="0 0 .478 | 0 0 0",
        second="0 0 0 0; -90 50 50 -90; 0 425 0 -90; -90 0 425 0; 90 0 0 0; -90 0 100 180",
    ),
    "tx2-60": Described(
        "ros-industrial/staubli_experimental@023ef524: staubli_tx2_60_support/urdf/tx2_60_macro.xacro",
        """
        joint_1 | 0 0 .375  | 0 0 0 | 0 0 1 | -180 180
        joint_2 | 0 0 0     | 0 0 0 | 0 1 0 | -127.5 127.5
        joint_3 | 0 .02 .29 | 0 0 0 | 0 1 0 | -152.5 152.5
        joint_4 | 0 0 0     | 0 0 0 | 0 0 1 | -270 270
        joint_5 | 0 0 .31   | 0 0 0 | 0 1 0 | -121 132.5
        joint_6 | 0 0 .07   | 0 0 0 | 0 0 1 | -270 270""",
        base="0 0 .375 | 0 0 0",
        second="0 0 0 0; -90 0 20 -90; 0 290 0 -90; -90 0 310 0; 90 0 0 0; -90 0 70 180",
    ),
    # ---------------------------------------------------------------- Fanuc
    "r2000ic-165f": r2000("r2000ic165f_macro.xacro@12dce708", "165F's"),
    "r2000ic-210f": r2000("r2000ic210f_macro.xacro@0d7b4d0a", "165F's (the 210F has the same arm)"),
    "m20ia": Described(
        "ros-industrial/fanuc@526347ab: fanuc_m20ia_support/urdf/m20ia_macro.xacro",
        """
        joint_1 | 0 0 .525 | 0 0 0 | 0 0 1  | -2.967060r 2.967060r
        joint_2 | .150 0 0 | 0 0 0 | 0 1 0  | -1.745329r 2.792527r
        joint_3 | 0 0 .790 | 0 0 0 | 0 -1 0 | -3.228859r 4.766843r
        joint_4 | 0 0 .250 | 0 0 0 | -1 0 0 | -3.490658r 3.490658r
        joint_5 | .835 0 0 | 0 0 0 | 0 -1 0 | -2.443461r 2.443461r
        joint_6 | .100 0 0 | 0 0 0 | -1 0 0 | -4.712389r 4.712389r""",
        base="0 0 .525 | 0 0 0",
        tip=FLANGE_UP_X,
        coupled=True,
        second=fanuc_table(150, 790, 250, 835, 100),
        senses=FANUC_SENSES,
    ),
    "m20id-25": Described(
        "ros-industrial/fanuc@cf4e182e: fanuc_m20id_support/urdf/m20id25_macro.xacro",
        """
        joint_1 | 0 0 .425      | 0 0 0 | 0 0 1  | -170 170
        joint_2 | .075 0 0      | 0 0 0 | 0 1 0  | -100 160
        joint_3 | 0 0 .840      | 0 h 0 | 0 -1 0 | -190 268.4
        joint_4 | -.215 0 .890  | 0 0 0 | 0 0 -1 | -200 200
        joint_5 | 0 0 0         | 0 0 0 | 0 -1 0 | -140 140
        joint_6 | 0 0 .09       | 0 0 0 | 0 0 -1 | -270 270""",
        base="0 0 .425 | 0 0 0",
        tip="0 0 0 | 0 0 pi",
        coupled=True,
        read="flange turned by half a turn about its z: the tool0 there has x down at zero, that of the other Fanucs here has it up",
        second=fanuc_table(75, 840, 215, 890, 90),
        senses=FANUC_SENSES,
    ),
    # ---------------------------------------------------------------- Motoman
    "gp25": Described(
        "ros-industrial/motoman@0961ed72: motoman_gp25_support/urdf/gp25_macro.xacro",
        """
        joint_1_s | 0 0 .505 | 0 0 0 | 0 0 1  | -180 180
        joint_2_l | .150 0 0 | 0 0 0 | 0 1 0  | -105 155
        joint_3_u | 0 0 .760 | 0 0 0 | 0 -1 0 | -86 160
        joint_4_r | 0 0 .200 | 0 0 0 | -1 0 0 | -200 200
        joint_5_b | .795 0 0 | 0 0 0 | 0 -1 0 | -155 150
        joint_6_t | 0 0 0    | 0 0 0 | -1 0 0 | -455 455""",
        base="0 0 .505 | 0 0 0",
        tip=".100 0 0 | 3.1415926 -1.570796 0",
        limits={5: "150° either way in RoboDK's library; -155° there"},
        second=fanuc_table(150, 760, 200, 795, 100),
        senses=FANUC_SENSES,
    ),
    "ma1400": Described(
        "kleinma/ma1400_sim@83842446: urdf/ma1400/ma1400.urdf.xacro",
        """
        joint_s | 0 0 .0795           | pi -h 0 | 1 0 0  | -170 170
        joint_l | .3705 -.0655 -.15   | h 0 h   | 1 0 0  | -90 170
        joint_u | -.0105 0 .614       | 0 0 pi  | 1 0 0  | -175 190
        joint_r | -.076 .069 .2       | 0 0 h   | -1 0 0 | -150 150
        joint_b | .571 .07 0          | pi 0 -h | 1 0 0  | -45 180
        joint_t | .07 -.03 .2         | h -h 0  | -1 0 0 | -200 200""",
        base="0 0 .450 | 0 0 pi",
        tip="0 0 0 | pi -h 0",  # the last link's x points out of the flange
        limits={2: "155° in RoboDK's library and in the table of the Czech Technical University, 170° there"},
        read="axes of L, R and B reversed: RoboDK's library and the table of the Czech Technical University have them so, as "
        "ROS-Industrial has those of like arms; x of joint R's origin 76 mm and not 75 mm, which puts that axis 1 mm beside axis S, where the two others have no offset",
        second="0 0 0 0; -90 150 0 -90; 0 614 0 0; -90 200 640 0; 90 0 0 90; -90 30 200 0",
        senses=FANUC_SENSES,
    ),
    # ---------------------------------------------------------------- Universal Robots
    "ur3": Described(
        UR1.format("ur3") + "@5d72bdd5",
        ur_joints(0.1519, -0.24365, -0.21325, 0.11235, -0.08535, -1.750557762378351e-11, 0.0819, -1.679797079540562e-11),
        limits=UR_ELBOW,
    ),
    "ur3 (first description)": Described(
        ERD.format("ur3"),
        old_ur_joints(0.1519, 0.1198, -0.0925, 0.24365, 0.21325, 0.08505, 0.08535),
        base=OLD_UR_BASE,
        tip="0 .0819 0 | -1.57079632679 0 0",
        limits=UR_ELBOW,
    ),
    "ur3e": Described(
        UR1.format("ur3e") + "@6485dfa6",
        ur_joints(0.15185, -0.24355, -0.2132, 0.13105, -0.08535, -1.750557762378351e-11, 0.0921, -1.8890025766262e-11),
        limits=UR_ELBOW,
        second=ur_table(151.85, -243.55, -213.2, 131.05, 85.35, 92.1),
        second_where=UR_ARTICLE,
    ),
    "ur5": Described(
        UR1.format("ur5") + "@9238b2c4",
        ur_joints(0.089159, -0.425, -0.39225, 0.10915, -0.09465, -1.941303950897609e-11, 0.0823, -1.688001216681175e-11),
        limits=UR_ELBOW,
    ),
    "ur5 (first description)": Described(
        ERD.format("ur5"),
        old_ur_joints(0.089159, 0.13585, -0.1197, 0.425, 0.39225, 0.093, 0.09465),
        base=OLD_UR_BASE,
        tip="0 .0823 0 | -1.57079632679 0 0",
        limits=UR_ELBOW,
    ),
    "ur5e": Described(
        UR1.format("ur5e") + "@6485dfa6",
        ur_joints(0.1625, -0.425, -0.3922, 0.1333, -0.0997, -2.044881182297852e-11, 0.0996, -2.042830148012698e-11),
        limits=UR_ELBOW,
        second=ur_table(162.5, -425, -392.2, 133.3, 99.7, 99.6),
        second_where=UR_ARTICLE,
    ),
    "ur7e": Described(
        "ros-industrial/universal_robot@3be81362: ur_description/config/ur7e, a link to ur5e",
        ur_joints(0.1625, -0.425, -0.3922, 0.1333, -0.0997, -2.044881182297852e-11, 0.0996, -2.042830148012698e-11),
        limits=UR_ELBOW,
    ),
    "ur8-long": Described(
        UR1.format("ur8long") + "@31e22940",
        ur_joints(0.2186, -0.8989, -0.7149, 0.1824, -0.1361, -2.7914576620936571e-11, 0.1434, -2.941183164909849e-11),
        limits=UR_ELBOW,
    ),
    "ur10": Described(
        UR1.format("ur10") + "@e30bc2ed",
        ur_joints(0.1273, -0.612, -0.5723, 0.163941, -0.1157, -2.373046667922381e-11, 0.0922, -1.891053610911353e-11),
        limits=UR_ELBOW,
    ),
    "ur10 (first description)": Described(
        ERD.format("ur10"),
        old_ur_joints(0.1273, 0.220941, -0.1719, 0.612, 0.5723, 0.1149, 0.1157),
        base=OLD_UR_BASE,
        tip="0 .0922 0 | -1.57079632679 0 0",
        limits=UR_ELBOW,
    ),
    "ur10e": Described(
        UR1.format("ur12e") + "@2f339257, the same arm",
        ur_joints(0.1807, -0.6127, -0.57155, 0.17415, -0.11985, -2.458164590756244e-11, 0.11655, -2.390480459346185e-11),
        limits=UR_ELBOW,
    ),
    "ur12e": Described(
        UR1.format("ur12e") + "@2f339257",
        ur_joints(0.1807, -0.6127, -0.57155, 0.17415, -0.11985, -2.458164590756244e-11, 0.11655, -2.390480459346185e-11),
        limits=UR_ELBOW,
    ),
    "ur15": Described(
        UR1.format("ur15") + "@499e728e",
        ur_joints(0.2186, -0.6475, -0.5164, 0.1824, -0.1361, -2.7914576620936571e-11, 0.1434, -2.941183164909849e-11),
        limits=UR_ELBOW,
    ),
    "ur16e": Described(
        UR1.format("ur16e") + "@2f185eee",
        ur_joints(0.1807, -0.4784, -0.36, 0.17415, -0.11985, -2.458164590756244e-11, 0.11655, -2.390480459346185e-11),
        limits=UR_ELBOW,
    ),
    "ur18": Described(
        UR1.format("ur18") + "@34b13710",
        ur_joints(0.2186, -0.475, -0.3389, 0.1824, -0.1361, -2.7914576620936571e-11, 0.1434, -2.941183164909849e-11),
        limits=UR_ELBOW,
    ),
    "ur20": Described(
        UR1.format("ur20") + "@174e5bb3",
        ur_joints(0.2363, -0.862, -0.7287, 0.201, -0.1593, -3.2672976162492252e-11, 0.1543, -3.1647459019915597e-11),
        limits=UR_ELBOW,
        second=ur_table(236.3, -862, -728.7, 201, 159.3, 154.3),
        second_where=UR_ARTICLE,
    ),
    "ur30": Described(
        "UniversalRobots/Universal_Robots_ROS2_Description@67272756: config/ur30/default_kinematics.yaml",
        ur_joints(0.2363, -0.637, -0.5037, 0.201, -0.1593, 0, 0.1543, -3.1647459019915597e-11),
        limits=UR_ELBOW,
    ),
    # ---------------------------------------------------------------- Barrett
    "wam": Described(
        "jhu-lcsr/barrett_model@00f07a7f: models/components.urdf.xacro",
        """
        - | 0 0 .346     | 0 0 0  | 0 0 1 | -2.6r 2.6r
        - | 0 0 0        | -h 0 0 | 0 0 1 | -1.985r 1.985r
        - | 0 0 0        | h 0 0  | 0 0 1 | -2.8r 2.8r
        - | .045 0 .55   | -h 0 0 | 0 0 1 | -.9r 3.141592653589793r
        - | -.045 -.3 0  | h 0 0  | 0 0 1 | -4.8r 1.3r
        - | 0 0 0        | -h 0 0 | 0 0 1 | -1.5707r 1.5707r
        - | 0 0 0        | h 0 0  | 0 0 1 | -2.95r 2.95r""",
        base="0 0 .346 | 0 0 0",
        tip="0 0 .06 | 0 0 0",
        limits=dict.fromkeys([1, 2, 3, 4, 5, 7], "the user's manual, table 6, in degrees"),
        read="flange 60 mm beyond axis 6, by the user's manual: the description ends at the wrist's centre",
        second="0 0 0 0; -90 0 0 0; 90 0 550 0; -90 45 0 0; 90 -45 300 0; -90 0 0 0; 90 0 60.9 0",
        second_where="BarrettTechnology/libbarrett@71aa5cc3: config/wam7w.conf",
        second_mm=0.9 + MOST_MM,  # its tool plate stands at 60.9 mm
    ),
    # ---------------------------------------------------------------- Franka
    "panda": Described(
        "PyPI example-robot-data 6.0.0: panda_description/urdf/panda.urdf",
        """
        panda_joint1 | 0 0 .333      | 0 0 0  | 0 0 1 | -2.8973r 2.8973r
        panda_joint2 | 0 0 0         | -h 0 0 | 0 0 1 | -1.7628r 1.7628r
        panda_joint3 | 0 -.316 0     | h 0 0  | 0 0 1 | -2.8973r 2.8973r
        panda_joint4 | .0825 0 0     | h 0 0  | 0 0 1 | -3.0718r -.0698r
        panda_joint5 | -.0825 .384 0 | -h 0 0 | 0 0 1 | -2.8973r 2.8973r
        panda_joint6 | 0 0 0         | h 0 0  | 0 0 1 | -.0175r 3.7525r
        panda_joint7 | .088 0 0      | h 0 0  | 0 0 1 | -2.8973r 2.8973r""",
        tip="0 0 .107 | 0 0 0",
        second=FRANKA_TABLE,
        second_where="frankaemika/docs@03982aaf: source/control_parameters.rst",
    ),
    "fr3": Described(
        "Swiss-Battery-Technology-Center/franka_description@3c55fbf8: robots/fr3/kinematics.yaml; limits: "
        "frankarobotics/docs@a76efff7: source/control-parameters-joint-fr3.csv",
        """
        fr3_joint1 | 0 0 .333      | 0 0 0                  | 0 0 1 | -2.9007r 2.9007r
        fr3_joint2 | 0 0 0         | -1.570796326794897 0 0 | 0 0 1 | -1.8361r 1.8361r
        fr3_joint3 | 0 -.316 0     | 1.570796326794897 0 0  | 0 0 1 | -2.9007r 2.9007r
        fr3_joint4 | .0825 0 0     | 1.570796326794897 0 0  | 0 0 1 | -3.0770r -.1169r
        fr3_joint5 | -.0825 .384 0 | -1.570796326794897 0 0 | 0 0 1 | -2.8763r 2.8763r
        fr3_joint6 | 0 0 0         | 1.570796326794897 0 0  | 0 0 1 | .4398r 4.6216r
        fr3_joint7 | .088 0 0      | 1.570796326794897 0 0  | 0 0 1 | -3.0508r 3.0508r""",
        tip="0 0 .107 | 0 0 0",
        second=FRANKA_TABLE,
        second_where="frankarobotics/docs@71ff5d54: source/robot_specifications.rst",
    ),
}


# -------------------------------------------------------------------- kinematics, of many poses at once


def turn(axis, angle):
    """Turns about an axis by each of the angles, as 4 × 4 matrices (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.atleast_1d(angle)[:, None, None]
    out = np.tile(np.eye(4), (len(angle), 1, 1))
    out[:, :3, :3] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    return out


def shift(xyz):
    out = np.eye(4)[None].copy()
    out[0, :3, 3] = xyz
    return out


def fixed_xyz(rpy):
    """Turns about the fixed x, then y, then z axis (roll, pitch, yaw), rad."""
    roll, pitch, yaw = rpy
    return turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)


def of_quaternion(xyzw):
    x, y, z, w = np.asarray(xyzw, float) / np.linalg.norm(xyzw)
    half = np.arctan2(np.linalg.norm((x, y, z)), w)
    return turn((x, y, z) if half else (0, 0, 1), 2 * half)


def inverse(placed):
    out = np.tile(np.eye(4), (len(placed), 1, 1))
    turned = np.swapaxes(placed[:, :3, :3], 1, 2)
    out[:, :3, :3], out[:, :3, 3:] = turned, -turned @ placed[:, :3, 3:]
    return out


def numbers(text):
    return [NAMES_OF_ANGLES.get(word, None) if word in NAMES_OF_ANGLES else float(word) for word in text.split()]


def placement(text):
    """A placement `xyz | roll pitch yaw` in mm."""
    xyz, rpy = (numbers(part) for part in text.split("|"))
    return shift(1000 * np.array(xyz)) @ fixed_xyz(rpy)


def limit(word):
    return np.degrees(float(word[:-1])) if word.endswith("r") else float(word)


def described_joints(arm):
    rows = [[part.strip() for part in line.split("|")] for line in arm.joints.strip().splitlines()]
    return [(name, f"{xyz} | {rpy}", numbers(axis), [limit(word) for word in limits.split()]) for name, xyz, rpy, axis, limits in rows]


def described_flange(arm, angles):
    """The flange in the controller's base by the description; angles in rad as the controller reports them, one row a pose."""
    angles = angles.copy()
    if arm.coupled:
        angles[:, 2] += angles[:, 1]
    flange = inverse(placement(arm.base))
    for joint, (_, origin, axis, _) in enumerate(described_joints(arm)):
        flange = flange @ placement(origin) @ turn(axis, angles[:, joint])
    return flange @ placement(arm.tip)


def second_flange(arm, angles):
    """The flange by the second source's table in modified DH."""
    angles = angles.copy()
    if arm.coupled:
        angles[:, 2] += angles[:, 1]
    flange = np.eye(4)[None]
    for joint, row in enumerate(arm.second.split(";")):
        alpha, a, d, theta = (float(word) for word in row.split())
        turned = np.radians(theta) + arm.senses[joint] * angles[:, joint]
        flange = flange @ turn((1, 0, 0), np.radians(alpha)) @ shift((a, 0, 0)) @ turn((0, 0, 1), turned) @ shift((0, 0, d))
    return flange


def stated_placement(section):
    if section is None:
        return np.eye(4)[None]
    if "quaternion_xyzw" in section:
        turned = of_quaternion(section["quaternion_xyzw"])
    else:
        assert section["euler_order"] == "fixed-xyz", section
        turned = fixed_xyz(np.radians(section["euler_deg"]))
    return shift(section["xyz_mm"]) @ turned


def stated_flange(robot, angles):
    """The flange in the base by the rows of a robot file."""
    axes = angles @ np.array(robot["joint_map"]).T if "joint_map" in robot else angles
    flange = stated_placement(robot.get("base"))
    for joint, row in enumerate(robot["joint"]):
        theta = row["sign"] * axes[:, joint] + np.radians(row["offset_deg"])
        about_z = turn((0, 0, 1), theta) @ shift((0, 0, row["d_mm"]))
        about_x = shift((row["a_mm"], 0, 0)) @ turn((1, 0, 0), np.radians(row["alpha_deg"]))
        match robot["convention"]:
            case "standard-dh":
                flange = flange @ about_z @ about_x
            case "modified-dh":
                flange = flange @ about_x @ about_z
            case other:
                raise ValueError(f"convention {other}")
    return flange @ stated_placement(robot.get("flange"))


# -------------------------------------------------------------------- what is checked


def poses(robot):
    """Zero, home and random poses within the limits, rad."""
    generator = np.random.default_rng(2024)
    low, high = np.radians([row["limits_deg"] for row in robot["joint"]]).T
    drawn = generator.uniform(low, high, (POSES, len(low)))
    return np.vstack([np.zeros(len(low)), np.radians(robot["home_deg"]), drawn])


def differences(one, other):
    """The largest difference of two sets of placements: mm and rad."""
    off = np.linalg.norm(one[:, :3, 3] - other[:, :3, 3], axis=1).max()
    between = np.swapaxes(one[:, :3, :3], 1, 2) @ other[:, :3, :3]
    # The angle of a small turn from its antisymmetric part, which keeps digits that the trace loses.
    sine = np.stack([between[:, 2, 1] - between[:, 1, 2], between[:, 0, 2] - between[:, 2, 0], between[:, 1, 0] - between[:, 0, 1]], 1)
    sine = np.linalg.norm(sine, axis=1) / 2
    cosine = (np.trace(between, axis1=1, axis2=2) - 1) / 2
    return off, np.arctan2(sine, cosine).max()


def faults(robot, arm):
    """Everything of a robot file that is not as the description has it, and the largest differences found."""
    found, angles = [], poses(robot)
    joints = described_joints(arm)
    if len(joints) != len(robot["joint"]):
        return [f"{len(robot['joint'])} joints; the description has {len(joints)}"], (np.inf, np.inf), None
    flange = stated_flange(robot, angles)
    first = differences(flange, described_flange(arm, angles))
    if first[0] > MOST_MM or first[1] > MOST_RAD:
        found.append(f"flange off by {first[0]:.3g} mm, {first[1]:.3g} rad from {arm.where}")
    second = None
    if arm.second:
        second = differences(flange, second_flange(arm, angles))
        if second[0] > arm.second_mm or second[1] > MOST_RAD:
            found.append(f"flange off by {second[0]:.3g} mm, {second[1]:.3g} rad from {arm.second_where}")
    for number, (row, (name, _, _, limits)) in enumerate(zip(robot["joint"], joints), 1):
        if name not in ("-", row["name"]):
            found.append(f"joint {number} is called {row['name']}; the description says {name}")
        low, high = row["limits_deg"]
        home = robot["home_deg"][number - 1]
        if not low <= home <= high:
            found.append(f"home of {row['name']} is {home}°, outside of {low} to {high}°")
        off = max(abs(low - limits[0]), abs(high - limits[1]))
        if number in arm.limits:
            if off <= MOST_LIMIT_DEG:
                found.append(f"limits of {row['name']} are those of the description, though it is said here: {arm.limits[number]}")
        elif off > MOST_LIMIT_DEG:
            found.append(f"limits of {row['name']} are {low} to {high}°; the description has {limits[0]:.3f} to {limits[1]:.3f}°")
    return found, first, second


def wrong_rows(path):
    """Rows of urdf_flanges.csv whose flange is not that of the description, and how many rows there are."""
    found, rows = [], list(csv.DictReader(path.read_text().splitlines()))
    for row in rows:
        angles = np.radians([[float(row[f"q{joint}_deg"]) for joint in range(1, 7)]])
        kept = shift([float(row[f"{axis}_mm"]) for axis in "xyz"]) @ of_quaternion([float(row[f"q{axis}"]) for axis in "xyzw"])
        off, turned = differences(kept, described_flange(ARMS[row["robot"]], angles))
        if off > MOST_MM or turned > MOST_RAD:
            found.append(f"{path.name}: a flange of {row['robot']} is off by {off:.3g} mm, {turned:.3g} rad")
    return found, len(rows)


def little_changes(robot, arm):
    """Copies of a robot file with one number changed by little, and what was changed."""
    for index, row in enumerate(robot["joint"]):
        steps = [("a_mm", 1e-3), ("d_mm", 1e-3), ("alpha_deg", 1e-3), ("offset_deg", 1e-3), ("sign", -2 * row["sign"])]
        for key, step in steps:
            yield f"{key} of {row['name']}", changed(robot, index, key, row[key] + step)
        if index + 1 not in arm.limits:
            low, high = row["limits_deg"]
            yield f"limits of {row['name']}", changed(robot, index, "limits_deg", [low, high + 0.5])
    if "joint_map" in robot:
        yield "joint_map", {key: value for key, value in robot.items() if key != "joint_map"}
    for end in ("base", "flange"):
        if end in robot:
            yield end, {key: value for key, value in robot.items() if key != end}


def changed(robot, index, key, value):
    joints = [dict(row) for row in robot["joint"]]
    joints[index][key] = value
    return {**robot, "joint": joints}


def entries(name):
    """The descriptions that an arm is held against: the one under its own name, and any others `name (…)`."""
    return [(key, arm) for key, arm in ARMS.items() if key == name or key.startswith(f"{name} (")]


def digits(value):
    return "< 1e-9" if value < 1e-9 else f"{value:.0e}"


def in_short(where):
    """The repository or package of a description, without path and commit."""
    if where == UR_ARTICLE:
        return "Universal Robots' article on DH parameters"
    return where.split(":")[0].split("@")[0].removeprefix("PyPI ").split(" ")[0].split(",")[0]


def table_row(name, robot, results):
    """A row of the table in README.md beside the files."""
    against = [in_short(arm.where) for _, arm, _, _ in results]
    for _, arm, _, second in results:
        if second:
            but = f" (but {second[0]:.1f} mm, see the file)" if second[0] > MOST_MM else ""
            against.append(in_short(arm.second_where) + but)
    worst = [max(first[part] for _, _, first, _ in results) for part in (0, 1)]
    source = robot["source"].split(";")[0]
    largest = f"{digits(worst[0])} mm, {digits(worst[1])} rad"
    cells = [f"`{name}.toml`", robot["model"], str(len(robot["joint"])), robot["convention"], source, ", ".join(against), largest]
    return "| " + " | ".join(cells) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=pathlib.Path, default=ROOT / "pipelines" / "robots")
    parser.add_argument("--only", action="append")
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("--table", action="store_true")
    options = parser.parse_args()
    listed = (options.robots / "README.md").read_text() if (options.robots / "README.md").exists() else ""
    wrong = changes = 0
    for path in sorted(options.robots.glob("*.toml")):
        if options.only and path.stem not in options.only:
            continue
        robot = tomllib.loads(path.read_text())
        results = []
        for key, arm in entries(path.stem):
            found, first, second = faults(robot, arm)
            results.append((key, arm, first, second))
            for fault in found:
                print(f"{path.name}: {fault}")
            wrong += len(found)
            if not options.table:
                beside = f", second source {second[0]:.2g} mm {second[1]:.2g} rad" if second else ""
                print(f"{key}: {len(robot['joint'])} joints, {POSES + 2} poses: {first[0]:.2g} mm {first[1]:.2g} rad{beside}")
            if options.self_test and not found:
                for what, other in little_changes(robot, arm):
                    changes += 1
                    if not faults(other, arm)[0]:
                        print(f"{key}: a change of {what} is not noticed")
                        wrong += 1
        if not results:
            print(f"{path.name}: no description is held against it; add one to ARMS, or take the file away")
            wrong += 1
        elif options.table:
            print(table_row(path.stem, robot, results))
        if not options.table and f"`{path.name}`" not in listed:
            print(f"{path.name}: not in the table of {options.robots / 'README.md'}")
            wrong += 1
    if not options.table:
        found, rows = wrong_rows(ROOT / "tests/library/kinematics/urdf_flanges.csv")
        print("\n".join([*found, f"urdf_flanges.csv: {rows} flanges"]))
        wrong += len(found)
    if options.self_test:
        print(f"{changes} changes of one number each")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
