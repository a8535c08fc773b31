"""Functional mock-up units (FMI 2.0, co-simulation) that need no Python: the C library of a stepper behind FMI's
functions, which are declared here by the standard."""

from __future__ import annotations

import hashlib
import io
import os
import platform
import shutil
import subprocess
import tempfile
import uuid
import zipfile
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

from coadjoint.checks import CLOSE
from coadjoint.errors import ArgumentError
from coadjoint.kernels.lanes import of_lanes
from coadjoint.kernels.run.portable_code import exported_code, linked
from coadjoint.simulation.steppers.base import StepperBase
from coadjoint.simulation.steppers.c_library import ERRORS, sources
from coadjoint.simulation.steppers.fields import variables

_SOURCE = """#include "{name}.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef unsigned int reference;
enum {{ OK, WARNING, DISCARD, ERROR }};
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {{
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
}} Callbacks;
typedef struct {{
    {name} vehicle;
    Callbacks callbacks;
    char called[256];
}} Unit;

/* text: without conversions, for masters that print it as a format and those that do not. */
static int logged(Unit *unit, int status, const char *text) {{
    const char *category = status == WARNING ? "logStatusWarning" : "logStatusError";
    if (unit->callbacks.logger)
        unit->callbacks.logger(unit->callbacks.environment, unit->called, status, category, text);
    return status;
}}

EXPORT const char *fmi2GetTypesPlatform(void) {{ return "default"; }}
EXPORT const char *fmi2GetVersion(void) {{ return "2.0"; }}

EXPORT void *fmi2Instantiate(const char *called, int kind, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging) {{
    (void)resources, (void)visible, (void)logging;
    if (kind != 1 || !guid || strcmp(guid, "{guid}") || !callbacks) return NULL;
    Unit *unit = callbacks->allocate(1, sizeof *unit);
    if (!unit) return NULL;
    memset(unit, 0, sizeof *unit);
    unit->callbacks = *callbacks;
    strncpy(unit->called, called ? called : "", sizeof unit->called - 1);
    {name}_reset(&unit->vehicle);
    return unit;
}}

EXPORT void fmi2FreeInstance(Unit *unit) {{
    if (unit) unit->callbacks.release(unit);
}}

EXPORT int fmi2SetDebugLogging(Unit *unit, int on, size_t count, const char *const *categories) {{
    (void)unit, (void)on, (void)count, (void)categories;
    return OK;
}}

EXPORT int fmi2SetupExperiment(Unit *unit, int limited, double tolerance, double start, int ends, double stop) {{
    (void)limited, (void)tolerance, (void)ends, (void)stop;
    double t = unit->vehicle.state[{time}], off = fabs(start - t), size = fmax(fabs(start), fabs(t));
    char text[160];
    if (off <= {close} * fmax(size, {N}_DT)) return OK;
    snprintf(text, sizeof text, "The stepper goes on from t = %g s, not from %g s.", t, start);
    logged(unit, WARNING, text);
    return OK;
}}

EXPORT int fmi2EnterInitializationMode(Unit *unit) {{ return unit ? OK : ERROR; }}
EXPORT int fmi2ExitInitializationMode(Unit *unit) {{ return unit ? OK : ERROR; }}
EXPORT int fmi2Terminate(Unit *unit) {{ return unit ? OK : ERROR; }}

EXPORT int fmi2Reset(Unit *unit) {{
    {name}_reset(&unit->vehicle);
    return OK;
}}

EXPORT int fmi2GetReal(Unit *unit, const reference *which, size_t count, double *values) {{
    for (size_t i = 0; i < count; i++) {{
        if (which[i] >= {N}_COMMANDS + {N}_OBSERVATIONS) return logged(unit, ERROR, "There is no such variable.");
        values[i] = which[i] < {N}_COMMANDS ? unit->vehicle.commands[which[i]]
                                            : unit->vehicle.observations[which[i] - {N}_COMMANDS];
    }}
    return OK;
}}

EXPORT int fmi2SetReal(Unit *unit, const reference *which, size_t count, const double *values) {{
    for (size_t i = 0; i < count; i++) {{
        if (which[i] >= {N}_COMMANDS) return logged(unit, ERROR, "Inputs alone can be set.");
        unit->vehicle.commands[which[i]] = values[i];
    }}
    return OK;
}}

EXPORT int fmi2DoStep(Unit *unit, double now, double length, int keeps) {{
    (void)now, (void)keeps;
    double steps = round(length / {N}_DT);
    char text[160];
    if (!(steps >= 1 && steps < 9e15) || !(fabs(steps * {N}_DT - length) <= {close} * fmax(length, {N}_DT))) {{
        snprintf(text, sizeof text, "A communication step must be a whole number of steps of %.10g s, but is %.10g s.",
                 {N}_DT, length);
        return logged(unit, ERROR, text);
    }}
    switch ({name}_step(&unit->vehicle, (int64_t)steps)) {{
        case {N}_OK: return OK;
{cases}
        default: return logged(unit, ERROR, "The step failed.");
    }}
}}

EXPORT int fmi2CancelStep(Unit *unit) {{ return logged(unit, ERROR, "A step cannot be cancelled."); }}

EXPORT int fmi2GetFMUstate(Unit *unit, void **state) {{
    if (!*state) *state = unit->callbacks.allocate(1, sizeof unit->vehicle);
    if (!*state) return logged(unit, ERROR, "There is no memory for the state.");
    memcpy(*state, &unit->vehicle, sizeof unit->vehicle);
    return OK;
}}

EXPORT int fmi2SetFMUstate(Unit *unit, void *state) {{
    memcpy(&unit->vehicle, state, sizeof unit->vehicle);
    return OK;
}}

EXPORT int fmi2FreeFMUstate(Unit *unit, void **state) {{
    if (*state) unit->callbacks.release(*state);
    *state = NULL;
    return OK;
}}

EXPORT int fmi2SerializedFMUstateSize(Unit *unit, void *state, size_t *size) {{
    (void)state;
    *size = sizeof unit->vehicle;
    return OK;
}}

EXPORT int fmi2SerializeFMUstate(Unit *unit, void *state, char bytes[], size_t size) {{
    if (size < sizeof unit->vehicle) return logged(unit, ERROR, "There is no room for the state.");
    memcpy(bytes, state, sizeof unit->vehicle);
    return OK;
}}

EXPORT int fmi2DeSerializeFMUstate(Unit *unit, const char bytes[], size_t size, void **state) {{
    if (size != sizeof unit->vehicle) return logged(unit, ERROR, "These bytes are no state of this unit.");
    *state = NULL;
    if (!(*state = unit->callbacks.allocate(1, size))) return logged(unit, ERROR, "There is no memory for the state.");
    memcpy(*state, bytes, size);
    return OK;
}}

EXPORT int fmi2GetDirectionalDerivative(Unit *unit, const reference *u, size_t m, const reference *k, size_t n,
                                        const double *d, double *v) {{
    (void)u, (void)m, (void)k, (void)n, (void)d, (void)v;
    return logged(unit, ERROR, "The unit gives no directional derivatives.");
}}

{others}
"""
_NONE = """EXPORT int fmi2{call}(Unit *unit, const void *given, size_t count, const void *values) {{
    (void)given, (void)values;
    return count ? logged(unit, ERROR, "All variables are real.") : OK;
}}
"""
_STATUS = """EXPORT int fmi2Get{call}Status(Unit *unit, int kind, void *value) {{
    (void)unit, (void)kind, (void)value;
    return DISCARD;
}}
"""


