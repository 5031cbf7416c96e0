"""The page of figures of ``benchmarks.recognition``."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.full_captures import WIDTH_PX, FullCapture
from benchmarks.measured_faces import POINTS, Light
from evaluation.recognition.recogniser import Recogniser, equal_error, threshold_at
from geometry.arrays import Floats, Ints

ASKED = 200
DRAWS = 400
VERDICT = (
    "- Persons are drawn from a statistical model. They differ in the ways the model knows, and",
    "  real ones look more alike in some and less in others: the rates of a real population are",
    "  another matter, and certainly worse.",
    "- A person at rest has the very shape that was enrolled: only place, noise and gaps differ.",
    "  Real faces are never twice the same. The row of expressions says more.",
    "- Who is enrolled was scanned without error; a gallery of the rig's own captures is another.",
    "- Faces are not searched for: their frame is sought from where a search would put it.",
    "- Nobody ages, gains weight, grows a beard or wears glasses between enrolment and probe, and",
    "  all expressions are mixtures of the model's own. Hair is not modelled.",
    "- The light takes away the brightest or the darkest part of a face and adds noise; shadows",
    "  that fall, gloss and blur are in the full captures alone.",
    "- Poses and lenses are known exactly.",
    "",
)
NAMES = {"right": "right", "dark": "two stops less", "over": "1.3 stops more"}


@dataclass(frozen=True)
class Row:
    """Rates of some probes, each with the bounds of 95 % of ``DRAWS`` draws of persons."""

    rig: str
    light: str
    probes: int
    refused: int
    equal_error: tuple[float, float, float]
    missed: tuple[float, float, float]
    matched: tuple[float, float, float]
    missed_at_1000: tuple[float, float, float]

    @classmethod
    def of(
        cls,
        rig: str,
        light: str,
        probes: int,
        refused: int,
        genuine: Floats,
        impostor: Floats,
        genuine_person: Ints,
        impostor_person: Ints,
        threshold: float,
    ) -> Row:
        """Refused probes count as not matched, never as matched."""
        genuine = np.concatenate([genuine, np.full(refused, -1.0)])
        people = np.unique(genuine_person)
        extra = np.arange(refused) + 1_000_000
        genuine_person = np.concatenate([genuine_person, extra])
        people = np.concatenate([people, extra])
        order = np.argsort(impostor_person, kind="stable")
        starts = np.searchsorted(impostor_person[order], people)
        ends = np.searchsorted(impostor_person[order], people, side="right")
        by_person = [impostor[order[a:b]] for a, b in zip(starts, ends, strict=True)]
        own = [genuine[genuine_person == p] for p in people]

        def figures(pick: Ints) -> list[float]:
            g = np.concatenate([own[k] for k in pick])
            i = np.concatenate([by_person[k] for k in pick])
            if not len(i):
                # All were refused: nobody is recognised, and nobody taken for another.
                return [np.nan, float((g <= threshold).mean()), np.nan, np.nan]
            strict = threshold_at(i, 0.001)
            return [
                equal_error(g, i),
                float((g <= threshold).mean()),
                float((i > threshold).mean()),
                float((g <= strict).mean()),
            ]

        rng = np.random.default_rng(0)
        middle = figures(np.arange(len(people)))
        drawn = [figures(rng.integers(len(people), size=len(people))) for _ in range(DRAWS)]
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "All-NaN")
            low, high = np.nanquantile(np.array(drawn), [0.025, 0.975], axis=0)
        all_ = [(m, float(a), float(b)) for m, a, b in zip(middle, low, high, strict=True)]
        return cls(rig, light, probes, refused, *all_)

    @property
    def line(self) -> str:
        """One line of the table."""
        values = (self.equal_error, self.missed, self.matched, self.missed_at_1000)
        cells = " | ".join(_bounded(*value) for value in values)
        light = NAMES[self.light]
        return f"| {self.rig} | {light} | {self.probes} | {self.refused} | {cells} |"


def _bounded(value: float, low: float, high: float) -> str:
    if np.isnan(value):
        return "-"
    return f"{100 * value:.2f} ({100 * low:.2f} to {100 * high:.2f})"


def page(
    rows: Sequence[Row],
    checks: Sequence[tuple[FullCapture, float]],
    lights: Sequence[Light],
    model: Recogniser,
    enrolled: int,
    persons: int,
    command: str,
    seconds: float,
) -> str:
    """The page, Markdown."""
    ict = "--model" in command
    whose = "the ICT face model (60 modes of scans, 12 expressions)" if ict else "the generator"
    rates = model.rates
    threshold = f"{100 * rates.threshold:.0f} %"
    lines = [
        *("# Does the data of a rig suffice to recognise a person?", ""),
        f"Written by `{command}`,",
        f"{seconds:.0f} s of processor time. Persons of {whose}. {enrolled} of",
        f"{persons} are enrolled from one scan without error, at rest (of the others the program",
        "is not certain how their faces stand, and refuses them), and probed as rigs would measure",
        "them, in another place, every second with an expression. The model saw none of them. How",
        "recognition works: [recognise.md](../how-to/recognise.md).",
        "",
        "On persons left out of the training, on scans without error: equal error rate",
        f"{100 * rates.equal_error:.2f} %; at the model's threshold, {threshold} of the votes,",
        f"{100 * rates.false_match:.3f} % false matches of {rates.impostors:,} and",
        f"{100 * rates.false_non_match:.2f} % false non-matches of {rates.genuines:,}.",
        *("", "## Figures", ""),
        "Per cent, in brackets 95 % of 400 draws of persons. A refused probe counts as not",
        "matched. *Missed* and *strangers* are at the model's own threshold, the last column where",
        "one stranger in 1000 is let in.",
        "",
        "| cameras | exposure | probes | refused | equal error | missed | strangers "
        "| missed at 0.1 % strangers |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *(row.line for row in rows),
        *("", "## The error model, and full captures that set it", ""),
        "| exposure | sigma of a point, px | lost of what two cameras see, beyond the usual |",
        "| --- | --- | --- |",
        *(f"| {NAMES[x.name]} | {x.sigma_px:.3f} | {100 * x.lost_share:.1f} % |" for x in lights),
        "",
        f"A probe has the covariance that the design predicts for each of {POINTS:,} points at",
        "that sigma, alike within a matching patch, nothing where fewer than two cameras see at 70",
        "degrees or less, and nothing on the brightest (overexposed) or darkest part.",
        *_origin(checks),
        *("", "## What this does not show", ""),
        *_asked(rows, enrolled, len(checks)),
        *VERDICT,
    ]
    return "\n".join(lines)


def _asked(rows: Sequence[Row], enrolled: int, captures: int) -> list[str]:
    """How far this is from 200 persons, reconstructed in all configurations."""
    probes = sum(row.probes for row in rows if row.rig.isdecimal())
    return [
        f"- Asked were {ASKED} persons, each probed by a reconstruction from pictures, with",
        f"  every rig in every light. {enrolled} are enrolled here, but {captures} of",
        f"  {probes + captures:,} probes are reconstructions, all of the rig of seven; the others",
        "  are drawn from the error model. It knows noise and what is lost, not strays, creases or",
        "  pictures that match badly.",
        "- Dark and overexposed every third person is probed.",
    ]


def _origin(checks: Sequence[tuple[FullCapture, float]]) -> list[str]:
    """Where the error model is from."""
    if not checks:
        return [
            "Sigma and losses were assumed: this page was made without full captures",
            "(`--captures`), which set them.",
        ]
    return [
        f"Sigma and losses are those of captures that were simulated ({WIDTH_PX} px wide, plain",
        "skin with the studio's grain) and reconstructed in full by the rig nearest to seven",
        "cameras. They were verified like all other probes:",
        "",
        "| person | exposure | points | scatter, mm | px | lost | votes for the person |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        *(_check(capture, score) for capture, score in checks),
    ]


def _check(capture: FullCapture, score: float) -> str:
    votes = "refused" if np.isnan(score) else f"{100 * score:.0f} %"
    return (
        f"| {capture.person} | {NAMES[capture.light]} | {len(capture.points_mm):,} "
        f"| {capture.sigma_mm:.3f} | {capture.sigma_px:.3f} | {100 * capture.lost_share:.1f} % "
        f"| {votes} |"
    )
