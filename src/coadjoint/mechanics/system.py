"""A mechanical system with symmetry: a group, the spaces it acts on, and a reduced Lagrangian or Hamiltonian."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import jax

from coadjoint import checks
from coadjoint.arrays import Coordinates, PyTree, Scalar
from coadjoint.checks import known_arguments
from coadjoint.errors import ArgumentError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element, require_group
from coadjoint.interrupts import deferred_interrupts
from coadjoint.mechanics.check import check
from coadjoint.mechanics.constraints import Bound, Constraint
from coadjoint.mechanics.copies import replace_parameters, replaced
from coadjoint.mechanics.coupling import require_room
from coadjoint.mechanics.declared_constraints import bound, constraints_from
from coadjoint.mechanics.forces import Forces, forces_from
from coadjoint.mechanics.inputs import Given, Inputs, inputs_from
from coadjoint.mechanics.integrability import warnings_of_rows
from coadjoint.mechanics.invariance import Invariance, in_words, is_right, places_of
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.projection import projected
from coadjoint.mechanics.quantities import Quantities, quantities_from
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.start import starting_state
from coadjoint.mechanics.state import Force, State
from coadjoint.mechanics.system_arguments import parameters_from, require_functions, require_plain, space_from
from coadjoint.overview import NumberRow, Overview, WithOverview, listed
from coadjoint.paths import paths
from coadjoint.portable import Portable
from coadjoint.spaces import Space
from coadjoint.spaces.axioms import require_own_forms
from coadjoint.spaces.links import on_links


@dataclass(frozen=True, init=False, repr=False)
class System(ReducedFunctions, Portable, WithOverview):
    """ℓ(ξ, n, ν, a) on 𝔤 × TQ × V* with its group, spaces and parameters (P17).

        def lagrangian(xi, a, p):  # a heavy top
            return 0.5 * xi @ p.inertia @ xi - p.weight * p.center @ a

        top = co.System(co.SO3(), lagrangian, advected=co.Defining(), parameters=dict(inertia=…, weight=…, center=…))

    ξ = g⁻¹ġ is the body velocity, (dim G,); n = g⁻¹q and ν = g⁻¹q̇ are the additional dynamics in the body frame;
    a = g⁻¹a₀ are advected parameters. All functions return or take float64 in terms of jax.numpy; units are the user's,
    as long as they are one system; the models and vehicles use SI.

    Arguments:
        group: G, a Lie group such as `co.SE3()`.
        lagrangian: ℓ, a function of xi [, n, nu] [, a] [, p] that returns a number: n, ν come with `additional`, a with
            `advected`, p with `parameters`; it may take keyword-only `t`, `inputs` and `internal`, the mean of the
            internal state over the step.
        additional: the space of q, by default none, or a dictionary of spaces that reach ℓ as `n.name`, `nu.name`.
        advected: the space V* of a, by default none, or a dictionary of spaces that reach ℓ as `a.name`.
        parameters: p, `co.Parameters(…)` or a dictionary, by default none: the leaves that one replaces, varies over
            members and differentiates by.
        forces: a function (motion [, p]) → `co.Force(torque, force)`, body frame, (dim G,) and (dim Q,), or a
            dictionary of them under names: they add up, and the energy budget of a run has a line for each. By default
            none.
        discrete_lagrangian: Λ(ξ, n, s, a, p, h) with s = g_k⁻¹q_{k+1}, instead of ℓ or in addition to it (the papers'
            h·ℓᵈ); integrated by `co.Variational`.
        group_lagrangian: the discrete Lagrangian in group form, Λ(F, n, s, a, p, h) of the increment F = g_k⁻¹g_{k+1};
            integrated by `co.methods.GroupVariational`.
        hamiltonian: ℋ(μ, n, π, a, p) instead of ℓ, a function of mu [, n, pi] [, a] [, p]; ℓ is its Legendre transform,
            for which ∂²ℋ/∂(μ, π)² must be invertible (P6–P9). A π on a curved Q is projected onto T*_nQ.
        quantities: name → function (state) or (state, p) to a number that runs observe at every step.
        internal: the rule (motion, h [, p]) → the internal state after h, a dictionary like the start's, applied at
            each node for the step of h from there; `co.mechanics.Course` gives the mean of a part of it over the step,
            and `co.mechanics.jumped` makes it jump at the node. Forces read that mean as `motion.internal.name`, ℓ, ℋ
            or Λ as `internal.name`; μ and π are continuous at the nodes. A `co.mechanics.InternalRule` declares
            warnings, datasets and random numbers as well.
        name: for certificates, files and figures, by default the name of the function.
        units: units of dataset variables, as in {"q": "m", "energy": "J"}, and of parameters by their names, as in
            {"hull.length": "m"}; by default none.
        verify: whether what user-defined groups, spaces and difference maps override is compared with its derivation;
            by default True.
        checks: parameters that replace others, by name → the same as they are kept, or ArgumentError; by default every
            finite number may replace one.
        invariance: "left" (the default), or "right": ξ = ġg⁻¹, n = gq, ν = gq̇ and a = ga₀ are in the space frame, and
            the conserved momentum is in the body frame. μ and π, forces and F = g_{k+1}g_k⁻¹ go with them, and
            `system.group` is `co.groups.Opposite(group)`, on which all equations are those of left invariance.
        constraints: name → `co.Holonomic(function)` or `co.Nonholonomic(rows)`, by default none: what the place or the
            velocities satisfy at every node, held by reactions.

    Raises ArgumentError, LagrangianError or GroupError for functions and spaces that do not fit.
    """

    group: LieGroup
    lagrangian: Callable[..., PyTree] | None
    additional: Space
    advected: Space
    forces: Forces | None
    discrete_lagrangian: Callable[..., PyTree] | None
    group_lagrangian: Callable[..., PyTree] | None
    hamiltonian: Callable[..., PyTree] | None
    quantities: Quantities
    internal: Callable[..., PyTree] | None
    name: str
    units: tuple[tuple[str, str], ...]
    inputs: Inputs | None
    constraints: tuple[Bound, ...]
    verify: bool
    parameters: Parameters | None
    checks: Callable[[Mapping[str, PyTree]], Mapping[str, PyTree]] | None = field(compare=False)

    @known_arguments("co.System")
    @deferred_interrupts()
    def __init__(
        self,
        group: LieGroup,
        lagrangian: Callable[..., PyTree] | None = None,
        *,
        additional: Space | Mapping[str, Space] | None = None,
        advected: Space | Mapping[str, Space] | None = None,
        parameters: Parameters | Mapping[str, PyTree] | None = None,
        forces: Callable[..., Force] | Mapping[str, Callable[..., Force]] | Forces | None = None,
        discrete_lagrangian: Callable[..., PyTree] | None = None,
        group_lagrangian: Callable[..., PyTree] | None = None,
        hamiltonian: Callable[..., PyTree] | None = None,
        quantities: Mapping[str, Callable[..., PyTree]] | None = None,
        internal: Callable[..., PyTree] | None = None,
        name: str = "",
        units: Mapping[str, str] | None = None,
        verify: bool = True,
        checks: Callable[[Mapping[str, PyTree]], Mapping[str, PyTree]] | None = None,
        invariance: Invariance = "left",
        constraints: Mapping[str, Constraint] | None = None,
    ):
        require_group(group, "group")
        parameters = parameters_from(parameters)
        require_plain(name, units, verify)
        given = [f for f in (lagrangian, hamiltonian, discrete_lagrangian, group_lagrangian) if f is not None]
        values: dict[str, PyTree] = {
            "group": group,
            "lagrangian": lagrangian,
            "additional": on_links(group, space_from(additional, "additional")),
            "advected": on_links(group, space_from(advected, "advected")),
            "forces": forces_from(forces, parameters is not None),
            "discrete_lagrangian": discrete_lagrangian,
            "group_lagrangian": group_lagrangian,
            "hamiltonian": hamiltonian,
            "quantities": quantities_from(quantities),
            "internal": internal,
            "name": name or getattr(given[0] if given else None, "__name__", "system"),
            "units": tuple(dict(units or {}).items()),
            "inputs": None,
            "constraints": (),
            "verify": verify,
            "parameters": parameters,
            "checks": checks,
        }
        spaces = values["additional"], values["advected"]
        if hamiltonian is None:
            require_room(group)
        if verify:
            require_own_forms(group, *spaces)
        for space in spaces:
            space.require_fit(group)
        values |= places_of(group, *spaces, invariance)._asdict()
        for key, value in values.items():
            object.__setattr__(self, key, value)
        require_functions(self)
        object.__setattr__(self, "constraints", bound(self, constraints_from(constraints)))

    def _overview(self) -> Overview:
        functions = ("lagrangian", "hamiltonian", "discrete_lagrangian", "group_lagrangian")
        units = dict(self.units)
        facts = {
            "on": in_words(self.places),
            "of": listed(name.replace("_", " ") for name in functions if getattr(self, name) is not None),
            **{
                name: repr(space)
                for name in ("additional", "advected")
                if (space := getattr(self, name)).dim(self.group)
            },
            "with forces": listed(name for name, _ in self.forces or ()),
            "constraints": listed(one.name for one in self.constraints),
            "an internal state": "" if self.internal is None else getattr(self.internal, "__name__", "by a rule"),
            "watching": listed(name for name, _ in self.quantities),
        }
        given = {} if self.parameters is None else paths(self.parameters)
        numbers = tuple(NumberRow(name, value, units.get(name, "")) for name, value in given.items())
        return Overview(f"System {self.name}", facts, numbers)

    @property
    def invariance(self) -> Invariance:
        """ "left", or "right" of a right-invariant system, whose `group` is the opposite of the group it was given."""
        return "right" if is_right(self.places) else "left"

    def replace(self, **values: object) -> System:
        """A copy with some parameters replaced: `vehicle.replace(mass=130.0, rudder={"area": 0.02})`.

        `with_forces`, `with_constraints` and `watching` add functions. Raises ArgumentError for unknown parameters,
        and, of models and vehicles, for values that they reject when they are made, such as a mass of −15 kg.
        """
        if self.parameters is None:
            raise ArgumentError("This system has no parameters to replace.")
        made = self.parameters.replace(**values)
        if self.checks is not None:
            made = made.replace(**self.checks({name: getattr(made, name) for name in values}))
        return replace_parameters(self, made)

    def driven(self, inputs: Given | Inputs | None) -> System:
        """A copy driven by the `inputs` of a run, as co.simulate takes them."""
        return replaced(self, inputs=inputs_from(inputs))

    def with_forces(self, forces: Callable[..., Force] | Mapping[str, Callable[..., Force]]) -> System:
        """A copy with more forces: `body.with_forces({"drag": drag})`; those of a name that it has are replaced.

        forces: as `co.System` takes them; `unforced` leaves out those that are there. Raises LagrangianError and
        ArgumentError for others.
        """
        has = self.parameters is not None
        more = forces_from(forces, has)
        made = replaced(self, forces=None if more is None else forces_from(dict((*(self.forces or ()), *more)), has))
        bound(made, tuple((one.name, one.constraint) for one in self.constraints))
        return made

    def with_constraints(self, constraints: Mapping[str, Constraint]) -> System:
        """A copy with more constraints: `body.with_constraints({"pin": co.Holonomic(hold)})`; those of a name that it
        has are replaced.

        constraints: as `co.System` takes them. Raises LagrangianError and ArgumentError for others.
        """
        held = {one.name: one.constraint for one in self.constraints}
        return replaced(
            self, constraints=bound(self, constraints_from({**held, **dict(constraints_from(constraints))}))
        )

    @property
    def unforced(self) -> System:
        """A copy without its forces."""
        return replaced(self, forces=None)

    def watching(self, quantities: Mapping[str, Callable[..., PyTree]]) -> System:
        """A copy whose runs observe more quantities: `co.simulate(top.watching(co.mechanics.casimirs(top)), …)`."""
        return replaced(self, quantities=quantities_from(dict((*self.quantities, *quantities_from(quantities)))))

    @known_arguments("System.state")
    @deferred_interrupts()
    def state(
        self,
        *,
        g: Element | None = None,
        q: Coordinates | None = None,
        xi: Coordinates | None = None,
        qdot: Coordinates | None = None,
        mu: Coordinates | None = None,
        pi: Coordinates | None = None,
        a0: Coordinates | None = None,
        t: Scalar = 0.0,
        inputs: PyTree = None,
        internal: PyTree = None,
    ) -> State:
        """The state at configuration (g, q) with body velocity ξ, space-frame velocity q̇ and advected a₀.

            start = top.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0, 0, 20], a0=[0, 0, 1])

        n = g⁻¹q, ν = g⁻¹q̇, a = g⁻¹a₀ (P17); (μ, π) = (∂ℓ/∂ξ, ∂ℓ/∂ν), the continuous Legendre transform.

        Arguments:
            g: an element of G in the group's own form, by default e.
            q, qdot: a point of the additional space and its velocity in the space frame, (dim,), or dictionaries by the
                names of the spaces; needed where the system has `additional`, q̇ by default 0.
            xi: the body velocity, (dim G,), by default 0.
            mu, pi: the momenta μ, (dim G,), and π, (dim,), in the body frame, instead of ξ and q̇, each by default 0;
                a run starts from exactly these, otherwise from those of ξ and q̇ with `inputs` and `internal`.
            a0: advected parameters in the space frame, (dim V*,), or a dictionary; needed with `advected`.
            t: the time, s, by default 0.
            inputs: a dictionary of numbers or arrays, held; by default none.
            internal: the internal state, a dictionary; needed where the system has a rule `internal`.

        Any of g, q, xi, qdot, mu, pi, a0, t and the values of `internal` may be `co.each(values)`, for an ensemble.
        Raises ArgumentError for wrong shapes, for values that are not finite, for g outside G, for velocities together
        with momenta, and for velocities that belong to several momenta of ℋ.
        """
        if (mu is None and pi is None) or not (xi is None and qdot is None):
            if mu is not None or pi is not None:
                raise ArgumentError(
                    "A state is given by velocities `xi` and `qdot` or by momenta `mu` and `pi`, not both."
                )
            return starting_state(self, g, q, xi, qdot, a0, t, inputs, internal)
        return starting_state(self, g, q, mu, pi, a0, t, inputs, internal, by_momenta=True)

    def check(self, start: State, regular: bool = True) -> list[str]:
        """Raise where ℓ cannot be integrated from `start`; return warnings, one sentence each.

        regular: whether the method needs an invertible Legendre transform.
        """
        return check(self, start, regular) + warnings_of_rows(self, start)

    def project(self, state: State) -> State:
        """A state on all constraints close to one near them: the nearest in the kinetic metric up to O(distance²).

        Newton's iteration moves (g, q) by the least motion (η, w) in ⟨(η, w), M(η, w)⟩ with φ + Dφ·(η, w) = 0, and the
        momenta get the impulse Aᵀλ after which A·(ξ, ν) = b. Arguments: state: of this system, at one time. Raises
        ArgumentError without constraints, and if no such state is found; in traces `co.trajectory` gives a code.
        """
        if not self.constraints:
            raise ArgumentError("This system has no constraints to project a state onto.")
        checks.expect(
            isinstance(state, State) and state.places == self.places, state, "state", f"a state of `{self.name}`"
        )
        return projected(self, state)


# Rebuilt without being checked again; the static part is the skeleton.
jax.tree_util.register_pytree_node(
    System,
    lambda system: ((system.parameters,), replace_parameters(system, None)),
    lambda skeleton, leaves: replace_parameters(skeleton, *leaves),
)
