"""A filter as a C library without Python: its machine code, a header with the layout of its numbers, and their glue."""

from __future__ import annotations

from collections.abc import Mapping

from coadjoint.c_sources import array, header, layout, macro
from coadjoint.estimation.engines import CodedFilter
from coadjoint.estimation.innovation import FilterMemory
from coadjoint.estimation.saved_filter import FilterInterface
from coadjoint.kernels.emit.filter_memory import FIELDS
from coadjoint.kernels.emit.kalman import CORRECT, PREDICT
from coadjoint.kernels.run.kalman import parts_of, table

_BODY = """#define {N}_ROW {size}
#define {N}_ERRORS {n}
#define {N}_INPUTS {inputs}

{places}

enum {{
    {N}_OK = 0,
    {N}_FAILED = 1,   /* no step from the estimate, or a covariance that is not finite; nothing has changed */
    {N}_STOPPED = 2,  /* too many values in a row are beyond the gate of a measurement that stops the filter then */
    {N}_ARGUMENT = 3  /* a dt that is not positive, or an input that is not finite */
}};

/* A filter. It holds no pointers: a copy of it is a filter of its own, and each thread may have one. No function
   allocates memory or reads a global variable that changes; they need {stack} bytes of stack. */
typedef struct {name} {{
    double row[{size}];                 /* the estimate */
    double covariance[{square}];   /* of the errors, by rows */
    double inputs[{inputs_}];          /* held over each step until they are changed */
    int64_t rejected[{rejected}];         /* values in a row beyond the gate, of each measurement */
    double parameters[{parameters}];
    double work[{work}];
}} {name};

/* used: 0 where the value was rejected or holds a NaN, 1 where it was used, 2 where `after_rejections` let it be. */
typedef struct {name}_innovation {{
    double nis;
    int used;
}} {name}_innovation;

/* The estimate that was exported, with its inputs. */
void {name}_reset({name} *self);

/* Advance by one step of dt, s, with the inputs. */
int {name}_predict({name} *self, double dt);

/* Process a measurement at the time of the estimate; innovation may be NULL. */
{updates}
"""
_SOURCE = """#include "{name}.h"

#include <math.h>
#include <string.h>

{externals}

{arrays}

static int64_t at(const void *pointer) {{
    return (int64_t)(intptr_t)pointer;
}}

static int64_t of(void (*function)(void)) {{
    return (int64_t)(intptr_t)function;
}}

static int execute({name} *self, const int64_t *order, const double *data, double *output) {{
    double row[{size}], covariance[{square}];
    int64_t rejected[{rejected}], status[4] = {{0, 0, 0, 0}}, memory[{fields}] = {{0}};
    int64_t functions[{count}] = {{{functions}}}, covariances[{count}] = {{{covariances}}};
    int64_t effective[{count}] = {{{effective}}};
    memcpy(row, self->row, sizeof row);
    memcpy(covariance, self->covariance, sizeof covariance);
    memcpy(rejected, self->rejected, sizeof rejected);
{memory}
    int64_t failed = {name}_code_filter(memory, order, 1, data, output);
    for (int i = 0; failed < 0 && i < {size}; i++)
        if (!isfinite(self->row[i])) failed = 0;
    if (failed < 0) return {N}_OK;
    int stopped = order[0] == {correct} && actions[order[1]] == 3 && self->rejected[order[1]] >= limits[order[1]];
    memcpy(self->row, row, sizeof row);
    memcpy(self->covariance, covariance, sizeof covariance);
    memcpy(self->rejected, rejected, sizeof rejected);
    return stopped ? {N}_STOPPED : {N}_FAILED;
}}

void {name}_reset({name} *self) {{
    memset(self, 0, sizeof *self);
    memcpy(self->row, begin, sizeof begin);
    memcpy(self->covariance, spread, sizeof spread);
    memcpy(self->rejected, counted, sizeof counted);
    memcpy(self->parameters, parameters, sizeof parameters);
    for (int i = 0; i < {inputs}; i++) self->inputs[i] = begin[input_places[i]];
}}

int {name}_predict({name} *self, double dt) {{
    const int64_t order[4] = {{{predict}, 0, 0, 0}};
    double output[2], before[{inputs_}];
    if (!(dt > 0.0) || !isfinite(dt)) return {N}_ARGUMENT;
    for (int i = 0; i < {inputs}; i++)
        if (!isfinite(self->inputs[i])) return {N}_ARGUMENT;
    for (int i = 0; i < {inputs}; i++) {{
        before[i] = self->row[input_places[i]];
        self->row[input_places[i]] = self->inputs[i];
    }}
    int error = execute(self, order, &dt, output);
    for (int i = 0; error && i < {inputs}; i++) self->row[input_places[i]] = before[i];
    return error;
}}
{updates}"""
_UPDATE = """
int {name}_update_{called}({name} *self, const double value[{size}], {name}_innovation *innovation) {{
    const int64_t order[4] = {{{correct}, {place}, 0, 0}};
    double output[2] = {{NAN, 0.0}};
    int error = execute(self, order, value, output);
    if (innovation) {{
        innovation->nis = output[0];
        innovation->used = error ? 0 : (int)output[1];
    }}
    return error;
}}
"""


