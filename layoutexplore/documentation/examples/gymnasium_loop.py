"""The environment by hand, without a learner: the first valid frontier, which is the nearest."""

import gymnasium as gym
import numpy as np

import layoutexplore  # noqa: F401  (registers the environments)

if __name__ == "__main__":
    env = gym.make("LayoutExplore/Frontier-v0", plan="apartment:3", sensor="indoor")
    observation, info = env.reset(seed=0)
    total, terminated, truncated = 0.0, False, False
    while not (terminated or truncated):
        valid = np.flatnonzero(env.get_wrapper_attr("action_masks")())
        observation, reward, terminated, truncated, info = env.step(int(valid[0]))
        total += float(reward)
    print(f"{info['coverage']:.1%} seen in {info['distance']:.0f} m, return {total:.2f}")
