"""A plan as an FMU: FMI 3.0 co-simulation, built from the exported C code, with its sources inside."""

import hashlib
import io
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ..errors import ExportError
from .c_source import fill
from .plan import ExportPlan

_TYPES = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String")
_ABSENT = (
    *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in (*_TYPES, "Binary", "Clock", "FMUState")),
    *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("IntervalDecimal", "IntervalFraction")),
    *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in ("ShiftDecimal", "ShiftFraction")),
    *("GetNumberOfVariableDependencies", "GetVariableDependencies", "FreeFMUState", "SerializedFMUStateSize"),
    *("SerializeFMUState", "DeserializeFMUState", "GetDirectionalDerivative", "GetAdjointDerivative"),
    *("EnterConfigurationMode", "ExitConfigurationMode", "EvaluateDiscreteStates", "UpdateDiscreteStates"),
    *("EnterContinuousTimeMode", "CompletedIntegratorStep", "SetTime", "SetContinuousStates"),
    *("GetContinuousStateDerivatives", "GetEventIndicators", "GetContinuousStates", "EnterEventMode"),
    *("GetNominalsOfContinuousStates", "GetNumberOfEventIndicators", "GetNumberOfContinuousStates"),
    *("GetOutputDerivatives", "ActivateModelPartition"),
)
_UNITS = {
    "-": ("1", ""),
    "1/s": ("1/s", 's="-1"'),
    "Pa, absolute": ("Pa", 'kg="1" m="-1" s="-2"'),
    "Pa/s": ("Pa/s", 'kg="1" m="-1" s="-3"'),
    "N": ("N", 'kg="1" m="1" s="-2"'),
    "kg/s": ("kg/s", 'kg="1" s="-1"'),
    "m^3": ("m3", 'm="3"'),
    "m^3/Pa": ("m3/Pa", 'kg="-1" m="4" s="2"'),
}
_WORDS = {
    "eps": ("-", "contraction ratio (L0 - L)/L0"),
    "deps": ("1/s", "rate of the contraction ratio"),
    "P": ("Pa, absolute", "gas pressure, absolute"),
    "dP": ("Pa/s", "rate of the gas pressure"),
    "V": ("m^3", "gas volume"),
    "V_eps": ("m^3", "derivative of the volume by the contraction ratio"),
    "V_P": ("m^3/Pa", "derivative of the volume by the pressure"),
}


def fmu(plan: ExportPlan, sources: Mapping[str, str], compiler: str | None = None) -> bytes:
    """Compile the C code of a plan and pack it."""
    starts = dict(zip(("eps", "deps", "P", "dP"), plan.centre, strict=True))
    token = hashlib.sha256("".join(sources.values()).encode()).hexdigest()[:32]
    wrapper = fill(
        "fmi3.c",
        {
            "NAME_UPPER": plan.name.upper(),
            "NAME": plan.name,
            "TOKEN": token,
            "STARTS": ", ".join(repr(float(v)) for v in starts.values()),
            "ABSENT": "\n".join(f"ABSENT({name})" for name in _ABSENT),
            **_memory_parts(plan),
        },
    )
    kept = {name: text for name, text in sources.items() if not name.endswith("_selftest.c")}
    code = kept | {f"{plan.name}_fmi3.c": wrapper}
    folder, ending = binary_folder(3)
    entries: dict[str, bytes] = {
        "modelDescription.xml": _description(plan, token, starts).encode(),
        "sources/buildDescription.xml": _build(plan, code).encode(),
        f"binaries/{folder}/{plan.name}{ending}": compiled(code, compiler),
    }
    return packed(entries | {f"sources/{name}": text.encode() for name, text in code.items()})


def _memory_parts(plan: ExportPlan) -> dict[str, str]:
    """Return the parts of the wrapper that differ for a model with memory."""
    name = plan.name
    given = ", ".join(f"({name}_real)m->x[{k}]" for k in range(4))
    if plan.memory is None:
        return {
            "WHAT": "The outputs are functions of the present inputs; there are no states.",
            "TAKE": f"    const {name}_state s = {{{given}}};\n",
            **dict.fromkeys(("INSTANCE", "RESET", "STEP"), ""),
        }
    reading = f"const {name}_reading r = {{{given}}};"
    return {
        "WHAT": "A step takes in the inputs as a reading; the first one begins.",
        "INSTANCE": f"\n    bool begun;\n    {name}_state state;",
        "RESET": "\n    m->begun = false;",
        "TAKE": (f"    {reading}\n    {name}_state s = m->state;\n    if (!m->begun)\n        {name}_begin(&s, &r);\n"),
        "STEP": (
            f"\n    {{\n        {reading}\n        if (m->begun)\n            {name}_follow(&m->state, &r, "
            f"({name}_real)step);\n        else\n            {name}_begin(&m->state, &r);\n        m->begun = true;\n"
            "    }"
        ),
    }