def compiled_unit(stepper: StepperBase, name: str) -> bytes:
    """A stepper as the content of a unit without Python, called `name`; raises ArgumentError without a C compiler."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None or platform.system() == "Windows":
        raise ArgumentError(
            "A unit without Python is compiled: install a C compiler, such as gcc, whose command is `cc`."
        )
    own, glue, parts = sources(stepper, "unit", {})
    code = exported_code(linked(parts))
    guid = f"{{{uuid.UUID(bytes=hashlib.sha256(code + own.encode() + glue.encode()).digest()[:16])}}}"
    cases = [
        f'        case UNIT_{key}: return logged(unit, ERROR, "{words[0].upper()}{words[1:]}.");'
        for key, (_, words) in ERRORS.items() if key not in ("OK", "ARGUMENT")
    ]  # fmt: skip
    cases.append('        case UNIT_ARGUMENT: return logged(unit, ERROR, "A command must be finite.");')
    others = [
        _NONE.format(call=f"{verb}{kind}") for verb in ("Get", "Set") for kind in ("Integer", "Boolean", "String")
    ]
    others += [_NONE.format(call=call) for call in ("SetRealInputDerivatives", "GetRealOutputDerivatives")]
    others += [_STATUS.format(call=call) for call in ("", "Real", "Integer", "Boolean", "String")]
    words = {"name": "unit", "N": "UNIT", "guid": guid, "time": stepper.face.time, "close": CLOSE}
    wrapper = _SOURCE.format(**words, cases="\n".join(cases), others="\n".join(others))
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        contents = {"unit.h": own, "unit.c": glue, "fmi.c": wrapper}
        for file, text in contents.items():
            (here / file).write_text(text, encoding="utf-8")
        (here / "unit_code.o").write_bytes(code)
        flags = ["-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"]
        call = [compiler, *flags, "fmi.c", "unit.c", "unit_code.o", "-o", "unit.so", "-lm"]
        done = subprocess.run(call, cwd=here, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ArgumentError(f"The C compiler {compiler} failed: {done.stderr.strip().splitlines()[-1:]}.")
        library = (here / "unit.so").read_bytes()
    kept, ending = io.BytesIO(), {"Darwin": "dylib"}.get(platform.system(), "so")
    with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "modelDescription.xml", tostring(_description(stepper, name, guid), "utf-8", xml_declaration=True)
        )
        archive.writestr(f"binaries/{platform.system().lower()}64/{name}.{ending}", library)
    return kept.getvalue()


def _description(stepper: StepperBase, name: str, guid: str) -> Element:
    """The model's description (FMI 2.0, 2.2)."""
    face, commands = stepper.face, of_lanes(stepper._buffers.state)[0][list(stepper.face.commanded)]
    title = f"{face.title}, in steps of {face.dt:g} s"
    known = {"fmiVersion": "2.0", "modelName": name, "guid": guid, "description": title, "generationTool": "coadjoint"}
    root = Element("fmiModelDescription", {**known, "variableNamingConvention": "structured"})
    able = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUstate", "canSerializeFMUstate")
    SubElement(root, "CoSimulation", {"modelIdentifier": name, **dict.fromkeys(able, "true")})
    categories = SubElement(root, "LogCategories")
    for one in ("logStatusWarning", "logStatusError"):
        SubElement(categories, "Category", name=one)
    SubElement(root, "DefaultExperiment", startTime=repr(float(stepper.t)), stepSize=repr(face.dt))
    listed, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    inputs, outputs = variables(face.commands), variables(face.observations)
    for place, one in enumerate([*inputs, *outputs]):
        causality = "input" if place < len(inputs) else "output"
        more = {"variability": "continuous", **({} if place < len(inputs) else {"initial": "calculated"})}
        more |= {"name": one, "valueReference": str(place), "causality": causality}
        scalar = SubElement(listed, "ScalarVariable", more)
        SubElement(scalar, "Real", {"start": repr(float(commands[place]))} if place < len(inputs) else {})
    for kind in ("Outputs", "InitialUnknowns") if outputs else ():
        unknowns = SubElement(structure, kind)
        for place in range(len(outputs)):
            SubElement(unknowns, "Unknown", index=str(len(inputs) + place + 1))
    return root
