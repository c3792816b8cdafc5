"""Robots of a fleet, simulated in seconds: an arm of two joints, a healthy session and one of today."""
import pathlib
import random
import subprocess

URDF = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0.02"/><mass value="3"/><inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
</robot>
"""


def effect(name, joint, **parameters):
    values = ", ".join(f"{key} = {value}" for key, value in parameters.items())
    where = f"joint = {joint}\n" if joint else ""
    return f'[[effect]]\nname = "{name}"\n{where}parameters = {{ {values} }}\n'


# What may come up on a robot overnight.
DRIFTS = {
    "payload": effect("payload", 0, mass=0.6, com_x=0.25, com_y=0.0, com_z=0.02),
    "ripple": effect("ripple", 2, wavenumber=12.0, cos=0.25, sin=0.2),
    "stribeck": effect("stribeck", 2, velocity=0.08, amplitude=0.8),
}


def scenario(seed, friction, logs, extra="", duration_s=10, sample_s=0.005):
    """`friction`: viscous and Coulomb of each joint. `logs`: names; every one is another motion."""
    text = (f"seed = {seed}\n[sensors]\nencoder_bits = 20\nsample_s = {sample_s}\ntorque_noise = 0.005\n[robot]\n"
            'urdf = "arm.urdf"\nrated_torque = [60, 20]\nacceleration = [8, 8]\n')
    for joint, (viscous, coulomb) in enumerate(friction, 1):
        text += effect("viscous", joint, coefficient=viscous)
        text += effect("coulomb", joint, amplitude=coulomb, width=0.004)
    text += extra
    for k, log in enumerate(logs):
        text += f'[[log]]\nname = "{log}"\nduration_s = {duration_s}\nspeed = 0.4\nseed = {seed + k}\n'
    return text


def project(logs):
    """`logs`: (file, role)."""
    return ('[robot]\nurdf = "arm.urdf"\nrated_torque = [60, 20]\n' +
            "".join(f'[[log]]\nfile = "{file}"\nrole = "{role}"\n' for file, role in logs))


def simulate(program, folder, name, text):
    (folder / f"{name}.scenario").write_text(text)
    subprocess.run([program, "simulate", f"{name}.scenario", "--out", "."], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for truth in folder.glob(f"{name}_*.truth.csv"):
        truth.unlink()


def make_robot(program, folder, name, seed, drift=None, **of_logs):
    """NAME.toml and its logs; friction differs from robot to robot and by a few per cent from session to session."""
    draw = random.Random(seed)
    own = [(draw.uniform(0.7, 1.4), draw.uniform(1.0, 2.0)) for _ in range(2)]
    for k, (session, logs) in enumerate((("healthy", "abc"), ("today", "abc"))):
        friction = [tuple(value * draw.uniform(0.97, 1.03) for value in joint) for joint in own]
        extra = DRIFTS[drift] if drift and session == "today" else ""
        simulate(program, folder, f"{name}_{session}",
                 scenario(1000 * seed + 100 * k + 1, friction, [f"{name}_{session}_{log}" for log in logs], extra, **of_logs))
    (folder / f"{name}.toml").write_text(project([
        (f"{name}_healthy_a.csv", "baseline"), (f"{name}_healthy_b.csv", "baseline"), (f"{name}_today_a.csv", "train"),
        (f"{name}_today_b.csv", "train"), (f"{name}_today_c.csv", "validate")]))


def make_folder(folder):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(URDF)
    return folder
