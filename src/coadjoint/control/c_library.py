"""A controller as a C library without Python: the problem by CasADi's sequential quadratic programming, as C code.

IPOPT and HPIPM cannot be generated; `sqpmethod` with the active-set method `qrqp` can. The Hessian is the exact one of
the Lagrangian, and a solution counts where the conditions of an optimum hold to `TOLERANCE`.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.c_sources import array, header, layout, number
from coadjoint.control.given import given_values, with_previous
from coadjoint.control.guess import Guesses
from coadjoint.control.library import casadi
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.program import NonlinearProgram, nonlinear_program
from coadjoint.control.transcribe import transcribe
from coadjoint.control.transcription import Transcription
from coadjoint.kernels.packing import layout as layout_of
from coadjoint.simulation.steppers.beginning import shapes_of

TOLERANCE = 1e-6
"""The largest violation of the constraints, and of stationarity relative to the largest multiplier, of a solution."""

_BODY = """#define {N}_STATE {nx}
#define {N}_COMMANDS {nu}
#define {N}_GIVEN {given}
#define {N}_STEPS {steps}
#define {N}_DT {dt}

{places}

enum {{
    {N}_OK = 0,
    {N}_NOT_CONVERGED = 1, /* no optimum within {iterations} iterations: the commands are those of the last plan */
    {N}_ARGUMENT = 2       /* a state that is not finite, or steps passed that are not from 0 to {N}_STEPS - 1 */
}};

/* A controller. It holds no pointers: a copy of it is a controller of its own. No function allocates memory, and
   {name}_command needs {stack} bytes of stack. CasADi's code has static memory: one thread at a time may call it. */
typedef struct {name} {{
    double commands[{nu_}];        /* of the first step of the plan */
    double given[{given_}];          /* may be changed before a call */
    double variables[{n}];     /* the plan: x, u and z of each step, the last x */
    double bound_multipliers[{n}];
    double multipliers[{m}];
    double residuals[2];         /* violation of the constraints, and of stationarity */
    double work[{work}];
    {casadi_int} integers[{integers}];
}} {name};

/* The first plan, and the given numbers of the problem. */
void {name}_reset({name} *self);

/* The commands for a state, so many steps of {N}_DT after that of the last call; the command in force is that of the
   last plan. */
int {name}_command({name} *self, const double state[{nx}], int passed);

/* Places of `state` among the numbers of a stepper of the same system. */
extern const int {name}_places[{nx}];
"""
_SOURCE = """#include "{name}.h"

#include <math.h>
#include <string.h>

extern int {name}_solve(const double **arguments, double **results, {casadi_int} *integers, double *work, int memory);

{arrays}

const int {name}_places[{nx}] = {{{state_places}}};

enum {{ BLOCK = {block}, FIRST_COMMAND = {nx} }};

void {name}_reset({name} *self) {{
    memset(self, 0, sizeof *self);
    memcpy(self->variables, guess, sizeof guess);
    memcpy(self->given, given, sizeof given);
    memcpy(self->commands, guess + FIRST_COMMAND, {N}_COMMANDS * sizeof(double));
}}

