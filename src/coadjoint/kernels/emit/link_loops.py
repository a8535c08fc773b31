"""The LLVM function that steps a chain by loops over its links.

    void step(parameters, h, state, records, save_every, record_out, monitor_out, extrema, status, workspace)

It is that of `kernels.emit.stepping` without lanes of members, monitors and extrema; `workspace` is memory for arrays.
Its loop runs over the substeps of all steps, which are solved as in `link_newton`.
"""

from __future__ import annotations

from llvmlite import ir

from coadjoint.kernels.emit import FEW_PASSES
from coadjoint.kernels.emit.emitter import DOUBLE, INT64, Emitter, Value
from coadjoint.kernels.emit.link_arrays import LinkArrays, sizes, stride
from coadjoint.kernels.emit.link_newton import ChordNewton, JointsNewton, unknowns
from coadjoint.kernels.emit.link_plan import LinkCode, LinkPlan
from coadjoint.kernels.emit.stepping import NAME, POINTER
from coadjoint.kernels.emit.substeps import constant_table
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.program import Code


def assemble(plan: LinkPlan, width: int, fractions: tuple[float, ...], everywhere: bool) -> str:
    """The module as LLVM assembly; width: of the SIMD lanes.

    fractions: the substeps as parts of h. everywhere: whether there is a record of each substep.
    """
    return str(_LinkFunction(plan, width, fractions, everywhere).module)


def workspace(plan: LinkPlan) -> int:
    """How many numbers the arrays hold."""
    return sum(sizes(plan).values()) * stride(plan)


def _exact(plan: LinkPlan) -> list[Expr]:
    """Results and residuals, whose sums must not be reordered."""
    roots = [*plan.prepared, *plan.after, *plan.record]
    for code in plan.codes:
        roots += [
            *code.prepared,
            *code.guess,
            *code.residual,
            *code.chart,
            *code.free,
            *code.rate,
            *code.after,
            *code.record,
        ]
    return reachable(roots)


