"""A finished run, and an ensemble of runs: records, certificate, dataset and plots."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError
from coadjoint.labelled import Labelled
from coadjoint.mechanics.state import Origin, State
from coadjoint.simulation.certificate import certificate, failure
from coadjoint.simulation.certificate_forms import Certificate
from coadjoint.simulation.derived import at_nodes, derivation, known_at_nodes, one_at_node
from coadjoint.simulation.result import Result
from coadjoint.texts import Table

if TYPE_CHECKING:
    import xarray


ANGLES = "euler_angles"


class _Shown(Result):
    """A result with its certificate and its dataset."""

    @cached_property
    def _arrays(self) -> Labelled:
        from coadjoint.simulation.dataset import dataset

        return dataset(self)

    def summary(self) -> Table:
        """The certificate as plain numbers."""
        return certificate(self)

    @property
    def certificate(self) -> Certificate:
        """The certificate: `print` it for five lines, `print(run.certificate.long())` for all of them."""
        from coadjoint.simulation.certificate_text import certificate_of

        return certificate_of(self)

    @property
    def _hint(self) -> str:
        """The end of a short form."""
        unresolved = self.accuracy is not None and not self.accuracy.resolved
        return "unresolved: print it for the reason" if unresolved else "print it for the certificate"


class Run(_Shown):
    """The result of `co.simulate`; `print` it for the certificate.

    records: the saved states, with a leading axis of nodes in every leaf; ξ and ν are those of the step that starts at
    the node. final: the last of them, with ξ and ν at the node itself, as in the dataset. monitors: name →
    (nodes,) or (nodes, k). extrema: name → (minimum, maximum) of every monitored scalar over all steps, saved or not.
    accuracy: how well the steps that were judged resolve the motion. dataset: the same as an xarray.Dataset with names
    and units. plot: figures. `save(path)` writes the dataset, `at(times)` gives the motion between the nodes.
    """

    @property
    def dt(self) -> float:
        """The step size h, s."""
        return self.plan.h

    @property
    def steps(self) -> int:
        """The number of steps requested; `good_steps` were done."""
        return self.plan.steps

    @cached_property
    def events(self) -> dict[str, State]:
        """The states at the events, in order, by the names given in `events`, with a leading axis; ξ and ν are those of
        the node, at which the event is zero."""
        one = self.position.state
        return {name: self._at_nodes(stacked_records(states, one)) for name, states in self.crossed.items()}

    def at(self, times: object) -> State:
        """The states at times between the nodes (k,), s, with a leading axis and velocities as in the dataset.

        Steps of the method lead there from the saved node before: Φ_{θh} ∘ Φ_h ∘ … ∘ Φ_h, so that momenta are as
        exact as at the nodes and the order is the method's. Raises ArgumentError for times outside the run.
        """
        from coadjoint.simulation.dense import at_times

        return self._at_nodes(at_times(self.plan, self.records, times))

    @cached_property
    def records(self) -> State:
        """The saved states, every leaf with a leading axis."""
        return self._of_this(Result.records.func(self))

    def _at_nodes(self, records: State) -> State:
        return at_nodes(derivation(self.plan.program), self.system, self._of_this(records))

    def _of_this(self, records: State) -> State:
        """Records that know of which system's run they are."""
        return records.replace(origin=Origin(self.system))

    @cached_property
    def final(self) -> State:
        """The last record, with the velocities at the node in place of those of the step that starts there.

        A run that continues from it is bitwise identical to an undivided one: Newton's iteration begins with the
        unknowns of the step before, as there.
        """
        return one_at_node(derivation(self.plan.program), self.system, self.last_record, self._guess)

    @property
    def _guess(self) -> tuple[Array, Array]:
        """Newton's guess for the step that starts at the last record: the unknowns of the step before it."""
        last = self.position.state if self.position.complete else self.last_record
        return last.xi, last.nu

    @property
    def last_record(self) -> State:
        """The last record as a row of `records`."""
        return jax.tree.map(lambda rows: rows[-1], self.records)

    @property
    def newton_iterations_mean(self) -> float:
        """Newton iterations a step."""
        return self.position.iterations / max(self.good_steps, 1)

    def _last_record(self) -> dict[str, object]:
        from coadjoint.simulation.restart import written

        last = self.last_record
        if known_at_nodes(self.system, last):  # the velocities at the node are in the dataset
            last = last.replace(xi=self._guess[0], nu=self._guess[1])
        return written(last, self.system)

    def size(self, name: str) -> float:
        """|X₀| of a monitored X, to which its changes are relative; 0 if they are larger.

        Of an energy it is the largest kinetic energy, ½⟨μ, ξ⟩ + ½⟨π, ν⟩, where that is more than 20|E₀|.
        """
        return float(self.sizes(name))

    def relative_change(self, name: str) -> float:
        """max_k |X_k − X₀| / |X₀| over every step, for a monitored X; absolute where `size` is 0.

        The change of an energy is relative to the largest kinetic energy where that is more than 20|E₀|, so that it
        does not depend on the zero of the potential.
        """
        return float(self.relative_changes(name))

    def largest(self, name: str) -> float:
        """The largest value of a monitored scalar over every step."""
        self._require_monitored(name)
        return float(np.max(self.extrema[name][1]))

    def __repr__(self) -> str:
        return f"<Run of {self.title}: {self.good_steps} of {self.steps} steps; {self._hint}>"


