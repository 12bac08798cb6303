"""The best policy of a Cartpole run without openeureka's simulator: in plain MuJoCo, with ONNX Runtime.

pip install onnxruntime
python examples/play_onnx.py outputs/<time>_cartpole
"""

import sys

import mujoco
import numpy as np
import onnxruntime

from openeureka.suite.isaac.cartpole import Cartpole

model = Cartpole.compile_model()  # after mujoco.mj_saveModel you need neither openeureka nor PyTorch
data = mujoco.MjData(model)
data.qpos[1] = 0.1  # [rad]
policy = onnxruntime.InferenceSession(f"{sys.argv[1]}/best/policy.onnx")
while data.time < 10.0 and abs(data.qpos[1]) < np.pi / 2:
    observation = np.array([[data.qpos[0], data.qvel[0], data.qpos[1], data.qvel[1]]], dtype=np.float32)
    (action,) = policy.run(["action"], {"observation": observation})
    data.ctrl[:] = action[0]
    mujoco.mj_step(model, data, nstep=Cartpole.substeps)
print(f"The pole stood for {data.time:.1f} s, its angle is now {data.qpos[1]:.3f} rad")
