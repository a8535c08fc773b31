"""A stepper as a C library without Python: machine code, a header with the layout of its numbers, and their glue."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coadjoint.c_sources import array, header, layout, macro, number
from coadjoint.errors import ArgumentError
from coadjoint.kernels.lanes import of_lanes
from coadjoint.kernels.program import Code, StatusFlag
from coadjoint.simulation.steppers.base import StepperBase
from coadjoint.simulation.steppers.interface import NativeEngine

ERRORS = {
    "OK": (0, "the step was taken"),
    "NOT_CONVERGED": (int(Code.NOT_CONVERGED), "Newton's iteration did not converge; the state is the last good one"),
    "NOT_FINITE": (int(Code.NOT_FINITE), "the step gave numbers that are not finite"),
    "BEYOND_CHART": (int(Code.BEYOND_CHART), "the step left the chart of the difference map: dt is too long"),
    "STOPPED": (int(Code.STOPPED), "the event `until` happens in the next step"),
    "OBSERVATION": (16, "an observation is not finite"),
    "ARGUMENT": (17, "a number of steps below 0, or a command that is not finite"),
}
"""What functions return."""

_BODY = """#define {N}_STATE {state}
#define {N}_COMMANDS {commands}
#define {N}_OBSERVATIONS {observations}
#define {N}_PARAMETERS {parameters}
#define {N}_DT {dt}

{places}

enum {{
{errors}
}};

/* A vehicle. It holds no pointers: a copy of it is a vehicle of its own, and each thread may have one. No function
   allocates memory or reads a global variable that changes. A failed step stays failed until {name}_reset, or until
   status[1] is set to 0. */
typedef struct {name} {{
    double state[{state_}];
    double commands[{commands_}];     /* held until they are changed */
    double observations[{observations_}];
    double parameters[{parameters_}];
    int64_t status[4];                /* steps taken, code, Newton's iterations, the most of one step */
}} {name};

/* The start that was exported, with its commands, parameters and observations. */
int {name}_reset({name} *self);

/* Take so many steps of {N}_DT with the commands, and observe; 0 steps only observe. */
int {name}_step({name} *self, int64_t steps);
"""
_JACOBIAN = """
/* Take one step; jacobian[{N}_STATE * {N}_STATE] gets d(state after)/d(state before), by rows. The columns of the
   commands, {name}_command_places, are the derivatives by these. Needs {stack} bytes of stack. */
int {name}_step_jacobian({name} *self, double *jacobian);
extern const int {name}_command_places[{commands_}];
"""
_SOURCE = """#include "{name}.h"

#include <math.h>
#include <string.h>

extern int64_t {name}_code_online(int64_t *context, int64_t first, int64_t last, int64_t steps);

{arrays}

static int64_t at(const void *pointer) {{
    return (int64_t)(intptr_t)pointer;
}}

int {name}_step({name} *self, int64_t steps) {{
    double h = {N}_DT;
    int64_t context[8] = {{at(self->parameters), 0, at(&h), at(self->state), at(self->status), at(self->commands),
                          at(self->observations), at(limits)}};
    for (int i = 0; i < {N}_COMMANDS; i++)
        if (!isfinite(self->commands[i])) return {N}_ARGUMENT;
    if (steps < 0) return {N}_ARGUMENT;
    int64_t flags = {name}_code_online(context, 0, 1, steps);
    if (flags & {failed}) return (int)self->status[1];
    return flags & {not_finite} ? {N}_OBSERVATION : {N}_OK;
}}

int {name}_reset({name} *self) {{
    memset(self, 0, sizeof *self);
    memcpy(self->state, begin, sizeof begin);
    memcpy(self->commands, commands, sizeof commands);
    memcpy(self->parameters, parameters, sizeof parameters);
    return {name}_step(self, 0);
}}
"""
_JACOBIAN_SOURCE = """
extern void {name}_code_step(const double *p, const double *h, double *x, int64_t kept, int64_t every, double *record,
                             double *monitors, double *extrema, int64_t *status);
extern void {name}_code_substep(const double *x, const double *y, double *value, double *slopes, int64_t rows);

const int {name}_command_places[{commands_}] = {{{command_places}}};

enum {{ M = {unknowns}, N = {N}_STATE, P = {N}_PARAMETERS, PARTS = {parts}, RECORD = {record} }};

/* B <- A^-1 B by Gauss with row pivots; A (M, M) and B (M, N) are rows of `a` of the length M + N. */
static void eliminate(double *a) {{
    for (int k = 0; k < M; k++) {{
        int best = k;
        for (int i = k + 1; i < M; i++)
            if (fabs(a[i * (M + N) + k]) > fabs(a[best * (M + N) + k])) best = i;
        for (int j = 0; j < M + N; j++) {{
            double kept = a[k * (M + N) + j];
            a[k * (M + N) + j] = a[best * (M + N) + j];
            a[best * (M + N) + j] = kept;
        }}
        for (int i = 0; i < M; i++) {{
            double factor = a[i * (M + N) + k] / a[k * (M + N) + k];
            for (int j = k; i != k && j < M + N; j++) a[i * (M + N) + j] -= factor * a[k * (M + N) + j];
        }}
    }}
    for (int k = 0; k < M; k++)
        for (int j = M; j < M + N; j++) a[k * (M + N) + j] /= a[k * (M + N) + k];
}}

