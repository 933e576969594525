"""Numbers that pages quote are those of the recorded blocks of ``benchmarks/figures.md``."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
if not (ROOT / "benchmarks" / "_record.py").is_file():
    pytest.skip("needs the repository", allow_module_level=True)


def recorded() -> dict[str, str]:
    """The output of each recorded block, by its name."""
    import sys

    spec = importlib.util.spec_from_file_location("_record", ROOT / "benchmarks" / "_record.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return {b.name: b.output for b in module.blocks((ROOT / "benchmarks" / "figures.md").read_text(encoding="utf-8"))}


def page(name: str) -> str:
    """The text of a page, its lines joined."""
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


def line(text: str, start: str) -> list[str]:
    """What follows a name at the start of a line, in words; the line is there once."""
    (found,) = re.findall(rf"^{re.escape(start)} +(.*)$", text, re.M)
    return str(found).split()


FREE_RUNS = (
    "LiftedLoad(StaticPIHM)",
    "ForwardModel(direction)",
    "NNARX",
    "NNARX(one step)",
    "PolynomialNARX",
    "PolynomialNARX(one step)",
)


def quoted(blocks: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Each page and what it says, written from the blocks."""
    ratios = [float(row.split()[7]) for row in re.findall(r"^(?:force|flow) .*$", blocks["training-step"], re.M)]
    span = f"{min(ratios):.2f} to {max(ratios):.2f}"
    yield "docs/theory-hybrid.md", f"no second backward pass and takes {span} of the time"
    yield "benchmarks/targets.md", f"on quiet cores {span},"

    def cycle(calls: str, flags: str) -> float:
        found = re.findall(
            rf"^four evaluations in C, {calls} *, float64, {re.escape(flags)} +median +([\d.]+)",
            blocks["control-cycle"],
            re.M,
        )
        return float(found[0])

    plain, avx2 = cycle("one call", "-O3"), cycle("one call", "-O3 -march=x86-64-v3")
    one, four = cycle("one call", "-O3 -DFORCE_ONE_VERSION"), cycle("four calls", "-O3 -DFORCE_ONE_VERSION")
    yield "docs/export.md", f"take {plain:.1f} µs in one call"
    yield "docs/export.md", f"and {one:.1f} µs without AVX2"
    yield "benchmarks/figures.md", f"it is {one:.1f} µs; there four calls are the quicker way ({four:.1f} µs)"
    yield "benchmarks/targets.md", f"{avx2:.1f} µs with AVX2, {plain:.1f} µs with plain `-O3`"
    yield "benchmarks/targets.md", f"{four:.1f} µs in four calls, {one:.1f} µs in one"

    left_out = [line(blocks["festo"], f"{length} cm, all contractions")[-1] for length in (20, 30, 40)]
    yield "benchmarks/figures.md", "its pooled error is {}, {} and {} of the plain network's".format(*left_out)
    memory = line(blocks["festo"], "StaticPIHM(effects=...)")[:3]
    yield "benchmarks/targets.md", "{}, {}, {} N with `StaticPIHM(effects=".format(*memory)

    lift, force, festo = (
        line(blocks[name], "jax-sysid")[0] for name in ("peers-dynamic", "peers-force", "peers-festo")
    )
    yield "docs/choosing.md", f"| jax-sysid | {1000 * float(lift):.3f} | {force} | {float(festo):.2f} |"
    free = {name: line(blocks["choosing-dynamic"], name) for name in FREE_RUNS}
    once, model = (float(free[name][-2]) for name in ("LiftedLoad(StaticPIHM)", "ForwardModel(direction)"))
    yield "docs/choosing.md", f"the latter runs {once / model:.0f} times faster"
    worse = [float(free[f"{name}(one step)"][0]) / float(free[name][0]) for name in ("PolynomialNARX", "NNARX")]
    yield "docs/choosing.md", "the error of `PolynomialNARX` by {:.1f} and that of `NNARX` by {:.1f}".format(*worse)
    fits = [found for found in re.findall(r"^InverseModel .*? {2,}([\d.]+) ", blocks["inverse-model"], re.M)]
    yield "benchmarks/targets.md", f"| {min(fits)} to {max(fits)} s of one core |"

    steps = blocks["inverse-control"].split("untrained loads, ")
    usual, twice = (part for part in steps if part.startswith(("trained friction", "twice the friction")))
    column = {"sine": 1, "steps": 2}

    def tracked(part: str, name: str, task: str) -> float:
        return float(re.findall(r"([\d.]+) \(", re.findall(rf"^{re.escape(name)} .*$", part, re.M)[0])[column[task]])

    alone, inverse, learning = "PID alone", "inverse model + PID", "inverse model, learning online + PID"
    share = {
        (part is twice, name): tracked(part, name, "sine") / tracked(part, alone, "sine")
        for part in (usual, twice)
        for name in (inverse, learning)
    }
    yield (
        "docs/choosing.md",
        f"{100 * share[True, learning]:.0f} % of the error of PID alone; {100 * share[True, inverse]:.0f} % without",
    )
    yield (
        "docs/inverse.md",
        f"{share[False, inverse]:.2f} times the error of PID alone (with twice the friction, "
        f"{share[True, inverse]:.2f} times)",
    )
    yield (
        "docs/inverse.md",
        f"learning online, the factors are {share[False, learning]:.2f} and {share[True, learning]:.2f}.",
    )
    yield "benchmarks/targets.md", f"{share[True, inverse]:.2f}; learning online {share[True, learning]:.2f}"
    yield (
        "docs/inverse.md",
        f"the error is {tracked(twice, inverse, 'steps')} % with the inverse model, "
        f"{tracked(twice, alone, 'steps')} % with PID alone",
    )

    told = re.findall(r"told in (\d+) of (\d+), delay median (\d+) s, largest (\d+) s", blocks["changes"])
    tenth = re.findall(r"by 10 %: told in 3 of 3, delay median (\d+) s, largest (\d+) s", blocks["changes"])
    assert all(found == of for found, of, *_ in told)
    medians, largest = ([int(one[k]) for one in tenth] for k in (0, 1))
    median = f"{min(medians)} to {max(medians)} s"
    yield "docs/streaming.md", f"| median time to detect a 10 % change of the force | {median} ("
    yield "docs/streaming.md", f"| longest time to detect it | {max(largest)} s"
    named = re.findall(r"^(\w+) .* (\d+) streams: named rightly within 2 s 100.0%", blocks["streaming-runs"], re.M)
    streams = {who: sum(int(n) for name, n in named if name == who) for who, _ in named}
    assert len(set(streams.values())) == 1
    yield (
        "docs/streaming.md",
        "| a leak or friction named within 2 s by `GapMonitor` and `OnlineAdapter` "
        f"| in all of {streams['GapMonitor']} streams |",
    )
    (rate,) = re.findall(r"([\d,]+) a second of one core", blocks["streaming-samples"])
    yield "docs/streaming.md", f"`OnlineAdapter` processes per second on one core | {rate} in CPU time"
    peak, bound = re.findall(r"parquet +\d+ MB +100000 +[\d.]+ +(\d+) +(\d+)", blocks["large-logs"])[0]
    yield "docs/distributed.md", f"- measured: {peak} MB for 10⁷ rows in pieces of 100,000."
    assert int(peak) <= int(bound)

    def at(block: str, name: str, log: int) -> float:
        return float(line(blocks[block], name)[log - 1].rstrip("*"))

    leak = [f"{at('other-benches-flow', name, 3):g}" for name in ("ThermodynamicPIHM", "SINDyRegressor")]
    yield "docs/choosing.md", "a leak fills no volume: the hybrid's error is {} mg/s, against {} mg/s".format(*leak)
    geometry, learnt, friction = (
        at("other-benches-inverse", name, log)
        for name, log in (("InvertedForce(tondu_lopez)", 1), ("InverseModel", 1), ("InvertedForce(tondu_lopez)", 2))
    )
    directed = at("other-benches-inverse", "InverseModel(direction)", 2)
    beyond = f"error {geometry:.2f} kPa, `InverseModel` {learnt:.1f} kPa; but with Coulomb friction"
    yield "docs/choosing.md", f"{beyond} {friction:.1f} kPa, `InverseModel(direction)` {directed:.1f} kPa"
    runs = [at("other-benches-dynamic", "ForwardModel(direction)", log) for log in (1, 2, 3)]
    rows = re.findall(
        r"^(?!dynamic)(.*?) {2,}([\d.]+)\*? +([\d.]+)\*? +([\d.]+)", blocks["other-benches-dynamic"], re.M
    )
    assert len(rows) > 8 and all(sum(float(row[k]) < run for row in rows) <= 1 for k, run in enumerate(runs, 1))
    yield "docs/choosing.md", f"`ForwardModel(direction)` is best or second ({min(runs):.1f} to {max(runs):.1f} kPa)"
    arms = re.findall(r"^\| ([^|]*) \| \**([\d.]+)", (ROOT / "docs/published.md").read_text(encoding="utf-8"), re.M)
    arm = {simulator: error for simulator, error in arms}
    ours, vendor = arm["pamid: causes it names"], arm["a vendor's fit to another arm"]
    beside = f"for comparison, a vendor's fit: {vendor} mrad"
    yield "docs/measured.md", f"| {arm['public model']} → {ours} mrad | {beside} |"
    yield "docs/published.md", f"| absolute | 14 mrad | {ours} mrad |"
    opinions = blocks["second-opinion"]
    causes, fits = re.findall(r"(\d+) causes on 4 simulators, (\d+) fits", opinions)[0]
    biased, told, rate = re.findall(r"absorbed a cause: (\d+), told (\d+) \((\d+)%", opinions)[0]
    clean, accused = re.findall(r"clean: (\d+), accused (\d+)", opinions)[0]
    assert accused == "0"
    faulty = int(fits) - int(clean)
    yield "docs/published.md", f"| to logs with a cause ({causes} kinds) | {faulty} |"
    yield "docs/published.md", f"| of these, with a biased parameter | {biased} |"
    yield "docs/published.md", f"| of the {biased}, cause found by pamid | {told} ({rate} %) |"
    yield "docs/published.md", f"| to logs without a cause | {clean} |"
    bound = 100 * (1 - 0.05 ** (1 / int(clean)))  # 95 % of none in so many
    yield "docs/published.md", f"| of these, false alarms | {accused} (95 % bound: {bound:.1f} %) |"
    arm_block = blocks["published-so101"]
    bands, lags = (
        sorted(1e3 * float(x) for x in re.findall(rf"(?:{kind}) ([\d.]+)", arm_block))
        for kind in ("half_width", "lag time_constant|delay delay")
    )
    yield "docs/published.md", f"dead bands of ±{bands[1]:.0f} to ±{bands[-1]:.0f} mrad (jaw ±{bands[0]:.0f})"
    yield "docs/published.md", f"delays or lags of {lags[0]:.0f} to {lags[-1]:.0f} ms"
    yield "docs/published.md", f"take {re.findall(r'([0-9]+) s of CPU for 6 diag', arm_block)[0]} s of CPU time"
    common = r"kp\^-[\d.]+ kv\^-[\d.]+ armature\^-"  # all in one direction
    steps = [
        re.findall(rf"{joint}: (\d+) mrad.*; ([\d.]+) mrad for {common}", arm_block)[0] for joint in ("pan", "roll")
    ]
    (most, least), (most_roll, least_roll) = steps
    yield "docs/published.md", f"its own factor of 1.2 to 1.8 | {least} mrad | {least_roll} mrad |"
    yield "docs/published.md", f"| the best-determined | {most} mrad | {most_roll} mrad |"
    aim = "of those named without reservations"
    (wrong,) = re.findall(rf"{aim} .*?\*\*missed\*\*", page("docs/withheld.md"))
    share = re.findall(r"([\d.]+) % \(", wrong)[0]
    yield "docs/withheld.md", f"It is missed: {share} % were **measured**"
    yield (
        "docs/diagnosis.md",
        f"Of the causes named without reservations, at most 5 % should be wrong; [{share} % were](withheld.md#results)",
    )
    yield "docs/theory-diagnosis.md", f"[{share} % were](withheld.md#results)"


