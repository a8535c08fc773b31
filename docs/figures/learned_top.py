"""A heavy top with an unknown magnet: a small network inside ℓ learns the missing energy from noisy motions.

Run as: python docs/figures/learned_top.py [iterations, 120]
It prints the errors along a motion that was not in the data, of the known Lagrangian, of the Lagrangian with the
network, and of a plain neural ODE with a network of the same width, with the drift of the conserved vertical momentum.

The known part is ℓ = ½ ξ·Jξ − w·a; the truth also has −V(a) of a magnet. The learned Lagrangian is ℓ − N(a) with a
network N of 12 tanh, and its variational integrator keeps the momentum for any weights.
"""

import sys

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from scipy.optimize import minimize

import coadjoint as co

iterations = int(sys.argv[1]) if len(sys.argv) > 1 else 120
dt, steps, segments, noise, width = 0.05, 10, 96, 0.002, 12
random = np.random.default_rng(8)
inertia, weight = np.array([1.0, 1.2, 0.6]), np.array([0.1, 0.0, 0.9])


def known(xi, a):
    return 0.5 * xi @ (inertia * xi) - weight @ a


def with_magnet(xi, a):
    return known(xi, a) - 0.6 * a[0] ** 2 - 0.4 * a[0] * a[1] + 0.3 * jnp.sin(2 * a[1])


def network(layers, x):
    for layer in layers[:-1]:
        x = jnp.tanh(layer["weight"] @ x + layer["bias"])
    return layers[-1]["weight"] @ x


def with_network(xi, a, p):
    return known(xi, a) - network([layer.asdict() for layer in p.net], a)[0]


def random_layers(inputs, outputs, size):
    first = {"weight": random.normal(size=(size, inputs)) / np.sqrt(inputs), "bias": np.zeros(size)}
    return [first, {"weight": 0.1 * random.normal(size=(outputs, size))}]


truth = co.System(co.SO3(), with_magnet, advected=co.Defining(), name="truth")
plain = co.System(co.SO3(), known, advected=co.Defining(), name="known")
learned = co.System(
    co.SO3(), with_network, advected=co.Defining(), parameters={"net": random_layers(3, 1, width)}, name="learned"
)


def motion(system, xi, a0, count, every=1):
    """(μ, a) at nodes, (count + 1, 6); `every` takes smaller steps in between."""
    start = system.state(xi=xi, a0=a0)
    records = co.trajectory(
        system, start, dt=dt / every, steps=count * every, save_every=every, backend="xla", accuracy=False
    ).records
    return jnp.concatenate([records.mu, records.a], axis=1)


def direction():
    a = random.normal(size=3)
    return a / np.linalg.norm(a)


with co.float64():
    # Noisy pieces of the true motion, and one long motion that is kept for the test.
    data = np.stack([motion(truth, random.normal(size=3), direction(), steps, 4) for _ in range(segments)])
    data = data + noise * random.normal(size=data.shape)
    test_xi, test_a = np.array([0.2, -0.1, 0.9]), np.array([0.6, 0.0, 0.8])
    test = motion(truth, test_xi, test_a, 200, 4)


def of_lagrangian(layers):
    """The pieces by the variational integrator, from their first noisy nodes."""
    system = learned.replace(net=layers)
    return jax.vmap(lambda y: motion(system, y[:3] / inertia, y[3:], steps))(data[:, 0])


def of_ode(layers, starts, count):
    """The pieces by a neural ODE (μ, a)˙ = N(μ, a) with four stages a step."""

    def step(y, _):
        k1 = network(layers, y)
        k2 = network(layers, y + 0.5 * dt * k1)
        k3 = network(layers, y + 0.5 * dt * k2)
        y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + network(layers, y + dt * k3))
        return y, y

    return jax.vmap(lambda y: jnp.concatenate([y[None], jax.lax.scan(step, y, None, count)[1]]))(starts)


def trained(predicted, layers):
    """The layers that fit the pieces best after some iterations of L-BFGS, with a small penalty on their size."""
    flat, rebuilt = ravel_pytree(layers)

    @jax.jit
    @jax.value_and_grad
    def misfit(flat):
        return jnp.mean((predicted(rebuilt(flat)) - data) ** 2) + 1e-8 * flat @ flat

    found = minimize(lambda x: tuple(map(np.asarray, misfit(x))), np.asarray(flat), jac=True, method="L-BFGS-B",
                     options={"maxiter": iterations})  # fmt: skip
    return rebuilt(jnp.asarray(found.x))


with co.float64():
    layers = trained(of_lagrangian, [layer.asdict() for layer in learned.parameters.net])
    ode = trained(lambda layers: of_ode(layers, jnp.asarray(data[:, 0]), steps), random_layers(6, 6, width))
    found = (
        motion(plain, test_xi, test_a, 200),
        motion(learned.replace(net=layers), test_xi, test_a, 200),
        of_ode(ode, test[:1], 200)[0],
    )
    rows = dict(zip(("known ℓ", "learned ℓ", "neural ODE"), map(np.asarray, found), strict=True))
    test = np.asarray(test)

count = sum(np.size(leaf) for leaf in jax.tree.leaves(layers)), sum(np.size(leaf) for leaf in jax.tree.leaves(ode))
print(f"{segments} pieces of {steps} steps, noise {noise}; {count[0]} weights in ℓ, {count[1]} in the neural ODE")
print(f"{'':12}{'error of a in 2 s':>20}{'in 10 s':>12}{'drift of μ·a':>16}")
for name, found in rows.items():
    error = np.max(np.abs(found[:, 3:] - test[:, 3:]), axis=1)
    momentum = np.sum(found[:, :3] * found[:, 3:], axis=1)
    print(f"{name:12}{np.max(error[:41]):20.4f}{np.max(error):12.4f}{np.ptp(momentum):16.1e}")