class Ensemble(_Shown):
    """The result of `co.simulate` for many members; `print` it for the certificate.

    `records` have axes (member, node, …); members that failed are NaN from there on, and `steps_done` and `codes` give
    the step and the reason. `extrema` are (minimum, maximum) over every step, one row a member.
    """

    @property
    def steps_done(self) -> np.ndarray:
        """The number of good steps of each member, (members,)."""
        return self.position.steps_done

    @property
    def codes(self) -> np.ndarray:
        """How the last step of each member ended, (members,), 0 where it was good."""
        return self.position.codes

    @property
    def iterations(self) -> np.ndarray:
        """Newton's, over all good steps of each member, (members,)."""
        return self.position.iterations

    @property
    def failures(self) -> dict[int, str]:
        """How members failed, and at which step, by their index."""
        return {int(i): failure(self, int(i)) for i in np.flatnonzero(self.codes)}

    @property
    def final(self) -> State:
        """The records of all members at the last node, or at the event that ended them, with ξ and ν at the node."""
        last = jax.tree.map(np.array, self.last_record)
        for index, state in self.ended.items():
            jax.tree.map(lambda rows, leaf, index=index: rows.__setitem__(index, leaf), last, state)
        return at_nodes(derivation(self.plan.program), self.system, last, np.arange(len(self.codes)))

    @property
    def last_record(self) -> State:
        """The records of all members at the last node."""
        return jax.tree.map(lambda rows: rows[:, -1], self.records)

    @cached_property
    def events(self) -> dict[str, tuple[State, ...]]:
        """The states at the events, as those of a `Run`, by the names given in `events`: for each member a State."""
        one, derive = self.one[1], derivation(self.plan.program)

        def of(index: int, rows: list[State]) -> State:
            return at_nodes(derive, self.system, stacked_records(rows, one), np.full(len(rows), index))

        return {name: tuple(of(*row) for row in enumerate(found)) for name, found in self.crossed.items()}

    def statistics(
        self, variables: str | Sequence[str] | None = None, quantiles: Sequence[float] = (0.05, 0.5, 0.95)
    ) -> xarray.Dataset:
        """Mean, standard deviation, extremes and quantiles over the members, at every saved node.

            fleet.statistics(["q", "euler_angles"]).q.sel(statistic="95%")

        Arguments, labels and errors as in the function of this name; all variables by default.
        """

        return statistics(self.dataset, variables, quantiles)

    def __repr__(self) -> str:
        return f"<Ensemble of {self.title}: {len(self.failures)} failed; {self._hint}>"


def stacked_records(states: list[State], like: State) -> State:
    """Records as one State with a leading axis, of length 0 if there are none."""
    if not states:
        return jax.tree.map(lambda leaf: np.zeros((0, *np.shape(leaf))), like)
    return jax.tree.map(lambda *leaves: np.stack(leaves), *states)


