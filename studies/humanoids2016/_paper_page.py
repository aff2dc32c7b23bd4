"""The article that `sealag paper` writes."""

import csv
import io
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

import numpy as np

from humanoids2016 import _diagrams, _equations
from humanoids2016._ablation import PUBLISHED_LAW
from humanoids2016._assumptions import assumptions_section
from humanoids2016._bounds_page import beyond_section, figure_5_section, limits_section
from humanoids2016._claims import Claim, Verdict
from humanoids2016._concordance import concordance_section
from humanoids2016._figure4 import Figure4
from humanoids2016._figure5 import TorqueTrace
from humanoids2016._findings import Findings
from humanoids2016._left_out_page import left_out_section
from humanoids2016._page import Article, Block, Cell, Figure, Raw, Section, Table, Text
from humanoids2016._plots import plot_figure_4, plot_levels, plot_walk_bounds
from humanoids2016._ports_page import ports_section
from humanoids2016._random_table import RandomPlantTable
from humanoids2016._unsafe import UnsafeExample
from humanoids2016._walk_page import energy_section, means_section, walk_section
from sealag.files import bundled, write_text

TORQUE_STRIDE = 2
"""Every how many logged instants of Fig. 5 are written."""

TITLE = "Passivity of time-delayed whole-body control with series elastic actuation, recomputed"

ABOUT = (
    "On Ye Zhao and Luis Sentis, “Passivity of Time-Delayed Whole-Body Operational Space Control "
    "with Series Elastic Actuation”, IEEE-RAS International Conference on Humanoid Robots "
    "(Humanoids), 2016."
)


