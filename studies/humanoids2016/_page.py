"""A self-contained HTML article from sections of text, equations, tables and figures."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal

LONG_TABLE = 6
"""Rows from which a table is folded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A paragraph of plain text.

    Attributes:
        text: the paragraph; it is escaped, so it may hold any character.
        kind: tells the template what this block is.
    """

    text: str
    kind: Literal["text"] = "text"


@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """A displayed equation.

    Attributes:
        latex: what it says, in LaTeX.
        number: the paper's number, or what it is called.
        kind: tells the template what this block is.
    """

    latex: str
    number: str
    kind: Literal["equation"] = "equation"

    @property
    def mathml(self) -> str:
        """The equation as MathML."""
        from latex2mathml.converter import convert

        return convert(self.latex, display="block")


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A drawing inside the page.

    Attributes:
        svg: the drawing as SVG markup, not escaped.
        caption: what it shows, with units.
        kind: tells the template what this block is.
    """

    svg: str
    caption: str
    kind: Literal["figure"] = "figure"


@dataclass(frozen=True, slots=True, kw_only=True)
class Raw:
    """Markup with its own script, such as the 3-D playback.

    Attributes:
        html: the markup, not escaped.
        caption: what it shows.
        kind: tells the template what this block is.
    """

    html: str
    caption: str
    kind: Literal["raw"] = "raw"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One cell of a table.

    Attributes:
        text: what it says.
        css: class names of the page's style sheet: number, verdict, confirmed, …
    """

    text: str
    css: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table; on a phone it scrolls sideways, or stacks its cells where they hold sentences.

    Attributes:
        title: what it lists, its caption.
        columns: the heads, with units.
        rows: the cells, one sequence a row; plain strings become cells.
        note: a sentence below it, or nothing.
        stack: whether cells are stacked on narrow screens.
        open: whether a long table is shown unfolded.
        kind: tells the template what this block is.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence["Cell | str"]]
    note: str = ""
    stack: bool = False
    open: bool = False
    kind: Literal["table"] = "table"

    @property
    def folded(self) -> bool:
        """Whether the reader unfolds it."""
        return len(self.rows) > LONG_TABLE and not self.open

    @property
    def cells(self) -> list[list[Cell]]:
        """The rows as cells."""
        return [
            [cell if isinstance(cell, Cell) else Cell(text=str(cell)) for cell in row]
            for row in self.rows
        ]


Block = Text | Equation | Figure | Raw | Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the page with its own heading and anchor.

    Attributes:
        anchor: the name that links use.
        title: the heading, a question or a subject.
        blocks: what it holds, in order.
    """

    anchor: str
    title: str
    blocks: Sequence[Block]

    def tables(self) -> Iterator[tuple[str, Table]]:
        """Go through the tables.

        Yields:
            The name of its CSV file without ending, and the table.
        """
        tables = [block for block in self.blocks if isinstance(block, Table)]
        for k, block in enumerate(tables, start=1):
            yield self.anchor if len(tables) == 1 else f"{self.anchor}_{k}", block


@dataclass(frozen=True, slots=True, kw_only=True)
class Article:
    """What the page says before its sections, and under them.

    Attributes:
        title: the heading and the window's title.
        about: one line: which paper, by whom.
        abstract: paragraphs with the findings.
        sections: the parts, in order.
        citation: how to cite, BibTeX.
        made: how and when it was computed.
    """

    title: str
    about: str
    abstract: Sequence[str]
    sections: Sequence[Section]
    citation: str
    made: str

    def render(self) -> str:
        """Render a page that needs no network: style, figures and scripts are inside it."""
        import jinja2

        environment = jinja2.Environment(
            loader=jinja2.PackageLoader("humanoids2016"), autoescape=True, trim_blocks=True
        )
        names = {id(table): name for section in self.sections for name, table in section.tables()}
        figures = [b for section in self.sections for b in section.blocks if isinstance(b, Figure)]
        marks = {id(figure): f"f{k}-" for k, figure in enumerate(figures, start=1)}
        return environment.get_template("page.html").render(
            article=self,
            csv=lambda table: names[id(table)],
            svg=lambda figure: _inlined(figure, marks[id(figure)]),
        )


def _inlined(figure: Figure, mark: str) -> str:
    """A drawing with an alternative text, ids of its own, and the page's ink instead of black."""
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{mark}", figure.svg)
    text = re.sub(r"#000(000)?\b", "currentColor", text)
    text = text.replace("fill: #ffffff", "fill: none")
    title = f'<title id="{mark}title">{escape(figure.caption)}</title>'
    head, body = text.split(">", 1)
    return f'{head} role="img" aria-labelledby="{mark}title">{title}{body}'