def statistics(
    made: xarray.Dataset, variables: str | Sequence[str] | None = None, quantiles: Sequence[float] = (0.05, 0.5, 0.95)
) -> xarray.Dataset:
    """The variables of an ensemble's dataset with a dimension `statistic` in place of `member`.

    Its labels are "mean", "std" (with N − 1), "min", "max" and "5%", "50%", "95%" for quantiles 0.05, 0.5, 0.95.
    A member that fails does not count from there on; `members` is the number left at each node, and the statistics
    are NaN where no member is left. Euler angles are measured from the mean direction, so that headings near south
    are not split at ±π. Raises ArgumentError for a variable that the dataset does not have, and for numbers that are
    not quantiles.
    """
    import xarray

    if "member" not in made.dims:
        raise ArgumentError("Statistics are over the members of an ensemble, but this dataset has none.")
    names = _known(made, variables)
    wanted = _quantiles(quantiles)
    labels = ["mean", "std", "min", "max", *(f"{100 * q:.12g}%" for q in wanted)]
    mu = np.isfinite(made["mu"].transpose("member", "time", ...).values)
    left = mu.reshape(*mu.shape[:2], -1).all(axis=-1).sum(axis=0)
    found = {}
    for name in names:
        array = made[name].transpose("member", ...)
        values = _angles(array.values, wanted) if name == ANGLES else _rows(array.values, wanted)
        found[name] = (("statistic", *array.dims[1:]), values, array.attrs)
    coordinates = {str(key): value for key, value in made.coords.items() if "member" not in value.dims}
    return xarray.Dataset(found, coords={"statistic": labels, **coordinates}).assign_coords(members=("time", left))


def _known(made: xarray.Dataset, variables: str | Sequence[str] | None) -> list[str]:
    with_members = [str(name) for name, array in made.data_vars.items() if {"member", "time"} <= set(array.dims)]
    if variables is None:
        return with_members
    names = [variables] if isinstance(variables, str) else list(variables)
    checks.all_known(names, with_members, "variable", "The ensemble")
    return names


def _quantiles(given: Sequence[float]) -> list[float]:
    return [checks.number(q, "Each of `quantiles`", 0.0, 1.0) for q in given]


def _rows(values: np.ndarray, quantiles: list[float]) -> np.ndarray:
    """Statistics over the first axis, (statistic, …), without NaN values."""
    good = np.isfinite(values)
    count = good.sum(axis=0)
    if good.all() and len(values) > 1:
        rest = [values.mean(axis=0), values.std(axis=0, ddof=1), values.min(axis=0), values.max(axis=0)]
        return np.stack([*rest, *np.quantile(values, quantiles, axis=0)])
    some = count > 0
    filled = np.where(good | ~some, values, np.nan)
    mean = np.divide(np.where(good, values, 0.0).sum(axis=0), count, out=np.full(count.shape, np.nan), where=some)
    square = np.where(good, values - mean, 0.0) ** 2
    spread = np.divide(square.sum(axis=0), count - 1, out=np.full(count.shape, np.nan), where=count > 1)
    least = np.where(some, np.where(good, values, np.inf).min(axis=0), np.nan)
    most = np.where(some, np.where(good, values, -np.inf).max(axis=0), np.nan)
    inside = np.full((len(quantiles), *count.shape), np.nan)
    if some.any() and quantiles:
        inside[:, some] = np.nanquantile(filled[:, some], quantiles, axis=0)
    return np.stack([mean, np.sqrt(spread), least, most, *inside])


def _angles(values: np.ndarray, quantiles: list[float]) -> np.ndarray:
    """Statistics of angles, counted from their mean direction within half a turn of it."""
    good = np.isfinite(values)
    sine, cosine = (np.where(good, f(values), 0.0).sum(axis=0) for f in (np.sin, np.cos))
    middle = np.arctan2(sine, cosine)
    turned = values - middle
    found = _rows(np.arctan2(np.sin(turned), np.cos(turned)), quantiles)
    found[np.arange(len(found)) != 1] += middle
    return found
