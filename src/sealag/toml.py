"""TOML documents that are edited, with their comments and order kept."""

import tomllib
from typing import Any

from sealag.errors import InputError


def text_of(document: Any, *, refusal: str) -> str:
    """Return the text of an edited document, which says what the document says.

    Args:
        document: a document of TOML Kit.
        refusal: the sentence for a document whose dotted keys TOML Kit cannot extend.

    Raises:
        InputError: it is such a document.
    """
    import tomlkit

    text = tomlkit.dumps(document)
    try:
        same = tomllib.loads(text) == document.unwrap()
    except tomllib.TOMLDecodeError:
        same = False
    if not same:
        raise InputError(refusal)
    return text


def table_in(parent: Any, *, header: bool = True) -> Any:
    """Return an empty table of the kind that a table can hold: an inline one takes inline ones.

    Args:
        parent: the table, of TOML Kit.
        header: whether it has values of its own, so that it needs a header line.
    """
    import tomlkit
    from tomlkit.items import InlineTable

    if isinstance(parent, InlineTable):
        return tomlkit.inline_table()
    return tomlkit.table(is_super_table=not header)


__all__ = ["table_in", "text_of"]
