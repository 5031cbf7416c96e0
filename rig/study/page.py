"""``report.html`` of a study: one file without scripts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from common.page.document import still_page, style_sheet
from common.page.html import element, esc, figure_text, long_words, percent, section, table
from rig.study.charts import curves, front_view, scatter
from rig.study.findings import NEAR_BEST_SHARE, REACH_DEG, usable
from rig.study.resultfile import Row, StudyResultFile

STYLE = """
svg.study { width: 100%; height: auto; display: block; background: var(--paper); }
svg.study { border-radius: 10px; max-width: 620px; }
svg.study text { font: 12px system-ui, sans-serif; fill: var(--soft); }
svg.study .g { stroke: var(--line); }
svg.study .head { fill: none; stroke: var(--soft); stroke-dasharray: 4 4; }
svg.study .hull { fill: var(--after-wash); stroke: var(--after); }
.gallery { display: grid; gap: 16px; grid-template-columns: repeat(auto-fill, minmax(190px, 1fr)); }
"""

LONGEST_TABLE = 400
"""A page with more rows than this is no page any more; study.csv has them all."""

MOST_LAYOUTS = 36


def study_page(result: StudyResultFile) -> str:
    """The page of a study."""
    found, rows = result.findings, result.rows
    chosen = None if found.recommended is None else rows[found.recommended]
    name = result.study.name
    parts = [
        _verdict(result, chosen),
        _front(result),
        _over_cameras(rows),
        _gallery(result),
        _consensus(result, chosen),
        _all(result),
    ]
    header = f"<header><h1>{esc(name)}</h1><p>{esc(_sizes(result))}</p>{_nav(parts)}</header>"
    return still_page(name, f"{header}<main>{''.join(parts)}</main>", style_sheet() + STYLE)


def _sizes(result: StudyResultFile) -> str:
    rows, held = result.rows, len(usable(result.rows))
    text = f"{len(rows)} designs of {_names(result.rigs)} for {_names(result.heads)}; "
    return text + f"{held} of them hold every limit."


def _names(names: Sequence[str]) -> str:
    return (
        ", ".join(names) if len(names) <= 4 else f"{', '.join(names[:3])} and {len(names) - 3} more"
    )


def _nav(parts: Iterable[str]) -> str:
    words = {"front": "front", "cameras": "number of cameras", "gallery": "layouts"}
    words |= {"consensus": "places that recur", "designs": "all designs"}
    shown = "".join(parts)
    links = (f'<a href="#{k}">{w}</a>' for k, w in words.items() if f'id="{k}"' in shown)
    return f"<nav>{''.join(links)}</nav>"


def _verdict(result: StudyResultFile, chosen: Row | None) -> str:
    why = esc(result.findings.why)
    if chosen is None:
        word = '<p class="word">Nothing to recommend.</p>'
        return f'<div class="verdict broken">{word}<p class="more">{why}</p></div>'
    words = esc(_said(chosen, result))
    build = (
        "Its rig file is recommended.toml: <code>rigwright design HEAD --rig recommended.toml "
        "--out DIR</code> gives this rig with all its files."
    )
    return (
        f'<div class="verdict"><p class="word">Recommended: {words}</p>'
        f'<p class="more">{why}</p><p class="more">{build}</p></div>{_tiles(chosen)}'
    )


def _said(row: Row, result: StudyResultFile | None = None) -> str:
    """A row in words; its rig and head too where there are several."""
    choice, more = row.choice, []
    if result is None or len(result.rigs) > 1:
        more.append(choice.rig)
    if result is None or len(result.heads) > 1:
        more.append(f"for {choice.head}")
    text = choice.words() or f"{row.cameras} cameras"
    return f"{text} ({', '.join(more)})" if more else text


def _tiles(row: Row) -> str:
    across, deep, high = row.size_mm
    tiles = [
        ("Cameras", str(row.cameras), ""),
        ("Sigma, median", f"{_um(row.sigma_median_mm)} <small>µm</small>", ""),
        ("Sigma, 95 %", f"{_um(row.sigma_p95_mm)} <small>µm</small>", "of the points are below"),
        ("Seen by two", percent(row.seen_twice_share or 0.0), ""),
        ("Array", f"{across:.0f} × {high:.0f} × {deep:.0f}", "mm wide, high, deep"),
    ]
    if len(row.heads) > 1:
        tiles.append(("Heads", f"{row.holds_on} of {len(row.heads)}", "hold every limit"))
    if row.price is not None:
        tiles.append(("Price", f"{row.price:.0f}", "cameras and lenses"))
    cells = (
        f'<div class="tile"><div class="name">{name}</div><div class="figure{_long(value)}">'
        f'{value}</div><div class="note">{note}</div></div>'
        for name, value, note in tiles
    )
    return f'<div class="tiles">{"".join(cells)}</div>'


def _long(value: str) -> str:
    return " long" if len(value) > 14 and "<" not in value else ""


def _um(value_mm: float | None) -> str:
    return "–" if value_mm is None else figure_text(1e3 * value_mm)


def _series(row: Row, rigs: int) -> str:
    """What a row's curve is called: its choice without the number of cameras."""
    words = row.choice.model_copy(update={"cameras": None}).words()
    return f"{row.choice.rig}, {words}".strip(", ") if rigs > 1 else words or row.choice.rig