def test_pages_quote_what_was_recorded() -> None:
    said = list(quoted(recorded()))
    assert len(said) >= 13
    wrong = [f"{name} does not say: {text}" for name, text in said if text not in page(name)]
    assert not wrong, "\n".join(wrong)


MARK = re.compile(r"^<!-- from: (?P<sources>[^>]*?) -->\n(?P<passage>.*?)(?=\n\n|\Z)", re.M | re.S)
"""A passage whose numbers all come from recorded blocks or from sections of other pages: `from: BLOCK, PAGE#TITLE`."""
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:,\d{3})*(?:\.\d+)?(?:e[+-]\d+)?(?!\w)")
UNITS = (1.0, 1e3, 1e-3, 1e6)
"""What a page may multiply by: N to mN, Pa to kPa, kg/s to mg/s."""


def numbers(text: str) -> list[str]:
    """The numbers of a text, without those of code and of links."""
    text = re.sub(r"`[^`]*`|\]\([^)]*\)", " ", text).replace("−", "-")
    return [found.replace(",", "") for found in NUMBER.findall(text)]


def agrees(shown: str, source: str) -> bool:
    """Whether a number is that of the source, in one of the units, to the digits shown."""
    last = 0.5 * 10.0 ** -len(shown.partition(".")[2])
    units = UNITS if "." in shown or len(shown) > 2 else UNITS[:1]  # two digits agree with something by chance
    return any(abs(float(source) * unit - float(shown)) <= last * (1 + 1e-6) for unit in units)


