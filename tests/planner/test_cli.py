"""The command line as a whole process: messages, exit codes, nothing left behind."""

import json
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
import typer

from geometry.errors import InputError
from planner import cli
from planner.files.yaml_site import load_site

ROOT = Path(__file__).resolve().parents[2]
HOVSORE = str(ROOT / "examples" / "hovsore" / "site.yaml")
KASSEL = str(ROOT / "examples" / "kassel" / "site.yaml")
PROGRAM = "import sys; from planner.cli import main; main()"


def lidarplan(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", PROGRAM, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8", check=False)


def test_new_writes_a_site_file_that_is_valid(tmp_path: Path) -> None:
    done = lidarplan("new", str(tmp_path / "here"))
    assert (done.returncode, done.stdout) == (0, f"{tmp_path / 'here' / 'site.yaml'}\n")
    assert load_site(tmp_path / "here" / "site.yaml").name == "My campaign"


def test_new_never_overwrites(tmp_path: Path) -> None:
    (tmp_path / "site.yaml").write_text("mine", encoding="utf-8")
    done = lidarplan("new", str(tmp_path))
    assert done.returncode == 2
    assert done.stderr.startswith("lidarplan: ")
    assert "exists already" in done.stderr
    assert "Traceback" not in done.stderr
    assert [p.read_text(encoding="utf-8") for p in tmp_path.iterdir()] == ["mine"]


def test_json_is_one_document_and_quiet_is_quiet(tmp_path: Path) -> None:
    done = lidarplan("new", str(tmp_path), "--json", "--quiet")
    assert json.loads(done.stdout) == {"site": str(tmp_path / "site.yaml")}
    assert done.stderr == ""


@pytest.mark.parametrize("arguments", [("nwe",), ("new",), ("new", "a", "--bogus")])
def test_a_mistyped_command_line_exits_2_without_a_traceback(arguments: tuple[str, ...]) -> None:
    done = lidarplan(*arguments)
    assert done.returncode == 2
    assert "Error" in done.stderr
    assert "Traceback" not in done.stderr