def _front(result: StudyResultFile) -> str:
    rows = [result.rows[k] for k in usable(result.rows)]
    if not rows:
        return ""

    def cloud(x: str) -> str:
        points = [
            (row.extent_mm() if x == "size" else row.price or 0.0, 1e3 * (row.sigma_p95_mm or 0.0),
             f"{row.cameras} cameras", row.on_front, _said(row, result))
            for row in rows if x == "size" or row.price is not None
        ]  # fmt: skip
        name = "longest side of the array, mm" if x == "size" else "price"
        return scatter(points, name, "95 % sigma, µm", f"Sigma over {name}")

    figures = "".join(f"<figure>{svg}</figure>" for svg in map(cloud, ("size", "price")) if svg)
    front = [result.rows[k] for k in result.findings.front]

    def by_count(row: Row) -> tuple[int, float]:
        return row.cameras, row.sigma_p95_mm or 0.0

    head = ["rig", "cameras", "sigma median, µm", "95 %, µm", "seen by two", "array, mm", "price"]
    words = (
        "No other rig of the study is better than these in one respect and as good in all the "
        "others: accuracy, coverage, size, number of cameras, price where it is known, heads on "
        "which the limits hold. Strong dots are on the front; hold the pointer over one."
    )
    return section(
        "front", "The Pareto front", words, f'<div class="grid2">{figures}</div>',
        table(head, (_front_cells(row, result) for row in sorted(front, key=by_count))),
    )  # fmt: skip


def _front_cells(row: Row, result: StudyResultFile) -> list[str]:
    size = " × ".join(f"{v:.0f}" for v in (row.size_mm[0], row.size_mm[2], row.size_mm[1]))
    price = "–" if row.price is None else f"{row.price:.0f}"
    return [
        long_words(_said(row, result)), str(row.cameras),
        _um(row.sigma_median_mm), _um(row.sigma_p95_mm), _seen(row), size, price,
    ]  # fmt: skip


def _best_per(rows: Sequence[Row]) -> dict[tuple[str, int], Row]:
    """The most accurate row that holds its limits, for each series and number of cameras."""
    best: dict[tuple[str, int], Row] = {}
    rigs = len({row.choice.rig for row in rows})
    for row in (rows[k] for k in usable(rows)):
        where = (_series(row, rigs), row.cameras)
        held = best.get(where)
        if held is None or (row.sigma_p95_mm or 0.0) < (held.sigma_p95_mm or 0.0):
            best[where] = row
    return dict(sorted(best.items(), key=lambda item: (item[0][1], item[0][0])))