def write_paper_page(
    out: Path, found: Findings, *, version: str, today: date | None = None
) -> Path:
    """Write the article and its CSV files.

    Args:
        out: folder for `index.html`, `figure4.csv`, `figure4_instants.csv`, both again for the
            simulated walk, `figure5.csv`, and `tables/` with every table of the page.
        found: what the study computed.
        version: of sealag.
        today: the date that the page bears; the computer's if None.

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
        _loop_section(),
        _criteria_section(),
        _live_section(found),
        *_bound_sections(found),
        ports_section(found),
        left_out_section(found),
        walk_section(found),
        means_section(found),
        energy_section(found),
        limits_section(found),
        figure_5_section(found),
        beyond_section(found),
        assumptions_section(found),
        concordance_section(),
    ]
    for name, content in _tables_csv(sections):
        write_text(out / "tables" / f"{name}.csv", content)
    cite = bundled("cite_paper.bib", ending=".bib", what="citation").read_text(encoding="utf-8")
    article = Article(
        title=TITLE,
        about=ABOUT,
        abstract=_abstract(found),
        sections=sections,
        citation=cite.strip(),
        made=(
            f"Computed by sealag {version} on {today or date.today():%d %B %Y} with "
            f"“sealag paper” from the project {found.system.name} (`make paper` in a clone); the "
            "same numbers come out again. `sealag cite` prints how to cite the software. The CSV "
            "files beside this page hold the numbers of all figures and tables."
        ),
    )
    write_text(out / "index.html", article.render())
    return out / "index.html"


def _abstract(found: Findings) -> list[str]:
    """What was asked, and what was found."""
    steps, instants = found.walk.case.walking.steps, len(found.figure.time)
    figure, table, gait = found.figure, found.table, found.walk.gait
    unit = int(np.argmin(np.abs(figure.alpha - 1.0)))
    count = {v: sum(claim.verdict is v for claim in found.claims) for v in Verdict}
    said = ", ".join(f"{n} {verdict.value}" for verdict, n in count.items() if n)
    smallest = figure.delay_s[1, unit] * 1e3
    static = [v for v in figure.certified if v.signal == "static_joint" and not v.reason]
    certified = f"{static[0].delay_s.min() * 1e3:.1f} ms" if static else "nothing"
    printed = [row for row in found.ablations if row.name.startswith(PUBLISHED_LAW)]
    return [
        "Zhao and Sentis bound the delay that a whole-body controller of a robot with series "
        "elastic actuators tolerates. This article computes their criterion in closed form "
        f"over {instants} instants of a planned {steps}-step walk of Hume, checks "
        f"{len(found.claims)} of their statements ({said}), and puts a corrected criterion "
        "beside theirs.",
        f"With the paper's gains the published criterion allows {smallest:.1f} ms, the certified "
        f"one {certified} with the paper's feedback of q̄(θ). On "
        f"{table.published_longer} of {table.presupposed} random plants under the paper's law the "
        "published criterion allows a delay at which the exact loop is unstable; the certified "
        f"one on {table.certified_longer} of all {table.plants}. "
        f"The law as printed walks {sum(row.walked for row in printed)} of "
        f"{sum(row.terrains for row in printed)} grounds: its damping acts on the velocity itself. "
        "With velocity feedforward, prediction over the delay and foot placement Hume takes "
        f"{gait.steps} steps on springs under the paper's delays in closed loop ({gait.cause}).",
    ]


def _claims_section(claims: Sequence[Claim]) -> Section:
    return Section(anchor="claims", title="What the paper says", blocks=[_claims_table(claims)])


def _loop_section() -> Section:
    """Figs. 1 to 3 and the equations that they stand for."""
    return Section(
        anchor="loop",
        title="The loop",
        blocks=[
            Figure(
                svg=_diagrams.architecture(),
                caption="Fig. 1: stiffness is computed centrally and late, damping in the drive.",
            ),
            *_equations.plant(),
            *_equations.law(),
            Text(
                text="What is measured reaches the controller late and the command reaches the "
                "drive late; together d_1 = T_H + T_L/2. The paper takes the motor angles, or "
                "q̄(θ), the joint angles that belong to them at rest."
            ),
            Figure(svg=_diagrams.layers(), caption="Fig. 2: what is evaluated how often, here."),
            Figure(
                svg=_diagrams.interconnection(),
                caption="Fig. 3: two subsystems in feedback; if both are passive, so is the whole.",
            ),
        ],
    )


def _criteria_section() -> Section:
    """(29), (31) and what is certified here."""
    return Section(
        anchor="criteria",
        title="The criteria",
        blocks=[
            Text(text="As published, for one task and for several priority levels:"),
            *_equations.published_criterion(),
            Text(
                text="The largest delay over all Q needs no LMI solver: it is a numerical radius "
                "w (Ando's theorem). For one joint it is d_1 = D_θ/k, and with the hold of a "
                "sampled controller k (d + T/2) < D_θ, the linear condition known from haptic "
                "displays. (29) is sufficient only where the stiffness is symmetric, so that V_3 "
                "exists, and where the signal fed back is the one whose stiffness it has. The "
                "corrected criterion takes the whole delayed stiffness F of the law that runs:"
            ),
            *_equations.certified_criterion(),
            Text(
                text="Where x̂ is fed back through the energy tank, the published flow does not "
                "pay for the work that u does on the spring potential; the corrected one does:"
            ),
            *_equations.tank(),
        ],
    )


def _live_section(found: Findings) -> Section:
    return Section(
        anchor="live",
        title="Try the gains",
        blocks=[
            Raw(
                html=found.live.markup(),
                caption="One leg, as in the paper: bounds of (29), of the certified criterion, and "
                "the exact margin for a constant delay of the leg with its torso held and without "
                "gravity. Computed in this browser.",
            )
        ],
    )


def _bound_sections(found: Findings) -> list[Section]:
    """Fig. 4, the certified criterion, priority levels, and where the published one is unsafe."""
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
        Section(anchor="levels", title="Priority levels", blocks=_level_blocks(found)),
        Section(
            anchor="unsafe",
            title="Where (29) is unsafe",
            blocks=_unsafe_blocks(found.unsafe, found.table),
        ),
    ]


def _level_blocks(found: Findings) -> list[Block]:
    levels = found.levels

    def ms(value: float) -> Cell:
        return Cell(text=f"{value * 1e3:.3f}", css="number")

    return [
        Figure(
            svg=plot_levels(levels),
            caption="Bound of (31) with two levels over that of (29) with one, along the walk. "
            "Above 1 the levels allow a longer delay.",
        ),
        Table(
            title="Bounds with one and with two priority levels",
            columns=["time (s)", "one level (ms)", *(f"{one.name} (ms)" for one in levels.levels)],
            rows=[
                [Cell(text=f"{time:.3f}", css="number"), ms(single), *(ms(value) for value in both)]
                for time, single, *both in zip(
                    levels.time.tolist(),
                    levels.single.tolist(),
                    *(one.delay_s.tolist() for one in levels.levels),
                    strict=True,
                )
            ],
        ),
    ]


def _claims_table(claims: Sequence[Claim]) -> Table:
    return Table(
        title="Statements of the paper",
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
        open=True,
    )


def _figure_blocks(figure: Figure4) -> list[Block]:
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
            title="One leg and both legs at α = 1",
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
            note="The stance leg limits the delay; the swing leg's columns hardly change it.",
        ),
    ]


def _certified_blocks(figure: Figure4) -> list[Block]:
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
            title="The paper's gains, run in five ways",
            columns=["Fed back", "Stiffness", "Gravity from", "Largest delay", "Because"],
            rows=rows,
            note="Over the same walk; the first row is the law as printed.",
            stack=True,
        ),
    ]


def _unsafe_blocks(unsafe: Sequence[UnsafeExample], table: RandomPlantTable) -> list[Block]:
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
                f"Of {table.plants} random plants (1 to 6 joints, springs from soft to stiff) "
                f"{table.presupposed} run the paper's law: ΛK_x as printed, with motor angles or a "
                "q̄(θ) that exists. For "
                f"{table.published_longer} of these the published criterion allows a delay at "
                f"which the exact loop is unstable; {table.published_without_delay} are unstable "
                f"without any delay. Taken beyond its law, with link angles or other stiffnesses, "
                f"it does so for {table.other_longer} more. The certified criterion gave a bound "
                "for "
                f"{table.certified_spoke} with a stable equilibrium and exceeded the exact margin "
                f"for {table.certified_longer}; exact margin over bound is at least "
                f"{table.smallest_ratio:.4f}, in the median {table.median_ratio:.2f}. For "
                f"{table.undecided} the exact margin could not be decided; they are left out."
            )
        ),
        Table(
            title="Plants on which the published criterion allows too much",
            columns=["Plant", "(29) allows (ms)", "certified (ms)", "exact margin (ms)"],
            rows=[
                [e.name, ms(e.published_delay_s), ms(e.certified_delay_s), ms(e.margin_s)]
                for e in [*named, *drawn]
            ],
            note="D_θ = 10 Nms/rad and B_s = 0.09 kg m² for one joint. Refused: the certified "
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
    head += [
        f"{what}_{joint}_nm" for what in ("task_sent", "task_delayed", "spring") for joint in joints
    ]
    blocks = []
    for trace in traces:
        time = trace.walk.run.time
        case = np.tile([trace.stiffness, trace.damping_scale, trace.beta], (len(time), 1))
        blocks.append(
            np.column_stack([case, time, trace.sent, trace.command, trace.achieved])[
                ::TORQUE_STRIDE
            ]
        )
    return _csv(head, np.concatenate(blocks))


def _tables_csv(sections: Sequence[Section]) -> Iterator[tuple[str, str]]:
    """Name and content of every table of the page, as it is shown."""
    for section in sections:
        for name, table in section.tables():
            yield name, _text_csv(table.columns, [[c.text for c in row] for row in table.cells])


def _csv(head: Sequence[str], rows: np.ndarray) -> str:
    return _text_csv(head, [[f"{value:.9g}" for value in row] for row in rows])


def _text_csv(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()
