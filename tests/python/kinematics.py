#!/usr/bin/env python3
"""Compares forward kinematics and Jacobians with Pinocchio, which reads the same URDF file.

usage: kinematics.py FOLDER

For every NAME.urdf in FOLDER, NAME.json has what is compared: `tip`, the link; `joints`, their names from base to tip;
`cases`, each with the values of the joints (`joints`, rad and m), the pose of the tip in the root link (`translation_m`,
`rotation` by rows) and its Jacobian (`jacobian_columns`, velocity and angular velocity of the tip per joint, in the axes of
the root link). Prints a line per arm; exits with 1 when one differs by more than 1e-9 m or rad, 2 when there is none.
"""

import json
import pathlib
import sys

import numpy as np
import pinocchio

TOLERANCE = 1e-9


def configuration(model, names, values):
    """Pinocchio's configuration; a joint without end is there as cosine and sine."""
    q = pinocchio.neutral(model)
    for name, value in zip(names, values):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return q


def compare(urdf, said):
    """Largest difference of position and of rotation, of poses and of Jacobians."""
    model = pinocchio.buildModelFromUrdf(str(urdf))
    data = model.createData()
    tip = model.getFrameId(said["tip"])
    assert tip < model.nframes, f"{urdf}: no link {said['tip']}"
    columns = [model.joints[model.getJointId(name)].idx_v for name in said["joints"]]
    worst = np.zeros(4)
    for case in said["cases"]:
        pinocchio.computeJointJacobians(model, data, configuration(model, said["joints"], case["joints"]))
        pose = pinocchio.updateFramePlacement(model, data, tip)
        jacobian = pinocchio.getFrameJacobian(model, data, tip, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:, columns]
        ours = np.array(case["jacobian_columns"]).T
        turn = pinocchio.log3(pose.rotation.T @ np.array(case["rotation"]))
        off = [np.linalg.norm(pose.translation - case["translation_m"]), np.linalg.norm(turn)]
        off += [np.abs(jacobian[:3] - ours[:3]).max(), np.abs(jacobian[3:] - ours[3:]).max()]
        worst = np.maximum(worst, off)
    return worst, len(said["cases"])


def main():
    files = sorted(pathlib.Path(sys.argv[1]).glob("*.urdf"))
    if not files:
        print("no URDF file there", file=sys.stderr)
        return 2
    bad = False
    for urdf in files:
        worst, cases = compare(urdf, json.loads(urdf.with_suffix(".json").read_text()))
        # NaN is no agreement.
        good = cases > 0 and bool(np.all(worst <= TOLERANCE))
        bad = bad or not good
        numbers = "pose {:.1e} m {:.1e} rad, Jacobian {:.1e} m {:.1e} rad".format(*worst)
        print(f"{urdf.stem}: {cases} configurations, {numbers}: {'agrees' if good else 'DIFFERS'}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
