"""The page of the benchmark: a table and a figure from the files of ``results``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from benchmarks.causes.entry import NAMES
from benchmarks.causes.make import published
from benchmarks.causes.methods import METHODS
from benchmarks.causes.tracks import EDITIONS, REAL, SEED, TRACKS, VERSION
from docs.studies.page_text import as_stamped
from tunnel_sim.files.reading import read_json
from tunnel_sim.vocabulary.errors import TunnelError, counted, shown

ROOT = Path(__file__).parents[2]
RESULTS = Path(__file__).parent / "results"
PAGE = ROOT / "docs" / "benchmark-of-causes.md"
FIGURE = ROOT / "docs" / "images" / "benchmark-of-causes.png"
OURS = "ours"
_TRACKS = (*TRACKS, REAL)
_SCATTERING = 2  # the version with runs that do not repeat


def results_of(version: int) -> Path:
    """The folder of the results on a version of the set."""
    return RESULTS if version == VERSION else RESULTS / f"v{version}"


def read_results(folder: Path = RESULTS, version: int = VERSION) -> list[dict[str, Any]]:
    """The results, in decreasing order of the share of exact sets.

    Args:
        folder: folder of one file for each method.
        version: version of the set.

    Raises:
        TunnelError: when a file is not a result, or belongs to another set.
    """
    found = []
    for path in sorted(folder.glob("*.json")):
        r = read_json(path, remedy="score the answers again")
        if r.get("version") != version or r.get("differing", []) is None:
            what = f"is not a result on the published set, version {version}"
            remedy = f"score answers to the set that 'make --version {version}' makes"
            raise TunnelError(what, where=shown(path), remedy=remedy)
        found.append(r)
    return sorted(found, key=lambda r: -_share(r["all"]["exact"]))


def _share(given: Mapping[str, Any]) -> float:
    return given["count"] / given["total"] if given["total"] else 0.0


def write_page() -> Path:
    """Write page and figure, and return the page's file."""
    found = read_results(RESULTS)
    scattering = read_results(RESULTS / f"v{_SCATTERING}", _SCATTERING)
    _draw(found, FIGURE)
    text = page_text(found, f"images/{FIGURE.name}", scattering)
    PAGE.write_text(
        text if not PAGE.exists() else as_stamped(text, PAGE.read_text("utf-8")), encoding="utf-8"
    )
    return PAGE


def page_text(
    results: Sequence[Mapping[str, Any]], image: str, scattering: Sequence[Mapping[str, Any]] = ()
) -> str:
    """The page.

    Args:
        results: best first.
        image: address of the figure.
        scattering: results on the campaigns with runs that do not repeat, best first.
    """
    parts = [
        "# Benchmark of causes\n",
        *_where_others_win(results),
        f"\nThe set has {sum(t.count for t in TRACKS.values())} simulated campaigns (version {VERSION}, "
        f"seed {SEED}) and "
        "the packaged measured records. [How it is made, and how to enter](../benchmarks/causes/README.md). "
        f"`python -m benchmarks.causes page` writes this page from answers scored {_scored(results)}; nothing in "
        "it is typed by hand. Intervals are Wilson's at 95 %. A method that cannot see a track has “–”.\n",
        "## Sets exactly right\n",
        _table(("method", "all", *(t.replace("_", " ") for t in _TRACKS)), [_exact(r) for r in results]),
        f"\n![Sets exactly right by method, with intervals]({image})\n",
        "## Causes, probabilities and time\n",
        _table(
            (
                "method",
                "causes found",
                "of those it can name",
                "named causes false",
                "log score, nats",
                "calibration error of inclusion",
                "true set in the 90 % set",
                "its size",
                "s of processor, median",
            ),
            [_causes(r) for r in results],
        ),
        "\nThe log score is the mean over campaigns of the log probability of what acts and what does "
        "not; 0 is best, and "
        "probabilities count as at least 0.01. The 90 % set is the smallest set of answers that together "
        "have nine tenths. "
        "The calibration error is the smooth one of the blind check.\n",
        *_coefficients_table(results),
        *_scatter_table(scattering),
        "\n## The methods\n",
        "The columns and the threshold that LISDD's recipe, the spike-and-slab regression and PySINDy use were "
        "chosen with knowledge of the truths of the first 40 campaigns; no other setting was tuned on the set, "
        "unless its row says so.\n",
        *[_about(r, results) for r in results],
        *[_about(r, scattering) for r in scattering if r["method"] not in {one["method"] for one in results}],
    ]
    return "\n".join(parts).rstrip() + "\n"