int {name}_step_jacobian({name} *self, double *jacobian) {{
    double x[M + N], y[P + 3], value[M + N], slopes[(M + N) * (M + N)], before[N * N], record[RECORD];
    double ignored[{watched}], h = {N}_DT;
    int error = {name}_step(self, 0);
    if (error || self->status[1]) return error ? error : (int)self->status[1];
    memcpy(x + M, self->state, sizeof self->state);
    memcpy(y, self->parameters, P * sizeof(double));
    int64_t status[4] = {{0, 0, 0, 0}};
    {name}_code_step(self->parameters, &h, self->state, 1, 1, record, ignored, ignored, status);
    self->status[0] += status[0];
    self->status[1] = status[1];
    self->status[2] += status[2];
    if (self->status[3] < status[3]) self->status[3] = status[3];
    if (status[1]) return (int)status[1];
    for (int part = 0; part < PARTS; part++) {{
        double *course = record + RECORD - (PARTS - part) * (M + N);
        memcpy(x, course, M * sizeof(double));
        y[P] = fractions[part] * h, y[P + 1] = h, y[P + 2] = part == 0;
        memset(slopes, 0, sizeof slopes);
        {name}_code_substep(x, y, value, slopes, 1);
        eliminate(slopes);
        if (part) memcpy(before, jacobian, sizeof before);
        for (int i = 0; i < N; i++) {{
            double own[N];
            for (int j = 0; j < N; j++) {{
                own[j] = slopes[(M + i) * (M + N) + M + j];
                for (int k = 0; k < M; k++) own[j] -= slopes[(M + i) * (M + N) + k] * slopes[k * (M + N) + M + j];
            }}
            if (!part) memcpy(jacobian + i * N, own, sizeof own);
            for (int j = 0; part && j < N; j++) {{
                double sum = 0.0;
                for (int k = 0; k < N; k++) sum += own[k] * before[k * N + j];
                jacobian[i * N + j] = sum;
            }}
        }}
        memcpy(x + M, course + M, N * sizeof(double));
    }}
    return {name}_step(self, 0);
}}
"""


class StepSlopes(NamedTuple):
    """What a Jacobian needs: assemblies of the step with its course and of a substep; unknowns, fractions, the size of
    a record with its course, and how many numbers the step observes."""

    step: str
    substep: str
    unknowns: int
    fractions: tuple[float, ...]
    record: int
    watched: int


def sources(
    stepper: StepperBase, name: str, units: Mapping[str, str], slopes: StepSlopes | None = None
) -> tuple[str, str, dict[str, tuple[str, str]]]:
    """The header, the C source, and the parts of the machine code, of a single native stepper."""
    face, engine, memory = stepper.face, stepper._engine, stepper._buffers
    if face.members is not None or not isinstance(engine, NativeEngine):
        why = "runs by XLA" if face.members is None else f"has {face.members} members"
        raise ArgumentError(f"A stepper that {why} is no C library: only native code of one can leave the process.")
    prefix, N = f"{name}_code_", name.upper()
    kinds = {"state": face.state, "command": face.commands, "observation": face.observations,
             "parameter": face.parameters}  # fmt: skip
    texts = [layout(kind.capitalize(), one.shapes, f"{name}_{kind}", units) for kind, one in kinds.items()]
    sizes = {"state": face.state.size, "commands": face.commands.size, "observations": face.observations.size,
             "parameters": face.parameters.size}  # fmt: skip
    errors = [f"    {macro(name, key)} = {code}, /* {words} */" for key, (code, words) in ERRORS.items()]
    given = {"name": name, "N": N, "dt": number(face.dt), **sizes, "errors": "\n".join(errors),
             **{f"{key}_": max(size, 1) for key, size in sizes.items()},
             "places": "\n".join(text for _, text in texts if text)}  # fmt: skip
    fixed = ", ".join(face.parameters.names) if not face.compiled_in else "those that are 0 or 1 are compiled in"
    comment = f"{face.title}, in steps of {face.dt:g} s. Parameters: {fixed or 'none'}.\n\n"
    comment += "\n\n".join(text for text, _ in texts)
    rows = {"begin": of_lanes(memory.state)[0], "commands": of_lanes(memory.state)[0][list(face.commanded)],
            "parameters": of_lanes(memory.parameters)[0], "limits": memory.limits[..., 0]}  # fmt: skip
    parts = {f"{prefix}online": (engine.assembly, "online")}
    body, source = _BODY.format(**given), _SOURCE
    if slopes is not None:
        m, n = slopes.unknowns, face.state.size
        stack = 8 * ((m + n) * (m + n + 2) + n * (n + 1) + slopes.record + face.parameters.size + 100)
        body += _JACOBIAN.format(**given, stack=stack)
        source += _JACOBIAN_SOURCE
        rows["fractions"] = np.array(slopes.fractions)
        parts |= {f"{prefix}step": (slopes.step, "step"), f"{prefix}substep": (slopes.substep, "function")}
        given |= {"unknowns": m, "parts": len(slopes.fractions), "record": slopes.record}
        given |= {"watched": max(2 * slopes.watched, 1), "command_places": ", ".join(map(str, face.commanded)) or "0"}
    given["arrays"] = "\n".join(array(key, np.asarray(value, float)) for key, value in rows.items())
    words = {"failed": int(StatusFlag.FAILED), "not_finite": int(StatusFlag.NOT_FINITE)}
    return header(name, comment, body), source.format(**given, **words), parts
