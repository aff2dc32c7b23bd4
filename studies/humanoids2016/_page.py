"""A self-contained HTML page from sections of text, tables and figures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal


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
        columns: the heads, with units.
        rows: the cells, one sequence a row; plain strings become cells.
        caption: a sentence below it, or nothing.
        stack: whether cells are stacked on narrow screens.
        kind: tells the template what this block is.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence["Cell | str"]]
    caption: str = ""
    stack: bool = False
    kind: Literal["table"] = "table"


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the page with its own heading and anchor.

    Attributes:
        anchor: the name that links use.
        title: the heading.
        blocks: what it holds, in order.
    """

    anchor: str
    title: str
    blocks: Sequence[Text | Figure | Raw | Table]


def render_page(title: str, lead: str, sections: Sequence[Section], *, footer: str) -> str:
    """Render a page that needs no network: style, figures and scripts are inside it.

    Args:
        title: the heading and the window's title.
        lead: the first paragraph.
        sections: the parts, in order.
        footer: the last line.

    Returns:
        HTML text.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("humanoids2016"), autoescape=True, trim_blocks=True
    )
    plain = [
        {
            "anchor": section.anchor,
            "title": section.title,
            "blocks": [_with_cells(block) for block in section.blocks],
        }
        for section in sections
    ]
    template = environment.get_template("page.html")
    return template.render(title=title, lead=lead, sections=plain, footer=footer)


def _with_cells(block: Text | Figure | Raw | Table) -> Text | Figure | Raw | Table:
    if not isinstance(block, Table):
        return block
    rows = [
        [cell if isinstance(cell, Cell) else Cell(text=str(cell)) for cell in row]
        for row in block.rows
    ]
    return Table(columns=block.columns, rows=rows, caption=block.caption, stack=block.stack)
