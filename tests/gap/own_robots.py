"""What tests of a user's own robot share."""

from bns.gap.describe import Description, describe
from bns.gap.models.mjcf.model import OwnModel

ARM = """
<mujoco model="arm"><compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <default><joint damping="0.6" armature="0.01"/></default>
  <worldbody><body name="upper">
    <joint name="FL_hip_joint" axis="1 0 0" range="-1.5 1.5" limited="true"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="1"/>
    <body name="lower" pos="0 0 -0.2">
      <joint name="FL_calf_joint" axis="0 1 0" range="-2 2" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.3"/>
      <site name="toe" pos="0 0 -0.2"/>
    </body></body></worldbody>
  <actuator>ACTUATORS</actuator></mujoco>"""
MOTORS = "".join(
    f'<motor joint="FL_{name}_joint" ctrlrange="-20 20"/>' for name in ("hip", "calf")
)
SERVOS = "".join(
    f'<position joint="FL_{name}_joint" kp="20" kv="1.5"/>' for name in ("hip", "calf")
)


def described(folder, mjcf, log, **loop) -> tuple[Description, OwnModel]:
    """A robot described from a log, and the model of that description.

    Args:
        folder: where its MJCF and its description are written.
        mjcf: text of the former.
        log: file.
        loop: gains of its own, as `describe` takes them.
    """
    (folder / "robot.xml").write_text(mjcf)
    own = folder / "own.toml"
    found = describe(folder / "robot.xml", log, out=own, **loop)
    found.write(own)
    return found, OwnModel.read(own, threads=1)


def arm(folder, actuators, description) -> OwnModel:
    """The arm as it is described, its actuators called as their joints.

    Args:
        folder: where its MJCF and its description are written.
        actuators: `MOTORS` or `SERVOS`.
        description: text of the latter.
    """
    for name in ("hip", "calf"):
        told = f'joint="FL_{name}'
        actuators = actuators.replace(told, f'name="{name}" {told}')
    (folder / "robot.xml").write_text(ARM.replace("ACTUATORS", actuators))
    (folder / "own.toml").write_text(description)
    return OwnModel.read(folder / "own.toml", threads=1)


def of_motors(effects: str) -> str:
    """A description of the arm with motors.

    Args:
        effects: what it lists.
    """
    return f"""
name = "arm"
model = "robot.xml"
commands.hip = {{ actuator = "hip", unit = "N m", low = -2.0, high = 2.0 }}
commands.calf = {{ actuator = "calf", unit = "N m", low = -0.5, high = 0.5 }}
observed.q0 = {{ joint = "FL_hip_joint", unit = "rad", noise = 0.002 }}
observed.q1 = {{ joint = "FL_calf_joint", unit = "rad", noise = 0.002 }}
[effects]
{effects}"""
