"""Files appear whole or not at all."""

import os
from pathlib import Path

import pytest

from sealag.errors import FileError
from sealag.files import check_output, read_whole, write_text, written_whole


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(RuntimeError), written_whole(path) as file:
        file.write(b"half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]
    write_text(path, "new é")
    assert path.read_text(encoding="utf-8") == "new é"


def test_folders_are_made_and_blocked_ones_named(tmp_path):
    write_text(tmp_path / "b" / "c.txt", "x")
    with pytest.raises(FileError, match=r"c\.txt"):
        write_text(tmp_path / "b" / "c.txt" / "d.txt", "x")


def test_outputs_do_not_replace_inputs_folders_or_devices(tmp_path):
    path, link = tmp_path / "a.txt", tmp_path / "b.txt"
    check_output(path, path)
    write_text(path, "x")
    check_output(path, link)
    link.symlink_to(path)
    for wrong in (path, link):
        with pytest.raises(FileError, match=r"\.txt"):
            check_output(wrong, path)
    for wrong in (tmp_path, Path(os.devnull)):
        with pytest.raises(FileError, match="regular"):
            check_output(wrong)


def test_reading_is_bounded(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "1234")
    assert read_whole(path, what="The file", largest=4) == b"1234"
    with pytest.raises(FileError, match="larger"):
        read_whole(path, what="The file", largest=3)
    with pytest.raises(FileError, match="regular"):
        read_whole(Path("/dev/zero"), what="The file", largest=3)
