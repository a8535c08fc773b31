"""Whether the code of the first, an inner and the last link of a short chain is that of all links of a long one."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple, cast

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.emit.link_plan import LinkPlan
from coadjoint.kernels.emit.link_symbols import unknowns_of
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.operations import BINARY, UNARY
from coadjoint.kernels.packing import layout, pack
from coadjoint.kernels.program import JointedStage, LinkedStage
from coadjoint.kernels.trace.evaluate import Tabulated, tabulate
from coadjoint.kernels.untraceable import NotLinked

APART = 1e-9
"""The largest difference of a number, relative to the largest of its kind: round-off."""

LENGTH = 0.1
"""h of the comparison, by less where velocities are large: links that turn by π lose digits."""


Pair = tuple[np.ndarray, np.ndarray]


class Draw(NamedTuple):
    """How far a comparison is from the given start.

    size: of random changes of the state and its inputs. later: the largest time that passes, s. varied: whether
    parameters have other values. As kernels serve other parameters, and a force on one link may set in late or above
    some speed, the given start alone does not tell whether links are alike.
    """

    size: float
    later: float
    varied: bool


DRAWS = (Draw(0.1, 0.0, False), Draw(1.0, 10.0, True), Draw(20.0, 1e3, True))
"""The comparisons; in all but the first, numbers that are not finite on both sides count as equal."""


def require_links(plan: LinkPlan, stage: LinkedStage, parameters: PyTree, state: PyTree) -> None:
    """Raise NotLinked unless the expressions of links have the values of the stage at random states."""
    random, functions = np.random.default_rng(1788), dict[str, Tabulated]()
    for i, draw in enumerate(DRAWS):
        there = stage.nearby(state, random, draw.size, draw.later * random.uniform(0.5, 1.0))
        numbers = _varied(parameters, random) if draw.varied else parameters
        with np.errstate(all="ignore"):
            apart = _Check(plan, stage, numbers, there, draw.size, functions).differences(strict=i == 0)
        wrong = max(apart, key=lambda name: apart[name])
        if not apart[wrong] <= APART:
            raise NotLinked(f"its links are not all alike, {wrong} differs by {apart[wrong]:.1g} of its size")


def _varied(parameters: PyTree, random: np.random.Generator) -> PyTree:
    """Other values of parameters, of the order of 1 where they are small; zeros and ones, which code contains, stay."""

    def one(leaf: Any) -> np.ndarray:
        x = np.asarray(leaf)
        if x.dtype.kind != "f":
            return x
        size = np.where(np.abs(x) < 1e-3, 1.0, np.abs(x)) * random.uniform(0.5, 1.5, x.shape)
        return np.where((x == 0.0) | (x == 1.0), x, np.sign(x) * size)

    return jax.tree.map(one, parameters)


class _Check:
    """Both sides of the comparison at one state; functions: those of the stage that are traced, by their names."""

    def __init__(
        self, plan: LinkPlan, stage: LinkedStage, parameters: PyTree, state: PyTree, size: float,
        functions: dict[str, Tabulated],
    ) -> None:  # fmt: skip
        self.functions = functions
        self.plan, self.stage, self.parameters, self.size = plan, stage, parameters, size
        random, self.h = np.random.default_rng(1834), np.float64(LENGTH / max(1.0, size))
        self.unknowns = unknowns_of(stage)
        self.z = max(1.0, size) * random.normal(size=self.unknowns.size)
        self.multipliers = self.unknowns[:, plan.base :] - (sum(stage.blocks[:-1]) if plan.jointed else 0)
        self.impulse = random.normal(size=self.multipliers.size)
        p = pack(parameters)[1]
        self.arrays = {
            "p": plan.parameters.of(p),
            "z": self.z[self.unknowns],
            "d": self.impulse[self.multipliers],
        }
        self.shared = {"p": p[plan.parameters.shared]}
        self._begin(state)

    def _begin(self, state: PyTree) -> None:
        """Compare from another state."""
        self.state, self.arrays["s"] = state, self._numbers(state)
        self.shared["s"] = pack(state)[1][self.plan.state.shared]

    def _numbers(self, state: PyTree) -> np.ndarray:
        return self.plan.state.of(pack(state)[1])

    def _of_stage(self, name: str, *args: object) -> PyTree:
        """A function of the stage at these values, traced once for all comparisons."""
        if name not in self.functions:
            self.functions[name] = tabulate(getattr(self.stage, name), *args)
        return self.functions[name](*args)

    def differences(self, strict: bool) -> dict[str, float]:
        """The largest relative difference of each function; strict: infinite where numbers are not finite."""
        p, stage, h = self.parameters, self.stage, self.h
        prepared, renewed = self._values("prepared"), self._of_stage("prepare", p, self.state, h)
        guess = self._after(renewed, "guess"), self._of_stage("guess", p, renewed, h)[self.unknowns]
        # From here on with inputs that do not vanish.
        self._begin(stage.nearby(renewed, np.random.default_rng(1889), self.size, 0.0))
        chart = float(self._of_stage("chart", p, self.state, h, self.z))
        residual = self._of_stage("residual", p, self.state, h, self.z)[self.unknowns]
        record = self._numbers(self._of_stage("record", p, self.state, h, self.z))
        pairs = {
            "an input": (prepared, self._numbers(renewed)),
            "the guess": guess,
            "the residual": (self._values("residual"), residual),
            **(self._jointed(cast(JointedStage, stage)) if self.plan.jointed else self._advanced(stage)),
            "the record": (self._values("record"), record),
            "the chart": (np.max(self._values("chart"), axis=0)[None], np.array([[chart]])),
        }
        return {name: _apart(one, other, strict) for name, (one, other) in pairs.items()}

    def _after(self, state: PyTree, name: str) -> np.ndarray:
        self._begin(state)
        return self._values(name)

    def _advanced(self, stage: LinkedStage) -> dict[str, Pair]:
        after = self._of_stage("advanced", self.parameters, self.state, self.h, self.z)
        return {"the state after the step": (self._values("after"), self._numbers(after))}

    def _jointed(self, stage: JointedStage) -> dict[str, Pair]:
        p, h = self.parameters, self.h
        free = self._of_stage("free", p, self.state, h, self.z)
        self.arrays["f"] = self._numbers(free)
        moving = self._state(self._values("moving"), free)
        after = self._of_stage("ended", p, free, h, self.impulse)
        by_velocities = self._of_stage("momenta", p, after, moving)
        return {
            "the step": (self._values("free"), self.arrays["f"]),
            "a momentum": (self._numbers(by_velocities), self._numbers(after)),
            "the rate of a constraint": (self._values("rate"), self._of_stage("rate", p, moving)[self.multipliers]),
            "the state after the step": (self._values("after"), self._numbers(after)),
        }

    def _values(self, name: str) -> np.ndarray:
        """Expressions of all links, (N, k)."""
        codes, reach, count = self.plan.codes, self.plan.reach, self.plan.count
        ends = [*range(reach + 1), *range(count - reach, count + 1)]
        parts = [np.arange(a, b) for a, b in pairwise(ends)]
        pairs = zip(codes, parts, strict=True)
        return np.concatenate([self._at(getattr(code, name), code.link, links) for code, links in pairs])

    def _at(self, roots: Iterable[Expr], link: int, links: np.ndarray) -> np.ndarray:
        """Expressions of a link of the short chain, as those of these links."""
        values: dict[Expr, Any] = {}
        roots = list(roots)
        with np.errstate(all="ignore"):
            for node in reachable(roots):
                values[node] = self._value(node, [values[a] for a in node.args], link, links)
        return np.stack([np.broadcast_to(values[root], len(links)) for root in roots], axis=1)

    def _value(self, node: Expr, args: list[Any], link: int, links: np.ndarray) -> Any:
        if node is self.plan.h:
            return self.h
        address = self.plan.address.get(node)
        if address is not None:
            if address.link is None:
                return self.shared[address.array][address.slot]
            return self.arrays[address.array][links + address.link - link, address.slot]
        if node.op == "const":
            return node.value
        if node.op == "div":
            return args[0] / args[1]
        if node.op == "select":
            return np.where(*args)
        if node.op == "entry":
            return node.value.numbers[np.asarray(args[0], int)]  # pyright: ignore[reportOptionalMemberAccess,reportAttributeAccessIssue]
        function = (UNARY if len(args) == 1 else BINARY).get(node.op)
        if function is None:
            raise NotLinked(f"the operation `{node.op}` is not compared over links")
        return function(*args)

    def _state(self, numbers: np.ndarray, like: PyTree) -> Any:
        """The state with these numbers of links, and the others of another state."""
        row = pack(like)[1].copy()
        there = self.plan.state.there
        row[self.plan.state.links[there]] = numbers[there]
        return layout(like).unpack(row)


def _apart(one: np.ndarray, other: np.ndarray, strict: bool) -> float:
    """The largest difference of a column, relative to the largest number of it."""
    there = np.isfinite(other)
    if not strict and np.array_equal(there, np.isfinite(one)):
        one, other = np.where(there, one, 0.0), np.where(there, other, 0.0)
    sizes = np.maximum(np.max(np.abs(other), axis=0), 1e-3 * np.max(np.abs(other), initial=1e-300))
    found = np.max(np.abs(one - other) / sizes)
    return float(found) if np.isfinite(found) else np.inf