def _over_cameras(rows: Sequence[Row]) -> str:
    best = _best_per(rows)
    names = sorted({name for name, _ in best})
    if not best:
        return ""

    def lines(value: str) -> dict[str, list[tuple[float, float]]]:
        out: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
        for (name, count), row in best.items():
            figures = {
                "p95": 1e3 * (row.sigma_p95_mm or 0.0),
                "median": 1e3 * (row.sigma_median_mm or 0.0),
                "seen": 100.0 * (row.seen_thrice_share or 0.0),
                "size": row.extent_mm(),
            }
            out[name].append((count, figures[value]))
        return out

    charts = (
        ("p95", "95 % sigma, µm"),
        ("median", "median sigma, µm"),
        ("seen", "seen by three or more, %"),
        ("size", "longest side, mm"),
    )
    figures = "".join(
        f"<figure>{curves(lines(v), 'cameras', y, f'{y} over the number of cameras')}</figure>"
        for v, y in charts
    )
    words = (
        "The most accurate rig of each number that holds its limits. Sigma is the longest "
        "semi-axis of a point's error ellipsoid."
    )
    return section(
        "cameras", "Over the number of cameras", words, f'<div class="grid2">{figures}</div>'
    )


def _gallery(result: StudyResultFile) -> str:
    best = _best_per(result.rows)
    if not best:
        return ""
    shown = list(best.values())[:MOST_LAYOUTS]
    reach_mm = 1.15 * max(
        max(abs(p.position_mm[axis] - row.centre_mm[axis]) for axis in (0, 2))
        for row in shown
        for p in row.places
    )
    reach_mm = max(reach_mm, 130.0)
    cells = "".join(
        f"<figure>{front_view(row, reach_mm, _said(row))}<figcaption>{esc(_said(row, result))}: "
        f"{_um(row.sigma_p95_mm)} µm</figcaption></figure>"
        for row in shown
    )
    left = len(best) - len(shown)
    more = f" {left} more are in study.json." if left else ""
    words = (
        "Where the cameras stand, seen from behind the array towards the face (dashed); all at one "
        f"scale, each drawing is {2 * reach_mm:.0f} mm wide. Pale cameras stand farther from the "
        f"face.{more}"
    )
    return section("gallery", "Layouts", words, f'<div class="gallery">{cells}</div>')


def _consensus(result: StudyResultFile, chosen: Row | None) -> str:
    found = result.findings
    if chosen is None or not found.consensus:
        return ""
    count = len(found.best)
    rows = (
        [esc(c.name), f"{c.azimuth_deg:+.0f}°", f"{c.elevation_deg:+.0f}°", f"{c.distance_mm:.0f}",
         f"{c.recurs_in} of {count}", f"{c.spread_deg:.1f}°"]
        for c in found.consensus
    )  # fmt: skip
    words = (
        f"Of the {count} rigs of {chosen.cameras} cameras within {100 * NEAR_BEST_SHARE:.0f} % of "
        "the recommended one's 95 % sigma, it included: how many have a camera within "
        f"{REACH_DEG:.0f}° of each of its places, seen from the face. Each is taken as it is or "
        "mirrored, as it fits better."
    )
    head = ["camera", "across", "up", "distance, mm", "recurs in", "mean angle to it"]
    return section("consensus", "Places that recur", words, table(head, rows, css="narrow"))


def _all(result: StudyResultFile) -> str:
    rows = list(enumerate(result.rows))[:LONGEST_TABLE]
    cells, css = [], []
    for number, row in rows:
        css.append(
            "broken" if row.reason else "best" if number == result.findings.recommended else ""
        )
        badge = "broken" if row.reason else "holds"
        word = "no" if row.reason else "front" if row.on_front else "yes"
        cells.append([
            long_words(_said(row, result)), _seed(row),
            element("span", word, class_=f"badge {badge}"),
            _um(row.sigma_median_mm), _um(row.sigma_p95_mm), _seen(row),
            f"{row.holds_on} of {len(result.heads)}", long_words(row.reason),
        ])  # fmt: skip
    head = [
        "rig",
        "seed",
        "limits hold",
        "sigma median, µm",
        "95 %, µm",
        "seen by two",
        "heads",
        "reason",
    ]
    left = len(result.rows) - len(rows)
    words = "study.csv and study.json hold these and more." + (
        f" {left} are left out here." if left else ""
    )
    return section("designs", "All designs", words, table(head, cells, row_css=css))


def _seen(row: Row) -> str:
    return "–" if row.seen_twice_share is None else percent(row.seen_twice_share)


def _seed(row: Row) -> str:
    return "–" if row.choice.seed is None else str(row.choice.seed)
