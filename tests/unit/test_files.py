"""Files appear whole or not at all."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sealag.errors import FileError
from sealag.files import Draft, check_output, read_whole, write_text, written_whole


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
    (tmp_path / "d.txt").symlink_to("none/../a.txt")
    for wrong in (tmp_path / "none" / ".." / "a.txt", path / ".." / "a.txt", tmp_path / "d.txt"):
        with pytest.raises(FileError, match="is an input"):
            check_output(wrong, path)
    with pytest.raises(FileError, match="unfinished"):
        check_output(tmp_path / ".e.txt.sealag-draft")
    other = tmp_path / ".c.txt.sealag-draft"
    write_text(other, "an input with a draft's name")
    with pytest.raises(FileError, match=r"c\.txt is an input"):
        check_output(tmp_path / "c.txt", other)
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


# Drafts ----------------------------------------------------------------------------------------
KILLED = """
import os, signal, sys
from pathlib import Path
from sealag.files import Draft
draft = Draft(Path(sys.argv[1]))
draft.file.write(b"half")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_second_writer_is_refused_while_the_first_lives(tmp_path):
    path = tmp_path / "a.txt"
    with Draft(path) as first:
        first.file.write(b"first")
        with pytest.raises(FileError, match=r"a\.txt is being written by another process"):
            Draft(path)
        Draft(tmp_path / "b.txt").drop()
        first.keep()
    assert path.read_bytes() == b"first"
    with Draft(path) as second:
        second.file.write(b"second")
        second.keep()
    assert path.read_bytes() == b"second"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_what_a_killed_writer_left_is_swept(tmp_path):
    path = tmp_path / "a.txt"
    killed = subprocess.run([sys.executable, "-c", KILLED, str(path)])
    assert killed.returncode == -signal.SIGKILL
    assert os.listdir(tmp_path) == [".a.txt.sealag-draft"]
    write_text(path, "new")
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.txt"]


OFTEN = """
import sys
from pathlib import Path
from sealag.files import write_text
for _ in range(30):
    write_text(Path(sys.argv[1]), sys.argv[2] * 100_000)
"""


def test_many_writers_at_once_leave_one_whole_file(tmp_path):
    path = tmp_path / "a.txt"
    writers = [
        subprocess.Popen([sys.executable, "-c", OFTEN, str(path), letter]) for letter in "abc"
    ]
    seen = set()
    while any(writer.poll() is None for writer in writers):
        if path.exists():
            seen.add(path.read_text())
    assert [writer.returncode for writer in writers] == [0, 0, 0]
    assert seen
    assert seen <= {letter * 100_000 for letter in "abc"}
    assert os.listdir(tmp_path) == ["a.txt"]


def test_links_modes_and_the_umask_are_respected(tmp_path):
    target, link = tmp_path / "there" / "a.txt", tmp_path / "a.txt"
    write_text(target, "old")
    assert target.stat().st_mode & 0o777 == 0o666 & ~_umask()
    target.chmod(0o600)
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o600
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "b.txt", "x")
    finally:
        os.umask(before)
    assert (tmp_path / "b.txt").stat().st_mode & 0o777 == 0o640


def _umask():
    before = os.umask(0)
    os.umask(before)
    return before


def test_files_of_the_user_with_names_like_drafts_stay(tmp_path):
    others = [tmp_path / name for name in ("a.txt.partial", "a.txt.reserve", ".a.txt.tmp", "a~")]
    for other in others:
        other.write_text("mine")
    precious = tmp_path / "precious"
    precious.write_text("mine")
    write_text(tmp_path / "a.txt", "x")
    assert all(other.read_text() == "mine" for other in others)
    (tmp_path / ".b.txt.sealag-draft").symlink_to(precious)
    with pytest.raises(FileError, match=r"b\.txt cannot be written"):
        write_text(tmp_path / "b.txt", "x")
    assert precious.read_text() == "mine"


def test_a_draft_with_another_name_is_a_whole_file_and_stays_one(tmp_path):
    """As a writer leaves it that is killed after it has named a new file."""
    whole, draft = tmp_path / "a.txt", tmp_path / ".a.txt.sealag-draft"
    whole.write_text("whole")
    os.link(whole, draft)
    with Draft(whole) as second:
        second.file.write(b"half")
        assert whole.read_text() == "whole"
    assert whole.read_text() == "whole"
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("keep", [lambda d: d.keep(), lambda d: d.keep_beside("incomplete")])
def test_a_file_put_in_a_draft_s_place_is_not_named(keep, tmp_path):
    path, hidden = tmp_path / "a.txt", tmp_path / ".a.txt.sealag-draft"
    with Draft(path) as draft:
        hidden.unlink()
        hidden.write_text("another's")
        with pytest.raises(FileError, match="somebody has replaced its unfinished file"):
            keep(draft)
    assert hidden.read_text() == "another's"
    assert not path.exists()


def test_a_link_that_leads_back_to_itself_is_refused_and_stays(tmp_path):
    loop, folder = tmp_path / "a.txt", tmp_path / "folder"
    loop.symlink_to("b.txt")
    (tmp_path / "b.txt").symlink_to("a.txt")
    folder.symlink_to("folder")
    for wrong in (loop, folder / "c.txt"):
        for ask in (check_output, lambda path: write_text(path, "x")):
            with pytest.raises(FileError, match="leads back to itself"):
                ask(wrong)
    assert loop.is_symlink()
    assert folder.is_symlink()


def test_a_new_file_replaces_none(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "first", replace=False)
    with pytest.raises(FileError, match="exists already"):
        write_text(path, "second", replace=False)
    assert path.read_text() == "first"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_file_beside_gets_a_name_of_its_own(tmp_path):
    names = []
    for _ in range(3):
        with Draft(tmp_path / "a.mcap") as draft:
            names.append(draft.keep_beside("incomplete").name)
    assert names == ["a.mcap", "a.incomplete.mcap", "a.incomplete-2.mcap"]
    assert sorted(os.listdir(tmp_path)) == sorted(names)


def test_long_names_are_written_or_refused_in_a_sentence(tmp_path):
    write_text(tmp_path / ("a" * 250), "x")
    with pytest.raises(FileError, match="too long"):
        write_text(tmp_path / ("a" * 300), "x")
    with pytest.raises(FileError, match="too long"):
        check_output(tmp_path / ("a" * 300))


def test_a_named_pipe_is_refused_and_not_waited_for(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(FileError, match="regular"):
        read_whole(path, what="It", largest=10)
