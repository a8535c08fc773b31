"""The process of a filter that is a system's own model: one step of a variational integrator, and its tangent map."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, StepError, shown
from coadjoint.estimation.arguments import require_fit, roots_of_noise, sizes_of
from coadjoint.estimation.augmented_state import DriftingParameters
from coadjoint.estimation.constrained_errors import ConstrainedErrors
from coadjoint.estimation.drifts import Drift
from coadjoint.estimation.filtered import states_at
from coadjoint.estimation.process import spread
from coadjoint.kernels.packing import flattened, layout, pack, rows
from coadjoint.kernels.program import Code
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.run.kalman import Model
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.jaxprs import used_by_each
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.step_model import StepModel, StepsTaken
from coadjoint.simulation.accuracy.local_error import PartsOfSteps, recorded
from coadjoint.simulation.accuracy.ruler import course_of, ruler_of
from coadjoint.simulation.arguments import require_kinds, with_inputs
from coadjoint.simulation.steppers.beginning import shapes_of
from coadjoint.simulation.steppers.building import commands_from, places_of


class ModelProcess(ConstrainedErrors):
    """A system as a filter's process: x = (g, n, a, μ, π, …, θ) advances by one step of a variational method.

    The error e = (η, δq, δμ, δπ, δθ) is invariant under the group: with error="left" in body axes,

        g = ĝ exp(η),  q = q̂ + ĝδq,  μ = μ̂ + δμ,  π = π̂ + δπ,

    with error="right" in those of space,

        g = exp(η) ĝ,  q = exp(η)q̂ + δq,  μ = μ̂ + Ad*_g δμ,  π = π̂ + g*δπ;

    a = g⁻¹a₀ goes with g. With R(z, x) = 0 the equations of the step, its tangent map is that of the implicit function
    theorem, dz = −(∂R/∂z)⁻¹ ∂R/∂x dx, exact to round-off.

    Arguments:
        system, start, method: those of `co.simulate`; a method of fixed steps, compositions included, by default
            `co.Midpoint()`.
        inputs: the commands that are set before each step, as `co.Stepper` takes them; by default none.
        error: "left" (the default) or "right".
        noise: {"torque": S_T, "force": S_f}, the roots of the spectral densities of white torques and forces in body
            axes, N m √s and N √s in SI units, one number or (dim G,) and (dim Q,); by default none. Over a step of h
            they add S²h to the covariances of μ and π, and to those of attitudes and places S²h³/3 of the velocities,
            to second order in h.
        drifting: name → `RandomWalk` or `GaussMarkov` of parameters θ of the system that are estimated as well, as in
            {"water.velocity": GaussMarkov(0.3, 600)}; by default none.
        biases: name → `RandomWalk` or `GaussMarkov` of numbers that do not act on the motion and that only
            measurements read, as the biases of an inertial unit; they begin at 0, and are as many as the drift has
            numbers, as in {"imu_gyroscope": RandomWalk([1e-6, 1e-6, 1e-6])}; by default none.

    Of a system with constraints the states and errors stay on them: every corrected state moves onto them by the least
    motion in the kinetic metric, impulses of the noise get the reaction that keeps the velocities, and P is singular,
    of the rank of the tangent space. Deviations and covariances at the start are projected onto it.

    The internal state of the system, as the speed of a rotor, the angle of a fin or the memory of a controller,
    advances with the estimate, and has no coordinates in e: it counts as known exactly. Its uncertainty belongs into
    `noise`.

    Raises ArgumentError for arguments that do not fit the system.
    """

    def __init__(
        self,
        system: System,
        start: State,
        *,
        method: Method | None = None,
        inputs: PyTree = (),
        error: str = "left",
        noise: Mapping[str, PyTree] | None = None,
        drifting: Mapping[str, Drift] | None = None,
        biases: Mapping[str, Drift] | None = None,
    ):
        method = Midpoint() if method is None else method
        require_kinds(system, start, method)
        require_fit(method, system, start, error)
        commands = commands_from(inputs)
        if commands.start is not None:
            start = start.replace(inputs=commands.start)
        driven, start = with_inputs(system, start, commands.inputs, False)
        self.error, self.method, self.input_sizes = error, method, sizes_of(commands.fields.shapes)
        self._system, self._begun = driven, method.begin(driven, start, 1.0)
        self._layout, row = pack(self._begun)
        self.commanded = np.array(places_of(list(shapes_of(self._begun).items()), commands), int)
        self._constants = Constants(driven.parameters, None)
        self._drifts = DriftingParameters(self._constants, dict(drifting or {}), dict(biases or {}))
        self._first = np.concatenate([row, self._drifts.first])
        digest = version(driven, start, pure=False)
        self._program = StepProgram(replace_parameters(driven, None), method, version=digest)
        group, Q, _ = driven.places
        self._sizes = d, q = group.dim, Q.ambient(group)
        self.error_sizes = {"g": d, "q": q, "mu": d, "pi": q, **self._drifts.sizes}
        self.error_sizes = {name: size for name, size in self.error_sizes.items() if size}
        self.densities = roots_of_noise(noise, d, q)
        self.unknowns, self.drifting = self._program.unknowns, self._drifts.count
        self._model = StepModel(
            self._program, self._constants, self._begun, course=True, free=self._drifts.places.tolist()
        )
        self.substeps = self._program.substeps
        self._t = int(self._model.layout.places.t)

    @property
    def example(self) -> np.ndarray:
        return self._first

    @property
    def row_shapes(self) -> dict[str, tuple[int, ...]]:
        return {**shapes_of(self._begun), **{name: (size,) for name, size in self._drifts.sizes.items()}}

    # Rows and states.

    def row(self, state: PyTree) -> np.ndarray:
        if isinstance(state, np.ndarray) and state.shape == self._first.shape:
            return state
        if not isinstance(state, State) or state.places != self._system.places:
            raise ArgumentError(f"A filter's `state` must be one of the system's states, but is {shown(state)}.")
        if state.from_velocities:
            state = self.method.begin(self._system, state.replace(inputs=self._begun.inputs), 1.0)
        state = state.replace(ledger=None, inputs=self._begun.inputs if state.inputs is None else state.inputs)
        if layout(state) != self._layout:
            raise ArgumentError("Argument `state` must hold the same fields as the start of the process.")
        return np.concatenate([pack(state)[1], self._drifts.first])

    def state(self, row: np.ndarray) -> State:
        """The state of a row (…, size): ξ and ν are those of its momenta, of ℓ or ℋ at the node."""
        rows = row.reshape(-1, row.shape[-1])
        found = self._velocities(np.zeros((len(rows), 0)), rows)[0].reshape(*row.shape[:-1], -1)
        d = self._system.group.dim
        return self._layout.unpack(row[..., : self._layout.size]).replace(xi=found[..., :d], nu=found[..., d:])

    truths = "a run of co.simulate, states with an axis of nodes, or "

    def rows_of(self, states: PyTree, times: np.ndarray, known: Mapping[str, PyTree] | None = None) -> np.ndarray:
        """Rows (K, size) of a run at `times`, or of states: the attitudes, places and velocities at the nodes with the
        momenta that they have in this model, and θ, which is `known` or that of the system of the motion."""
        found = states_at(states, times, self._system)
        if found is None:
            return super().rows_of(states, times, known)
        system = found.origin.system or self._system
        there = evaluate(jax.vmap(lambda state: at_node(system, state)), found)
        like = self._layout.unpack(np.repeat(self._first[None, : self._layout.size], len(times), axis=0))
        like = like.replace(t=there.t, g=there.g, n=there.n, a=there.a)
        theta = self._drifts.true(Constants(system.parameters, None), dict(known or {}), len(times))
        return self.with_velocities(np.concatenate([rows(like), theta], axis=1), there.xi, there.nu)

    @cached_property
    def _velocities(self) -> RowFunction:
        """(), x ↦ (ξ, ν)."""

        def velocities(_: Any, row: Array) -> Array:
            state = self.observed(row)[0]
            return jnp.concatenate([state.xi, state.nu])

        return RowFunction(velocities, np.zeros(0), self._first)

    def with_velocities(self, rows: np.ndarray, xi: Array, nu: Array) -> np.ndarray:
        """Rows (…, size) with the momenta that velocities have there by ℓ: xi (…, dim G) and nu (…, ambient).

        Raises ArgumentError for other shapes.
        """
        size, d, q = len(self._first), *self._sizes
        rows = np.asarray(rows, float)
        several = rows.shape[:-1]
        if [np.shape(part) for part in (rows, xi, nu)] != [(*several, size), (*several, d), (*several, q)]:
            raise ArgumentError(
                f"Rows are (…, {size}), and velocities of rows are xi (…, {d}) and nu (…, {q}), but the shapes are "
                f"{rows.shape}, {np.shape(xi)} and {np.shape(nu)}."
            )
        given = np.concatenate([rows, xi, nu], axis=-1).reshape(-1, size + d + q)
        return self._by_velocities(np.zeros((len(given), 0)), given)[0].reshape(rows.shape)

    @cached_property
    def _by_velocities(self) -> RowFunction:
        """(), (x, ξ, ν) ↦ x with their momenta."""
        size, d = len(self._first), self._system.group.dim
        state = self._begun

        def moving(_: Any, y: Array) -> Array:
            return self._moving(y[:size], y[size : size + d], y[size + d :])

        return RowFunction(moving, np.zeros(0), np.concatenate([self._first, state.xi, state.nu]))

    def _moving(self, row: Array, xi: Array, nu: Array) -> Array:
        """The row with the momenta of these velocities, traced."""
        state, theta = self._unpacked(row)
        system = replace_parameters(self._system, self._drifts.replaced(theta).system)
        mu, pi = legendre(system, xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        return jnp.concatenate([flattened(state.replace(mu=mu, pi=pi)), theta])

    def time(self, rows: np.ndarray) -> np.ndarray:
        return rows[..., self._t]

    def motion(self, row: Array) -> tuple[PyTree, ...]:
        state, p, biases = self.observed(row)
        return replace_parameters(self._system, p).motion_at(state, state.inputs), p, biases

    def observed(self, row: Array) -> tuple[PyTree, ...]:
        state, theta = self._unpacked(row)
        p = self._drifts.replaced(theta).system
        return at_node(replace_parameters(self._system, p), state), p, self._drifts.biases(theta)

    # Steps.

    def stepped(self, rows: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        size = self._layout.size
        found = self._steps(rows, np.full(len(rows), float(h)))
        if worst := int(np.max(found.code)):
            t, code = float(np.min(self.time(rows))), Code(worst).name.lower().replace("_", " ")
            raise StepError(f"The model has no step of {h:g} s from the estimate at t = {t:g} s: {code}.")
        theta = self._drifts.moved(rows[:, size:], h)
        return np.concatenate([found.after, theta], axis=1), found.course

    def _steps(self, rows: np.ndarray, h: np.ndarray, steps: int = 1) -> StepsTaken:
        """Steps of h (members,) of the model from rows (members, size), with the parameters θ in them."""
        size, places = self._layout.size, self._drifts.places
        p = np.repeat(self._model.p, len(rows), axis=0)
        p[:, places] = rows[:, size : size + len(places)]
        return self._model.step(rows[:, :size], h, steps, p=p)

    @property
    def parts(self) -> PartsOfSteps:
        return self._parts

    @cached_property
    def _parts(self) -> PartsOfSteps:
        course = course_of(self._layout, self._system.internal)

        def probe(rows: np.ndarray, h: np.ndarray, steps: int = 1, members: PyTree = None):
            found, theta = self._steps(rows, h, steps), rows[:, self._layout.size :]
            after = np.concatenate([found.after, theta], axis=1)
            return after, recorded(rows, after, course), found.code

        return PartsOfSteps(probe, ruler_of(self._layout, self._system.places), course, self.method.order)

    def native(self) -> Model | None:
        model, tangent, moving, carrying = self._model, self.tangent.native, self.moving.native, self.carrying.native
        shake, projector = self.shaking.native, None if self.projector is None else self.projector.native
        if tangent is None or moving is None or carrying is None or (self.constrained and projector is None):
            return None
        if shake is None or model.backend == "xla":
            return None
        kernel = model.kernel(1)
        return Model(
            len(self._first), model.size, np.array(self.substeps), self.unknowns, kernel.record.size, model.p[0],
            self._spread_places, kernel.function, kernel.row, self.between, tangent, self.densities, moving, carrying,
            self.commanded, self.width, model.assembly, projector, shake, self._drifts.count - len(self._drifts.places),
        )  # fmt: skip

    @property
    def _spread_places(self) -> np.ndarray:
        """The places of θ among the parameters of the step; biases follow them, where no step reads."""
        behind = np.full(self._drifts.count - len(self._drifts.places), self._model.p.shape[1])
        return np.concatenate([self._drifts.places, behind]).astype(int)

    @property
    def tangent(self) -> RowFunction:
        return self._tangent

    @cached_property
    def _tangent(self) -> RowFunction:
        x = np.zeros(self.unknowns + self.between + len(self.densities))
        lengths = np.ones(1 if len(self.substeps) == 1 else 4)
        return RowFunction(self._error_after, x, np.concatenate([self._first, self._first, lengths]))

    def _error_after(self, x: Array, y: Array) -> Array:
        """See `tangent`: the residual of a substep, and the error after it."""
        m, n, size = self.unknowns, self.width, len(self._first)
        row, after, lengths = y[:size], y[size : 2 * size], y[2 * size :]
        z, e, w = x[:m], x[m : m + n], x[m + self.between :]
        state, theta = self._unpacked(self.retract(row, e))
        constants = self._drifts.replaced(theta)
        if len(self.substeps) == 1:
            h = lengths[0]
            residual, there = self._program.substep(constants, self._program.prepare(constants, state, h), h, z)
            there = self.shaken(constants, there, w)
            later = self._drifts.moved(theta, h)
            error = self.differ(after, jnp.concatenate([flattened(there), later]))
            return jnp.concatenate([residual, error, later, self._drifts.variances(h)])
        length, h, first, last = lengths
        state = self._layout.views(flattened(state).at[self._held].add(x[m + n : m + self.between]))
        residual, there = self._program.substep(
            constants, self._program.prepare_if(constants, state, h, first), length, z
        )
        there = self.shaken(constants, there, last * w)
        later = jnp.where(last > 0.5, self._drifts.moved(theta, h), theta)
        numbers = flattened(there)
        error = self.differ(after, jnp.concatenate([numbers, later]))
        held = numbers[self._held] - after[self._held]
        return jnp.concatenate([residual, error, held, later, last * self._drifts.variances(h)])

    @property
    def between(self) -> int:
        return self.width + len(self._held)

    @cached_property
    def _held(self) -> np.ndarray:
        """The places of the inputs and the internal state over a step that depend on the error at its start, and with
        which it reaches the second substep and later ones."""

        def over_step(e: Array) -> list[PyTree]:
            state, theta = self._unpacked(self.retract(self._first, e))
            return parts(self._program.prepare(self._drifts.replaced(theta), state, 1.0))

        def parts(state: State) -> list[PyTree]:
            return jax.tree.leaves((state.inputs, state.internal, state.internal_mean, state.internal_end))

        if len(self.substeps) == 1:
            return np.zeros(0, int)
        used = used_by_each(over_step, np.zeros(self.width))
        places = parts(self._model.layout.places)
        moving = [np.ravel(place) for place, (by_error,) in zip(places, used, strict=True) if by_error]
        return np.concatenate([np.zeros(0), *moving]).astype(int)

    # The first covariance.

    def first_covariance(self, row: np.ndarray, deviations: Mapping[str, PyTree]) -> np.ndarray:
        group, Q, _ = self._system.places
        sizes = {"g": group.dim, "q": Q.ambient(group), "xi": group.dim, "nu": Q.ambient(group), **self._drifts.sizes}
        sizes = {name: size for name, size in sizes.items() if size}
        given = spread(deviations, sizes)
        J = evaluate(lambda row: jax.jacfwd(lambda v: self._from_velocities(row, v))(jnp.zeros(self.width)), row)
        root = J * given
        return root @ root.T

    def _from_velocities(self, row: Array, v: Array) -> Array:
        """e of errors (η, δq, δξ, δν, δθ) of a row, with velocities instead of momenta."""
        eta, dq, dxi, dnu, dtheta = self._split(v)
        still = jnp.zeros(len(dxi) + len(dnu))
        here = self.observed(row)[0]
        moved = self.retract(row, jnp.concatenate([eta, dq, still, dtheta]))
        return self.differ(row, self._moving(moved, here.xi + dxi, here.nu + dnu))
