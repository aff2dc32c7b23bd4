"""The page that `sealag paper` writes."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from humanoids2016._bounds_page import beyond_section, figure_5_section, limits_section
from humanoids2016._claims import Claim
from humanoids2016._figure4 import Figure4
from humanoids2016._figure5 import TorqueTrace
from humanoids2016._findings import Findings
from humanoids2016._page import Cell, Figure, Section, Table, Text, render_page
from humanoids2016._plots import plot_figure_4, plot_walk_bounds
from humanoids2016._random_table import RandomPlantTable
from humanoids2016._unsafe import UnsafeExample
from humanoids2016._walk_page import energy_section, means_section, walk_section
from sealag.files import write_text

TORQUE_STRIDE = 2
"""Every how many logged instants of Fig. 5 are written."""

TITLE = "Passivity of time-delayed whole-body control with series elastic actuation, recomputed"


def write_paper_page(out: Path, found: Findings, *, version: str) -> Path:
    """Write the page and its CSV files.

    Args:
        out: folder for `index.html`, `figure4.csv`, `figure4_instants.csv`, both again for the
            simulated walk, `figure5.csv`, and `tables/` with every table of the page.
        found: what the study computed.
        version: of sealag, for the footer.

    Returns:
        Path of the page.

    Raises:
        FileError: a file cannot be written.
    """
    for name, computed in (("figure4", found.figure), ("figure4_simulated", found.simulated)):
        write_text(out / f"{name}.csv", _figure_csv(computed))
        write_text(out / f"{name}_instants.csv", _instants_csv(computed))
    write_text(out / "figure5.csv", _torques_csv(found.traces))
    sections = [
        _claims_section(found.claims),
        *_criteria_sections(found),
        walk_section(found),
        means_section(found),
        energy_section(found),
        limits_section(found),
        figure_5_section(found),
        beyond_section(found),
    ]
    for name, content in _tables_csv(sections):
        write_text(out / "tables" / f"{name}.csv", content)
    page = render_page(
        TITLE,
        _lead(found),
        sections,
        footer=f"Computed by sealag {version}. The CSV files beside this page hold the numbers.",
    )
    write_text(out / "index.html", page)
    return out / "index.html"


def _lead(found: Findings) -> str:
    """What the page is about."""
    steps, instants = found.walk.case.walking.steps, len(found.figure.time)
    return (
        "Zhao and Sentis (Humanoids 2016) bound the delay that a whole-body controller of a robot "
        "with series elastic actuators tolerates. This page computes their Fig. 4 over "
        f"{instants} instants of a planned {steps}-step walk of Hume, checks their statements, "
        "and puts a corrected criterion beside theirs."
    )


def _claims_section(claims: Sequence[Claim]) -> Section:
    return Section(anchor="claims", title="What the paper says", blocks=[_claims_table(claims)])


def _criteria_sections(found: Findings) -> list[Section]:
    """Fig. 4, the certified criterion, and where the published one is unsafe."""
    return [
        Section(
            anchor="figure4",
            title="Fig. 4: largest delay",
            blocks=_figure_blocks(found.figure),
        ),
        Section(
            anchor="certified",
            title="Certified criterion",
            blocks=_certified_blocks(found.figure),
        ),
        Section(
            anchor="unsafe",
            title="Where (29) is unsafe",
            blocks=_unsafe_blocks(found.unsafe, found.table),
        ),
    ]


def _claims_table(claims: Sequence[Claim]) -> Table:
    return Table(
        columns=["Statement", "Computed here", "Verdict", "Counts as agreement"],
        rows=[
            [
                f"{claim.published} ({claim.source})",
                claim.computed,
                Cell(text=claim.verdict.value, css=f"verdict {claim.verdict.value}"),
                claim.tolerance,
            ]
            for claim in claims
        ],
        stack=True,
    )


def _figure_blocks(figure: Figure4) -> list[Text | Figure | Table]:
    worst = figure.worst_instant[1]
    middle = int(np.argmin(np.abs(figure.alpha - 1.0)))
    return [
        Text(
            text=(
                "Each point is the smallest bound of Theorem 1 (29) over all instants of the walk, "
                "in closed form: the supremum over all multipliers, with a bracket of relative "
                "width 1e-6. As in the paper the robot is one leg, J* is 6 × 3, K_x = diag(100, "
                "100, 100, 50, 50, 50) 1/s² and D_θ = α diag(D_θ[0], 100, 100) Nms/rad. The three "
                "values of D_θ[0], the terrain, and the CoM height of 0.86 m are assumptions."
            )
        ),
        Figure(
            svg=plot_figure_4(figure),
            caption=(
                "Largest delay (ms) against α for three values of the abduction damping. Dashed: "
                "the certified criterion for the same gains with the symmetric stiffness and q̄(θ) "
                "fed back, all six joints."
            ),
        ),
        Figure(
            svg=plot_walk_bounds(figure),
            caption=(
                f"The bound at each instant for α = 1. With D_θ[0] = 10 Nms/rad it is smallest, "
                f"{figure.instants_delay_s[1][worst] * 1e3:.1f} ms, at {figure.time[worst]:.3f} s."
            ),
        ),
        Table(
            columns=["D_θ[0] (Nms/rad)", "one leg (ms)", "both legs (ms)"],
            rows=[
                [
                    Cell(text=f"{damping:g}", css="number"),
                    Cell(text=f"{one * 1e3:.2f}", css="number"),
                    Cell(text=f"{two * 1e3:.2f}", css="number"),
                ]
                for damping, one, two in zip(
                    figure.abduction_damping,
                    figure.delay_s[:, middle],
                    figure.both_legs_delay_s[:, middle],
                    strict=True,
                )
            ],
            caption="At α = 1. The stance leg limits the delay; the swing leg's columns hardly "
            "change it.",
        ),
    ]


def _certified_blocks(figure: Figure4) -> list[Text | Figure | Table]:
    rows = []
    for variant in figure.certified:
        good = not variant.reason
        rows.append(
            [
                f"{variant.signal.replace('_', ' ')}",
                f"{variant.form.value}",
                f"{variant.gravity.value}",
                Cell(
                    text=f"{variant.delay_s.min() * 1e3:.2f} ms" if good else "refused",
                    css="verdict confirmed" if good else "verdict contradicted",
                ),
                variant.reason or f"contraction factor of q̄(θ) at most {variant.contraction:.2f}",
            ]
        )
    return [
        Text(
            text=(
                "The certified criterion requires a symmetric stiffness and, where q̄(θ) is fed "
                "back, a contraction. It uses the whole delayed motor-side stiffness of the law "
                "that runs, gravity compensation included. Passivity does not imply stability: on "
                "one point foot the robot is an inverted pendulum, and its equilibrium is unstable "
                "without any delay."
            )
        ),
        Table(
            columns=["Fed back", "Stiffness", "Gravity from", "Largest delay", "Because"],
            rows=rows,
            caption="The paper's gains over the same walk; the first row is the law as printed.",
            stack=True,
        ),
    ]


def _unsafe_blocks(
    unsafe: Sequence[UnsafeExample], table: RandomPlantTable
) -> list[Text | Figure | Table]:
    named = [example for example in unsafe if "draw" not in example.name]
    drawn = sorted(
        (example for example in unsafe if "draw" in example.name),
        key=lambda example: example.margin_s - example.published_delay_s,
    )[:4]

    def ms(value: float | None) -> Cell:
        return Cell(text="refused" if value is None else f"{value * 1e3:.3f}", css="number")

    return [
        Text(
            text=(
                f"Of {table.plants} random plants (1 to 6 joints, springs from soft to stiff) the "
                f"published criterion allows a delay at which the exact loop is unstable for "
                f"{table.published_longer}; {table.published_without_delay} of these are unstable "
                f"without any delay. The certified criterion gave a bound for "
                f"{table.certified_spoke} with a stable equilibrium and exceeded the exact margin "
                f"for {table.certified_longer}; exact margin over bound is at least "
                f"{table.smallest_ratio:.4f}, in the median {table.median_ratio:.2f}. For "
                f"{table.undecided} the exact margin could not be decided; they are left out."
            )
        ),
        Table(
            columns=["Plant", "(29) allows (ms)", "certified (ms)", "exact margin (ms)"],
            rows=[
                [e.name, ms(e.published_delay_s), ms(e.certified_delay_s), ms(e.margin_s)]
                for e in [*named, *drawn]
            ],
            caption="D_θ = 10 Nms/rad and B_s = 0.09 kg m² for one joint. Refused: the certified "
            "criterion gives no bound there.",
        ),
    ]


def _figure_csv(figure: Figure4) -> str:
    head = ["alpha"]
    head += [f"one_leg_delay_s_D{d:g}" for d in figure.abduction_damping]
    head += [f"both_legs_delay_s_D{d:g}" for d in figure.abduction_damping]
    rows = np.column_stack([figure.alpha, *figure.delay_s, *figure.both_legs_delay_s])
    return _csv(head, rows)


def _instants_csv(figure: Figure4) -> str:
    head = ["time_s", *(f"published_delay_s_D{d:g}" for d in figure.abduction_damping)]
    head += [f"certified_delay_s_{v.form}_{v.signal}_{v.gravity}" for v in figure.certified]
    columns = [figure.time, *figure.instants_delay_s, *(v.delay_s for v in figure.certified)]
    return _csv(head, np.column_stack(columns))


def _torques_csv(traces: Sequence[TorqueTrace]) -> str:
    """Delayed task torque and spring torque of all walks of Fig. 5, one after the other."""
    joints = traces[0].walk.run.joints
    head = ["stiffness_nm_rad", "damping_scale", "beta", "time_s"]
    head += [f"{what}_{joint}_nm" for what in ("task_delayed", "spring") for joint in joints]
    blocks = []
    for trace in traces:
        time = trace.walk.run.time
        case = np.tile([trace.stiffness, trace.damping_scale, trace.beta], (len(time), 1))
        blocks.append(np.column_stack([case, time, trace.command, trace.achieved])[::TORQUE_STRIDE])
    return _csv(head, np.concatenate(blocks))


def _tables_csv(sections: Sequence[Section]) -> Iterator[tuple[str, str]]:
    """Name and content of every table of the page, as it is shown."""
    for section in sections:
        tables = [block for block in section.blocks if isinstance(block, Table)]
        for k, block in enumerate(tables, start=1):
            rows = [[c.text if isinstance(c, Cell) else c for c in row] for row in block.rows]
            name = section.anchor if len(tables) == 1 else f"{section.anchor}_{k}"
            yield name, _text_csv(block.columns, rows)


def _csv(head: Sequence[str], rows: np.ndarray) -> str:
    return _text_csv(head, [[f"{value:.9g}" for value in row] for row in rows])


def _text_csv(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()