def source_lines(source: str, blocks: dict[str, str]) -> list[str]:
    """The lines of a block, or of a page's section under a title."""
    if source in blocks:
        return blocks[source].splitlines()
    name, _, title = source.partition("#")
    text = (ROOT / name).read_text(encoding="utf-8")
    if title:
        (text,) = re.findall(rf"^#+ {re.escape(title)}\n(.*?)(?=^#|\Z)", text, re.M | re.S)
    return str(text).splitlines()


def disagreements(text: str, blocks: dict[str, str]) -> list[str]:
    """Numbers of marked passages that their sources lack; a row of a table is compared with the rows of its name."""
    wrong = []
    for mark in MARK.finditer(text):
        lines = [row for s in mark["sources"].split(",") for row in source_lines(s.strip(), blocks)]
        table = mark["passage"].startswith("|")
        for row in mark["passage"].splitlines()[2 if table else 0 :]:
            name, _, rest = row.strip("| ").partition(" | ") if table else ("", "", row)
            plain = name.replace("`", "")
            own = [
                at for at in lines if plain and at.strip("| ").replace("`", "").startswith((plain + " ", plain + "("))
            ]
            found = {number for at in own or lines for number in numbers(at)}
            wrong += [f"{n} in: {row}" for n in numbers(rest) if not any(agrees(n, at) for at in found)]
    return wrong