def sources(
    face: FilterInterface, coded: CodedFilter, held: FilterMemory, name: str, units: Mapping[str, str]
) -> tuple[str, str, dict[str, tuple[str, str]]]:
    """The header, the C source, and the parts of the machine code, of a filter."""
    model, seen = coded.model, coded.measurements
    given, prefix, n = table(model, seen), f"{name}_code_", model.errors
    parts = {f"{prefix}{key}": part for key, part in parts_of(model, seen).items()}
    kinds = {"row": face.row, "input": face.inputs, "measurement": face.measurements}
    texts = [layout(kind.capitalize(), one.shapes, f"{name}_{kind}", units) for kind, one in kinds.items()]
    errors = layout("Errors", [(one, ()) for one in face.errors], f"{name}_error", units)
    names = {one: macro(one).lower() for one in face.measurements.names}
    signatures = [
        f"int {name}_update_{called}({name} *self, const double value[{place.stop - place.start}], "
        f"{name}_innovation *innovation);"
        for (_, _, place), called in zip(face.measurements.places(), names.values(), strict=True)
    ]
    arrays = given.constants | {"begin": held.rows[0], "spread": held.P[0], "counted": held.rejected[0]}
    arrays |= {f"R{i}": one.matrices[0] for i, one in enumerate(seen)}
    arrays |= {f"E{i}": one.matrices[1] for i, one in enumerate(seen) if one.effective is not None}
    updates = [
        _UPDATE.format(name=name, called=called, size=place.stop - place.start, place=i, correct=CORRECT)
        for i, ((_, _, place), called) in enumerate(zip(face.measurements.places(), names.values(), strict=True))
    ]
    size, work = len(held.rows[0]), sum(given.scratch.values())
    fill = {
        "name": name, "N": name.upper(), "size": size, "n": n, "square": n * n, "inputs": face.inputs.size,
        "inputs_": max(face.inputs.size, 1), "rejected": held.rejected.shape[1], "work": work,
        "parameters": len(given.constants["parameters"]), "fields": len(FIELDS), "count": len(seen) + 1,
        "stack": 8 * (size + n * n + 2 * len(FIELDS) + 3 * len(seen) + 64), "predict": PREDICT, "correct": CORRECT,
        "places": "\n".join(text for _, text in (*texts, errors) if text),
        "externals": _externals(name, parts), "arrays": "\n".join(array(key, one) for key, one in arrays.items()),
        "functions": "".join(f"of({prefix}measure_{i}), " for i in range(len(seen))) + "0",
        "covariances": "".join(f"at(R{i}), " for i in range(len(seen))) + "0",
        "effective": "".join(f"at({'R' if one.effective is None else 'E'}{i}), " for i, one in enumerate(seen)) + "0",
    }  # fmt: skip
    comment = f"{face.title}.\n\n" + "\n\n".join(text for text, _ in (*texts, errors))
    body = _BODY.format(**fill, updates="\n".join(signatures))
    functions = {"step", "tangent", "retract", "carry", "projector", "shake"} & set(parts_of(model, seen))
    memory = _memory(name, given.sizes, given.scratch, list(given.constants), sorted(functions))
    return header(name, comment, body), _SOURCE.format(**fill, updates="".join(updates), memory=memory), parts


def _externals(name: str, parts: Mapping[str, tuple[str, str]]) -> str:
    """The declarations of the functions of machine code, which are called by their addresses but for the first."""
    first = f"{name}_code_filter"
    given = "int64_t *memory, const int64_t *orders, int64_t count, const double *data, double *output"
    orders = f"extern int64_t {first}({given});"
    return "\n".join([orders, *(f"extern void {one}(void);" for one in parts if one != first)])


def _memory(
    name: str, sizes: Mapping[str, int], scratch: Mapping[str, int], constants: list[str], functions: list[str]
) -> str:
    """The lines that fill the table of sizes and addresses."""
    found = {key: str(value) for key, value in sizes.items()}
    found |= {"row": "at(self->row)", "P": "at(self->covariance)", "rejected": "at(self->rejected)"}
    found |= {"measurements": "at(functions)", "covariances": "at(covariances)", "effective": "at(effective)"}
    found["status"] = "at(status)"
    found |= {key: f"at({key})" for key in constants} | {"parameters": "at(self->parameters)"}
    found |= {key: f"of({name}_code_{key})" for key in functions}
    start = 0
    for key, count in scratch.items():
        found[key], start = f"at(self->work + {start})", start + count
    return "\n".join(f"    memory[{FIELDS.index(key)}] = {value}; /* {key} */" for key, value in found.items())