def binary_folder(version: int) -> tuple[str, str]:
    """Return the folder of this machine's binaries in an FMU of FMI 2 or 3, and the ending of their names."""
    system = {"linux": "linux", "darwin": "darwin", "win32": "windows"}.get(sys.platform, sys.platform)
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine())
    ending = {"darwin": ".dylib", "windows": ".dll"}.get(system, ".so")
    if version == 2:
        short = {"windows": "win"}.get(system, system)
        return f"{short}{64 if sys.maxsize > 2**32 else 32}", ending
    return f"{machine}-{system}", ending


def packed(entries: Mapping[str, bytes]) -> bytes:
    """Return files as a zip archive that depends on nothing but their contents."""
    found = io.BytesIO()
    with zipfile.ZipFile(found, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(entries.items()):
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content)
    return found.getvalue()


def compiled(code: Mapping[str, str], compiler: str | None = None) -> bytes:
    """Return C code compiled to a shared library; raise where there is no compiler or it fails."""
    wanted = [compiler] if compiler else [os.environ.get("CC", ""), "cc", "gcc", "clang"]
    found = next((shutil.which(c) for c in wanted if c and shutil.which(c)), None)
    if found is None:
        raise ExportError(
            f"There is no C compiler ({', '.join(c for c in wanted if c)}).",
            "one, to build the FMU's binary",
            "Install gcc or clang, set CC, or export with --to c and build elsewhere.",
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, text in code.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        units = [n for n in code if n.endswith(".c")]
        flags = ["-std=c99", "-O3", "-shared", "-fPIC", "-fvisibility=hidden"]
        command = [found, *flags, *units, "-lm", "-o", "model.bin"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise ExportError(
                f"{found} failed: {' '.join(done.stderr.split())[:200]}.", "a C99 compiler", "Set CC to another one."
            )
        return (Path(folder) / "model.bin").read_bytes()


def _description(plan: ExportPlan, token: str, starts: Mapping[str, float]) -> str:
    variables = ['    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>']
    words = dict(_WORDS) | {o.name: (o.unit, f"predicted {o.name}") for o in plan.outputs}
    inputs, outputs = list(starts), [*(o.name for o in plan.outputs), "V", "V_eps", "V_P"]
    used = {words[n][0] for n in (*inputs, *outputs)}
    for reference, name in enumerate([*inputs, *outputs], 1):
        unit, text = words[name]
        kind = "input" if name in starts else "output"
        start = f' start="{float(starts[name])!r}"' if name in starts else ""
        variables.append(
            f'    <Float64 name="{name}" valueReference="{reference}" causality="{kind}" variability="continuous" '
            f"description={quoteattr(text)} unit={quoteattr(_UNITS[unit][0])}{start}/>"
        )
    units = [f"    <Unit name={quoteattr(_UNITS[u][0])}><BaseUnit {_UNITS[u][1]}/></Unit>" for u in sorted(used)]
    dependencies = " ".join(str(k) for k in range(1, len(inputs) + 1))
    structure = [
        f'    <{kind} valueReference="{k}" dependencies="{dependencies}"/>'
        for kind in ("Output", "InitialUnknown")
        for k in range(len(inputs) + 1, len(inputs) + len(outputs) + 1)
    ]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription fmiVersion="3.0" modelName="{plan.name}" description={quoteattr(plan.title)} '
            f'generationTool="pamid" instantiationToken="{token}">',
            f'  <CoSimulation modelIdentifier="{plan.name}" canHandleVariableCommunicationStepSize="true"/>',
            "  <UnitDefinitions>",
            *units,
            "  </UnitDefinitions>",
            '  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.001"/>',
            "  <ModelVariables>",
            *variables,
            "  </ModelVariables>",
            "  <ModelStructure>",
            *structure,
            "  </ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _build(plan: ExportPlan, code: Mapping[str, str]) -> str:
    files = "\n".join(f'      <SourceFile name="{n}"/>' for n in sorted(code) if n.endswith(".c"))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<fmiBuildDescription fmiVersion="3.0">\n'
        f'  <BuildConfiguration modelIdentifier="{plan.name}">\n'
        f'    <SourceFileSet language="C99">\n{files}\n    </SourceFileSet>\n'
        '    <Library name="m"/>\n  </BuildConfiguration>\n</fmiBuildDescription>\n'
    )
