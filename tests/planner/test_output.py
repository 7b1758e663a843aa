"""Whole files or none."""

import signal
from pathlib import Path

import pytest

from geometry.errors import InputError
from planner.output import new_text, output_folder, write_text


def test_a_run_that_succeeds_leaves_its_files_and_nothing_else(tmp_path: Path) -> None:
    with output_folder(tmp_path / "deep" / "out") as staging:
        (staging / "tables").mkdir()
        (staging / "tables" / "a.csv").write_text("1", encoding="utf-8")
        (staging / "report.html").write_text("2", encoding="utf-8")
        assert not (tmp_path / "deep").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deep"]
    assert (tmp_path / "deep/out/tables/a.csv").read_text(encoding="utf-8") == "1"
    assert (tmp_path / "deep/out/report.html").read_text(encoding="utf-8") == "2"


def test_a_run_that_breaks_off_changes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("old", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt), output_folder(out) as staging:
        (staging / "report.html").write_text("half", encoding="utf-8")
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (out / "report.html").read_text(encoding="utf-8") == "old"


def test_a_second_run_replaces_its_own_files_and_leaves_others(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    for text in ("first", "second"):
        with output_folder(tmp_path) as staging:
            (staging / "report.html").write_text(text, encoding="utf-8")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "second"
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_a_folder_in_the_way_of_one_file_stops_all(tmp_path: Path) -> None:
    (tmp_path / "out" / "b.csv").mkdir(parents=True)
    with pytest.raises(InputError, match="in the way"), output_folder(tmp_path / "out") as staging:
        (staging / "a.csv").write_text("1", encoding="utf-8")
        (staging / "b.csv").write_text("1", encoding="utf-8")
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["b.csv"]


def test_a_file_where_the_folder_should_be_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("x", encoding="utf-8")
    with pytest.raises(InputError, match="is a file"), output_folder(tmp_path / "out"):
        pytest.fail("the block must not run")


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match="No space left on device"):
        write_text(path, "new")
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_written_file_has_the_ordinary_permissions(tmp_path: Path) -> None:
    """Temporary files are private to their owner; results are not."""
    write_text(tmp_path / "a.txt", "x")
    (tmp_path / "b.txt").write_text("x", encoding="utf-8")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def test_new_text_never_replaces(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    new_text(path, "first")
    with pytest.raises(InputError, match="exists already"):
        new_text(path, "second")
    assert path.read_text(encoding="utf-8") == "first"


def test_a_link_to_nowhere_counts_as_existing(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.symlink_to(tmp_path / "elsewhere.yaml")
    with pytest.raises(InputError, match="exists already"):
        new_text(path, "text")
    assert not (tmp_path / "elsewhere.yaml").exists()


def test_an_interruption_while_files_are_put_in_place_waits_until_all_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Path.replace

    def interrupted(self: Path, target: Path) -> Path:
        signal.raise_signal(signal.SIGINT)
        return original(self, target)

    with pytest.raises(KeyboardInterrupt), output_folder(tmp_path / "out") as folder:
        for name in ("a.txt", "b.txt", "c.txt"):
            (folder / name).write_text(name, encoding="utf-8")
        monkeypatch.setattr(Path, "replace", interrupted)
    assert sorted(item.name for item in (tmp_path / "out").iterdir()) == ["a.txt", "b.txt", "c.txt"]