MARKED = (
    "README.md", "docs/adaptation.md", "docs/choosing.md", "docs/inverse.md", "docs/published.md",
    "benchmarks/targets.md",
)  # fmt: skip


@pytest.mark.parametrize("name", MARKED)
def test_marked_passages_hold_only_recorded_numbers(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert MARK.search(text)
    wrong = disagreements(text, recorded())
    assert not wrong, "\n".join(wrong)


LINK = re.compile(r"\]\((?:\.\./)?(?P<page>benchmarks/[\w/]+\.md|withheld\.md)#(?P<anchor>[\w-]+)\)")
"""A link to a section with what was measured."""
PAGES = ["README.md", *(f"docs/{page.name}" for page in sorted((ROOT / "docs").glob("*.md")))]


def section(name: str, anchor: str) -> str:
    """The section of a page, with those below it, blocks as text."""
    text, found, level = (ROOT / name).read_text(encoding="utf-8"), list[str](), 0
    for row in text.splitlines():
        if title := re.match(r"(#+) (.*)", row):
            slug = re.sub(r"[^\w\- ]", "", title[2].lower()).replace(" ", "-")
            if level and len(title[1]) <= level:
                break
            level = level or (len(title[1]) if slug == anchor else 0)
        if level and not row.startswith("```"):
            found.append(row)
    assert found, f"{name} has no section {anchor}"
    return "\n".join(found)


def unmeasured(text: str) -> list[str]:
    """Numbers of sentences with a link to a section that this section lacks."""
    wrong = []
    for sentence in re.split(r"(?<=[.)|])\s+(?=[A-Z`|*-])", re.sub(r"```.*?```", "", text, flags=re.S)):
        for link in LINK.finditer(sentence):
            name = link["page"] if link["page"].startswith("benchmarks") else f"docs/{link['page']}"
            own = re.sub(r"\[doi\]\([^)]*\)", "", sentence)
            there = numbers(section(name, link["anchor"]).replace("`", ""))
            wrong += [f"{n} in: {own}" for n in numbers(own) if not any(agrees(n, at) for at in there)]
    return wrong


def test_sentences_hold_the_numbers_of_the_section_that_they_link() -> None:
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in PAGES}
    assert sum(len(LINK.findall(text)) for text in texts.values()) >= 12
    wrong = [f"{name}: {one}" for name, text in texts.items() for one in unmeasured(text)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("name", "pictures"), [("README.md", ["arm"]), ("docs/index.md", ["landing", "landing-narrow"])]
)
def test_captions_hold_the_numbers_of_their_pictures(name: str, pictures: list[str]) -> None:
    """The last panel says how far the error falls; the page repeats it."""
    said = numbers((ROOT / name).read_text(encoding="utf-8").partition("**4**")[2].partition("\n\n")[0])
    assert len(said) >= 2
    for picture in pictures:
        drawn = (ROOT / "docs" / "images" / f"{picture}.svg").read_text(encoding="utf-8")
        shown = re.findall(r"<text[^>]*>(-?[\d.]+)<", drawn.replace("−", "-"))
        assert not [n for n in said if not any(agrees(n, at) for at in shown)], (picture, said, shown)


def test_a_number_that_a_linked_section_lacks_is_noticed() -> None:
    link = "([measured](../benchmarks/figures.md#changes-of-a-stream))"
    assert unmeasured(f"It was 7. None of 300 streams raises an alarm {link}. It is 8.") == []
    assert len(unmeasured(f"None of 301 streams raises an alarm {link}.")) == 1


def test_a_number_that_is_not_recorded_is_noticed() -> None:
    blocks = {"fits": "MLP   1.77  2.52\nother 3.14\n", "pressures": "MLP 1.34e+04\n"}
    table = (
        "<!-- from: fits, pressures -->\n| | N | s | kPa |\n| --- | --- | --- | --- |\n| `MLP` | 1.8 | {} | 13.4 |\n"
    )
    assert disagreements(table.format("2.52"), blocks) == []
    assert len(disagreements(table.format("3.14"), blocks)) == 1
    assert disagreements("<!-- from: fits -->\nIt takes 2.5 s.\n", blocks) == []
    assert len(disagreements("<!-- from: fits -->\nIt takes 2.6 s.\n", blocks)) == 1
