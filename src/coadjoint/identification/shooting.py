"""Multiple shooting: a log in segments, each a run from a separate start, all simulated together.

The start of a segment is a reference, g₀ exp(δ_g), q₀ + δ_q, ξ₀ + δ_ξ, ν₀ + δ_ν, with momenta by the Legendre transform
with the current parameters, and with actuators in the states to which their commands have brought them (`actuators`).
Of a system with only a discrete Lagrangian the velocities are those of the first step, and the transform is discrete.
Derivatives of the simulated measurements, by δ and by the parameters, are exact, except through internal states that
the motion moves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.identification.actuators import Actuators, ActuatorsAtStarts
from coadjoint.identification.channels import Channels
from coadjoint.identification.process_noise import Knots
from coadjoint.identification.sampling import Interpolation, Samples, StepsBetween
from coadjoint.identification.unknowns import Unknowns
from coadjoint.kernels.packing import flattened, layout, pack, rows
from coadjoint.kernels.run import batch
from coadjoint.kernels.run.function import NativeFunction
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import momenta_of_step
from coadjoint.methods.program import Constants
from coadjoint.spaces.named import Named

KEPT = 16
"""The number of functions for starts of segments kept in memory."""

_starts: dict[Any, NativeFunction] = {}


class Reference(NamedTuple):
    """The references of the starts of segments, before δ; a leading axis of segments."""

    g: PyTree
    q: Array
    xi: Array
    nu: Array


class Prediction(NamedTuple):
    """The simulated measurements at the samples, (segments, samples, numbers), with their trajectory.

    `interpolation`: their places, with delays; None at the times of the samples. `wandering`: piecewise parameters.
    `standing`: the states of actuators at the starts.
    """

    values: np.ndarray
    path: batch.Path
    slopes_of_start: np.ndarray
    interpolation: Interpolation | None
    wandering: batch.PiecewiseParameters | None = None
    standing: ActuatorsAtStarts | None = None


@dataclass(frozen=True)
class Shooting:
    """Segments of a log as runs. `template`: the state of one of them, for quantities that the log lacks."""

    unknowns: Unknowns
    channels: Channels
    samples: Samples
    reference: Reference
    template: State
    program: Any
    begun: Mapping[str, np.ndarray] = field(default_factory=dict)
    """States of actuators at the first sample of each segment, (segments, …), as far as they are logged."""
    knots: Knots | None = None
    """What wanders."""
    steps: StepsBetween | None = None
    """From the first start to the last, where there is an internal state and more than one segment."""

    @property
    def size(self) -> int:
        """The number of coordinates δ."""
        return 2 * self.unknowns.system.unknowns

    @property
    def runs(self) -> int:
        return len(self.samples.starts)

    @property
    def own(self) -> int:
        """The number of unknowns of each segment: δ and the knots of process noise."""
        return self.size + (self.knots.size if self.knots else 0)

    @cached_property
    def active(self) -> tuple[int, ...]:
        """The parameters that change, in order."""
        wandering = self.knots.places.tolist() if self.knots else []
        return tuple(sorted({*self.unknowns.active, *wandering}))

    @cached_property
    def code(self) -> batch.Driven:
        constants = Constants(self.unknowns.system.parameters, None)
        return batch.driven(self.program, constants, self.template, self.active)

    @cached_property
    def places(self) -> np.ndarray:
        """The places of the inputs among the numbers of a state."""
        inputs = jax.tree.leaves(layout(self.template).places.inputs)
        return np.concatenate([np.zeros(0, int), *(np.ravel(leaf).astype(int) for leaf in inputs)])

    @cached_property
    def table(self) -> np.ndarray:
        """The inputs of every step, in groups of lanes."""
        return batch.grouped(self.samples.table)

    @cached_property
    def held(self) -> PyTree:
        """The internal state with which all segments start until a better one is known."""
        begun = self.template.internal
        return self._after_gaps(
            jax.tree.map(lambda leaf: np.repeat(np.asarray(leaf, float)[None], self.runs, axis=0), begun)
        )

    def _after_gaps(self, internal: PyTree) -> PyTree:
        """Internal states with actuators as logged, in the segments after a gap."""
        after = self.samples.after_gap
        if not isinstance(internal, Named) or not after.any():
            return internal
        changed = {}
        for name, values in self.begun.items():
            if name in internal and not isinstance(there := getattr(internal, name), Named):
                found = np.array(there)
                found[after] = values.reshape(found.shape)[after]
                changed[name] = found
        return internal.replace(**changed)

    @cached_property
    def actuators(self) -> Actuators | None:
        """The part of the internal state that only the inputs drive; None if there is none."""
        if self.steps is None:
            return None
        begun = self.template.internal
        logged = {name for name in self.begun if isinstance(begun, Named) and name in begun}
        logged = {name for name in logged if not isinstance(getattr(begun, name), Named)}
        paths = [path[0] for path, _ in jax.tree_util.tree_leaves_with_path(begun)]
        found = Actuators(
            key=(self.program, layout(self.template)),
            system=self.unknowns.system,
            template=self.template,
            active=self.active,
            steps=self.steps,
            held=self.held,
            logged=tuple(getattr(path, "name", None) in logged for path in paths),
            after_gap=self.samples.after_gap,
        )
        return found if found.leaves else None

    @cached_property
    def handed(self) -> tuple[str, ...]:
        """Parts of the internal state that depend on the motion: a segment passes them to the next."""
        begun = self.template.internal
        if self.runs == 1 or begun is None:
            return ()
        paths = [jax.tree_util.keystr(path[:1]).lstrip(".") for path, _ in jax.tree_util.tree_leaves_with_path(begun)]
        driven_alone = self.actuators.leaves if self.actuators else ()
        return tuple(dict.fromkeys(path for i, path in enumerate(paths) if i not in driven_alone))

    @cached_property
    def inner(self) -> tuple[int, ...]:
        """The numbers of the internal state at starts that depend on estimated parameters."""
        return tuple(self.actuators.places.tolist()) if self.actuators and self.actuators.moving else ()

    @cached_property
    def begin(self) -> NativeFunction:
        """(δ, active parameters, `inner`), the data of a segment ↦ the numbers of the state at its start."""
        one = jax.tree.map(lambda leaf: leaf[0], self._known(self.held))
        step = None if self.unknowns.system.continuous else self.samples.h
        key = self.program, layout(self.template), layout(one), self.active, self.inner, step
        if key not in _starts:
            x = np.zeros(self.size + len(self.active) + len(self.inner))
            _starts[key] = NativeFunction(self._starting(one), x, pack(one)[1])
            while len(_starts) > KEPT:
                _starts.pop(next(iter(_starts)))
        return _starts[key]

    def _known(self, internal: PyTree) -> tuple[object, ...]:
        """Of every segment: reference, time, internal state, parameters and a₀ where they start."""
        return (self.reference, self.samples.starts, internal, *self._same)

    @cached_property
    def _same(self) -> list[np.ndarray]:
        group, _, V = self.unknowns.system.places
        a0 = evaluate(lambda s: V.act(group, s.g, s.a), self.template)
        return [np.repeat(np.asarray(leaf, float)[None], self.runs, axis=0) for leaf in (self.unknowns.numbers, a0)]

    def _starting(self, like: Any) -> PyTree:
        system, template, size = replace_parameters(self.unknowns.system, None), self.template, self.size
        group, Q, V = system.places
        structure, shape = layout(like), layout(self.unknowns.system.parameters)
        active, inner, within = self.active, self.inner, layout(like[2])
        ends = np.cumsum([group.dim, Q.dim(group), group.dim])

        def start(x, known):
            at, t, internal, numbers, a0 = structure.views(known)
            for i, place in enumerate(active):
                numbers = numbers.at[place].set(x[size + i])
            if inner:
                numbers_in = flattened(internal)
                for i, place in enumerate(inner, size + len(active)):
                    numbers_in = numbers_in.at[place].set(x[i])
                internal = within.views(numbers_in)
            turn, shift, spin, speed = jnp.split(x[:size], ends)
            g = group.compose(at.g, group.exp(turn))
            back = group.inverse(g)
            q = at.q + Q.difference(group, at.q, Q.tangent(group, at.q, shift)) if len(shift) else at.q
            n, a, xi = Q.act(group, back, q), V.act(group, back, a0), at.xi + spin
            nu = at.nu + Q.tangent(group, n, speed) if len(speed) else at.nu
            here = replace_parameters(system, shape.views(numbers))
            state = template.replace(t=t, g=g, n=n, a=a, xi=xi, nu=nu, internal=internal)
            mu, pi = self._momenta(here, state)
            state = state.replace(mu=mu, pi=pi)
            return flattened(state)

        return start

    def _momenta(self, system: System, state: State) -> tuple[Array, Array]:
        """(μ, π) of the velocities at a start, with the parameters of the system."""
        if not system.continuous:
            step, fraction = self.program.method.recorded
            return momenta_of_step(system, state, step, fraction, self.samples.h)
        return legendre(system, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)

    def predict(
        self, coordinates: np.ndarray, own: np.ndarray, internal: PyTree = None, delays: np.ndarray | None = None
    ) -> Prediction | None:
        """The simulated measurements, each number of the record `delays` s late; None if a step fails.

        own: (segments, own), δ and knots.
        """
        numbers, delta = self.unknowns.filled(coordinates), own[:, : self.size]
        active = np.repeat(numbers[None, list(self.active)], self.runs, axis=0)
        wandering = self._wandering(own[:, self.size :])
        if wandering is not None:
            active[:, [self.active.index(place) for place in wandering.places]] += wandering.values[:, 0]
        standing, internal = self._standing(numbers, self.held if internal is None else internal)
        x = [delta, active, *([standing.values] if standing and self.inner else [])]
        starts, slopes = self.begin(np.concatenate(x, axis=1), rows(self._known(internal)))
        if not np.all(np.isfinite(starts)):
            return None
        path = batch.run(self.code, numbers, self.samples.h, starts, self.places, self.table, wandering)
        if np.any(path.codes) or not np.all(np.isfinite(path.records)):
            return None
        records = self.samples.unwrapped(path.records)
        if delays is None:
            return Prediction(self.samples.weighed(records), path, slopes, None, wandering, standing)
        interpolation = self.samples.interpolation(delays, records.shape[1])
        values = self.samples.read(records, interpolation.nodes, interpolation.weights)
        return Prediction(values, path, slopes, interpolation, wandering, standing)

    def _standing(self, numbers: np.ndarray, internal: PyTree) -> tuple[ActuatorsAtStarts | None, Any]:
        """The states of actuators at the starts, and the internal states there."""
        if self.actuators is None:
            return None, internal
        found, numbers_within = self.actuators.at_starts(numbers), rows(internal)
        numbers_within[:, self.actuators.places] = found.values
        return found, layout(self.template.internal).views(numbers_within)

    def _wandering(self, x: np.ndarray) -> batch.PiecewiseParameters | None:
        """The numbers of parameters that x, (segments, knots · components), moves."""
        if self.knots is None:
            return None
        steps = max(1, round(self.knots.spacing / self.samples.h))
        values = x.reshape(self.runs, self.knots.count, -1)[..., self.knots.component]
        return batch.PiecewiseParameters(self.knots.places, len(self.knots.labels), steps, values)

    def speeds(self, found: Prediction) -> np.ndarray:
        """d/dt of the simulated measurements, (segments, samples, numbers)."""
        assert found.interpolation is not None
        records = self.samples.unwrapped(found.path.records)
        return self.samples.read(records, found.interpolation.nodes, found.interpolation.slopes)

    def slopes(self, coordinates: np.ndarray, found: Prediction) -> np.ndarray:
        """∂values/∂(δ, knots, coordinates): (segments, samples, columns, channels)."""
        numbers = self.unknowns.filled(coordinates)
        along = self.unknowns.directions(coordinates, self.active)
        if self.knots is not None:
            along = np.concatenate([along, self._directions(self.knots)])
        p_dot = np.concatenate([np.zeros((self.size, along.shape[1])), along])
        ends = np.cumsum([self.size, len(self.active)])
        by_delta, by_active, by_inner = np.split(found.slopes_of_start, ends, axis=2)
        if self.inner and found.standing:
            by_active = by_active + by_inner @ found.standing.slopes
        start_dot = np.concatenate([by_delta, by_active @ along.T], axis=2).swapaxes(1, 2)
        start_dot = np.ascontiguousarray(start_dot)
        dot = batch.push(self.code, numbers, self.samples.h, found.path, p_dot, start_dot, found.wandering)
        if self.knots is not None:
            first = self.size + len(self.unknowns.each)
            dot = np.concatenate([dot[:, :, : self.size], dot[:, :, first:], dot[:, :, self.size : first]], axis=2)
        if found.interpolation is None:
            return self.samples.weighed(dot)
        return self.samples.read(dot, found.interpolation.nodes, found.interpolation.weights)

    def _directions(self, knots: Knots) -> np.ndarray:
        """dp/dx of the first knot; 0 of the others, (knots · components, active)."""
        found = np.zeros((knots.size, len(self.active)))
        for place, component in zip(knots.places, knots.component, strict=True):
            found[component, self.active.index(place)] = 1.0
        return found

    def internal(self, found: Prediction) -> PyTree:
        """The internal state from which each segment starts: that at the end of the previous segment, and after a gap
        the logged states of actuators."""
        first = self.held
        if self.template.internal is None:
            return first
        shape = layout(self.template)
        last = found.path.states[np.arange(self.runs - 1), self.samples.nodes_to_next]
        came = shape.unpack(last)
        pairs = zip(jax.tree.leaves(first), jax.tree.leaves(came.internal), strict=True)
        leaves = [np.concatenate([start[:1], later.reshape(-1, *start.shape[1:])]) for start, later in pairs]
        return self._after_gaps(jax.tree.unflatten(jax.tree.structure(first), leaves))


def require_inputs(system: Any, state: State) -> None:
    """Raise ArgumentError where forces, ℓ or the internal rule ask for an input that the log does not hold."""

    def forces(state: State) -> Any:
        motion = system.motion(state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)
        return system.body_force(motion)

    try:
        evaluate(forces, state)
    except AttributeError as error:
        raise ArgumentError(f"The system takes an input that the log does not hold: {error}") from error