int {name}_command({name} *self, const double state[{nx}], int passed) {{
    double plan[{n}], bounds[{n}], rows[{m}];
    const double *arguments[{arguments}] = {{state, self->given, plan, bounds, rows}};
    double *results[{results}] = {{self->variables, self->bound_multipliers, self->multipliers, self->residuals}};
    for (int i = 0; i < {N}_STATE; i++)
        if (!isfinite(state[i])) return {N}_ARGUMENT;
    if (passed < 0 || passed >= {N}_STEPS) return {N}_ARGUMENT;
    memcpy(plan, self->variables, sizeof plan);
    if (passed > 0) {{
        for (int i = 0; i < {previous}; i++)
            self->given[previous_places[i]] = plan[(passed - 1) * BLOCK + FIRST_COMMAND + previous_commands[i]];
        memmove(plan, plan + passed * BLOCK, sizeof plan - passed * BLOCK * sizeof(double));
        for (int k = {N}_STEPS - passed; k < {N}_STEPS; k++) {{
            memcpy(plan + k * BLOCK, self->variables + {N}_STEPS * BLOCK, {N}_STATE * sizeof(double));
            memcpy(plan + k * BLOCK + {N}_STATE, self->variables + ({N}_STEPS - 1) * BLOCK + {N}_STATE,
                   (BLOCK - {N}_STATE) * sizeof(double));
        }}
        memcpy(plan + {N}_STEPS * BLOCK, self->variables + {N}_STEPS * BLOCK,
               sizeof plan - {N}_STEPS * BLOCK * sizeof(double));
    }}
    memcpy(bounds, self->bound_multipliers, sizeof bounds);
    memcpy(rows, self->multipliers, sizeof rows);
    {name}_solve(arguments, results, self->integers, self->work, 0);
    if (self->residuals[0] <= {tolerance} && self->residuals[1] <= {tolerance}) {{
        memcpy(self->commands, self->variables + FIRST_COMMAND, {N}_COMMANDS * sizeof(double));
        return {N}_OK;
    }}
    memcpy(self->variables, plan, sizeof plan);
    memset(self->bound_multipliers, 0, sizeof bounds);
    memset(self->multipliers, 0, sizeof rows);
    memcpy(self->commands, plan + FIRST_COMMAND, {N}_COMMANDS * sizeof(double));
    return {N}_NOT_CONVERGED;
}}
"""


class GeneratedSolver(NamedTuple):
    """C code of a solver, and its function of CasADi: (x, given, w, λ_w, λ_g) ↦ (w, λ_w, λ_g, residuals)."""

    code: str
    function: PyTree


def solver(program: NonlinearProgram, nx: int, name: str, iterations: int) -> GeneratedSolver:
    """The solver of a program from a state x, which is the first nx variables."""
    ca = casadi()
    quiet = {"print_time": False, "error_on_fail": False}
    silent = {"print_header": False, "print_iteration": False, "print_status": False}
    qp = {**quiet, "print_iter": False, "print_header": False, "print_info": False}
    given = {"qpsol": "qrqp", "qpsol_options": qp, "max_iter": iterations, "tol_pr": 1e-8, "tol_du": 1e-8}
    w, f, g, p = program.w, program.f, program.g, program.p
    solve = ca.nlpsol("optimum", "sqpmethod", {"x": w, "f": f, "g": g, "p": p}, {**quiet, **silent, **given})
    (low, high), (lower, upper) = program.bounds, program.limits
    x, first, on_w, on_g = (
        ca.MX.sym(*one) for one in (("x", nx), ("w", w.numel()), ("a", w.numel()), ("b", g.numel()))
    )
    both = [ca.vertcat(x, ca.DM(side[nx:])) for side in (low, high)]
    start = ca.vertcat(x, first[nx:])
    found = solve(x0=start, p=p, lbx=both[0], ubx=both[1], lbg=lower, ubg=upper, lam_x0=on_w, lam_g0=on_g)
    slopes = ca.gradient(f, w) + ca.jtimes(g, w, on_g, True) + on_w
    off = ca.mmax(ca.fmax(ca.fmax(lower - g, g - upper), 0))
    size = ca.fmax(1, ca.norm_inf(ca.vertcat(on_w, on_g)))
    judge = ca.Function("judge", [w, p, on_w, on_g], [ca.vertcat(off, ca.norm_inf(slopes) / size)])
    judged = judge(found["x"], p, found["lam_x"], found["lam_g"])
    results = [found["x"], found["lam_x"], found["lam_g"], judged]
    function = ca.Function(f"{name}_solve", [x, p, first, on_w, on_g], results)
    generator = ca.CodeGenerator(f"{name}_solver.c", {"casadi_int": "int", "with_header": False})
    generator.add(function)
    with tempfile.TemporaryDirectory() as folder:
        code = Path(generator.generate(f"{folder}{os.sep}")).read_text(encoding="utf-8")
    # CasADi copies nothing to the integer 0, which newer compilers reject.
    return GeneratedSolver(code.replace("casadi_copy(0, 0, 0+ i*0);", ""), function)


def sources(problem: ProblemData, name: str, iterations: int, units: Mapping[str, str]) -> dict[str, str]:
    """File → text of the library of a problem's controller."""
    problem = with_previous(problem)
    made = transcribe(problem)
    program, (nx, nu, nz, _) = nonlinear_program(made, given=True), made.sizes
    code, function = solver(program, nx, name, iterations)
    x = made.graph.numbers(made.beginning.state)[made.live]
    guess = Guesses(made).variables(problem, None, x)
    names, w_size, g_size = made.graph.names(), program.w.numel(), program.g.numel()
    texts = [
        layout("State", [(names[i], ()) for i in made.live], f"{name}_state", units),
        layout("Commands", [(key, one.shape) for key, one in made.inputs], f"{name}_command", units),
        layout("Given", _given(made), f"{name}_given", units),
    ]
    places, commands = _previous(made)
    arrays = {"guess": guess, "given": np.asarray(made.given, float)}
    arrays |= {"previous_places": places, "previous_commands": commands}
    fill = {
        "name": name, "N": name.upper(), "nx": nx, "nu": nu, "nu_": max(nu, 1), "given": len(made.given),
        "given_": max(len(made.given), 1), "steps": problem.count, "dt": number(problem.dt), "n": w_size,
        "m": g_size, "work": function.sz_w(), "integers": max(function.sz_iw(), 1), "casadi_int": "int",
        "iterations": iterations, "tolerance": TOLERANCE, "block": nx + nu + nz, "arguments": function.sz_arg(),
        "results": function.sz_res(), "previous": len(places),
        "state_places": ", ".join(map(str, _places(made))), "places": "\n".join(text for _, text in texts if text),
        "stack": 8 * (2 * w_size + g_size + function.sz_arg() + function.sz_res() + 100),
        "arrays": "\n".join(array(key, one) for key, one in arrays.items()),
    }  # fmt: skip
    title = f"Controller of {problem.system.name}, {problem.count} steps of {problem.dt:g} s"
    comment = f"{title}.\n\n" + "\n\n".join(text for text, _ in texts)
    return {
        f"{name}.h": header(name, comment, _BODY.format(**fill)),
        f"{name}.c": _SOURCE.format(**fill),
        f"{name}_solver.c": code,
    }  # fmt: skip


def _given(made: Transcription) -> list[tuple[str, tuple[int, ...]]]:
    """Names and shapes of the given numbers: parameters that may change, the goal, commands in force."""
    parameters = {name: getattr(made.problem.system.parameters, name) for name in made.problem.changing}
    found = [*shapes_of(parameters).items(), *shapes_of(given_values(made.problem)).items()]
    return [(name.replace("']['", ".").strip("[']"), shape) for name, shape in found]


def _places(made: Transcription) -> list[int]:
    """The places of x among all numbers of a state, which a stepper holds."""
    state = made.beginning.state
    return made.graph.numbers(layout_of(state).places)[made.live].astype(int).tolist()


def _previous(made: Transcription) -> tuple[np.ndarray, np.ndarray]:
    """The places of commands in force among the given numbers, and those of their inputs in u."""
    places, commands, start = [], [], 0
    for name, one in made.inputs:
        size = int(np.prod(one.shape, dtype=int))
        if name in made.previous:
            places += range(made.previous[name].start, made.previous[name].stop)
            commands += range(start, start + size)
        start += size
    return np.array(places, np.int64), np.array(commands, np.int64)
