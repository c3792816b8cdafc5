"""A small good project, from which every mistake is made: an arm of two joints in a vertical plane, and its logs."""
import math

URDF = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0.5 0 0"/><mass value="4"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.04" iyz="0" izz="0.04"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.4 0 0"/><mass value="2"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="5" effort="100"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2.5" upper="2.5" velocity="5" effort="50"/></joint>
</robot>
"""

PROJECT = """[robot]
urdf = "arm.urdf"
rated_torque = [60.0, 20.0]

[[log]]
file = "train.csv"
role = "train"

[[log]]
file = "test.csv"
role = "test"

[train]
enabled = false

[excite]
period_s = 2.0
order = 2
trajectories = 1
starts = 1
"""

STEP_S = 0.004
ROWS = 1500
COLUMNS = ["t", "q1", "q2", "tau1", "tau2"]


def motion(t, phase):
    """q, dq, ddq of both joints."""
    waves = [[(0.9, 1.7, phase), (0.25, 4.1, 2 * phase)], [(1.1, 2.3, 1 + phase), (0.3, 5.3, phase)]]
    q = [sum(a * math.sin(w * t + p) for a, w, p in joint) for joint in waves]
    dq = [sum(a * w * math.cos(w * t + p) for a, w, p in joint) for joint in waves]
    ddq = [sum(-a * w * w * math.sin(w * t + p) for a, w, p in joint) for joint in waves]
    return q, dq, ddq


def torque(q, dq, ddq):
    """Of URDF, with Coulomb and viscous friction. A link at angle q points to (cos q, -sin q)."""
    l1, r1, m1, i1, r2, m2, i2, g = 0.5, 0.5, 4.0, 0.04, 0.4, 2.0, 0.02, 9.81
    c2, s2 = math.cos(q[1]), math.sin(q[1])
    m11 = m1 * r1 * r1 + i1 + m2 * (l1 * l1 + r2 * r2 + 2 * l1 * r2 * c2) + i2
    m12 = m2 * (r2 * r2 + l1 * r2 * c2) + i2
    m22 = m2 * r2 * r2 + i2
    h = m2 * l1 * r2 * s2
    g2 = -m2 * g * r2 * math.cos(q[0] + q[1])
    g1 = -(m1 * r1 + m2 * l1) * g * math.cos(q[0]) + g2
    tau = [m11 * ddq[0] + m12 * ddq[1] - h * (2 * dq[0] * dq[1] + dq[1] * dq[1]) + g1,
           m12 * ddq[0] + m22 * ddq[1] + h * dq[0] * dq[0] + g2]
    return [tau[j] + f * math.tanh(dq[j] / 0.02) + 0.8 * dq[j] for j, f in enumerate((2.0, 1.0))]


def log(phase, rows=ROWS):
    """Rows of COLUMNS, with a noise that is the same every time."""
    out, state = [], 12345
    for k in range(rows):
        q, dq, ddq = motion(k * STEP_S, phase)
        tau = torque(q, dq, ddq)
        for j in range(2):
            state = (1103515245 * state + 12345) % 2**31
            tau[j] += 0.05 * (state / 2**30 - 1)
        out.append([k * STEP_S, *q, *tau])
    return out


def text(rows, columns=None, separator=","):
    lines = [separator.join(columns or COLUMNS)]
    lines += [separator.join(format(value, ".10g") for value in row) for row in rows]
    return "\n".join(lines) + "\n"


def files():
    """File name -> content of the good project."""
    return {"arm.urdf": URDF, "robot.toml": PROJECT, "train.csv": text(log(0.3)), "test.csv": text(log(1.4))}