def _where_others_win(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Tracks and scores in which another method is better than ours on the campaigns that both answered."""
    ours = next((r for r in results if r["method"] == OURS), None)
    if ours is None:
        return ["`tunnel diagnose` has not been run on this set yet."]
    said = []
    for r in results:
        both = sorted(set(r["cases"]) & set(ours["cases"])) if r is not ours else []
        other, mine = _right(r, both), _right(ours, both)
        if other > mine:
            said.append(
                f"- **{r['title']}** has more exact sets: {other} against {mine} of the {len(both)} that "
                f"both answered."
            )
        for track in r["tracks"]:
            members = [n for n in both if r["cases"][n]["track"] == track]
            other, mine = _right(r, members), _right(ours, members)
            if other > mine:
                name, part = (
                    track.replace("_", " "),
                    "" if r["answered"] == r["of"] else " that both answered",
                )
                said.append(
                    f"- **{r['title']}** is ahead on *{name}*: {other} against {mine} of {len(members)}{part}."
                )
        if (
            r is not ours
            and r["answered"] == ours["answered"]
            and r["all"]["log_score"] > ours["all"]["log_score"]
        ):
            said.append(f"- **{r['title']}** has the better log score.")
    head = "Where another method is ahead of `tunnel diagnose`:\n" if said else (
        "No other method is ahead of `tunnel diagnose` on a track or in all."
    )  # fmt: skip
    if ours["answered"] < ours["of"]:
        head = f"`tunnel diagnose` has answered {ours['answered']} of {ours['of']} campaigns so far. {head}"
    return [head, *said]


def _right(r: Mapping[str, Any], names: Sequence[str]) -> int:
    return sum(bool(r["cases"][name]["right"]) for name in names)


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] + ["---:"] * (len(heads) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _proportion(given: Mapping[str, Any] | None, *, interval: bool = True) -> str:
    if not given or not given["total"]:
        return "–"
    text = f"{given['count']}/{given['total']}"
    if not interval:
        return text
    low, high = given["wilson_95"]
    return f"{text} ({100 * low:.0f}–{100 * high:.0f} %)"


def _title(r: Mapping[str, Any]) -> str:
    return r["title"] if r["answered"] == r["of"] else f"{r['title']} ({r['answered']} of {r['of']} answered)"


def _exact(r: Mapping[str, Any]) -> list[str]:
    tracks = [_proportion(r["tracks"].get(t, {}).get("exact"), interval=False) for t in _TRACKS]
    return [_title(r), _proportion(r["all"]["exact"]), *tracks]


def _causes(r: Mapping[str, Any]) -> list[str]:
    a = r["all"]
    calibrated = a["inclusion_calibration"]
    return [
        _title(r), _proportion(a["found"]), _proportion(r["found_of_nameable"]), _proportion(a["false"]),
        f"{a['log_score']:.2f}", "–" if calibrated is None else f"{calibrated['error']:.3f}",
        _proportion(a["covered"]), f"{a['credible_size']:.1f}", f"{a['seconds']['median']:.2g}",
    ]  # fmt: skip


def _scatter_table(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Campaigns with runs that do not repeat exactly; nothing without results."""
    if not results:
        return []
    edition = EDITIONS[_SCATTERING]
    rows = []
    for r in results:
        tracks = [_proportion(r["tracks"].get(t, {}).get("exact"), interval=False) for t in edition.tracks]
        scatter = r["scatter"] or {}
        told = [
            _proportion(scatter.get(name), interval=False)
            for name in ("named_alone", "no_gap", "false_alarms")
        ]
        rows.append([_title(r), _proportion(r["all"]["exact"]), *tracks, *told])
    heads = (
        "method", "all", *(t.replace("_", " ") for t in edition.tracks), "scatter named, nothing else",
        "as stated: nothing named", "named where runs repeat",
    )  # fmt: skip
    others = "".join(map(_other_set, results))
    return [
        "\n## Runs that do not repeat exactly\n",
        f"Version {_SCATTERING} of the set (seed {edition.seed}) has {sum(edition.counts.values())} campaigns. In "
        "most of them wind speed, springs or damping differ from run to run by chance. Sets are exact whether "
        f"scatter is named or not; how it is named stands beside them. The answers were scored {_scored(results)}."
        + others
        + ("" if OURS in [r["method"] for r in results] else " `tunnel diagnose` has not been run on it yet.")
        + "\n",
        _table(heads, rows),
    ]


def _scored(results: Sequence[Mapping[str, Any]]) -> str:
    """The days on which the answers were scored."""
    days = sorted({date.fromisoformat(r["scored"]) for r in results})
    first, last = (f"{day.day} {day:%B %Y}" for day in (days[0], days[-1]))
    return f"on {first}" if first == last else f"from {first} to {last}"


def _coefficients_table(results: Sequence[Mapping[str, Any]]) -> list[str]:
    rows = [row for r in results if (row := _coefficients(r))]
    if not rows:
        return []
    heads = (
        "method",
        *(h for c in ("Cnβ", "Cnr") for h in (f"{c} within 2 σ", "median error before", "after")),
    )
    return ["## Coefficients\n", _table(heads, rows)]


def _coefficients(r: Mapping[str, Any]) -> list[str]:
    given, row = r["all"]["coefficients"], [_title(r)]
    if not given:
        return []
    for name in ("cn_beta", "cn_r"):
        before, after = given.get(f"{name} before"), given.get(f"{name} after")
        row.append(_proportion(after and after["within_2_std"]))
        row += [
            "–" if one is None else f"{100 * one['median_relative_error']:.2g} %" for one in (before, after)
        ]
    return row


def _about(r: Mapping[str, Any], results: Sequence[Mapping[str, Any]]) -> str:
    ours = next((one for one in results if one["method"] == OURS and r["answered"] < r["of"]), None)
    both = sorted(set(r["cases"]) & set(ours["cases"])) if ours is not None else []
    same = "" if ours is None else (
        f" On the {len(both)} campaigns that both answered it has {_right(r, both)} exact sets, and "
        f"`tunnel diagnose` {_right(ours, both)}."
    )  # fmt: skip
    same += _other_set(r)
    program = f"../benchmarks/causes/methods/{r['method']}.py" if r["method"] in METHODS else r["program"]
    folder = results_of(r["version"]).relative_to(RESULTS.parent).as_posix()
    result = f"../benchmarks/causes/{folder}/{r['method']}.json"
    links = ", ".join([*([f"[program]({program})"] if program else []), f"[result]({result})"])
    every = len(NAMES) + 1  # and `unknown`
    can = f" It can name {len(r['names'])} of {every} answers." if len(r["names"]) < every else ""
    return (
        f"- **{r['title']}** ({links}): {r['setting']}.{can}{same} Processor "
        f"time of all answers: "
        f"{r['all']['seconds']['sum'] / 3600:.2f} h. No answer: {r['all']['no_answer']}. Answers sha256 "
        f"`{r['answers_sha256'][:16]}…`, key `{r['key_sha256'][:16]}…`."
    )


def _other_set(r: Mapping[str, Any]) -> str:
    """The difference of a result's set from the published one, as a sentence; empty if none is known."""
    known = read_json(published(r["version"]), remedy="restore it")["key_sha256"]
    differing = r.get("differing")  # results of earlier days do not record it
    if differing:
        number = counted(len(differing), "campaign")
        return f" In the set of {r['title']}, {number} differed from the published ones."
    if r["key_sha256"] == known:
        return ""
    campaigns = "it is not recorded whether" if differing is None else "none of"
    return (
        f" The key of {r['title']}, `{r['key_sha256'][:16]}…`, is not the published one, `{known[:16]}…`; "
        f"{campaigns} its campaigns differed."
    )


def _draw(results: Sequence[Mapping[str, Any]], path: Path) -> None:
    """A point with its interval for each method."""
    from matplotlib.figure import Figure

    from identification.show.style import save

    figure = Figure(figsize=(6.4, 0.6 + 0.32 * len(results)), layout="constrained")
    axes = figure.subplots()
    for place, r in enumerate(reversed(results)):
        given = r["all"]["exact"]
        low, high = given["wilson_95"]
        colour = "C0" if r["method"] == OURS else "0.35"
        axes.plot([100 * low, 100 * high], [place, place], color=colour, linewidth=2)
        axes.plot([100 * _share(given)], [place], "o", color=colour)
    axes.set_yticks(range(len(results)), [_title(r) for r in reversed(results)])
    axes.set_xlim(0, 100)
    axes.set_xlabel("sets exactly right, %")
    save(figure, path)