def test_help_names_every_command_and_imports_nothing_heavy() -> None:
    heavy = (
        "numpy",
        "pandas",
        "scipy",
        "pyproj",
        "pydantic",
        "ruamel.yaml",
        "plotly",
        "pyvista",
        "rich",
        "shapely",
    )
    program = (
        "import sys; from planner.cli import run; code = run(['--help']);"
        f"print([name for name in {heavy!r} if name in sys.modules], file=sys.stderr); sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stderr == "[]\n"
    assert all(name.replace("_", "-") in done.stdout for name in cli.COMMANDS)


def test_every_listed_command_registers_itself() -> None:
    for name in cli.COMMANDS:
        app = typer.Typer()
        import_module(f"planner.commands.{name}").register(app)
        assert len(app.registered_commands) + len(app.registered_groups) == 1


def with_command(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def build() -> typer.Typer:
        app = typer.Typer(pretty_exceptions_enable=False)

        @app.command()
        def fail() -> None:
            raise error

        return app

    monkeypatch.setattr(cli, "build", build)


def test_bad_input_is_told_on_stderr_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with_command(monkeypatch, InputError("3 came; allowed: 4"))
    assert cli.run([]) == 2
    assert capsys.readouterr() == ("", "lidarplan: 3 came; allowed: 4\n")


def test_an_interrupt_exits_130_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with_command(monkeypatch, KeyboardInterrupt())
    assert cli.run([]) == 130
    assert capsys.readouterr().err == "lidarplan: interrupted\n"


def test_a_defect_is_not_dressed_up_as_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    with_command(monkeypatch, ZeroDivisionError())
    with pytest.raises(ZeroDivisionError):
        cli.run([])


def test_a_reader_that_goes_away_is_no_error_worth_a_word() -> None:
    """`lidarplan ... | true`: the pipe is closed before anything is written."""
    program = (
        "import typer; from planner import cli\n"
        "def build():\n"
        "    app = typer.Typer()\n"
        "    @app.command()\n"
        "    def talk():\n"
        "        for _ in range(100_000): typer.echo('word ' * 20)\n"
        "    return app\n"
        "cli.build = build; cli.main()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == cli.PIPE_CLOSED


@pytest.mark.parametrize("arguments", [("check", KASSEL), ("point", HOVSORE, "--json")])
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_is_told_in_one_line(arguments: tuple[str, ...]) -> None:
    """Exit code 2, no traceback, and nothing from the interpreter on its way out."""
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        command = [sys.executable, "-c", PROGRAM, *arguments, "--quiet"]
        done = subprocess.run(
            command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True, encoding="utf-8", check=False
        )
    assert done.returncode == 2
    assert done.stderr.startswith("lidarplan: the output cannot be written")
    assert done.stderr.count("\n") == 1


def test_a_closed_output_is_told_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    code = cli.run(["--version"])
    monkeypatch.undo()
    assert code == 2
    assert capsys.readouterr().err.startswith("lidarplan: standard output is closed")


def test_version_is_the_project_s(capsys: pytest.CaptureFixture[str]) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert cli.run(["--version"]) == 0
    assert capsys.readouterr().out == f"lidarplan {project['version']}\n"


def test_new_wants_a_folder_not_the_name_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["new", str(tmp_path / "own" / "site.yaml")]) == 2
    assert f"DIR is wanted, a folder in which site.yaml is made: give {tmp_path / 'own'}" in (
        capsys.readouterr().err
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["report", "view", "export", "tradeoff", "simulate", "place"])
def test_a_folder_that_cannot_be_made_is_refused_before_the_site_is_read(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The site file has faults, and they are not what is told; nothing is left behind."""
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    site = tmp_path / "site.yaml"
    site.write_text("name: Moor\n", encoding="utf-8")
    assert cli.run([command, str(site), "--out", str(tmp_path / "file" / "x")]) == 2
    told = capsys.readouterr().err
    assert "is a file, not a folder" in told
    assert {path.name for path in tmp_path.iterdir()} == {"file", "site.yaml"}


@pytest.mark.parametrize(
    "arguments",
    [
        ("tradeoff", HOVSORE, "--seed", "-1"),
        ("simulate", HOVSORE, "--seed", "-1"),
        ("simulate", HOVSORE, "--days", "nan"),
        ("simulate", HOVSORE, "--days", "0"),
        ("simulate", HOVSORE, "--cell-m", "-1"),
        ("place", HOVSORE, "--count", "0"),
        ("place", HOVSORE, "--reach", "-1"),
        ("place", HOVSORE, "--max-range", "0"),
        ("place", HOVSORE, "--max-elevation", "91"),
        ("place", HOVSORE, "--min-opening", "-1"),
        ("place", HOVSORE, "--max-lost", "2"),
        ("place", HOVSORE, "--head-height", "-1"),
        ("place", HOVSORE, "--near-cost", "inf"),
        ("tour", HOVSORE, "--cover", "0"),
        ("tour", HOVSORE, "--accumulation", "-1"),
        ("cnr-map", "plan", HOVSORE, "--lidar", "WS_W", "--accumulation", "0"),
        ("cnr-map", "plan", HOVSORE, "--lidar", "WS_W", "--heading-std", "181"),
        ("cnr-map", "plan", HOVSORE, "--lidar", "WS_W", "--beam", "0"),
        ("cnr-map", "plan", HOVSORE, "--lidar", "WS_W", "--pulse-ns", "-1"),
        ("cnr-map", "plan", HOVSORE, "--lidar", "WS_W", "--fft-points", "0"),
        ("export", HOVSORE, "--declination", "nan"),
        ("view", HOVSORE, "--exaggeration", "0"),
    ],
)
def test_a_number_out_of_range_is_told_with_its_option(
    arguments: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.run(list(arguments)) == 2
    assert arguments[-2] in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
