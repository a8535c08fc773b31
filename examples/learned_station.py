"""BlueROV2 Heavy learns to hold a station by its eight thrusters, beside the library's own controller.

Run as: python examples/learned_station.py [iterations] [policies]
A linear policy, actions = tanh(W o), is improved by evolution strategies (Salimans et al., 2017): half of the policies
have W + σE, the other half W − σE, all fly the same starts, and W goes along the E of those that were better. It prints
returns and distances, also in a current that it has never met, and writes learned_station.png."""

import sys
import time

import matplotlib.pyplot as plt
import numpy as np

import coadjoint_vehicles as vehicles
from coadjoint_vehicles.environments import HoldStation
from coadjoint_vehicles.water import UniformWater

iterations = int(sys.argv[1]) if len(sys.argv) > 1 else 80
policies = int(sys.argv[2]) if len(sys.argv) > 2 else 128  # of an iteration
EPISODES, SIGMA, RATE, TASK = 16, 0.05, 0.05, HoldStation(seconds=20.0)
SAME = {"vehicle": "bluerov2_heavy_von_benzon", "task": TASK, "autoreset": "same_step"}
random = np.random.default_rng(0)


def flown(envs, act, seeds, periods=200):
    """Returns of 20 s or until the first end, (members,), and the distances to the station, (periods, members)."""
    seen, _ = envs.reset(seed=[int(seed) for seed in seeds])
    alive, total, distances = np.ones(envs.num_envs, bool), np.zeros(envs.num_envs), []
    for period in range(periods):
        distances.append(np.linalg.norm(seen[:, envs.fields["offset"]], axis=1))
        seen, rewards, terminated, truncated, _ = envs.step(act(seen))
        total += alive * rewards * (period < 200)
        alive &= ~(terminated | truncated)
    return total, np.array(distances)


def linear(weights):
    """Actions of policies (count, size + 1, 8), each of which has its share of the members."""

    def act(seen):
        rows = seen.reshape(len(weights), -1, seen.shape[1])
        return np.tanh(rows @ weights[:, :-1] + weights[:, -1:]).reshape(len(seen), -1)

    return act


envs = vehicles.vector_environment(num_envs=policies * EPISODES, **SAME)
waters, tested = {"still water": None, "0.3 m/s": UniformWater((0, 0.3, 0))}, 1_000_000 + np.arange(64)  # other starts
few = {**SAME, "num_envs": 64, "seconds": 60.0}
tests = {where: vehicles.vector_environment(water=water, **few) for where, water in waters.items()}
weights = np.zeros((envs.observation_space.shape[1] + 1, 8))
first = second = np.zeros_like(weights)  # moments of Adam
curve, began = [], time.process_time()
for k in range(iterations):
    half = random.standard_normal((policies // 2, *weights.shape))
    seeds = np.tile(k * EPISODES + np.arange(EPISODES), policies)
    returns, _ = flown(envs, linear(weights + SIGMA * np.concatenate([half, -half])), seeds)
    ranks = returns.reshape(policies, EPISODES).mean(axis=1).argsort().argsort() / (policies - 1)
    slope = np.tensordot(ranks[: policies // 2] - ranks[policies // 2 :], half, 1) / (policies * SIGMA)
    first, second = 0.9 * first + 0.1 * slope, 0.99 * second + 0.01 * slope**2
    weights = weights + RATE * first / (1 - 0.9 ** (k + 1)) / (np.sqrt(second / (1 - 0.99 ** (k + 1))) + 1e-8)
    curve.append((time.process_time() - began, flown(tests["still water"], linear(weights[None]), tested)[0].mean()))
print(f"{iterations} iterations in {curve[-1][0]:.0f} s of processor time")
figure, panels = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
found = {}
for axes, where in zip(panels[1:], waters, strict=True):
    hover = vehicles.vector_environment(water=waters[where], actions="set_points", **few), lambda _: np.zeros((64, 4))
    for name, (env, act) in (("learned", (tests[where], linear(weights[None]))), ("Hover", hover)):
        returns, far = found[name, where] = flown(env, act, tested, 600)
        last = f"{np.median(far[200]):.3f} and {np.median(far[-1]):.3f} m"
        print(f"{name:>7}, {where}: mean return {returns.mean():6.1f}, median distance after 20 and 60 s {last}")
        (line,) = axes.plot(0.1 * np.arange(len(far)), np.median(far, axis=1), label=name)
        band = np.quantile(far, (0.05, 0.95), axis=1)
        axes.fill_between(*line.get_data()[:1], *band, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set(xlabel="time (s)", ylabel="distance (m)", title=f"{where}: median of 64, nine in ten", ylim=(0, 3))
panels[0].plot(*np.array(curve).T, label="learned")
panels[0].axhline(found["Hover", "still water"][0].mean(), color="C1", label="Hover")
panels[0].set(xlabel="processor time (s)", ylabel="mean return", title="64 starts not learned from")
panels[0].legend(frameon=False)
figure.savefig("learned_station.png", dpi=110)