class _LinkFunction:
    """Writes that function."""

    def __init__(self, plan: LinkPlan, width: int, fractions: tuple[float, ...], everywhere: bool) -> None:
        self.plan, self.fractions, self.everywhere = plan, fractions, everywhere
        self.module = ir.Module(name="coadjoint")
        if not plan.jointed:
            self.module.add_named_metadata(FEW_PASSES, ["1"])
        kinds = [*[POINTER] * 3, INT64, INT64, *[POINTER] * 3, INT64.as_pointer(), POINTER]
        function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), kinds), name=NAME)
        for argument in function.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")
        self.arguments = function.args
        self.b = ir.IRBuilder(function.append_basic_block("entry"))
        self.arrays = LinkArrays(plan, self.module, self.b, function.args[-1], width)
        for emit in self.arrays.emitters:
            emit.keep_exact(_exact(plan))
        self._function()

    def _function(self) -> None:
        b, plan, one = self.b, self.plan, self.arrays.one
        p, h, s, records, every, self.record_out, _, _, status, _ = self.arguments
        self.full, self.every, number = b.load(h), every, b.mul(records, every)
        self._constants(p)
        self.arrays.transposed(s, plan.state, "s", reading=True)
        self.shared = [one.variable(DOUBLE, b.load(self._place(s, k))) for k in plan.state.shared]
        self.before = [one.variable(DOUBLE) for _ in self.shared]
        self.steps, self.code, self.total, self.most, self.row, self.due, self.part, self.spent = (
            one.variable(INT64, INT64(0)) for _ in range(8)
        )
        self.sums, self.chart = self.arrays.variables(), self.arrays.variables()
        iteration = JointsNewton if plan.jointed else ChordNewton
        self.iteration = iteration(plan, self.arrays)
        loop, end = b.append_basic_block("step"), b.append_basic_block("end")
        b.cbranch(b.icmp_signed(">", number, INT64(0)), loop, end)
        b.position_at_end(loop)
        self._opened()
        with self.arrays.scopes():
            self._step()
        alive = b.icmp_signed("==", b.load(self.code), INT64(0))
        b.cbranch(b.and_(b.icmp_signed("<", b.load(self.steps), number), alive), loop, end)
        b.position_at_end(end)
        self.arrays.transposed(s, plan.state, "s", reading=False)
        for k, variable in zip(plan.state.shared, self.shared, strict=True):
            b.store(b.load(variable), self._place(s, k))
        for k, variable in enumerate((self.steps, self.code, self.total, self.most)):
            b.store(b.load(variable), self._place(status, k))
        b.ret_void()

    @property
    def _changes(self) -> bool:
        """Whether the state changes before a step has been found to be sound."""
        return self.plan.driven or len(self.fractions) > 1

    def _opened(self) -> None:
        """Where a step begins: keep its state, and renew inputs and internal state."""
        b, arrays, plan = self.b, self.arrays, self.plan
        if not self._changes:
            return
        with b.if_then(b.icmp_signed("==", b.load(self.part), INT64(0))):
            arrays.copied("s", "b")
            for variable, kept in zip(self.shared, self.before, strict=True):
                b.store(b.load(variable), kept)
            if plan.driven:
                with arrays.scopes():
                    self._bind_shared()
                    arrays.bind_all(plan.h, self.full)
                    arrays.fill("n", "prepared")
                    found = arrays.one.values(plan.prepared)
                arrays.copied("n", "s")
                for value, variable in zip(found, self.shared, strict=True):
                    b.store(value, variable)

    def _bind_shared(self) -> None:
        for node, address in self.plan.address.items():
            if address.array == "s" and address.link is None:
                self.arrays.bind_all(node, self.b.load(self.shared[address.slot]))

    def _length(self) -> Value:
        """h of the substep."""
        if len(self.fractions) == 1:
            return self.full
        table = constant_table(self.module, self.fractions)
        return self.b.fmul(self.full, self.b.load(self.b.gep(table, [INT64(0), self.b.load(self.part)])))

    def _place(self, row: Value, k: Value) -> Value:
        return self.b.gep(row, [INT64(int(k))])

    def _constants(self, p: Value) -> None:
        """Bind the parameters."""
        plan = self.plan
        for node, address in plan.address.items():
            if address.array == "p" and address.link is None:
                self.arrays.bind_all(node, self.b.load(self._place(p, plan.parameters.shared[address.slot])))
        self.arrays.transposed(p, plan.parameters, "p", reading=True)

    def _step(self) -> None:
        arrays, self.h = self.arrays, self._length()
        self._bind_shared()
        arrays.bind_all(self.plan.h, self.h)
        arrays.fill("z", "guess")
        settled, count = self.iteration.emit(self.h)
        arrays.set(self.sums, 0.0)
        arrays.set(self.chart, 0.0)

        def judge(emit: Emitter, values: list[Value], link: Value, code: LinkCode) -> None:
            *z, chart = values
            arrays.add(emit, self.sums, z)
            arrays.widen(emit, self.chart, [chart])

        arrays.links(lambda code: [*unknowns(self.plan, code), *code.chart], judge)
        solved = arrays.finite(self.sums)
        if isinstance(self.iteration, JointsNewton):
            arrays.fill("f", "free")
            arrays.fill("t", "closing")
            self.iteration.swept()
        arrays.fill("n", "after", self.sums)
        after = arrays.one.values(self.plan.after)
        arrays.add(arrays.one, self.sums, after)
        self._ended(settled, solved, count, after)

    def _ended(self, settled: Value, solved: Value, count: Value, after: list[Value]) -> None:
        """Keep a sound step, with its record if it is due; else note why it failed."""
        b, arrays = self.b, self.arrays
        inside = b.fcmp_ordered("<", arrays.largest(self.chart), DOUBLE(1.0))
        well = b.and_(b.and_(settled, inside), b.and_(solved, arrays.finite(self.sums)))
        code = b.select(inside, INT64(Code.NOT_FINITE), INT64(Code.BEYOND_CHART))
        code = b.select(settled, code, INT64(Code.NOT_CONVERGED))
        code = b.select(solved, code, INT64(Code.NOT_FINITE))
        with b.if_else(well, likely=True) as (fine, failed):
            with fine:
                self._recorded()
                arrays.copied("n", "s")
                for value, variable in zip(after, self.shared, strict=True):
                    b.store(value, variable)
                self._counted(count)
            with failed:
                b.store(code, self.code)
                if self._changes:
                    arrays.copied("b", "s")
                    for kept, variable in zip(self.before, self.shared, strict=True):
                        b.store(b.load(kept), variable)

    def _counted(self, count: Value) -> None:
        """Go on to the next substep, or to the next step."""
        b = self.b
        spent, part = b.add(b.load(self.spent), count), b.add(b.load(self.part), INT64(1))
        last = b.icmp_signed("==", part, INT64(len(self.fractions)))
        b.store(b.select(last, INT64(0), spent), self.spent)
        b.store(b.select(last, INT64(0), part), self.part)
        with b.if_then(last):
            b.store(b.add(b.load(self.steps), INT64(1)), self.steps)
            b.store(b.add(b.load(self.total), spent), self.total)
            most, due = b.load(self.most), b.load(self.due)
            b.store(b.select(b.icmp_signed(">", most, spent), most, spent), self.most)
            again = b.select(b.icmp_signed("==", due, INT64(0)), self.every, due)
            b.store(b.sub(again, INT64(1)), self.due)

    def _recorded(self) -> None:
        """Write the record of a step that is due, or of each of its substeps."""
        b = self.b
        due, first = (b.icmp_signed("==", b.load(x), INT64(0)) for x in (self.due, self.part))
        with b.if_then(due if self.everywhere else b.and_(due, first)):
            self._written()

    def _written(self) -> None:
        b, plan, arrays = self.b, self.plan, self.arrays
        with arrays.scopes():
            row = b.gep(self.record_out, [b.mul(b.load(self.row), INT64(plan.state.size))])

            def write(emit: Emitter, values: list[Value], link: Value, code: LinkCode) -> None:
                places = arrays.in_row(row, plan.state, link)
                for slot, value in zip(code.there, values, strict=True):
                    b.store(value, places[slot])

            arrays.links(lambda code: [code.record[slot] for slot in code.there], write, arrays.one)
            for value, k in zip(arrays.one.values(plan.record), plan.state.shared, strict=True):
                b.store(value, self._place(row, k))
            b.store(b.add(b.load(self.row), INT64(1)), self.row)
